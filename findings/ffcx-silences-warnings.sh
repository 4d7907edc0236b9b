#!/usr/bin/env bash
# One would guess that importing a form compiler leaves Python's warnings alone. Instead 'import ffcx' hands the warnings of
# the whole program to logging, whose logger for them has no output: warnings.warn() prints nothing from then on, also in
# the code of others, while pytest, which records warnings itself, still sees them. fenics-ffcx==0.9.0
set -euo pipefail
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
python3 -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check fenics-ffcx==0.9.0
printed() { "$here/env/bin/python" -c "$1import warnings; warnings.warn('the mesh is coarse')" 2>&1; }
version=$("$here/env/bin/python" -c 'from importlib.metadata import version; print(version("fenics-ffcx"))')
before=$(printed "") after=$(printed "import ffcx; ")
echo "fenics-ffcx $version"
echo "without it, a warning prints: ${before:-nothing}"
echo "after 'import ffcx': ${after:-nothing}"
[[ $before == *"the mesh is coarse"* && -z $after ]] || { echo "this has changed"; exit 1; }
