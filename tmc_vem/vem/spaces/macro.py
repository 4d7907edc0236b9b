"""Macro-element: H(div)-conforming piecewise polynomials on the sub-triangles.

``W = {p : p in [P_k(T)]^2 on every sub-triangle T, p . n continuous across sub-triangles, div p in P_(k-1)(E)}``.
As div p is one polynomial on the whole cell, ``int p . grad v = int_dE (p . n) v - int_E (div p) v`` needs the same
moments as [P_k]^2. The idea is that of Chen, Huang & Wei, arXiv 2212.01720, who use degree k - 1 for Poisson's
equation; plane elasticity needs k, as with k - 1 one strain mode of a fan has no energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.projector import edge_basis, moments_of_basis
from tmc_vem.vem.spaces.quadrature import gauss, triangle
from tmc_vem.vem.spaces.spaces import FullSpace, Gradients, Shapes
from tmc_vem.vem.spaces.triangulation import barycentric_gradients, equal_topologies, sides_of

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Singular values below this fraction of the largest one are redundant constraints.
REDUNDANT = 1e-10


@dataclass(frozen=True)
class MacroSpace:
    """Piecewise [P_k]^2 with continuous normal components and a divergence in P_(k-1) of the cell.

    Attributes:
        order: k.
    """

    order: int

    @property
    def label(self) -> str:
        """Its name."""
        return "macro"

    @property
    def degree(self) -> int:
        """k."""
        return self.order

    @property
    def piecewise_degree(self) -> int:
        """k."""
        return self.order

    def gradients(self, shapes: Shapes) -> Gradients:
        """See :class:`tmc_vem.vem.spaces.spaces.ProjectionSpace`; the second gradient is that of [P_k]^2."""
        smooth = FullSpace(self.order).gradients(shapes)
        n_pieces, n_m = shapes.triangles_ctpx.shape[1], monomials.dimension(self.order)
        first = np.empty((len(shapes), n_pieces, 2, n_m, shapes.n_basis))
        for chosen, corners_tp in equal_topologies(shapes.polygons_cvx, shapes.triangles_ctpx):
            first[chosen] = projection(shapes.take(chosen), corners_tp)
        return Gradients(first, smooth.second_sxma)


def projection(shapes: Shapes, corners_tp: Int) -> Float:
    """Coefficients (n_shapes, n_triangles, 2, dim P_k, n_basis) of the projected gradients in scaled monomials."""
    k, n_triangles = shapes.order, len(corners_tp)
    fields = _fields(shapes, corners_tp)
    mass = _mass(shapes, n_triangles)
    blocks = fields.reshape(len(shapes), 2 * n_triangles, -1, fields.shape[2])
    weighted = (np.repeat(mass, 2, axis=1) @ blocks).reshape(fields.shape)
    transposed = np.swapaxes(fields, 1, 2)
    solution = np.linalg.solve(transposed @ weighted, transposed @ _functionals(shapes, corners_tp))
    coefficients = fields @ solution / shapes.geometry.diameter_c[:, None, None]
    result: Float = coefficients.reshape(len(shapes), n_triangles, 2, monomials.dimension(k), shapes.n_basis)
    return result


def _fields(shapes: Shapes, corners_tp: Int) -> Float:
    """Orthonormal coefficients (n_shapes, n_triangles * 2 * dim P_k, n_fields): the kernel of all constraints."""
    k, n_m = shapes.order, monomials.dimension(shapes.order)
    vertices = shapes.scaled_triangles
    s, _ = gauss(k + 1)
    constraints = []
    for pair in sides_of(corners_tp).values():
        if len(pair) == 1:
            continue
        m, normal = _on_side(vertices, *pair[0], s, k)
        jump = np.zeros((len(shapes), len(s), len(corners_tp), 2, n_m))
        flux = normal[:, None, :, None] * m[:, :, None]
        jump[:, :, pair[0][0]], jump[:, :, pair[1][0]] = flux, -flux
        constraints.append(jump.reshape(len(shapes), len(s), -1))
    divergence = _divergence(k)
    for t in range(1, len(corners_tp)):
        difference = np.zeros((len(divergence), len(corners_tp), 2 * n_m))
        difference[:, 0], difference[:, t] = -divergence, divergence
        flat = difference.reshape(len(divergence), -1)
        constraints.append(np.broadcast_to(flat, (len(shapes), *flat.shape)))
    _, singular, right = np.linalg.svd(np.concatenate(constraints, axis=1))
    # shapes of one topology have one rank; should rounding make them differ, the largest keeps all in the space
    rank = int((singular > REDUNDANT * singular[:, :1]).sum(axis=1).max())
    return np.swapaxes(right[:, rank:], 1, 2)


def _functionals(shapes: Shapes, corners_tp: Int) -> Float:
    """``int p . grad v`` (n_shapes, n_triangles * 2 * dim P_k, n_basis) for every coefficient of p."""
    k, n_sides, n_m = shapes.order, shapes.geometry.n_sides, monomials.dimension(shapes.order)
    vertices = shapes.scaled_triangles
    s, weights = gauss(k + 1)
    shape_qn = edge_basis(k, s)
    result = np.zeros((len(shapes), len(corners_tp), 2, n_m, shapes.n_basis))
    for pair in sides_of(corners_tp).values():
        if len(pair) == 2:
            continue
        ((t, side),) = pair
        m, normal = _on_side(vertices, t, side, s, k)
        products = np.einsum("q,cqm,qn->cmn", weights, m, shape_qn)
        first = int(corners_tp[t, side])
        inside = range(n_sides + first * (k - 1), n_sides + (first + 1) * (k - 1))
        nodes = [first, *inside, (first + 1) % n_sides]
        result[:, t, :, :, nodes] += np.moveaxis(normal[:, :, None, None] * products[:, None], -1, 0)
    divergence = _divergence(k)
    moments = moments_of_basis(shapes.geometry, k, k - 1, shapes.elliptic_cad)
    # all sub-triangles have the same divergence: that of the first one stands for the cell
    result[:, 0] -= (divergence.T @ moments).reshape(len(shapes), 2, n_m, shapes.n_basis)
    return result.reshape(len(shapes), -1, shapes.n_basis)


def _divergence(k: int) -> Float:
    """Coefficients (dim P_(k-1), 2 dim P_k) of the divergence in scaled coordinates."""
    d_xi, d_eta = monomials.derivative_matrices(k)
    return np.concatenate([d_xi.T, d_eta.T], axis=1)[: monomials.dimension(k - 1)]


def _mass(shapes: Shapes, n_triangles: int) -> Float:
    """Integrals (n_shapes, n_triangles, dim P_k, dim P_k) of products of monomials over the scaled sub-triangles."""
    barycentric, weights = triangle(2 * shapes.order)
    m = monomials.values(shapes.order, shapes.scaled_points(barycentric))
    m = m.reshape(len(shapes), n_triangles, len(weights), -1)
    _, area = barycentric_gradients(shapes.scaled_triangles)
    mass: Float = np.einsum("ct,q,ctqm,ctqn->ctmn", area, weights, m, m, optimize=True)
    return mass


def _on_side(vertices_ctpx: Float, t: int, side: int, s: Float, k: int) -> tuple[Float, Float]:
    """Monomials (n_shapes, n_points, dim P_k) on a side, and its outward normal (n_shapes, 2) times its length."""
    start, end = vertices_ctpx[:, t, side], vertices_ctpx[:, t, (side + 1) % 3]
    points = start[:, None] * np.subtract(1.0, s)[:, None] + end[:, None] * s[:, None]
    along = end - start
    return monomials.values(k, points), np.stack([along[:, 1], -along[:, 0]], axis=-1)
