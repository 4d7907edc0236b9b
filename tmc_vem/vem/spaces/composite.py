"""Explicit functions on the sub-triangles: the gradient of a continuous piecewise polynomial of degree k + 1.

The function has the traces of v. Its coefficients inside minimise ``int |grad w|^2`` with the moments of v up to degree
k - 1 prescribed: those up to k - 2 are degrees of freedom, the others are those of Pi_nabla_k v. For v in P_k the
minimiser is v itself. The displacement within a cell is then continuous and known, the method is a conforming one with
composite elements, and only rigid motions have no strain, on any polygon.

All cells whose sub-triangles hang together alike take the same few products: what is integrated is, on every
sub-triangle, a sum of constant matrices times scalar products of the gradients of its barycentric coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.projector import moments_of_basis
from tmc_vem.vem.spaces.quadrature import triangle
from tmc_vem.vem.spaces.spaces import FullSpace, Gradients, Shapes
from tmc_vem.vem.spaces.triangulation import (
    affine_powers,
    barycentric_gradients,
    bernstein,
    bernstein_gradients,
    boundary_coefficients,
    coefficient_numbers,
    equal_topologies,
    lattice,
)

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Pairs of barycentric directions, each once.
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class CompositeSpace:
    """Gradients of continuous piecewise polynomials of degree k + 1 on the sub-triangles.

    Attributes:
        order: k.
    """

    order: int

    @property
    def label(self) -> str:
        """Its name."""
        return "composite"

    @property
    def degree(self) -> int:
        """k, also that of the second gradient's space [P_k]^2."""
        return self.order

    @property
    def piecewise_degree(self) -> int:
        """Degree k of the gradient on every sub-triangle."""
        return self.order

    def gradients(self, shapes: Shapes) -> Gradients:
        """See :class:`tmc_vem.vem.spaces.spaces.ProjectionSpace`; the second gradient is that of [P_k]^2."""
        smooth = FullSpace(self.order).gradients(shapes)
        topologies = equal_topologies(shapes.polygons_cvx, shapes.triangles_ctpx)
        if len(topologies) == 1:
            return Gradients(_gradients(shapes, topologies[0][1]), smooth.second_sxma, has_potential=True)
        n_triangles, n_m = shapes.triangles_ctpx.shape[1], monomials.dimension(self.order)
        first = np.empty((len(shapes), n_triangles, 2, n_m, shapes.n_basis))
        for chosen, corners_tp in topologies:
            first[chosen] = _gradients(shapes.take(chosen), corners_tp)
        return Gradients(first, smooth.second_sxma, has_potential=True)


@dataclass(frozen=True)
class _Topology:
    """What all cells have in common whose sub-triangles hang together alike; see :func:`_topology`.

    Attributes:
        numbers_tn: Bernstein coefficient (n_triangles, n) of the continuous function on every sub-triangle.
        known_ba: (n_boundary, n_sides k) the coefficients on the boundary, the first ones, by the values there.
        system: (n_triangles * 6, n_inside + n_moments, n_inside + n_moments + n_basis) for every sub-triangle and pair
            of directions: stiffness of the coefficients inside and the right-hand side for the degrees of freedom.
        moments: (n_triangles dim P_(k-1), n_inside + n_sides k) integrals of a polynomial, given by its values at
            the lattice of every sub-triangle, times the coefficients inside and times what the values contribute.
    """

    numbers_tn: Int
    known_ba: Float
    system: Float
    moments: Float


def _gradients(shapes: Shapes, corners_tp: Int) -> Float:
    """Coefficients (n_shapes, n_triangles, 2, dim P_k, n_basis) of the gradients in scaled monomials.

    Args:
        shapes: polygons whose sub-triangulations have the same topology.
        corners_tp: vertices of the sub-triangles.
    """
    k, n_shapes, (n_triangles, _) = shapes.order, len(shapes), corners_tp.shape
    n_m = monomials.dimension(k)
    slopes_tpx, area_t = barycentric_gradients(shapes.scaled_triangles)
    topology = _topology(corners_tp.tobytes(), shapes.geometry.n_sides, k)
    coefficients = _coefficients(shapes, topology, slopes_tpx, area_t)[:, topology.numbers_tn]

    # the second and third barycentric coordinates s, t are affine functions of xi, and w a polynomial of s and t:
    # on every sub-triangle, grad w = sum_p grad lambda_p sum_j A_jm(xi) D_pjn w_n
    slopes_xpt = np.ascontiguousarray(np.moveaxis(slopes_tpx[:, :, 1:], (3, 2), (0, 1)).reshape(2, 2, -1))
    origin_xt = shapes.scaled_triangles[:, :, 0].reshape(-1, 2).T
    constant_pt = -(slopes_xpt[0] * origin_xt[0] + slopes_xpt[1] * origin_xt[1])
    powers_jmt = affine_powers(k, np.concatenate([constant_pt[None], slopes_xpt]))
    # derivatives with respect to x, not xi
    physical_xpt = slopes_xpt / np.repeat(shapes.geometry.diameter_c, n_triangles)
    factors = physical_xpt[:, None, :, None] * np.swapaxes(powers_jmt, 0, 1)[None, :, None]
    factors = factors.reshape(2 * n_m, 2 * n_m, -1)
    derivatives = _monomial_derivatives(k + 1)
    by_coefficient = np.swapaxes(factors, 1, 2) @ derivatives  # (x m), (shape, triangle), n
    by_coefficient = np.ascontiguousarray(np.swapaxes(by_coefficient, 0, 1))
    product = by_coefficient @ coefficients.reshape(n_shapes * n_triangles, -1, shapes.n_basis)
    result: Float = product.reshape(n_shapes, n_triangles, 2, n_m, shapes.n_basis)
    return result


