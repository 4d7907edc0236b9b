"""Quadrature on intervals, triangles and polygons."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.vem.spaces.delaunay import delaunay_pieces

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Up to this degree the rules on triangles are symmetric in all corners, above it in the last two only.
SYMMETRIC = 6


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

    Degrees up to 6 use symmetric rules: of Strang and Fix (6 points) and Radon (7 points) in closed form, and of
    Dunavant (12 points; IJNME 21 (1985) 1129). Higher degrees use the product of Gauss and Gauss-Jacobi rules in
    coordinates that collapse at the first corner, so that the order of the other two does not matter.
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
    if degree == SYMMETRIC:
        points, weights = _orbits(
            [(0.24928674517091042, 0.11678627572637937), (0.063089014491502228, 0.050844906370206817)]
        )
        a, b = 0.053145049844816947, 0.31035245103378440
        more = np.array(list(permutations((a, b, 1 - a - b))))
        return np.vstack([points, more]), np.concatenate([weights, np.full(6, 0.082851075618373575)])
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
    return np.stack([y, 1.0 - x - y, x], axis=1), weights / weights.sum()


@dataclass(frozen=True)
class PieceRule:
    """Quadrature on one sub-triangle of a cell, the same for all.

    Attributes:
        barycentric_qp: (n_points, 3) points in barycentric coordinates.
        w_q: (n_points,) positive weights of sum 1.
    """

    barycentric_qp: Float
    w_q: Float


@cache
def piece_rule(degree: int, *, hub: bool) -> PieceRule:
    """Rule on sub-triangles, exact to ``degree``, that does not depend on how they are numbered.

    Args:
        degree: of the polynomials.
        hub: whether the first corner is the hub of a closed fan, so that only the other two are alike. Where there is
            none and the rule singles out a corner, the triangle is cut into three at its centroid.
    """
    barycentric, weights = triangle(degree)
    if degree <= SYMMETRIC or hub:
        return PieceRule(barycentric, weights)
    thirds = fan(np.eye(3)[None, :, :2])[0]  # corners by their first two barycentric coordinates
    first_two = (barycentric @ thirds).reshape(-1, 2)
    points = np.column_stack([first_two, 1.0 - first_two.sum(axis=1)])
    return PieceRule(points, np.tile(weights / 3.0, 3))


def fan(polygons_cvx: Float) -> Float:
    """Triangles (n_cells, n_sides, 3, 2) from the centroid to the sides, for polygons star-shaped about it."""
    center = np.broadcast_to(centroids(polygons_cvx)[:, None], polygons_cvx.shape)
    return np.stack([center, polygons_cvx, np.roll(polygons_cvx, -1, axis=1)], axis=2)


def star_shaped(polygons_cvx: Float) -> NDArray[np.bool_]:
    """(n_cells,) whether polygons are star-shaped about their centroid, and so fanned from it."""
    return star_shaped_about(polygons_cvx, centroids(polygons_cvx))


def sub_triangles(polygons_cvx: Float) -> list[tuple[Int, Float]]:
    """Sub-triangulations: pairs of cells (n,) and their triangles (n, n_triangles, 3, 2).

    Polygons that are star-shaped about their centroid are fanned from it; the others get the triangles of Delaunay.
    Both depend on the shape alone, not on how it is turned, reflected or numbered.
    """
    star = star_shaped(polygons_cvx)
    groups = []
    if star.any():
        groups.append((np.flatnonzero(star), fan(polygons_cvx[star])))
    others = np.flatnonzero(~star)
    triangulated = [_delaunay(polygons_cvx[c]) for c in others]
    sizes = np.array([len(triangles) for triangles in triangulated])
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size)
        groups.append((others[chosen], np.stack([triangulated[n] for n in chosen])))
    return groups


def _delaunay(polygon_vx: Float) -> Float:
    """Triangles (n, 3, 2) of a simple polygon; vertices on one circle are fanned from the centroid of their polygon.

    They are ordered by their vertices, so that cells whose triangles hang together alike have them in the same order.
    """
    found = [np.roll(piece, -int(np.argmin(piece))).tolist() for piece in delaunay_pieces(polygon_vx)]
    pieces = [polygon_vx[piece] for piece in sorted(found)]
    corners_tpx: Float = np.concatenate([p[None] if len(p) == 3 else fan(p[None])[0] for p in pieces])
    return corners_tpx


def is_fan(triangles_ctpx: Float) -> bool:
    """Whether the first corner of all triangles is the hub of a closed fan, in every cell."""
    hub, second, third = np.moveaxis(triangles_ctpx, 2, 0)
    return bool((hub == hub[:, :1]).all() and (third == np.roll(second, -1, axis=1)).all())


def on_triangles(triangles_ctpx: Float, degree: int) -> tuple[Float, Float]:
    """Points (n_cells, n_points, 2) and weights (n_cells, n_points) over the triangles of each cell."""
    return at_pieces(triangles_ctpx, piece_rule(degree, hub=is_fan(triangles_ctpx)))


def at_pieces(triangles_ctpx: Float, rule: PieceRule) -> tuple[Float, Float]:
    """The same with a rule that is given."""
    points = rule.barycentric_qp @ triangles_ctpx
    edge1, edge2 = triangles_ctpx[:, :, 1] - triangles_ctpx[:, :, 0], triangles_ctpx[:, :, 2] - triangles_ctpx[:, :, 0]
    area = 0.5 * (edge1[..., 0] * edge2[..., 1] - edge1[..., 1] * edge2[..., 0])
    n_cells = len(triangles_ctpx)
    return points.reshape(n_cells, -1, 2), (area[:, :, None] * rule.w_q).reshape(n_cells, -1)
