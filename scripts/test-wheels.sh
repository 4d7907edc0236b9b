#!/usr/bin/env bash
# tmc-vem from wheels alone, by an ordinary user of a bare Debian 13, in a chroot. First the commands of the README, with
# nothing but Python there: no compiler, no Python.h, no PETSc, no MPI; then, with gcc, Python.h and the libraries that
# gmsh is linked with, the package itself, demo, documentation and the whole test suite. Needs root for the chroot, the
# network and about 4 GB.
# usage: scripts/test-wheels.sh [CHROOT [TARGETS...]]     default: build/wheels, made anew; dist demo docs test
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/chroot.sh

chroot_dir=$(realpath -m "${1:-build/wheels}")
copy=/home/user/tmc-vem
shift || true
targets=${*:-dist demo docs test}

require_root
started=$(date +%s)
commit=$(git describe --always --dirty)
make_chroot trixie python3,python3-venv,ca-certificates
[ -d "$chroot_dir/home/user" ] || chroot "$chroot_dir" useradd --create-home user
copy_tree
chroot "$chroot_dir" chown -R user:user "$copy"

as_root() { inside root:root /root "$1"; }
as_user() { inside user:user /home/user "$1"; }
if ! as_root "command -v gcc >/dev/null"; then # a chroot that was used before has a compiler
  as_user scripts/first-steps.sh
fi
gmsh_needs=$(sed -n 's/.*"apt-get install \(libglu1-mesa[^"]*\)".*/\1/p' tmc_vem/support/optional.py)
needed="gcc libc6-dev python3-dev make git $gmsh_needs" # git: for the tests of revisions
as_root "dpkg-query -W $needed >/dev/null 2>&1" ||
  as_root "apt-get update -q && apt-get install -qy --no-install-recommends $needed"
as_user "[ -x .venv/bin/python ] || python3 -m venv .venv; .venv/bin/pip install -q -e '.[wheels,gmsh,dev]' && touch .venv/.ready"
as_user ".venv/bin/tmc-vem info"
status=0
as_user "export PATH=$copy/.venv/bin:\$PATH; make --keep-going $targets" || status=$?
echo "test-wheels: $targets on Debian $(cat "$chroot_dir/etc/debian_version"), commit $commit:" \
  "exit status $status after $((($(date +%s) - started) / 60)) minutes"
exit "$status"
