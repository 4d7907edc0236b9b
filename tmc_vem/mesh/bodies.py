"""Bodies: connected parts of the solids of a mesh, and their names."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh

Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def named_bodies(
    offsets: Int, nodes: Int, region_c: Int, region_names: Sequence[str], is_solid_c: Bool, numbers_c: Int
) -> tuple[Int, list[str]]:
    """Body (n_cells,) of each cell, -1 in media, and the names of all bodies.

    Cells that share a node are one body. Its name is that of its region, or ``a+b`` of several; further bodies of the
    same regions are ``a-2``, ``a-3``, ... in the order of the numbers of their cells.

    Args:
        offsets: (n_cells + 1,) where each cell starts in ``nodes``.
        nodes: nodes of all cells; those at one place have one number.
        region_c: (n_cells,) region of each cell.
        region_names: names of the regions.
        is_solid_c: (n_cells,) which cells are solid.
        numbers_c: (n_cells,) numbers of the cells, which do not depend on the distribution.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n_cells = len(region_c)
    cell = np.repeat(np.arange(n_cells), np.diff(offsets))
    of_solid = is_solid_c[cell]
    node = n_cells + nodes[of_solid]
    size = n_cells + int(nodes.max(initial=-1)) + 1
    graph = coo_array((np.ones(len(node)), (cell[of_solid], node)), shape=(size, size))
    label_c = connected_components(graph, directed=False)[1][:n_cells]
    solids = np.flatnonzero(is_solid_c)
    labels, found = np.unique(label_c[solids], return_inverse=True)
    members = [solids[found == b] for b in range(len(labels))]
    body_c = np.full(n_cells, -1)
    names: list[str] = []
    for cells in sorted(members, key=lambda cells: int(numbers_c[cells].min())):
        body_c[cells] = len(names)
        name = "+".join(region_names[r] for r in np.unique(region_c[cells]).tolist())
        candidates = itertools.chain([name], (f"{name}-{n}" for n in itertools.count(2)))
        names.append(next(each for each in candidates if each not in names))
    return body_c, names


def body_names(mesh: PolygonMesh, is_solid_c: Bool) -> list[str]:
    """Names of the bodies of a mesh, of which some cells (n_cells,) are solid."""
    return named_bodies(
        mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, is_solid_c, np.arange(mesh.n_cells)
    )[1]
