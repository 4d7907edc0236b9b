"""Two blocks with third medium between them, of polygons and quadrilaterals, written as a MED file by medcoupling."""

import sys

import medcoupling as mc

# the cells of the lower block are pentagons: the middle of the upper side is a node of the quadrilaterals above
points = [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 0.4), (0.25, 0.4), (0.5, 0.4), (0.75, 0.4), (1.0, 0.4)]
points += [(x, y) for y in (0.5, 0.9) for x in (0.0, 0.25, 0.5, 0.75, 1.0)]
quadrilaterals = [[3 + x, 4 + x, 9 + x, 8 + x] for x in range(4)] + [[8 + x, 9 + x, 14 + x, 13 + x] for x in range(4)]
pentagons = [[0, 1, 5, 4, 3], [1, 2, 7, 6, 5]]


def mesh_of(dimension, cells):
    """A mesh of cells, grouped by type as MED wants them."""
    mesh = mc.MEDCouplingUMesh("blocks", dimension)
    mesh.setCoords(mc.DataArrayDouble(points))
    mesh.allocateCells(len(cells))
    kinds = {2: mc.NORM_SEG2, 4: mc.NORM_QUAD4, 5: mc.NORM_POLYGON}
    for cell in cells:
        mesh.insertNextCell(kinds[len(cell)], cell)
    return mesh


def group(name, members):
    """A named group of cells."""
    numbers = mc.DataArrayInt(list(members))
    numbers.setName(name)
    return numbers


file = mc.MEDFileUMesh()
file.setMeshAtLevel(0, mesh_of(2, quadrilaterals + pentagons))
bottom, top = [[0, 1], [1, 2]], [[13 + x, 14 + x] for x in range(4)]
edges = mesh_of(1, bottom + top)
edges.setCoords(file.getCoords())
file.setMeshAtLevel(-1, edges)
file.setGroupsAtLevel(0, [group("gap", range(4)), group("block", range(4, 8)), group("base", [8, 9])])
file.setGroupsAtLevel(-1, [group("bottom", [0, 1]), group("top", range(2, 6))])
file.write(sys.argv[1] if len(sys.argv) > 1 else "blocks.med", 2)
