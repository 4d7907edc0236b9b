#!/usr/bin/env bash
# The README's way without root, in an environment of its own: install, then each kind of run once; says how long.
# usage: scripts/first-steps.sh [PLACE]     default: build/first-steps, made anew
set -euo pipefail
cd "$(dirname "$0")/.."

place=$(realpath -m "${1:-build/first-steps}")
rm -rf "$place"
mkdir -p "$place"
step() { # what, command...
  local begun
  begun=$(date +%s)
  echo "first steps: ${*:2}"
  "${@:2}" >"$place/out.txt" 2>&1 || { cat "$place/out.txt" >&2; exit 1; }
  grep -E '^(gap|reaction|C compiler|dolfinx|MPI) ' "$place/out.txt" || true
  echo "  $1: $(($(date +%s) - begun)) s"
}
SECONDS=0
step environment python3 -m venv "$place/env"
step install "$place/env/bin/pip" install -q '.[wheels,compiler]'
. "$place/env/bin/activate"
export OMP_NUM_THREADS=1 XDG_CACHE_HOME="$place/cache"
cases=$PWD/demos/problems
cd "$place" # so that what is used is what was installed
step info tmc-vem info
step "virtual elements" tmc-vem run box --cells 20 10 --uy -0.5 --out box
step "finite elements" tmc-vem run box --cells 20 10 --uy -0.5 --method fem --out box-fem
step "two ranks" mpirun -n 2 tmc-vem run box --cells 20 10 --uy -0.5 --out box-2
step "shapes in a file" tmc-vem run "$cases/seal.toml" --out seal
echo "first steps: all in $SECONDS s"
