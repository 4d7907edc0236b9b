"""In which cells points lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Points outside of all cells are taken to the nearest one up to this fraction of the mesh's extent.
TOLERANCE = 1e-6


@dataclass(frozen=True)
class Cells:
    """The cell of each point.

    Attributes:
        cell_n: (n,) the cell of the smallest number among those that a point lies in or on, else the nearest one.
        distance_n: (n,) distance to it; 0 within the tolerance, infinite if there are no cells.
        nearest_nx: (n, 2) the point of the cell that is nearest.
    """

    cell_n: Int
    distance_n: Float
    nearest_nx: Float


def find_cells(loops: list[Float], numbers: Int, points_nx: Float, tolerance: float) -> Cells:
    """Find the cells of points.

    Args:
        loops: vertices (n_vertices, 2) of each cell.
        numbers: (n_cells,) by which cells are preferred where a point lies on several: those of the whole mesh, so that
            the choice does not depend on its distribution.
        points_nx: (n, 2) the points.
        tolerance: distance up to which a point lies in a cell.
    """
    import shapely

    n = len(points_nx)
    cell_n, distance_n, nearest_nx = np.zeros(n, dtype=np.int64), np.full(n, np.inf), np.zeros((n, 2))
    if not loops or not n:
        return Cells(cell_n, distance_n, nearest_nx)
    polygons: Any = shapely.polygons(
        shapely.linearrings(
            np.concatenate(loops), indices=np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
        )
    )
    tree, at = shapely.STRtree(polygons), shapely.points(points_nx)
    point, cell = tree.query(at, predicate="dwithin", distance=tolerance)
    order = np.lexsort((numbers[cell], point))
    inside, first = np.unique(point[order], return_index=True)
    cell_n[inside], distance_n[inside] = cell[order][first], 0.0
    outside = np.setdiff1d(np.arange(n), inside)
    if len(outside):
        (which, nearest), away = tree.query_nearest(at[outside], return_distance=True, all_matches=False)
        cell_n[outside[which]], distance_n[outside[which]] = nearest, away
    lines = shapely.shortest_line(polygons[cell_n], at)
    nearest_nx[:] = shapely.get_coordinates(lines).reshape(n, 2, 2)[:, 0]
    return Cells(cell_n, distance_n, nearest_nx)
