"""Checks of single polygons, all cells of one size at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, diameters
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# An edge shorter than this fraction of the polygon's diameter counts as zero, an area below its square as none.
SMALLEST_EDGE = 1e-10


def check_polygons(points_vx: Float, cell_offsets: Int, cell_vertices: Int) -> None:
    """Check that every polygon is simple, counter-clockwise and not degenerate.

    Raises:
        InputError: the message names the cell, what is wrong with it and what to do.
    """
    n_sides_c = np.diff(cell_offsets)
    for n_sides in np.unique(n_sides_c):
        cells = np.flatnonzero(n_sides_c == n_sides)
        vertices_cv = cell_vertices[cell_offsets[cells][:, None] + np.arange(n_sides)]
        _check_group(cells, vertices_cv, points_vx[vertices_cv])


def is_simple(polygon_vx: Float) -> bool:
    """Whether a polygon is simple, counter-clockwise and not degenerate."""
    try:
        check_polygons(polygon_vx, np.array([0, len(polygon_vx)]), np.arange(len(polygon_vx)))
    except InputError:
        return False
    return True


def _check_group(cells: Int, vertices_cv: Int, polygons_cvx: Float) -> None:
    ordered = np.sort(vertices_cv, axis=1)
    repeated = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if len(repeated):
        row = ordered[repeated[0]]
        vertex = row[1:][row[1:] == row[:-1]][0]
        raise InputError(f"cell {cells[repeated[0]]} repeats vertex {vertex}: list each vertex once")

    diameter_c = diameters(polygons_cvx)
    edges_cvx = np.roll(polygons_cvx, -1, axis=1) - polygons_cvx
    length_cv = np.hypot(edges_cvx[..., 0], edges_cvx[..., 1])
    short = np.argwhere(length_cv <= SMALLEST_EDGE * diameter_c[:, None])
    if len(short):
        c, side = short[0]
        a, b = vertices_cv[c, side], vertices_cv[c, (side + 1) % vertices_cv.shape[1]]
        raise InputError(f"cell {cells[c]} has an edge of length zero between vertices {a} and {b}: merge them")

    # farthest point from the first vertex, and the largest distance from the line through both
    arms = polygons_cvx - polygons_cvx[:, :1]
    farthest = np.take_along_axis(arms, np.argmax((arms**2).sum(axis=2), axis=1)[:, None, None], axis=1)
    flat = np.flatnonzero(np.abs(_cross(farthest, arms)).max(axis=1) <= SMALLEST_EDGE * diameter_c**2)
    if len(flat):
        raise InputError(f"cell {cells[flat[0]]} has no area: its vertices lie on a line")

    crossing = _first_self_intersection(polygons_cvx, diameter_c)
    if crossing is not None:
        c, i, j = crossing
        raise InputError(f"cell {cells[c]} intersects itself: its sides {i} and {j} cross or touch")

    area_c = areas(polygons_cvx)
    clockwise = np.flatnonzero(area_c < 0)
    if len(clockwise):
        c = clockwise[0]
        raise InputError(f"cell {cells[c]} is clockwise (area {area_c[c]:.3g}): list its vertices counter-clockwise")


def _first_self_intersection(polygons_cvx: Float, diameter_c: Float) -> tuple[int, int, int] | None:
    """First cell with two sides that meet outside a common vertex, and those sides."""
    n_sides = polygons_cvx.shape[1]
    tolerance_c = SMALLEST_EDGE * diameter_c**2
    following = np.roll(polygons_cvx, -1, axis=1)
    for i in range(n_sides):
        p, q = polygons_cvx[:, i], following[:, i]
        fold = following[:, (i + 1) % n_sides] - q  # the next side must not run back along this one
        along = np.einsum("cx,cx->c", fold, q - p)
        folded = np.flatnonzero((np.abs(_cross(q - p, fold)) <= tolerance_c) & (along < 0))
        if len(folded):
            return int(folded[0]), i, (i + 1) % n_sides
        for j in range(i + 2, n_sides - (i == 0)):
            r, s = polygons_cvx[:, j], following[:, j]
            d1, d2 = _cross(q - p, r - p), _cross(q - p, s - p)
            d3, d4 = _cross(s - r, p - r), _cross(s - r, q - r)
            crosses = (d1 * d2 < 0) & (d3 * d4 < 0)
            for d, point, a, b in ((d1, r, p, q), (d2, s, p, q), (d3, p, r, s), (d4, q, r, s)):
                inside = np.einsum("cx,cx->c", point - a, point - b) <= 0
                crosses |= (np.abs(d) <= tolerance_c) & inside
            hit = np.flatnonzero(crosses)
            if len(hit):
                return int(hit[0]), i, j
    return None


def _cross(a: Float, b: Float) -> Float:
    product: Float = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product
