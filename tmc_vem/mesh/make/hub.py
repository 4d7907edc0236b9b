"""From where cells are cut: a point that sees all of the cell, and where there is no good one, parts that have one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids, diameters, star_shaped_about
from tmc_vem.mesh.make.loops import Loops

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# A hub is good if it is farther from the lines through all sides than this fraction of the cell's width (area over
# diameter): a triangle's centroid has 2/3, a rectangle's 1/2.
DEEP = 0.1
# Diagonals that make a smaller angle (radians) are no cuts.
SHARPEST = 1e-6


def find_hubs(points_vx: Float, loops: Loops) -> tuple[Float, Bool]:
    """Points (n, 2) that see all of their polygon, and whether there is a good one: the centroid, else another."""
    hubs, good = np.empty((len(loops), 2)), np.empty(len(loops), dtype=bool)
    for which, vertices in loops.by_size():
        polygons = points_vx[vertices]
        hubs[which] = centroids(polygons)
        good[which] = _depth(polygons, hubs[which]) >= DEEP * areas(polygons) / diameters(polygons)
    for n in np.flatnonzero(~good).tolist():
        polygon = points_vx[loops.vertices[loops.offsets[n] : loops.offsets[n + 1]]]
        hubs[n], good[n] = _other_hub(polygon, hubs[n])
    return hubs, good


def star_parts(polygon_vx: Float) -> list[list[int]] | None:
    """Parts of a simple polygon that have a good hub, by numbers of its vertices; None if no diagonals make such parts.

    The diagonal whose smallest angle is largest is cut first. Every part begins with an end of its last diagonal.
    """
    return _parts(polygon_vx, list(range(len(polygon_vx))))


def worst_hub(polygon_vx: Float) -> Float | None:
    """A point that sees all of a polygon, however near to its sides; None if there is none."""
    for point in (centroids(polygon_vx[None])[0], _middle_of_kernel(polygon_vx)):
        if point is not None and star_shaped_about(polygon_vx[None], point[None])[0]:
            return point
    return None


def _other_hub(polygon: Float, centroid: Float) -> tuple[Float, bool]:
    point = _middle_of_kernel(polygon)
    if point is None:
        return centroid, False
    depth = _depth(polygon[None], point[None])[0]
    return point, bool(depth >= DEEP * areas(polygon[None])[0] / diameters(polygon[None])[0])


def _depth(polygons_cvx: Float, points_cx: Float) -> Float:
    """(n_cells,) smallest distance from the lines through the sides, negative outside of one."""
    a = polygons_cvx - points_cx[:, None]
    b = np.roll(a, -1, axis=1)
    height = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / np.hypot(*np.moveaxis(b - a, -1, 0))
    depth: Float = height.min(axis=1)
    return depth


def _middle_of_kernel(polygon: Float) -> Float | None:
    """Centroid of the points that see all of a polygon, None if there are hardly any."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    kernel = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        side, arm = end - start, kernel - start
        left = side[0] * arm[:, 1] - side[1] * arm[:, 0]
        clipped = []
        for n in range(len(kernel)):
            here, before = left[n], left[n - 1]
            if (here > 0.0) != (before > 0.0):
                clipped.append(kernel[n - 1] + before / (before - here) * (kernel[n] - kernel[n - 1]))
            if here > 0.0:
                clipped.append(kernel[n])
        if len(clipped) < 3:
            return None
        kernel = np.array(clipped)
    if areas(kernel[None])[0] <= 1e-12 * areas(polygon[None])[0]:
        return None
    middle: Float = centroids(kernel[None])[0]
    return middle


def _parts(points: Float, loop: list[int]) -> list[list[int]] | None:
    polygon = points[loop]
    centroid = centroids(polygon[None])
    width = areas(polygon[None]) / diameters(polygon[None])
    if _depth(polygon[None], centroid)[0] >= DEEP * width[0] or _other_hub(polygon, centroid[0])[1]:
        return [loop]
    cut = _best_diagonal(polygon)
    if cut is None:
        return None
    i, j = cut
    halves = [_parts(points, half) for half in (loop[i : j + 1], loop[j:] + loop[: i + 1])]
    return None if halves[0] is None or halves[1] is None else halves[0] + halves[1]


def _best_diagonal(polygon: Float) -> tuple[int, int] | None:
    """Ends i < j of the diagonal whose smallest angle with the sides is largest; of equal ones the shortest."""
    n = len(polygon)
    i, j = np.triu_indices(n, 2)
    apart = (i > 0) | (j < n - 1)
    i, j = i[apart], j[apart]
    to_next, to_last = np.roll(polygon, -1, axis=0) - polygon, np.roll(polygon, 1, axis=0) - polygon
    full = _angle(to_next, to_last)
    arm = polygon[j] - polygon[i]
    first, second = _angle(to_next[i], arm), _angle(to_next[j], -arm)
    smallest = np.min([first, full[i] - first, second, full[j] - second], axis=0)
    good = (smallest > SHARPEST) & ~_crossed(polygon, i, j)
    if not good.any():
        return None
    i, j, arm, smallest = i[good], j[good], arm[good], smallest[good]
    length = np.hypot(*arm.T)
    scale = length.max()
    # ties are broken by what does not depend on where the list of vertices begins
    middle = np.round((polygon[i] + polygon[j]) / scale, 7)
    best = np.lexsort([middle[:, 1], middle[:, 0], np.round(length / scale, 7), -np.round(smallest, 7)])[0]
    return int(i[best]), int(j[best])


def _angle(a: Float, b: Float) -> Float:
    """Angles from a to b, counter-clockwise, from 0 to 2 pi."""
    angle: Float = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)) % (2.0 * np.pi)
    return angle


def _crossed(polygon: Float, i: Int, j: Int) -> Bool:
    """Whether diagonals meet a side, or a vertex, other than at their ends."""
    n = len(polygon)
    p, q = polygon[i][:, None], polygon[j][:, None]
    r, s = polygon[None], np.roll(polygon, -1, axis=0)[None]
    at = np.arange(n)[None]
    ends = (at == i[:, None]) | (at == j[:, None])
    touching = ends | np.roll(ends, -1, axis=1)  # sides that begin or end at an end of the diagonal
    small = 1e-9 * np.ptp(polygon, axis=0).max() ** 2
    # a side that ends on the diagonal meets it too
    d1, d2, d3, d4 = _turn(p, q, r), _turn(p, q, s), _turn(r, s, p), _turn(r, s, q)
    meets = ((d1 > small) != (d2 > small)) | ((d1 < -small) != (d2 < -small))
    meets &= ((d3 > small) != (d4 > small)) | ((d3 < -small) != (d4 < -small))
    crossed: Bool = (meets & ~touching).any(axis=1)
    return crossed


def _turn(a: Float, b: Float, c: Float) -> Float:
    turn: Float = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]
    return turn
