"""J on a grid much finer than the quadrature's: what happens between the points that the solver looks at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, diameters, triangle_lattice
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.spaces.quadrature import sub_triangles

Float = NDArray[np.float64]

# Points along the side of each sub-triangle; both ends are among them.
ALONG = 7


def smallest_jacobians(block: Block, mesh: PolygonMesh, u_ni: Float, chosen: slice) -> Float:
    """Smallest J (n_cells,) of some cells of a block on a lattice in every sub-triangle, sides and vertices included.

    Args:
        block: the cells.
        mesh: that they are of.
        u_ni: (n_nodes, 2) displacements of the nodes.
        chosen: which of them.
    """
    polygons = block.polygons(mesh, chosen)
    smallest = np.empty(len(polygons))
    for cells, triangles in sub_triangles(polygons):
        points = (triangle_lattice(ALONG) @ triangles).reshape(len(cells), -1, 2)
        xi = (points - centroids(polygons[cells])[:, None]) / diameters(polygons[cells])[:, None, None]
        H = block.gradients_at(u_ni, np.arange(chosen.start, chosen.stop)[cells], xi)
        J = (1.0 + H[..., 0, 0]) * (1.0 + H[..., 1, 1]) - H[..., 0, 1] * H[..., 1, 0]
        smallest[cells] = J.min(axis=1)
    return smallest
