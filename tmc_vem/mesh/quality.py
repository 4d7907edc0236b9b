"""Quality of the cells of a mesh: what makes an element badly conditioned or in need of a high degree l."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids, diameters, star_shaped_about
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Quality:
    """Quality by cell.

    Attributes:
        area_c, diameter_c: (n_cells,) area and largest distance of two vertices.
        shortest_edge_c: (n_cells,) length of the shortest edge.
        aspect_c: (n_cells,) square root of the ratio of the principal moments of inertia of the vertices, 1 for regular
            polygons.
        convex_c, star_shaped_c: (n_cells,) whether the cell is convex (straight angles allowed), and star-shaped about
            its centroid; where it is not, it is integrated over its triangles of Delaunay.
    """

    area_c: Float
    diameter_c: Float
    shortest_edge_c: Float
    aspect_c: Float
    convex_c: NDArray[np.bool_]
    star_shaped_c: NDArray[np.bool_]


def measure(mesh: PolygonMesh) -> Quality:
    """Quality of all cells."""
    n = mesh.n_cells
    area, diameter, shortest, aspect = np.empty((4, n))
    convex, star = np.empty((2, n), dtype=bool)
    for _, cells, vertices_cv in mesh.cells_by_size():
        polygons = mesh.points_vx[vertices_cv]
        sides = np.roll(polygons, -1, axis=1) - polygons
        after = np.roll(sides, -1, axis=1)
        turn = sides[..., 0] * after[..., 1] - sides[..., 1] * after[..., 0]
        area[cells], diameter[cells] = areas(polygons), diameters(polygons)
        shortest[cells] = np.hypot(sides[..., 0], sides[..., 1]).min(axis=1)
        convex[cells] = (turn >= -1e-9 * diameter[cells][:, None] ** 2).all(axis=1)
        star[cells] = star_shaped_about(polygons, centroids(polygons))
        arm = polygons - polygons.mean(axis=1, keepdims=True)
        moments = np.linalg.eigvalsh(np.einsum("cvx,cvy->cxy", arm, arm))
        aspect[cells] = np.sqrt(moments[:, 1] / np.maximum(moments[:, 0], 1e-300))
    return Quality(area, diameter, shortest, aspect, convex, star)
