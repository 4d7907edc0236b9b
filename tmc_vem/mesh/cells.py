"""What is true of every cell of a mesh, whatever its number of sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]


def centroids_and_areas(mesh: PolygonMesh) -> tuple[Float, Float]:
    """Centroids (n_cells, 2) and areas (n_cells,) of all cells."""
    center_cx, area_c = np.empty((mesh.n_cells, 2)), np.empty(mesh.n_cells)
    for _, cells, vertices in mesh.cells_by_size():
        polygons = mesh.points_vx[vertices]
        center_cx[cells], area_c[cells] = centroids(polygons), areas(polygons)
    return center_cx, area_c
