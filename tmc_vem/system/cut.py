"""Straight cuts through cells: which cells are left of a line, and which points they share with those on the right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

AT_ENDS = 1e-6  # of the length of a cut: points so little beyond its ends belong to it


def cut_points(
    points_nx: Float, offsets: Int, connectivity: Int, chosen_c: Bool, line: Sequence[Sequence[float]]
) -> tuple[Bool, Int, Int]:
    """Cells left of a line, and points that touch cells on both sides of it.

    Args:
        points_nx: (n_points, 2) points of cells.
        offsets, connectivity: the cells, as in :class:`tmc_vem.system.fields.Polygons`.
        chosen_c: (n_cells,) which cells are cut.
        line: both ends.

    Returns:
        (n_cells,) which of the chosen cells are left, by the mean of their points; points that are at chosen cells on
        both sides, between the ends of the line; and points of chosen cells on both sides or one, of those cells that
        may share points with cells of other ranks.
    """
    start, end = (np.asarray(point, dtype=float) for point in line)
    along = (end - start) / np.hypot(*(end - start))
    left_c = sides_of(points_nx, offsets, connectivity, line) & chosen_c
    sizes = np.diff(offsets)
    at_left, at_right = (np.zeros(len(points_nx), dtype=bool) for _ in range(2))
    at_left[connectivity[np.repeat(left_c, sizes)]] = True
    at_right[connectivity[np.repeat(chosen_c & ~left_c, sizes)]] = True
    length, t = float(np.hypot(*(end - start))), (points_nx - start) @ along
    between = (t >= -AT_ENDS * length) & (t <= (1.0 + AT_ENDS) * length)
    return left_c, np.flatnonzero(at_left & at_right & between), np.flatnonzero((at_left | at_right) & between)


def going_on(
    points_nx: Float, offsets: Int, connectivity: Int, chosen_c: Bool, line: Sequence[Sequence[float]]
) -> Float:
    """(n, 2) points beyond the ends of a line to which sides that it cuts go: there are some if it ends in a body.

    The arguments are those of :func:`cut_points`, of a whole mesh.
    """
    start, end = (np.asarray(point, dtype=float) for point in line)
    left_k = np.repeat(sides_of(points_nx, offsets, connectivity, line), np.diff(offsets))
    following = np.arange(1, len(connectivity) + 1)
    following[offsets[1:] - 1] = offsets[:-1]
    pairs = np.column_stack([connectivity, connectivity[following]])
    chosen_k = np.repeat(chosen_c, np.diff(offsets))
    at_left, at_right = (
        {(int(a), int(b)) for a, b in np.sort(pairs[chosen_k & (left_k == side)], axis=1)} for side in (True, False)
    )
    sides = np.array(sorted(at_left & at_right), dtype=np.int64).reshape(-1, 2)
    t = (points_nx[sides] - start) @ (end - start) / float((end - start) @ (end - start))
    within = (t >= -AT_ENDS) & (t <= 1.0 + AT_ENDS)
    beyond: Float = points_nx[sides[~within & within[:, ::-1]]]
    return beyond


def sides_of(points_nx: Float, offsets: Int, connectivity: Int, line: Sequence[Sequence[float]]) -> Bool:
    """(n_cells,) whether the mean of a cell's points is left of a line, or on it."""
    start, end = (np.asarray(point, dtype=float) for point in line)
    if not len(connectivity):
        return np.zeros(len(offsets) - 1, dtype=bool)
    mean_cx = np.add.reduceat(points_nx[connectivity], offsets[:-1]) / np.diff(offsets)[:, None]
    x, y = (mean_cx - start).T
    left: Bool = (end[0] - start[0]) * y - (end[1] - start[1]) * x >= 0.0
    return left
