"""The projectors of the enhanced virtual element space of order k >= 2, vectorised over cells of one shape class.

Scalar degrees of freedom of a polygon with N vertices, in this order: the N vertex values; the values at the k - 1
interior Gauss-Lobatto points of each side, side after side, each in the direction of the cell's boundary; the
k (k - 1) / 2 moments ``1/|E| int_E v m_a`` with the scaled monomials of degree up to k - 2.

Source: Xu & Wriggers, CMAME 450 (2026) 118611, section 4.1; in the divergence term of (42) the projection of the full
order k stands in place of order 1, which would cost one order of convergence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids, diameters
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.quadrature import gauss, gauss_lobatto

Float = NDArray[np.float64]


def n_scalar_dofs(n_sides: int, k: int) -> int:
    """Scalar degrees of freedom of a polygon with ``n_sides`` sides."""
    return n_sides * k + k * (k - 1) // 2


@dataclass(frozen=True)
class PolygonGeometry:
    """Polygons (n_cells, n_sides, 2) in scaled coordinates about their centroids.

    Attributes:
        xi_cvx: vertices ``(x - x_E) / h_E``.
        centroid_cx, diameter_c, area_c: x_E, h_E (diameter) and area in the original units.
        integrals_ca: integrals over the scaled polygon of the monomials of degree up to ``2 degree``.
        degree: largest degree of a polynomial that will be projected on.
    """

    xi_cvx: Float
    centroid_cx: Float
    diameter_c: Float
    area_c: Float
    integrals_ca: Float
    degree: int

    @staticmethod
    def of(polygons_cvx: Float, degree: int) -> PolygonGeometry:
        """Geometry of counter-clockwise polygons for projections on degrees up to ``degree``."""
        centroid_cx, diameter_c = centroids(polygons_cvx), diameters(polygons_cvx)
        xi = (polygons_cvx - centroid_cx[:, None]) / diameter_c[:, None, None]
        return PolygonGeometry(
            xi, centroid_cx, diameter_c, areas(polygons_cvx), monomials.integrals(2 * degree, xi), degree
        )

    @property
    def n_sides(self) -> int:
        """Number of sides of every polygon."""
        return self.xi_cvx.shape[1]

    @property
    def scaled_area_c(self) -> Float:
        """Area in units of h_E^2."""
        area: Float = self.integrals_ca[:, 0]
        return area

    def boundary(self, k: int) -> tuple[Float, Float]:
        """:func:`boundary_products` up to ``degree``, computed once."""
        known = self.__dict__.setdefault("_boundary", {})
        if k not in known:
            known[k] = boundary_products(self, k, max(self.degree, k))
        both: tuple[Float, Float] = known[k]
        return both

    def mass(self, degree: int) -> Float:
        """Integrals of products of monomials of the given degree over the scaled polygons."""
        return monomials.mass_matrices(degree, self.integrals_ca)


def elliptic_projector(geometry: PolygonGeometry, k: int) -> Float:
    """Pi_nabla_k of (36): coefficients (n_cells, dim P_k, n_dofs) in scaled monomials.

    ``int grad(Pi v - v) . grad p = 0`` for all p in P_k and equal mean values. The right-hand side needs v on the
    boundary, where it is a known polynomial, and moments of degree k - 2.
    """
    n_sides = geometry.n_sides
    d_xi, d_eta = monomials.derivative_matrices(k)
    mass = geometry.mass(k)
    stiffness = d_xi @ mass @ d_xi.T + d_eta @ mass @ d_eta.T
    n_moments = monomials.dimension(k - 2)

    boundary_x, boundary_y = geometry.boundary(k)
    n_m = monomials.dimension(k)
    rhs: Float = np.add(d_xi @ boundary_x[:, :n_m], d_eta @ boundary_y[:, :n_m])  # int_dE v dm/dn
    laplacian = d_xi @ d_xi + d_eta @ d_eta  # rows are monomials, columns degree k - 2 at most
    moments = slice(n_sides * k, n_sides * k + n_moments)
    rhs[:, :, moments] -= geometry.scaled_area_c[:, None, None] * laplacian[:, :n_moments]

    # the constant is fixed by the mean value, which is the moment of degree 0
    stiffness[:, 0] = geometry.integrals_ca[:, : monomials.dimension(k)]
    rhs[:, 0] = 0.0
    rhs[:, 0, n_sides * k] = geometry.scaled_area_c
    projector: Float = np.linalg.solve(stiffness, rhs)
    return projector


def moments_of_basis(geometry: PolygonGeometry, k: int, degree: int, elliptic_cad: Float) -> Float:
    """``int_E v m`` over the scaled polygons for all monomials up to ``degree``: (n_cells, dim P_degree, n_dofs).

    Up to degree k - 2 these are degrees of freedom; beyond, those of Pi_nabla_k v (enhanced space).
    """
    n_projected = monomials.dimension(k)
    mass = geometry.mass(max(degree, k))[:, : monomials.dimension(degree), :n_projected]
    moments: Float = mass @ elliptic_cad
    known = monomials.dimension(min(k - 2, degree))
    moments[:, :known] = 0.0
    for a in range(known):
        moments[:, a, geometry.n_sides * k + a] = geometry.scaled_area_c
    return moments


def gradient_projector(geometry: PolygonGeometry, k: int, degree: int, elliptic_cad: Float) -> tuple[Float, Float]:
    """Pi0_l grad of (41): coefficients of d/dx and d/dy in scaled monomials of P_l, (n_cells, dim P_l, n_dofs) each.

    ``int p . Pi(grad v) = int_dE (p . n) v - int_E (div p) v`` for all p in [P_l]^2. The results are derivatives with
    respect to x and y (they include the factor 1 / h_E).
    """
    d_xi, d_eta = monomials.derivative_matrices(degree)
    n_lower = monomials.dimension(degree - 1)
    moments = moments_of_basis(geometry, k, degree - 1, elliptic_cad)
    boundary_x, boundary_y = geometry.boundary(k)
    n_m = monomials.dimension(degree)
    rhs_x = boundary_x[:, :n_m] - d_xi[:, :n_lower] @ moments
    rhs_y = boundary_y[:, :n_m] - d_eta[:, :n_lower] @ moments
    both = np.concatenate([rhs_x, rhs_y], axis=2)
    solution = solve_with_mass(geometry.mass(degree), both) / geometry.diameter_c[:, None, None]
    n_dofs = rhs_x.shape[2]
    return solution[:, :, :n_dofs], solution[:, :, n_dofs:]


def value_projector(geometry: PolygonGeometry, k: int, elliptic_cad: Float) -> Float:
    """Pi0_k: coefficients (n_cells, dim P_k, n_dofs) of the L2 projection on P_k.

    For k = 2 it is Pi_nabla_k. From k = 3 on it is not: Pi_nabla_k keeps the mean value but not the moments of degree
    1 to k - 2, and a load that works on it would cost one order of convergence.
    """
    return solve_with_mass(geometry.mass(k), moments_of_basis(geometry, k, k, elliptic_cad))


def dofs_of_monomials(geometry: PolygonGeometry, k: int) -> Float:
    """Degrees of freedom (n_cells, n_dofs, dim P_k) of the scaled monomials up to degree k."""
    nodes = gauss_lobatto(k + 1)[0][1:-1]
    start, end = geometry.xi_cvx[:, :, None], np.roll(geometry.xi_cvx, -1, axis=1)[:, :, None]
    inside = np.subtract(1.0, nodes)[:, None] * start + nodes[:, None] * end
    points = np.concatenate([geometry.xi_cvx, inside.reshape(len(start), -1, 2)], axis=1)
    moments = geometry.mass(k)[:, : monomials.dimension(k - 2)] / geometry.scaled_area_c[:, None, None]
    return np.concatenate([monomials.values(k, points), moments], axis=1)


def n_translated_dofs(n_sides: int, k: int) -> int:
    """Degrees of freedom, the first ones, that are 1 for the constant function 1, while the others are 0.

    Those at the boundary and the moment of degree 0; linear moments about the centroid are 0. From k = 4 on there are
    moments of degree 2, which are neither, and the answer is 0: there is no such split.
    """
    return k * n_sides + 1 if k < 4 else 0


def solve_with_mass(mass_cab: Float, rhs_cad: Float) -> Float:
    """Solution with mass matrices of monomials, whose condition numbers a scaling to unit diagonal brings down."""
    scale = 1.0 / np.sqrt(np.einsum("caa->ca", mass_cab))
    scaled = mass_cab * scale[:, :, None] * scale[:, None, :]
    solution: Float = scale[:, :, None] * np.linalg.solve(scaled, scale[:, :, None] * rhs_cad)
    return solution


def boundary_products(geometry: PolygonGeometry, k: int, degree: int) -> tuple[Float, Float]:
    """``int_dE m n_x v`` and ``int_dE m n_y v`` over the scaled boundary: (n_cells, dim P_degree, n_dofs) each.

    Args:
        geometry: the polygons.
        k: order of the element; v is a polynomial of degree k on every side.
        degree: largest degree of the monomials m.
    """
    n_sides, n_cells = geometry.n_sides, len(geometry.xi_cvx)
    points, weights = gauss((degree + k) // 2 + 1)
    following = np.roll(geometry.xi_cvx, -1, axis=1)
    nodes_csqx = (
        np.subtract(1.0, points)[:, None] * geometry.xi_cvx[:, :, None] + points[:, None] * following[:, :, None]
    )
    tangent = following - geometry.xi_cvx
    m = monomials.values(degree, nodes_csqx.reshape(n_cells, -1, 2)).reshape(n_cells, n_sides, len(points), -1)
    # int_side m v for every node of every side; the outward normal times the side's length is the turned tangent
    side_csmn = np.swapaxes(m, 2, 3) @ (weights[:, None] * edge_basis(k, points))
    results = []
    for normal_cs in (tangent[..., 1], -tangent[..., 0]):
        flux = np.moveaxis(normal_cs[..., None, None] * side_csmn, 1, 2)  # cell, monomial, side, node
        result = np.zeros((n_cells, monomials.dimension(degree), n_scalar_dofs(n_sides, k)))
        result[:, :, :n_sides] = flux[..., 0] + np.roll(flux[..., k], 1, axis=2)
        result[:, :, n_sides : n_sides * k] = flux[..., 1:k].reshape(n_cells, -1, n_sides * (k - 1))
        results.append(result)
    return results[0], results[1]


def edge_basis(k: int, points: Float) -> Float:
    """Lagrange polynomials (n_points, k + 1) of the Gauss-Lobatto nodes on [0, 1]."""
    nodes, _ = gauss_lobatto(k + 1)
    basis = np.ones((len(points), k + 1))
    for n in range(k + 1):
        for other in range(k + 1):
            if other != n:
                basis[:, n] *= (points - nodes[other]) / (nodes[n] - nodes[other])
    return basis


def edge_basis_slopes(k: int, points: Float) -> Float:
    """Derivatives (n_points, k + 1) of :func:`edge_basis`, per unit of the side's length."""
    nodes, _ = gauss_lobatto(k + 1)
    slopes = np.zeros((len(points), k + 1))
    for n in range(k + 1):
        for left_out in range(k + 1):
            if left_out != n:
                product = np.full(len(points), 1.0 / (nodes[n] - nodes[left_out]))
                for other in range(k + 1):
                    if other not in (n, left_out):
                        product *= (points - nodes[other]) / (nodes[n] - nodes[other])
                slopes[:, n] += product
    return slopes
