"""Quadrature on intervals, triangles and polygons."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids, diameters, star_shaped_about

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# A triangle is flat if its area is below this fraction of its longest side squared.
FLAT = 1e-12
# A vertex this close to a diagonal, as a fraction of the diagonal's length, lies on it.
ON_DIAGONAL = 1e-6


@cache
def gauss(n_points: int) -> tuple[Float, Float]:
    """Gauss-Legendre points and weights on [0, 1], exact to degree ``2 n_points - 1``."""
    x, w = np.polynomial.legendre.leggauss(n_points)  # type: ignore[no-untyped-call]
    return 0.5 * (x + 1.0), 0.5 * w


@cache
def gauss_lobatto(n_points: int) -> tuple[Float, Float]:
    """Gauss-Lobatto points and weights on [0, 1], end points included, exact to degree ``2 n_points - 3``.

    Interior points are the roots of P'_(n-1); the weights are ``2 / (n (n - 1) P_(n-1)(x)^2)`` on [-1, 1].
    """
    if n_points < 2:
        raise ValueError(f"a Gauss-Lobatto rule has at least 2 points, got {n_points}")
    legendre = np.polynomial.legendre.Legendre.basis(n_points - 1)  # type: ignore[no-untyped-call]
    interior = np.sort(legendre.deriv().roots().real)
    x = np.concatenate([[-1.0], interior, [1.0]])
    w = 2.0 / (n_points * (n_points - 1) * legendre(x) ** 2)
    return 0.5 * (x + 1.0), 0.5 * w


@cache
def triangle(degree: int) -> tuple[Float, Float]:
    """Barycentric points (n, 3) and weights (n,) of sum 1 on a triangle, exact to ``degree``; all weights positive.

    Degrees up to 5 use the symmetric rules of Strang and Fix (6 points) and Radon (7 points), in closed form; higher
    degrees the product of Gauss and Gauss-Jacobi rules in collapsed coordinates.
    """
    if degree <= 1:
        return np.full((1, 3), 1 / 3), np.ones(1)
    if degree == 2:
        return _orbits([(1 / 6, 1 / 3)])
    if degree <= 4:
        root = np.sqrt(38.0 - 44.0 * np.sqrt(0.4))
        sqrt10, spread = np.sqrt(10.0), np.sqrt(213125.0 - 53320.0 * np.sqrt(10.0))
        return _orbits(
            [((8 - sqrt10 + root) / 18, (620 + spread) / 3720), ((8 - sqrt10 - root) / 18, (620 - spread) / 3720)]
        )
    if degree == 5:
        sqrt15 = np.sqrt(15.0)
        points, weights = _orbits(
            [((6 - sqrt15) / 21, (155 - sqrt15) / 1200), ((6 + sqrt15) / 21, (155 + sqrt15) / 1200)]
        )
        return np.vstack([np.full((1, 3), 1 / 3), points]), np.concatenate([[9 / 40], weights])
    return _collapsed(degree)


def _orbits(pairs: list[tuple[float, float]]) -> tuple[Float, Float]:
    """Points (a, a, 1 - 2a) and permutations, with equal weights."""
    points = [permuted for a, _ in pairs for permuted in ((1 - 2 * a, a, a), (a, 1 - 2 * a, a), (a, a, 1 - 2 * a))]
    return np.array(points), np.repeat([w for _, w in pairs], 3)


def _collapsed(degree: int) -> tuple[Float, Float]:
    from scipy.special import roots_jacobi

    n = degree // 2 + 1
    s, w_s = gauss(n)
    t, w_t = roots_jacobi(n, 1.0, 0.0)  # weight 1 - t: the width of the triangle
    t, w_t = 0.5 * (t + 1.0), w_t / 2.0
    first, second = np.meshgrid(s, t, indexing="ij")
    x, y = (first * (1.0 - second)).ravel(), second.ravel()
    weights = np.outer(w_s, w_t).ravel()
    return np.stack([1.0 - x - y, x, y], axis=1), weights / weights.sum()


def fan(polygons_cvx: Float) -> Float:
    """Triangles (n_cells, n_sides, 3, 2) from the centroid to the sides, for polygons star-shaped about it."""
    center = np.broadcast_to(centroids(polygons_cvx)[:, None], polygons_cvx.shape)
    return np.stack([center, polygons_cvx, np.roll(polygons_cvx, -1, axis=1)], axis=2)


def ear_clipping(polygon_vx: Float) -> Float:
    """Triangles (n_sides - 2, 3, 2) of any simple counter-clockwise polygon.

    At every step the ear with the largest smallest angle (by area over squared longest side) is cut off, which keeps
    triangles away from degenerate; ears of collinear points come last.

    Raises:
        ValueError: no ear is left, which a simple polygon cannot have.
    """
    remaining = list(range(len(polygon_vx)))
    triangles = []
    while len(remaining) > 3:
        best = _best_ear(polygon_vx, remaining, ON_DIAGONAL)
        if best < 0:
            best = _best_ear(polygon_vx, remaining, FLAT)
        if best < 0:  # nothing but collinear vertices may be left, and they enclose no area
            rest = polygon_vx[remaining]
            if abs(areas(rest[None])[0]) > FLAT * diameters(rest[None])[0] ** 2:
                raise ValueError("ear clipping found no ear: the polygon is not simple")
            best = 0
        triangles.append([remaining[best - 1], remaining[best], remaining[(best + 1) % len(remaining)]])
        del remaining[best]
    triangles.append(remaining)
    corners_tpx: Float = polygon_vx[np.array(triangles)]
    return corners_tpx


def _best_ear(points: Float, remaining: list[int], tolerance: float) -> int:
    """Place in the list of the ear with the largest quality that no other vertex lies in; -1 if there is none."""
    best, best_quality = -1, 0.0
    for n in range(len(remaining)):
        a, b, c = (points[remaining[(n + d) % len(remaining)]] for d in (-1, 0, 1))
        quality = _triangle_quality(a, b, c)
        if quality > best_quality and not _contains_any(points, remaining, n, tolerance):
            best, best_quality = n, quality
    return best


def _triangle_quality(a: Float, b: Float, c: Float) -> float:
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    longest = max(np.dot(b - a, b - a), np.dot(c - b, c - b), np.dot(a - c, a - c))
    return float(area / longest) if area > FLAT * longest else 0.0


def _contains_any(points: Float, remaining: list[int], ear: int, tolerance: float) -> bool:
    """Whether the closed triangle of an ear contains another remaining vertex, apart from its own corners.

    A vertex as good as on the diagonal counts as inside, whatever rounding makes of it: else the next ear there would
    have no area.
    """
    corners = [remaining[ear - 1], remaining[ear], remaining[(ear + 1) % len(remaining)]]
    others = points[[v for v in remaining if v not in corners]]
    a, b, c = points[corners]
    inside = np.ones(len(others), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        twice_area = (q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0])
        inside &= twice_area >= -tolerance * np.dot(q - p, q - p)
    return bool(inside.any())


def star_shaped(polygons_cvx: Float) -> NDArray[np.bool_]:
    """(n_cells,) whether polygons are star-shaped about their centroid, and so fanned from it."""
    return star_shaped_about(polygons_cvx, centroids(polygons_cvx))


def sub_triangles(polygons_cvx: Float) -> list[tuple[Int, Float]]:
    """Sub-triangulations: pairs of cells (n,) and their triangles (n, n_triangles, 3, 2).

    Polygons that are star-shaped about their centroid are fanned from it; the others are triangulated by ear clipping.
    """
    star = star_shaped(polygons_cvx)
    groups = []
    if star.any():
        groups.append((np.flatnonzero(star), fan(polygons_cvx[star])))
    if not star.all():
        others = np.flatnonzero(~star)
        groups.append((others, np.stack([ear_clipping(polygons_cvx[c]) for c in others])))
    return groups


def on_triangles(triangles_ctpx: Float, degree: int) -> tuple[Float, Float]:
    """Points (n_cells, n_points, 2) and weights (n_cells, n_points) over the triangles of each cell."""
    barycentric, weights = triangle(degree)
    points = barycentric @ triangles_ctpx
    edge1, edge2 = triangles_ctpx[:, :, 1] - triangles_ctpx[:, :, 0], triangles_ctpx[:, :, 2] - triangles_ctpx[:, :, 0]
    area = 0.5 * (edge1[..., 0] * edge2[..., 1] - edge1[..., 1] * edge2[..., 0])
    n_cells = len(triangles_ctpx)
    return points.reshape(n_cells, -1, 2), (area[:, :, None] * weights).reshape(n_cells, -1)
