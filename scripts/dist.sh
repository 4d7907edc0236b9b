#!/usr/bin/env bash
# Wheel and sdist into build/dist, checked; then the wheel in an environment of its own, used from another folder. What is
# not Python's comes from the extra wheels, or from the system where its Python is older than 3.12.
set -euo pipefail
cd "$(dirname "$0")/.."

out=$PWD/build/dist
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
rm -rf "$out"
.venv/bin/python -m build --outdir "$out" >"$place/build.txt" 2>&1 || { cat "$place/build.txt" >&2; exit 1; }
.venv/bin/twine check --strict "$out"/*

wheel=$(echo "$out"/*.whl)
if .venv/bin/python -c 'import sys; sys.exit(sys.version_info < (3, 12))'; then
  python3 -m venv "$place/env"
  wheel+="[wheels]"
else
  /usr/bin/python3 -m venv --system-site-packages "$place/env"
fi
"$place/env/bin/pip" install -q --disable-pip-version-check "$wheel"
cd "$place"
env/bin/python -c 'import codegen, tmc_vem; print(tmc_vem.__version__, "in", tmc_vem.__path__[0])' | grep -F "$place"
TMC_VEM_CACHE=$place/cache env/bin/tmc-vem run box --cells 20 5 --uy -0.2 --out box | grep -E '^(gap|reaction) '
env/bin/tmc-vem list .
ls -l "$out"
