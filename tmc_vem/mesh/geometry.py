"""Geometry of polygons, vectorised over cells with equally many vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


def areas(polygons_cvx: Float) -> Float:
    """Signed areas (n_cells,) of polygons (n_cells, n_vertices, 2): positive if counter-clockwise."""
    relative = polygons_cvx - polygons_cvx[:, :1]  # the shoelace sum loses digits far from the origin
    following = np.roll(relative, -1, axis=1)
    area: Float = 0.5 * (relative[..., 0] * following[..., 1] - relative[..., 1] * following[..., 0]).sum(axis=1)
    return area


def centroids(polygons_cvx: Float) -> Float:
    """Centroids (n_cells, 2) of the polygons' areas."""
    origin = polygons_cvx[:, :1]
    relative = polygons_cvx - origin
    following = np.roll(relative, -1, axis=1)
    cross = relative[..., 0] * following[..., 1] - relative[..., 1] * following[..., 0]
    moment = ((relative + following) * cross[..., None]).sum(axis=1)
    centroid: Float = origin[:, 0] + moment / (3.0 * cross.sum(axis=1))[:, None]
    return centroid


def diameters(polygons_cvx: Float) -> Float:
    """Largest distance (n_cells,) between two vertices."""
    largest = np.zeros(len(polygons_cvx))
    for shift in range(1, polygons_cvx.shape[1] // 2 + 1):
        difference = polygons_cvx - np.roll(polygons_cvx, -shift, axis=1)
        np.maximum(largest, np.einsum("cvx,cvx->cv", difference, difference).max(axis=1), out=largest)
    return np.sqrt(largest)


def star_shaped_about(polygons_cvx: Float, center_cx: Float, tolerance: float = 1e-6) -> NDArray[np.bool_]:
    """Whether each polygon is star-shaped about the given point.

    True where every triangle of the point and a side has at least ``tolerance`` times the polygon's area, except that
    the bound shrinks with the side's length; with such fans, all quadrature weights are positive.
    """
    a = polygons_cvx - center_cx[:, None]
    b = np.roll(a, -1, axis=1)
    twice_area = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    side = np.hypot(*np.moveaxis(b - a, -1, 0))
    bound = tolerance * side * diameters(polygons_cvx)[:, None]
    inside: NDArray[np.bool_] = (twice_area > bound).all(axis=1)
    return inside


def triangle_lattice(along: int) -> Float:
    """Barycentric coordinates (n, 3) of a lattice in a triangle with this many points on each side."""
    i, j = (index.ravel() for index in np.meshgrid(np.arange(along), np.arange(along), indexing="ij"))
    inside = i + j < along
    i, j = i[inside], j[inside]
    points: Float = np.column_stack([i, j, along - 1 - i - j]) / (along - 1)
    return points
