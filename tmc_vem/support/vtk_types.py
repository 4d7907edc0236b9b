"""Polygons as cells of VTK: quadratic triangles and quadrilaterals where it interpolates them as finite elements do.

VTK interpolates in its polygons with inverse squared distances: gradients are near zero at the vertices, and lines
through cells are off. In its quadratic triangles (22) and quadrilaterals (23) linear displacements are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]

POLYGON, QUADRATIC_TRIANGLE, QUADRATIC_QUAD = 7, 22, 23
# Half the sine of the angles at corners, times the sides there, is at least this fraction of the squared diameter.
BLUNT = 1e-4


def cell_types(points_nx: Float, offsets: Int, connectivity: Int) -> Int:
    """VTK's types (n_cells,) of polygons through vertices and points on the sides, vertices first.

    Triangles and strictly convex quadrilaterals with a node in the middle of every side are quadratic, others polygons.
    """
    sizes = np.diff(offsets)
    types = np.full(len(sizes), POLYGON)
    for n_sides, kind in ((3, QUADRATIC_TRIANGLE), (4, QUADRATIC_QUAD)):
        cells = np.flatnonzero(sizes == 2 * n_sides)
        rings = points_nx[connectivity[offsets[cells][:, None] + np.arange(2 * n_sides)]]
        corners, middles = rings[:, ::2], rings[:, 1::2]
        sides = np.roll(corners, -1, axis=1) - corners
        before = np.roll(sides, 1, axis=1)
        size = np.ptp(corners, axis=1).max(axis=1)
        turn = before[..., 0] * sides[..., 1] - before[..., 1] * sides[..., 0]
        away = np.abs(corners + 0.5 * sides - middles).max(axis=(1, 2))
        plain = (turn > BLUNT * size[:, None] ** 2).all(axis=1) & (away <= 1e-9 * size)
        types[cells[plain]] = kind
    return types


def to_vtk(offsets: Int, connectivity: Int, types: Int) -> Int:
    """The connectivity in VTK's order: in quadratic cells the corners first, then the middles of the sides."""
    return _reordered(offsets, connectivity, types, np.arange(3) * 2, np.arange(4) * 2, True)


def from_vtk(offsets: Int, connectivity: Int, types: Int) -> Int:
    """The connectivity around the cells, of that in VTK's order."""
    return _reordered(offsets, connectivity, types, np.arange(3), np.arange(4), False)


def _reordered(offsets: Int, connectivity: Int, types: Int, three: Int, four: Int, to: bool) -> Int:
    result = connectivity.copy()
    for kind, first in ((QUADRATIC_TRIANGLE, three), (QUADRATIC_QUAD, four)):
        n = len(first)
        entries = offsets[:-1][types == kind][:, None]
        order = np.concatenate([first, first + 1]) if to else np.stack([first, first + n], axis=1).ravel()
        result[entries + np.arange(2 * n)] = connectivity[entries + order]
    return result
