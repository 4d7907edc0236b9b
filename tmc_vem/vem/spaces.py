"""What a gradient is projected on: the interface of projection spaces, and the spaces of global polynomials.

A projection space W consists of vector fields p on a polygon for which ``int p . grad v`` follows from the degrees of
freedom of v. Elements only need a table of six derivative rows at the quadrature points, so that is the interface. The
first two rows are the projected gradient. The other four, the second gradient, may come from another space: where W is
piecewise polynomial they are those of the smooth [P_k]^2. docs/projection.md derives and compares the spaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem import monomials
from tmc_vem.vem.projector import (
    PolygonGeometry,
    boundary_products,
    elliptic_projector,
    gradient_projector,
    moments_of_basis,
    n_scalar_dofs,
)

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# d1, d2, then d1 d1, d2 d1, d1 d2, d2 d2: first and second derivatives, first index fastest
N_ROWS = 6


@dataclass(frozen=True)
class Shapes:
    """Polygons with equally many vertices and sub-triangles, and what every space needs of them.

    Attributes:
        polygons_cvx: vertices (n_shapes, n_sides, 2).
        triangles_ctpx: sub-triangles (n_shapes, n_triangles, 3, 2).
        order: k.
        geometry: scaled coordinates and integrals of monomials.
        elliptic_cad: Pi_nabla_k, see :func:`tmc_vem.vem.projector.elliptic_projector`.
    """

    polygons_cvx: Float
    triangles_ctpx: Float
    order: int
    geometry: PolygonGeometry
    elliptic_cad: Float

    @staticmethod
    def of(polygons_cvx: Float, triangles_ctpx: Float, order: int, degree: int) -> Shapes:
        """Shapes for spaces that contain polynomials up to ``degree``."""
        geometry = PolygonGeometry.of(polygons_cvx, max(degree, order))
        return Shapes(polygons_cvx, triangles_ctpx, order, geometry, elliptic_projector(geometry, order))

    def __len__(self) -> int:
        return len(self.polygons_cvx)

    @property
    def n_basis(self) -> int:
        """Scalar degrees of freedom."""
        return n_scalar_dofs(self.geometry.n_sides, self.order)

    def take(self, chosen: Int) -> Shapes:
        """Some of the shapes."""
        g = self.geometry
        geometry = PolygonGeometry(
            g.xi_cvx[chosen],
            g.centroid_cx[chosen],
            g.diameter_c[chosen],
            g.area_c[chosen],
            g.integrals_ca[chosen],
            g.degree,
        )
        return Shapes(
            self.polygons_cvx[chosen], self.triangles_ctpx[chosen], self.order, geometry, self.elliptic_cad[chosen]
        )

    def scaled_points(self, barycentric_qp: Float) -> Float:
        """Points (n_shapes, n_triangles * n_points, 2) in scaled coordinates, triangle after triangle."""
        points = np.einsum("qp,ctpx->ctqx", barycentric_qp, self.triangles_ctpx).reshape(len(self), -1, 2)
        scaled: Float = (points - self.geometry.centroid_cx[:, None]) / self.geometry.diameter_c[:, None, None]
        return scaled


class ProjectionSpace(Protocol):
    """Space of vector fields that gradients are projected on."""

    @property
    def label(self) -> str:
        """The degree l of the full space, else a name, for results and messages."""

    @property
    def degree(self) -> int:
        """Degree of its (piecewise) polynomials, which quadrature has to integrate."""

    def rows(self, shapes: Shapes, barycentric_qp: Float) -> Float:
        """Derivatives (n_shapes, n_points, 6, n_basis) of the projected basis, in the order of ``N_ROWS``.

        Args:
            shapes: the polygons.
            barycentric_qp: points (n, 3) of each sub-triangle; ``n_points`` counts those of all sub-triangles.
        """


@dataclass(frozen=True)
class FullSpace:
    """[P_l]^2, the choice of Xu & Wriggers, CMAME 450 (2026) 118611, eq. (41).

    Attributes:
        degree: l.
    """

    degree: int

    @property
    def label(self) -> str:
        """The degree l."""
        return str(self.degree)

    def rows(self, shapes: Shapes, barycentric_qp: Float) -> Float:
        """See :class:`ProjectionSpace`."""
        grad_x, grad_y = gradient_projector(shapes.geometry, shapes.order, self.degree, shapes.elliptic_cad)
        return derivative_rows(shapes, barycentric_qp, self.degree, grad_x, grad_y)


@dataclass(frozen=True)
class HarmonicSpace:
    """[P_base]^2 and the gradients of the harmonic polynomials up to a degree.

    Those gradients have no divergence: they need no moments, and there are only two more per degree. The idea is that
    of the smallest spaces of Berrone, Borio & Marcon, arXiv 2302.00621.

    Attributes:
        base: degree of the full part; k keeps the accuracy of the plain element, k - 1 is the least.
        degree: largest degree of a field, above ``base``.
    """

    base: int
    degree: int

    @property
    def label(self) -> str:
        """Both degrees."""
        return f"harmonic {self.base}+{self.degree - self.base}"

    def rows(self, shapes: Shapes, barycentric_qp: Float) -> Float:
        """See :class:`ProjectionSpace`."""
        geometry, k = shapes.geometry, shapes.order
        p_xi, p_eta = harmonic_fields(self.base, self.degree)
        mass = geometry.mass(self.degree)
        gram = p_xi @ mass @ p_xi.T + p_eta @ mass @ p_eta.T
        rhs = boundary_products(geometry, k, self.degree, p_xi, p_eta)
        d_xi, d_eta = monomials.derivative_matrices(self.degree)
        n_lower = monomials.dimension(self.base - 1)
        divergence = (p_xi @ d_xi + p_eta @ d_eta)[:, :n_lower]
        rhs -= divergence @ moments_of_basis(geometry, k, self.base - 1, shapes.elliptic_cad)
        scale = 1.0 / np.sqrt(np.einsum("cff->cf", gram))[:, :, None]
        scaled = gram * scale * np.swapaxes(scale, 1, 2)
        solution = scale * np.linalg.solve(scaled, scale * rhs) / geometry.diameter_c[:, None, None]
        return derivative_rows(shapes, barycentric_qp, self.degree, p_xi.T @ solution, p_eta.T @ solution)


def harmonic_fields(base: int, degree: int) -> tuple[Float, Float]:
    """Coefficients (n_fields, dim P_degree) of both components of the fields of :class:`HarmonicSpace`.

    The gradients of Re and Im of ``(xi + i eta)^(d + 1)`` are ``(d + 1) (Re z^d, -Im z^d)`` and
    ``(d + 1) (Im z^d, Re z^d)``; the factor is left out.
    """
    n, n_base = monomials.dimension(degree), monomials.dimension(base)
    p_xi, p_eta = np.zeros((2, 2 * (n_base + degree - base), n))
    p_xi[:n_base, :n_base] = p_eta[n_base : 2 * n_base, :n_base] = np.eye(n_base)
    for m, d in enumerate(range(base + 1, degree + 1)):
        real, imaginary = _powers_of_z(d)
        first, last = monomials.dimension(d - 1), monomials.dimension(d)
        row = 2 * n_base + 2 * m
        p_xi[row, first:last], p_eta[row, first:last] = real, -imaginary
        p_xi[row + 1, first:last], p_eta[row + 1, first:last] = imaginary, real
    return p_xi, p_eta


def _powers_of_z(degree: int) -> tuple[Float, Float]:
    """Coefficients (degree + 1,) of Re and Im of z^degree in xi^(degree - b) eta^b."""
    z = np.array([1.0 + 0.0j])
    for _ in range(degree):
        z = np.convolve(z, [1.0, 1.0j])
    return z.real, z.imag


def derivative_rows(shapes: Shapes, barycentric_qp: Float, degree: int, grad_x: Float, grad_y: Float) -> Float:
    """Rows (n_shapes, n_points, 6, n_basis) of global polynomials.

    Args:
        shapes: the polygons.
        barycentric_qp: points of each sub-triangle.
        degree: l.
        grad_x, grad_y: coefficients (n_shapes, dim P_l, n_basis) of the derivatives with respect to x and y.
    """
    m = monomials.values(degree, shapes.scaled_points(barycentric_qp))
    d_xi, d_eta = monomials.derivative_matrices(degree)
    inverse_h = 1.0 / shapes.geometry.diameter_c[:, None, None]
    m_x, m_y = (m @ d_xi.T) * inverse_h, (m @ d_eta.T) * inverse_h
    # second derivatives first index fastest: d1 of (d/dx v), d1 of (d/dy v), then d2 of both
    return np.stack([m @ grad_x, m @ grad_y, m_x @ grad_x, m_x @ grad_y, m_y @ grad_x, m_y @ grad_y], axis=2)
