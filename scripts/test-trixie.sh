#!/usr/bin/env bash
# All that a newcomer does on Debian 13, in a chroot: set up, demo, documentation, the whole test suite, with its PETSc
# (3.22), dolfinx (0.9), numpy (2.2), Open MPI (5), gcc (13 and 14) and clang (19). Needs root, the network and about 6 GB.
# usage: scripts/test-trixie.sh [CHROOT [TARGETS...]]     default: build/trixie, kept for the next time; demo docs test
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/chroot.sh

chroot_dir=$(realpath -m "${1:-build/trixie}")
copy=/tmc-vem
shift || true
targets=${*:-demo docs test}
compilers="gcc-13 gcc-14" # gcc itself, clang and the rest are in scripts/debian-packages*.txt

require_root
started=$(date +%s)
commit=$(git describe --always --dirty)
make_chroot trixie
copy_tree

as_root() { inside root:root /root "$1"; }
as_root "for program in $compilers make; do command -v \$program >/dev/null; done" ||
  as_root "apt-get update -q && apt-get install -qy --no-install-recommends $compilers make"
as_root "scripts/setup.sh --test"
as_root '.venv/bin/python -c "import dolfinx; print(\"dolfinx\", dolfinx.__version__)"; for c in gcc-13 gcc-14 clang; do $c --version | head -n 1; done'
status=0
as_root "make --keep-going $targets" || status=$?
echo "test-trixie: $targets on Debian $(cat "$chroot_dir/etc/debian_version"), commit $commit:" \
  "exit status $status after $((($(date +%s) - started) / 60)) minutes"
exit "$status"
