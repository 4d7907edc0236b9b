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
from tmc_vem.vem.spaces.piecewise import PiecewiseGradients, Topology
from tmc_vem.vem.spaces.projector import moments_of_basis
from tmc_vem.vem.spaces.quadrature import triangle
from tmc_vem.vem.spaces.spaces import FullSpace, Shapes
from tmc_vem.vem.spaces.triangulation import (
    barycentric_gradients,
    bernstein,
    bernstein_gradients,
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

    def gradients(self, shapes: Shapes) -> PiecewiseGradients:
        """See :class:`tmc_vem.vem.spaces.spaces.ProjectionSpace`; the second gradient is that of [P_k]^2.

        Raises:
            ValueError: the sub-triangles of the shapes do not all hang together alike.
        """
        smooth = FullSpace(self.order).gradients(shapes)
        topologies = equal_topologies(shapes.polygons_cvx, shapes.triangles_ctpx)
        if len(topologies) > 1:
            raise ValueError(f"sub-triangles of {len(shapes)} shapes hang together in {len(topologies)} ways")
        corners_tp = topologies[0][1]
        topology = Topology.of(corners_tp, shapes.geometry.n_sides, self.order)
        slopes_tpx, area_t = barycentric_gradients(shapes.scaled_triangles)
        corners_sdx = np.empty((len(shapes), int(corners_tp.max()) + 1, 2))
        corners_sdx[:, corners_tp] = shapes.scaled_triangles
        return PiecewiseGradients(
            inside_sba=_inside(shapes, _minimisation(topology), slopes_tpx, area_t),
            corners_sdx=corners_sdx,
            h_s=shapes.geometry.diameter_c,
            topology=topology,
            second_sxma=smooth.second_sxma,
        )


@dataclass(frozen=True)
class _Minimisation:
    """What all cells have in common whose sub-triangles hang together alike; see :func:`_minimisation`.

    Attributes:
        system: (n_triangles * 6, n_inside + n_moments, n_inside + n_moments + n_basis) for every sub-triangle and pair
            of directions: stiffness of the coefficients inside and the right-hand side for the degrees of freedom.
        moments: (n_triangles dim P_(k-1), n_inside + n_sides k) integrals of a polynomial, given by its values at
            the lattice of every sub-triangle, times the coefficients inside and times what the values contribute.
    """

    system: Float
    moments: Float


def _inside(shapes: Shapes, common: _Minimisation, slopes_tpx: Float, area_t: Float) -> Float:
    """Bernstein coefficients (n_shapes, n_inside, n_basis) that are not on the boundary, of the basis.

    Args:
        shapes: the polygons.
        common: of their sub-triangles.
        slopes_tpx, area_t: gradients (n_shapes, n_triangles, 3, 2) of the barycentric coordinates, and areas, scaled.
    """
    k, n_shapes, n_values = shapes.order, len(shapes), shapes.geometry.n_sides * shapes.order
    target = moments_of_basis(shapes.geometry, k, k - 1, shapes.elliptic_cad)
    n_moments, n_rows = target.shape[1], common.system.shape[1]
    n_inside = n_rows - n_moments

    x, y = slopes_tpx[..., 0], slopes_tpx[..., 1]
    products = np.stack([area_t * (x[..., p] * x[..., r] + y[..., p] * y[..., r]) for p, r in PAIRS], axis=2)
    system = products.reshape(n_shapes, -1) @ common.system.reshape(len(common.system), -1)
    system = system.reshape(n_shapes, n_rows, -1)

    m = monomials.values(k - 1, shapes.scaled_points(lattice(k - 1)))
    weighted = m * np.repeat(area_t, m.shape[1] // area_t.shape[1], axis=1)[..., None]
    moments = np.swapaxes(weighted, 1, 2) @ common.moments
    system[:, n_inside:, :n_inside] = moments[..., :n_inside]
    system[:, :n_inside, n_inside:n_rows] = np.swapaxes(moments[..., :n_inside], 1, 2)
    system[:, n_inside:, n_rows:] = target
    system[:, n_inside:, n_rows : n_rows + n_values] -= moments[..., n_inside:]
    solution: Float = np.linalg.solve(system[..., :n_rows], system[..., n_rows:])[:, :n_inside]
    return solution


@lru_cache(maxsize=64)
def _minimisation(topology: Topology) -> _Minimisation:
    """The constant matrices of a topology."""
    numbers, known, k, degree = topology.numbers_tn, topology.known_ba, topology.order, topology.order + 1
    (n_boundary, n_values), n_triangles, n_total = known.shape, len(numbers), topology.n_coefficients
    n_inside, n_moments = n_total - n_boundary, monomials.dimension(k - 1)
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
    return _Minimisation(system, both)
