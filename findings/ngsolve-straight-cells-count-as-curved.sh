#!/usr/bin/env bash
# One would guess that second derivatives of a polynomial on rectangles are exact up to rounding, and symmetric. A quadrilateral
# that is made by hand, netgen.meshing.Element2D, counts as curved, whatever the order of its geometry. NGSolve's operator "hesse" then
# needs second derivatives of the mapping, and seems to take differences for them: of u = x y, which is in the space, d2u/dxdy
# and d2u/dydx are off by 1e-8 to 1e-7 on 40 x 20 cells and differ from each other by as much, while first derivatives are right to
# 1e-12. 'element.curved = False' before it is added makes them symmetric and right to 1e-9. MakeStructured2DMesh says so
# unless it has a mapping, even the identity. ngsolve==6.2.2608
set -euo pipefail
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
python3 -m venv "$here/env"
"$here/env/bin/pip" install --quiet --disable-pip-version-check ngsolve==6.2.2608 numpy
"$here/env/bin/python" - <<'PYTHON'
import netgen.meshing as netgen
import ngsolve as ng
import numpy as np


def rectangles(nx: int, ny: int, curved: bool | None) -> ng.Mesh:
    """The unit square in rectangles; None leaves what they count as alone."""
    made = netgen.Mesh(dim=2)
    nodes = [[made.Add(netgen.MeshPoint(netgen.Pnt(i / nx, j / ny, 0.0))) for j in range(ny + 1)] for i in range(nx + 1)]
    made.Add(netgen.FaceDescriptor(surfnr=1, domin=1, bc=1))
    for i in range(nx):
        for j in range(ny):
            corners = [nodes[i][j], nodes[i + 1][j], nodes[i + 1][j + 1], nodes[i][j + 1]]
            cell = netgen.Element2D(1, corners)
            if curved is not None:
                cell.curved = curved
            made.Add(cell)
    return ng.Mesh(made)


print("ngsolve", ng.__version__)
found = {}
for name, curved in (("as they are", None), ("curved = False", False)):
    mesh = rectangles(40, 20, curved)
    u = ng.GridFunction(ng.H1(mesh, order=2))
    u.Set(ng.x * ng.y)
    points = mesh.MapToAllElements(ng.IntegrationRule(ng.QUAD, 4), ng.VOL)
    first = np.abs(np.array(ng.grad(u)(points)) - np.array(ng.CF((ng.y, ng.x))(points))).max()
    hesse = np.array(u.Operator("hesse")(points))
    second, symmetry = np.abs(hesse - [0.0, 1.0, 1.0, 0.0]).max(), np.abs(hesse[:, 1] - hesse[:, 2]).max()
    found[name] = first, second, symmetry
    print(f"{name}: error of grad {first:.0e}, of hesse {second:.0e}, of its symmetry {symmetry:.0e}")
rough, exact = found.values()
if not (rough[0] < 1e-10 and rough[1] > 1e-8 and rough[2] > 1e-8 and exact[1] < 2e-9 and exact[2] < 1e-12):
    raise SystemExit("this has changed")
PYTHON
