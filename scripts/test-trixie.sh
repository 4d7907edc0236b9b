#!/usr/bin/env bash
# Run the tests with the PETSc (3.22), dolfinx (0.9), numpy (2.2) and Open MPI (5) of Debian 13 in a chroot. Needs root and
# about 4 GB. The tests of the demos and of the documentation, which need the environment of 'make setup', are not run.
# usage: scripts/test-trixie.sh [CHROOT [TESTS...]]     default: build/trixie, kept for the next time, and all tests
set -euo pipefail
cd "$(dirname "$0")/.."

chroot_dir=$(realpath -m "${1:-build/trixie}")
shift || true
tests=${*:-tests/unit tests/fem tests/mpi}
mirror=${DEBIAN_MIRROR:-} # empty: the one that debootstrap knows
packages="gcc libc6-dev python3-cffi python3-click python3-dolfinx-real python3-gmsh python3-hypothesis
  python3-jinja2 python3-matplotlib python3-meshio python3-mpmath python3-numpy python3-pandas python3-petsc4py-real
  python3-pytest python3-pyvista python3-rich python3-scipy python3-shapely python3-sympy openmpi-bin"

if [ "$(id -u)" -ne 0 ]; then
  echo "test-trixie: a chroot needs root; run: sudo scripts/test-trixie.sh" >&2
  exit 2
fi
if [ "$(cat "$chroot_dir/.tmc-ready" 2>/dev/null)" != "$packages" ]; then
  command -v debootstrap >/dev/null || { apt-get update -q && apt-get install -qy --no-install-recommends debootstrap; }
  [ -x "$chroot_dir/usr/bin/apt-get" ] || debootstrap --variant=minbase trixie "$chroot_dir" ${mirror:+"$mirror"}
  chroot "$chroot_dir" sh -c "export DEBIAN_FRONTEND=noninteractive; apt-get update -q &&
    apt-get install -qy --no-install-recommends $(echo $packages)"
  echo "$packages" >"$chroot_dir/.tmc-ready"
fi

# The tests run on a copy, so that nothing of Debian 13 is left in the working tree.
copy=$chroot_dir/tmc-vem
rm -rf "$copy"
mkdir -p "$copy" "$chroot_dir/proc" "$chroot_dir/sys"
cp -a codegen tmc_vem tests demos docs scripts pyproject.toml README.md "$copy"/
mountpoint -q "$chroot_dir/proc" || mount -t proc proc "$chroot_dir/proc"
mountpoint -q "$chroot_dir/sys" || mount -t sysfs -o ro sysfs "$chroot_dir/sys" # Open MPI looks for cores there
trap 'umount "$chroot_dir/proc" "$chroot_dir/sys"' EXIT
chroot "$chroot_dir" env HOME=/root OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
  PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe PYTHONPATH=/tmc-vem sh -c \
  'cd /tmc-vem && python3 -c "import dolfinx; print(\"dolfinx\", dolfinx.__version__)" &&
   python3 -m pytest "$@" -m "not slow and not paper" --durations=5' sh $tests
