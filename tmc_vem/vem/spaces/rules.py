"""Quadrature rules on polygons with few points and positive weights.

Polynomials up to degree d on a polygon are integrated exactly by as many points as their space has dimensions, whatever
the number of sides (Tchakaloff's theorem), and on convex quadrilaterals by a product rule with fewer. Rules on all
sub-triangles have up to four times as many points; they are needed where the integrand is a polynomial on each
sub-triangle only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.quadrature import PieceRule, at_pieces, gauss, is_fan, on_triangles, piece_rule

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class CellRule:
    """Points and weights for polygons of one kind.

    Attributes:
        points_sqx: (n_shapes, n_points, 2).
        w_sq: (n_shapes, n_points) weights, positive, with the areas as sums.
        piece_q: (n_points,) sub-triangle of each point where the rule is one of sub-triangles, else 0.
        on_pieces: the rule of sub-triangles, if it is one.
    """

    points_sqx: Float
    w_sq: Float
    piece_q: Int
    on_pieces: PieceRule | None = None


def on_sub_triangles(triangles_stpx: Float, degree: int) -> CellRule:
    """Rule on every sub-triangle; ``piece_q`` tells which."""
    rule = piece_rule(degree, hub=is_fan(triangles_stpx))
    points, weights = at_pieces(triangles_stpx, rule)
    return CellRule(points, weights, np.repeat(np.arange(triangles_stpx.shape[1]), len(rule.w_q)), rule)


def compressed(polygons_svx: Float, triangles_stpx: Float, degree: int) -> CellRule:
    """Rule for polynomials on the whole polygon.

    On more than four sides, and on quadrilaterals that are not convex, it depends on the numbering which points are
    kept.

    Args:
        polygons_svx: all triangles, all convex quadrilaterals, or anything else.
        triangles_stpx: their sub-triangles.
        degree: up to which polynomials are integrated exactly.
    """
    n_sides = polygons_svx.shape[1]
    if n_sides == 3:
        points, weights = on_triangles(polygons_svx[:, None], degree)  # symmetric in the corners for any degree
    elif n_sides == 4 and convex(polygons_svx).all():
        points, weights = _product_rule(polygons_svx, (degree + 3) // 2)
    else:
        points, weights = _fewest_points(*on_triangles(triangles_stpx, degree), degree)
    return CellRule(points, weights, np.zeros(weights.shape[1], dtype=np.int64))


def simple(polygons_svx: Float, triangles_stpx: Float, degree: int) -> CellRule:
    """Rule with few points on triangles and convex quadrilaterals, on others that of all sub-triangles.

    On quadrilaterals it has one point more in each direction than exactness asks for. That is still a third less than
    on sub-triangles, and as the energy is no polynomial, it is the more accurate rule.
    """
    n_sides = polygons_svx.shape[1]
    if n_sides == 3:
        return compressed(polygons_svx, triangles_stpx, degree)
    if n_sides == 4 and convex(polygons_svx).all():
        points, weights = _product_rule(polygons_svx, (degree + 5) // 2)
        return CellRule(points, weights, np.zeros(weights.shape[1], dtype=np.int64))
    return on_sub_triangles(triangles_stpx, degree)


def convex(polygons_svx: Float) -> NDArray[np.bool_]:
    """(n_shapes,) whether every corner of a counter-clockwise polygon turns left."""
    before, after = np.roll(polygons_svx, 1, axis=1), np.roll(polygons_svx, -1, axis=1)
    a, b = polygons_svx - before, after - polygons_svx
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    size = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    turns: NDArray[np.bool_] = (cross > 1e-6 * size).all(axis=1)
    return turns


def _product_rule(quadrilaterals_svx: Float, n: int) -> tuple[Float, Float]:
    """Gauss points in the bilinear map of the square, n in each direction: exact to degree 2 n - 2, as the determinant
    of the map has degree 1 in each coordinate."""
    s, w = gauss(n)
    x, y = (c.ravel() for c in np.meshgrid(s, s, indexing="ij"))
    shape_qv = np.stack([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y], axis=1)
    along_x = np.stack([y - 1, 1 - y, y, -y], axis=1) @ quadrilaterals_svx
    along_y = np.stack([x - 1, -x, x, 1 - x], axis=1) @ quadrilaterals_svx
    determinant = along_x[..., 0] * along_y[..., 1] - along_x[..., 1] * along_y[..., 0]
    return shape_qv @ quadrilaterals_svx, determinant * np.outer(w, w).ravel()


def _fewest_points(points_sqx: Float, w_sq: Float, degree: int) -> tuple[Float, Float]:
    """Keep as many points as the polynomials have dimensions, by Caratheodory's elimination, all cells at once.

    A vector z in the kernel of the moments changes weights but no integral: ``w - t z`` with the smallest t that makes
    a weight vanish removes a point. The kernel is computed once; each removal takes one vector out of it.
    """
    n_shapes, n_points = w_sq.shape
    keep = monomials.dimension(degree)
    if n_points <= keep:
        return points_sqx, w_sq
    center = points_sqx.mean(axis=1, keepdims=True)
    scale = np.abs(points_sqx - center).max(axis=(1, 2))
    scaled = (points_sqx - center) / scale[:, None, None]
    m_sqm = _orthogonal(degree, scaled)
    q_sqq, _ = np.linalg.qr(m_sqm, mode="complete")
    kernel = np.ascontiguousarray(q_sqq[:, :, keep:])
    w, every = w_sq.copy(), np.arange(n_shapes)
    gone = np.zeros_like(w, dtype=bool)
    for last in range(n_points - keep - 1, -1, -1):
        z = np.where(gone, 0.0, kernel[:, :, last])
        small = 1e-12 * np.abs(z).max(axis=1, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(np.abs(z) > small, w / z, np.nan)
        up = np.where(step > 0.0, step, np.inf).argmin(axis=1)  # first weight to vanish along z, and against it
        down = np.where(step < 0.0, -step, np.inf).argmin(axis=1)
        chosen = np.where(np.abs(z[every, up]) >= np.abs(z[every, down]), up, down)  # the larger pivot
        w -= step[every, chosen, None] * z
        gone[every, chosen] = True
        w[every, chosen] = 0.0
        row = kernel[every, chosen, :last] / z[every, chosen, None]
        kernel[:, :, :last] -= z[:, :, None] * row[:, None]
    support = np.argsort(gone, axis=1, kind="stable")[:, :keep]
    at = every[:, None]
    # once more from the moments, without the rounding of the elimination
    moments = np.einsum("sqm,sq->sm", m_sqm, w_sq)
    exact = np.linalg.solve(np.swapaxes(m_sqm[at, support], 1, 2), moments[:, :, None])[:, :, 0]
    fine = (exact > 0.0).all(axis=1)
    return points_sqx[at, support], np.where(fine[:, None], exact, np.maximum(w[at, support], 0.0))


def _orthogonal(degree: int, xi_sqx: Float) -> Float:
    """Products of Legendre polynomials up to a total degree, (n_shapes, n_points, dim P_degree), on [-1, 1]^2."""
    legendre = np.polynomial.legendre.legvander(xi_sqx, degree)  # type: ignore[no-untyped-call]
    a, b = monomials.exponents(degree).T
    product: Float = legendre[:, :, 0, a] * legendre[:, :, 1, b]
    return product