def _coefficients(shapes: Shapes, topology: _Topology, slopes_tpx: Float, area_t: Float) -> Float:
    """Bernstein coefficients (n_shapes, n_total, n_basis) of the piecewise polynomials of the basis.

    Args:
        shapes: the polygons.
        topology: of their sub-triangles.
        slopes_tpx, area_t: gradients (n_shapes, n_triangles, 3, 2) of the barycentric coordinates, and areas, scaled.
    """
    k, n_shapes, (n_boundary, n_values) = shapes.order, len(shapes), topology.known_ba.shape
    target = moments_of_basis(shapes.geometry, k, k - 1, shapes.elliptic_cad)
    n_moments, n_rows = target.shape[1], topology.system.shape[1]
    n_inside = n_rows - n_moments

    x, y = slopes_tpx[..., 0], slopes_tpx[..., 1]
    products = np.stack([area_t * (x[..., p] * x[..., r] + y[..., p] * y[..., r]) for p, r in PAIRS], axis=2)
    system = products.reshape(n_shapes, -1) @ topology.system.reshape(len(topology.system), -1)
    system = system.reshape(n_shapes, n_rows, -1)

    m = monomials.values(k - 1, shapes.scaled_points(lattice(k - 1)))
    weighted = m * np.repeat(area_t, m.shape[1] // area_t.shape[1], axis=1)[..., None]
    moments = np.swapaxes(weighted, 1, 2) @ topology.moments
    system[:, n_inside:, :n_inside] = moments[..., :n_inside]
    system[:, :n_inside, n_inside:n_rows] = np.swapaxes(moments[..., :n_inside], 1, 2)
    system[:, n_inside:, n_rows:] = target
    system[:, n_inside:, n_rows : n_rows + n_values] -= moments[..., n_inside:]

    coefficients = np.zeros((n_shapes, n_boundary + n_inside, shapes.n_basis))
    coefficients[:, :n_boundary, :n_values] = topology.known_ba
    coefficients[:, n_boundary:] = np.linalg.solve(system[..., :n_rows], system[..., n_rows:])[:, :n_inside]
    return coefficients


@lru_cache(maxsize=64)
def _topology(corners: bytes, n_sides: int, k: int) -> _Topology:
    """What sub-triangulations of ``n_sides``-gons with these corners (n_triangles, 3) take for elements of order k."""
    corners_tp = np.frombuffer(corners, dtype=np.int64).reshape(-1, 3)
    degree = k + 1
    numbers, n_total = coefficient_numbers(corners_tp, n_sides, degree)
    n_boundary, n_triangles, n_values = n_sides * degree, len(numbers), n_sides * k
    n_inside, n_moments = n_total - n_boundary, monomials.dimension(k - 1)
    known = boundary_coefficients(n_sides, degree, k)
    barycentric, weights = triangle(2 * degree)
    values, slopes = bernstein(degree, barycentric), bernstein_gradients(degree, barycentric)

    reference = np.einsum("q,qnp,qmr->prnm", weights, slopes, slopes)
    pairs = np.stack([reference[p, r] + (reference[r, p] if p != r else 0.0) for p, r in PAIRS])
    stiffness = np.zeros((n_triangles, len(PAIRS), n_total, n_total))
    for t, at in enumerate(numbers):
        stiffness[t, :, at[:, None], at] = np.moveaxis(pairs, 0, 2)
    n_rows = n_inside + n_moments
    system = np.zeros((n_triangles * len(PAIRS), n_rows, n_rows + n_values + k * (k - 1) // 2))
    inside = stiffness.reshape(-1, n_total, n_total)[:, n_boundary:]
    system[:, :n_inside, :n_inside] = inside[:, :, n_boundary:]
    system[:, :n_inside, n_rows : n_rows + n_values] = -inside[:, :, :n_boundary] @ known

    # values at the lattice -> values at the quadrature points -> integrals with the Bernstein polynomials
    nodes = lattice(k - 1)
    interpolation = np.linalg.solve(bernstein(k - 1, nodes).T, bernstein(k - 1, barycentric).T)
    local = (interpolation * weights) @ values
    moments = np.zeros((n_triangles, len(nodes), n_total))
    for t, at in enumerate(numbers):
        moments[t, :, at] = local.T
    moments = moments.reshape(-1, n_total)
    both = np.concatenate([moments[:, n_boundary:], moments[:, :n_boundary] @ known], axis=1)
    return _Topology(numbers, known, system, both)


@lru_cache(maxsize=8)
def _monomial_derivatives(degree: int) -> Float:
    """Coefficients (2 dim P_(degree-1), n) in ``s^a t^b`` of the derivatives with respect to s, then t, of Bernstein
    polynomials, with the barycentric coordinates ``1 - s - t, s, t``."""
    points = lattice(degree - 1)
    slopes = bernstein_gradients(degree, points)
    along = np.concatenate([slopes[:, :, p] - slopes[:, :, 0] for p in (1, 2)], axis=1)
    both = np.linalg.solve(monomials.values(degree - 1, points[None, :, 1:])[0], along)
    result: Float = np.concatenate(np.split(both, 2, axis=1))
    return result
