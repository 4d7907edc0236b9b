"""Explicit functions on the sub-triangles: the gradient of a continuous piecewise polynomial of degree k + 1.

The function has the traces of v. Its coefficients inside minimise ``int |grad w|^2`` with the moments of v up to degree
k - 1 prescribed: those up to k - 2 are degrees of freedom, the others are those of Pi_nabla_k v. For v in P_k the
minimiser is v itself. The displacement within a cell is then continuous and known, the method is a conforming one with
composite elements, and only rigid motions have no strain, on any polygon.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem import monomials
from tmc_vem.vem.projector import moments_of_basis
from tmc_vem.vem.quadrature import triangle
from tmc_vem.vem.spaces import FullSpace, Gradients, Shapes, fitted
from tmc_vem.vem.triangulation import (
    barycentric_gradients,
    bernstein,
    bernstein_gradients,
    boundary_coefficients,
    coefficient_numbers,
    corner_numbers,
    equal_topologies,
    lattice,
)

Float = NDArray[np.float64]
Int = NDArray[np.int64]


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
        """See :class:`tmc_vem.vem.spaces.ProjectionSpace`; the second gradient is that of [P_k]^2."""
        points = lattice(self.piecewise_degree)
        slopes = bernstein_gradients(self.piecewise_degree + 1, points)
        corners = corner_numbers(shapes.polygons_cvx, shapes.triangles_ctpx)
        values = np.empty((*shapes.triangles_ctpx.shape[:2], len(points), 2, shapes.n_basis))
        for chosen, corners_tp in equal_topologies(corners):
            part = shapes.take(chosen)
            coefficients_ctna = reconstruction(part, corners_tp)
            gradients, _ = barycentric_gradients(part.triangles_ctpx)
            along = np.swapaxes(slopes, 1, 2).reshape(-1, slopes.shape[1]) @ coefficients_ctna  # (q p), a
            along = along.reshape(*gradients.shape[:2], len(points), 3, -1)
            values[chosen] = np.swapaxes(gradients, 2, 3)[:, :, None] @ along
        smooth = FullSpace(self.order).gradients(shapes)
        xi = shapes.scaled_points(points).reshape(*values.shape[:3], 2)
        return Gradients(fitted(values, xi, self.piecewise_degree), smooth.second_sxma)


def reconstruction(shapes: Shapes, corners_tp: Int) -> Float:
    """Bernstein coefficients (n_shapes, n_triangles, n, n_basis) of the piecewise polynomials of the basis.

    Args:
        shapes: polygons whose sub-triangulations have the same topology.
        corners_tp: vertices of the sub-triangles.
    """
    k, n_sides = shapes.order, shapes.geometry.n_sides
    numbers, n_total = coefficient_numbers(corners_tp, n_sides, k + 1)
    n_boundary = n_sides * (k + 1)
    n_inside = n_total - n_boundary
    target = moments_of_basis(shapes.geometry, k, k - 1, shapes.elliptic_cad)
    n_moments = target.shape[1]
    stiffness, moments = _assemble(shapes, numbers, n_total, n_moments)

    known = np.zeros((n_boundary, shapes.n_basis))
    known[:, : n_sides * k] = boundary_coefficients(n_sides, k + 1, k)
    matrix = np.zeros((len(shapes), n_inside + n_moments, n_inside + n_moments))
    matrix[:, :n_inside, :n_inside] = stiffness[:, n_boundary:, n_boundary:]
    matrix[:, n_inside:, :n_inside] = moments[:, :, n_boundary:]
    matrix[:, :n_inside, n_inside:] = np.swapaxes(moments[:, :, n_boundary:], 1, 2)
    rhs = np.concatenate(
        [-stiffness[:, n_boundary:, :n_boundary] @ known, target - moments[:, :, :n_boundary] @ known], axis=1
    )
    inside = np.linalg.solve(matrix, rhs)[:, :n_inside]
    everywhere = np.concatenate([np.broadcast_to(known, (len(shapes), *known.shape)), inside], axis=1)
    coefficients: Float = everywhere[:, numbers]
    return coefficients


def _assemble(shapes: Shapes, numbers: Int, n_total: int, n_moments: int) -> tuple[Float, Float]:
    """Stiffness (n_shapes, n_total, n_total) of the Laplacian and moments (n_shapes, n_moments, n_total) over the
    scaled polygons."""
    degree = shapes.order + 1
    barycentric, weights = triangle(2 * degree)
    gradients, area = barycentric_gradients(shapes.triangles_ctpx)
    slopes = bernstein_gradients(degree, barycentric)
    # on the reference triangle, for every pair of barycentric directions; then by the directions' scalar products
    reference = np.einsum("q,qnp,qmr->prnm", weights, slopes, slopes).reshape(9, -1)
    products = area[..., None, None] * (gradients @ np.swapaxes(gradients, 2, 3))
    local = (products.reshape(len(shapes), len(numbers), 9) @ reference).reshape(*area.shape, slopes.shape[1], -1)
    m = monomials.values(shapes.order, shapes.scaled_points(barycentric))[..., :n_moments]
    m = m.reshape(len(shapes), len(numbers), len(weights), n_moments)
    scaled_area = area / shapes.geometry.diameter_c[:, None] ** 2
    local_moments = scaled_area[..., None, None] * (
        np.swapaxes(m, 2, 3) @ (weights[:, None] * bernstein(degree, barycentric))
    )
    stiffness = np.zeros((len(shapes), n_total, n_total))
    moments = np.zeros((len(shapes), n_moments, n_total))
    for t, at in enumerate(numbers):
        stiffness[:, at[:, None], at] += local[:, t]
        moments[:, :, at] += local_moments[:, t]
    return stiffness, moments
