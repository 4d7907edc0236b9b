#!/usr/bin/env bash
# One would guess that 'from petsc4py import PETSc' works in an environment that has just installed it with all that it needs.
# The petsc4py inside the wheel of dolfinx' solver is linked with an MPI library that another wheel brings into a folder the
# loader does not know; only 'import mpi4py.MPI' loads it from there, so the order of two imports decides, and 'import
# dolfinx', which is in the same wheel, fails alike. dolfinx-solver-real==0.11.0.post0 (Python 3.12 or newer)
set -euo pipefail
python=$(for v in 3.12 3.13; do
  for p in "python$v" "$HOME/.pyenv/versions/$v".*/bin/python3; do
    "$p" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && echo "$p" && break 2
  done
done || true)
[[ -n $python ]] || { echo "skipped: needs Python 3.12 or 3.13"; exit 0; }
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
"$python" -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check dolfinx-solver-real==0.11.0.post0 'mpi4py>=4.1'
try() { env -u LD_LIBRARY_PATH "$here/env/bin/python" -c "$1; print('it works')" 2>&1 | tail -1 || true; }
echo "dolfinx-solver-real 0.11.0.post0"
first=$(try 'from petsc4py import PETSc')
dolfinx=$(try 'import dolfinx')
after=$(try 'import mpi4py.MPI; from petsc4py import PETSc')
echo "petsc4py alone: $first"
echo "dolfinx alone: $dolfinx"
echo "after mpi4py: $after"
[[ $first == ImportError*libmpi* && $dolfinx == ImportError*libmpi* && $after == "it works" ]] || { echo "this has changed"; exit 1; }
