#!/usr/bin/env bash
# One would guess that cell data of a legacy VTK file come with its cells whatever their type: they do for quadrilaterals.
# Instead meshio reads polygons (type 7) of versions before 5 without their cell data, so that regions are gone, with no
# warning. meshio==5.3.5 (and 5.0.0 of Debian 12)
set -euo pipefail
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
python3 -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
for type in 9 7; do # quadrilaterals, and the same as polygons
  cat >"$here/type$type.vtk" <<VTK
# vtk DataFile Version 4.2
two squares
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 6 double
0 0 0 1 0 0 2 0 0 0 1 0 1 1 0 2 1 0
CELLS 2 10
4 0 1 4 3
4 1 2 5 4
CELL_TYPES 2
$type
$type
CELL_DATA 2
SCALARS region int 1
LOOKUP_TABLE default
5
6
VTK
done
"$here/env/bin/python" - "$here" <<'PY'
import sys

import meshio
import numpy as np

print("meshio", meshio.__version__)
found = {}
for kind, name in ((9, "quadrilaterals"), (7, "polygons")):
    mesh = meshio.read(f"{sys.argv[1]}/type{kind}.vtk")
    found[name] = {key: np.concatenate(blocks).ravel().tolist() for key, blocks in mesh.cell_data.items()}
    print(f"{name}: {sum(len(block) for block in mesh.cells)} cells, cell data {found[name]}")
if found != {"quadrilaterals": {"region": [5, 6]}, "polygons": {}}:
    raise SystemExit("this has changed")
PY
