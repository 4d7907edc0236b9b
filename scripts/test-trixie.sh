#!/usr/bin/env bash
# Run the finite element tests against the dolfinx of Debian 13 (0.9) in a chroot. Needs root and about 3 GB.
# usage: scripts/test-trixie.sh [CHROOT]     default: build/trixie; an existing chroot is used as it is
set -euo pipefail
cd "$(dirname "$0")/.."

chroot_dir=$(realpath -m "${1:-build/trixie}")
mirror=${DEBIAN_MIRROR:-} # empty: the one that debootstrap knows
packages="gcc libc6-dev python3-cffi python3-click python3-dolfinx-real python3-gmsh python3-hypothesis
  python3-matplotlib python3-meshio python3-mpmath python3-numpy python3-petsc4py-real python3-pytest python3-rich
  python3-scipy python3-sympy openmpi-bin"

if [ "$(id -u)" -ne 0 ]; then
  echo "test-trixie: a chroot needs root; run: sudo scripts/test-trixie.sh" >&2
  exit 2
fi
if [ ! -e "$chroot_dir/.tmc-ready" ]; then
  command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -qy --no-install-recommends debootstrap; }
  [ -x "$chroot_dir/usr/bin/apt-get" ] || debootstrap --variant=minbase trixie "$chroot_dir" ${mirror:+"$mirror"}
  chroot "$chroot_dir" sh -c "export DEBIAN_FRONTEND=noninteractive; apt-get update -q &&
    apt-get install -qy --no-install-recommends $(echo $packages)"
  touch "$chroot_dir/.tmc-ready"
fi

# The tests run on a copy, so that nothing of Debian 13 is left in the working tree.
copy=$chroot_dir/tmc-vem
rm -rf "$copy"
mkdir -p "$copy" "$chroot_dir/proc"
cp -a codegen tmc_vem tests pyproject.toml README.md "$copy"/
mountpoint -q "$chroot_dir/proc" || mount -t proc proc "$chroot_dir/proc"
trap 'umount "$chroot_dir/proc"' EXIT
chroot "$chroot_dir" env HOME=/root OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
  OMPI_MCA_rmaps_base_oversubscribe=1 PYTHONPATH=/tmc-vem sh -c \
  'cd /tmc-vem && python3 -c "import dolfinx; print(\"dolfinx\", dolfinx.__version__)" &&
   python3 -m pytest tests/fem -m "not slow and not paper" --durations=5'
