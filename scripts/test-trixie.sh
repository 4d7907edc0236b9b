#!/usr/bin/env bash
# All that a newcomer does on Debian 13, in a chroot: set up, demo, documentation, the whole test suite, with its PETSc
# (3.22), dolfinx (0.9), numpy (2.2), Open MPI (5), gcc (13 and 14) and clang (19). Needs root, the network and about 6 GB.
# usage: scripts/test-trixie.sh [CHROOT [TARGETS...]]     default: build/trixie, kept for the next time; demo docs test
set -euo pipefail
cd "$(dirname "$0")/.."

chroot_dir=$(realpath -m "${1:-build/trixie}")
shift || true
targets=${*:-demo docs test}
mirror=${DEBIAN_MIRROR:-} # empty: the one that debootstrap knows
compilers="gcc-13 gcc-14" # gcc itself, clang and the rest are in scripts/debian-packages*.txt

if [ "$(id -u)" -ne 0 ]; then
  echo "test-trixie: a chroot needs root; run: sudo scripts/test-trixie.sh" >&2
  exit 2
fi
started=$(date +%s)
commit=$(git describe --always --dirty)
if [ ! -x "$chroot_dir/usr/bin/apt-get" ]; then
  command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -qy --no-install-recommends debootstrap; }
  debootstrap --variant=minbase trixie "$chroot_dir" ${mirror:+"$mirror"}
fi

# A copy of the working tree, so that nothing of Debian 13 is left there; its environment is kept for the next time.
copy=$chroot_dir/tmc-vem
mkdir -p "$copy" "$chroot_dir/proc" "$chroot_dir/sys" "$chroot_dir/dev/shm"
find "$copy" -mindepth 1 -maxdepth 1 ! -name .venv -exec rm -rf {} +
git ls-files -z --cached --others --exclude-standard | xargs -0 sh -c 'for f; do [ ! -e "$f" ] || echo "$f"; done' sh |
  tar -c -T - | tar -x -C "$copy"
# The network is that of the host: its names, its certificates, its settings of pip.
cp -L /etc/resolv.conf "$chroot_dir/etc/resolv.conf"
certificates="" # beside those of Debian 13, whose package would replace them
if [ -f /etc/ssl/certs/ca-certificates.crt ]; then
  certificates=/etc/host-certificates.crt
  cp -L /etc/ssl/certs/ca-certificates.crt "$chroot_dir$certificates"
fi

mounted=()
mount_once() { # TYPE PLACE [OPTIONS]
  mountpoint -q "$chroot_dir/$2" && return
  mount -t "$1" ${3:+-o "$3"} "$1" "$chroot_dir/$2"
  mounted=("$chroot_dir/$2" "${mounted[@]}")
}
trap '[ "${#mounted[@]}" -eq 0 ] || umount "${mounted[@]}"' EXIT
mount_once proc proc
mount_once sysfs sys ro # Open MPI looks for cores there
mount_once tmpfs dev/shm

inside() {
  chroot "$chroot_dir" env -i HOME=/root LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive \
    XDG_CACHE_HOME=/tmc-vem/build/cache ${certificates:+PIP_CERT="$certificates"} ${PIP_INDEX_URL:+PIP_INDEX_URL="$PIP_INDEX_URL"} \
    PYTEST_ADDOPTS="-rfEs --durations=10" bash -c "cd /tmc-vem; $1"
}
inside "for program in $compilers make; do command -v \$program >/dev/null; done" ||
  inside "apt-get update -q && apt-get install -qy --no-install-recommends $compilers make"
inside "scripts/setup.sh --test"
inside '.venv/bin/python -c "import dolfinx; print(\"dolfinx\", dolfinx.__version__)"; for c in gcc-13 gcc-14 clang; do $c --version | head -n 1; done'
status=0
inside "make --keep-going $targets" || status=$?
echo "test-trixie: $targets on Debian $(cat "$chroot_dir/etc/debian_version"), commit $commit:" \
  "exit status $status after $((($(date +%s) - started) / 60)) minutes"
exit "$status"
