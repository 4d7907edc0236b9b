#!/usr/bin/env bash
# One would guess that meshio's cell data 'gmsh:physical' tells which physical groups a cell of an MSH 4.1 file is in, as the
# files of MSH 2.2 repeat an element for every group. Instead it has the first group of each entity only, without a word;
# the second group of a curve, and with it a support, is found in cell_sets alone. meshio==5.3.5 (and 5.0.0 of Debian 12)
set -euo pipefail
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
python3 -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
cat >"$here/two.msh" <<'MSH'
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "bottom"
1 2 "fixed"
2 3 "block"
$EndPhysicalNames
$Entities
0 1 1 0
1 0 0 0 1 0 0 2 1 2 0
1 0 0 0 1 1 0 1 3 1 1
$EndEntities
$Nodes
2 4 1 4
1 1 0 2
1
2
0 0 0
1 0 0
2 1 0 2
3
4
1 1 0
0 1 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 3 1
2 1 2 3 4
$EndElements
MSH
"$here/env/bin/python" - "$here/two.msh" <<'PY'
import sys

import meshio

mesh = meshio.read(sys.argv[1])
tags = [block.tolist() for block in mesh.cell_data["gmsh:physical"]]
sets = {name: [len(part) for part in parts] for name, parts in mesh.cell_sets.items() if not name.startswith("gmsh:")}
print("meshio", meshio.__version__)
print("the line is in groups 1 (bottom) and 2 (fixed); cell_data['gmsh:physical'] =", tags)
print("lines and quadrilaterals in each of cell_sets:", sets)
if tags != [[1], [3]] or sets != {"bottom": [1, 0], "fixed": [1, 0], "block": [0, 1]}:
    raise SystemExit("this has changed")
PY
