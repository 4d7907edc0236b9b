"""What a gradient is projected on: the interface of projection spaces, and the spaces of global polynomials.

A projection space W consists of vector fields p on a polygon for which ``int p . grad v`` follows from the degrees of
freedom of v. All that elements need are the coefficients of the projected gradients, piecewise polynomials, so that is
the interface. The second gradient may come from another space: where W is piecewise polynomial it is the derivative of
the projection on the smooth [P_k]^2. docs/projection.md derives and compares the spaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import LAYOUT
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.projector import (
    PolygonGeometry,
    elliptic_projector,
    gradient_projector,
    moments_of_basis,
    n_scalar_dofs,
)

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# d1, d2, then d1 d1, d2 d1, d1 d2, d2 d2: first and second derivatives, first index fastest
N_ROWS, N_FIRST_ROWS = LAYOUT.n_rows, LAYOUT.n_first_rows


@dataclass(frozen=True)
class Shapes:
    """Polygons with equally many vertices and sub-triangles, and what every space needs of them.

    Attributes:
        polygons_cvx: vertices (n_shapes, n_sides, 2).
        triangles_ctpx: sub-triangles (n_shapes, n_triangles, 3, 2).
        order: k.
        geometry: scaled coordinates and integrals of monomials.
        elliptic_cad: Pi_nabla_k, see :func:`tmc_vem.vem.spaces.projector.elliptic_projector`.
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

    @cached_property
    def scaled_triangles(self) -> Float:
        """Sub-triangles in scaled coordinates."""
        g = self.geometry
        scaled: Float = (self.triangles_ctpx - g.centroid_cx[:, None, None]) / g.diameter_c[:, None, None, None]
        return scaled

    def scaled_points(self, barycentric_qp: Float) -> Float:
        """Points (n_shapes, n_triangles * n_points, 2) in scaled coordinates, triangle after triangle."""
        points: Float = (barycentric_qp @ self.scaled_triangles).reshape(len(self), -1, 2)
        return points


class ProjectedGradients(Protocol):
    """Projected gradients of the basis of shapes, in the form in which they are stored.

    On every piece the first gradient is a combination of polynomials of degree l, which the class chooses; the second
    gradient is that of one polynomial vector field on the cell.
    """

    @property
    def second_sxma(self) -> Float:
        """(n_shapes, 2, dim P_m, n_basis) coefficients of the field whose derivatives are the second gradient."""

    @property
    def n_basis(self) -> int:
        """Scalar basis functions."""

    @property
    def n_pieces(self) -> int:
        """Pieces on which the first gradient is polynomial."""

    @property
    def degree(self) -> int:
        """Degree l of its polynomials."""

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""

    def take(self, chosen: Int | slice) -> ProjectedGradients:
        """Those of some of the shapes."""

    def values(self, xi_sqx: Float) -> Float:
        """The polynomials (n_shapes, n_pieces, n, dim P_l) at points (n_shapes, n_pieces n, 2), piece after piece."""

    def polynomials(self, u_sai: Float) -> Float:
        """Their coefficients (n_shapes, n_pieces, dim P_l, 2 n) of the gradients of functions, d/dx of all, then d/dy.

        Args:
            u_sai: (n_shapes, n_basis, n) degrees of freedom of each shape's own functions.
        """

    def rows(self, h_s: Float, xi_sqx: Float, piece_q: NDArray[np.integer[Any]], n_rows: int = N_ROWS) -> Float:
        """Derivatives (n_shapes, n_points, n_rows, n_basis) at points, in the order of ``N_ROWS``.

        Args:
            h_s: diameters of the cells.
            xi_sqx: points in scaled coordinates.
            piece_q: piece on which each of them lies.
            n_rows: 2 for the gradient alone, or 6.

        Raises:
            ValueError: pieces have not equally many points, one piece after the other.
        """


@dataclass(frozen=True)
class Gradients:
    """Projected gradients of the basis as polynomials in the scaled coordinates ``xi = (x - x_E) / h_E``.

    Attributes:
        first_stxma: (n_shapes, n_pieces, 2, dim P_l, n_basis) coefficients of the derivatives with respect to x and y;
            one piece, or one for every sub-triangle.
        second_sxma: (n_shapes, 2, dim P_m, n_basis) coefficients of the vector field, one polynomial on the cell, whose
            derivatives are the second gradient.
    """

    first_stxma: Float
    second_sxma: Float

    @staticmethod
    def smooth(grad_x: Float, grad_y: Float) -> Gradients:
        """First and second gradient from the same global polynomials, (n_shapes, dim P_l, n_basis) each."""
        both = np.stack([grad_x, grad_y], axis=1)
        return Gradients(both[:, None], both)

    @property
    def shared(self) -> bool:
        """Whether both come from the same polynomials, which are stored once."""
        return np.shares_memory(self.first_stxma, self.second_sxma)

    @property
    def n_basis(self) -> int:
        """Scalar basis functions."""
        return self.first_stxma.shape[-1]

    @property
    def n_pieces(self) -> int:
        """One piece, or all sub-triangles."""
        return self.first_stxma.shape[1]

    @property
    def degree(self) -> int:
        """Degree l of the polynomials."""
        return monomials.degree_of(self.first_stxma.shape[3])

    @property
    def nbytes(self) -> int:
        """Memory of the arrays; what is shared counts once."""
        return self.first_stxma.nbytes + (0 if self.shared else self.second_sxma.nbytes)

    def take(self, chosen: Int | slice) -> Gradients:
        """Those of some of the shapes."""
        first = self.first_stxma[chosen]
        return Gradients(first, first[:, 0] if self.shared else self.second_sxma[chosen])

    def values(self, xi_sqx: Float) -> Float:
        """Monomials (n_shapes, n_pieces, n, dim P_l); see :class:`ProjectedGradients`."""
        _, n_pieces, _, n_m, _ = self.first_stxma.shape
        return monomials.values(monomials.degree_of(n_m), xi_sqx).reshape(len(xi_sqx), n_pieces, -1, n_m)

    def polynomials(self, u_sai: Float) -> Float:
        """See :class:`ProjectedGradients`."""
        n_shapes, n_pieces, _, n_m, n_basis = self.first_stxma.shape
        by_direction = np.moveaxis(self.first_stxma, 3, 2).reshape(n_shapes, -1, n_basis)  # pieces, monomials, x
        product: Float = by_direction @ u_sai
        return product.reshape(len(u_sai), n_pieces, n_m, -1)

    def rows(self, h_s: Float, xi_sqx: Float, piece_q: NDArray[np.integer[Any]], n_rows: int = N_ROWS) -> Float:
        """See :class:`ProjectedGradients`."""
        (n_shapes, n_points, _), (_, n_pieces, _, n_m, n_basis) = xi_sqx.shape, self.first_stxma.shape
        if len(piece_q) % n_pieces or (np.reshape(piece_q, (n_pieces, -1)) != np.arange(n_pieces)[:, None]).any():
            raise ValueError("all pieces must have equally many points, one piece after the other")
        first = self.values(xi_sqx) @ np.moveaxis(self.first_stxma, 2, 3).reshape(n_shapes, n_pieces, n_m, 2 * n_basis)
        if n_rows == N_FIRST_ROWS:
            return first.reshape(n_shapes, n_points, 2, n_basis)
        result = np.empty((n_shapes, n_points, n_rows, n_basis))
        result[:, :, :2] = first.reshape(n_shapes, n_points, 2, n_basis)
        result[:, :, 2:] = second_rows(self.second_sxma, h_s, xi_sqx)
        return result


def second_rows(second_sxma: Float, h_s: Float, xi_sqx: Float) -> Float:
    """Derivatives (n_shapes, n_points, 4, n_basis) of a vector field, first index fastest.

    Args:
        second_sxma: (n_shapes, 2, dim P_m, n_basis) coefficients of the field.
        h_s: scales of the coordinates.
        xi_sqx: (n_shapes, n_points, 2) points in scaled coordinates.
    """
    degree = monomials.degree_of(second_sxma.shape[2])
    m = monomials.values(degree, xi_sqx) / h_s[:, None, None]
    # d1 of (d/dx v), d1 of (d/dy v), then d2 of both
    rows = [(m @ matrix.T) @ second_sxma[:, x] for matrix in monomials.derivative_matrices(degree) for x in (0, 1)]
    return np.stack(rows, axis=2)


def smooth_rows(second_sxma: Float, h_s: Float, xi_sqx: Float) -> Float:
    """Values and derivatives (n_shapes, n_points, 6, n_basis) of the same field, in the order of ``N_ROWS``."""
    m = monomials.values(monomials.degree_of(second_sxma.shape[2]), xi_sqx)
    values = np.stack([m @ second_sxma[:, x] for x in (0, 1)], axis=2)
    return np.concatenate([values, second_rows(second_sxma, h_s, xi_sqx)], axis=2)


class ProjectionSpace(Protocol):
    """Space of vector fields that gradients are projected on."""

    @property
    def label(self) -> str:
        """The degree l of the full space, else a name, for results and messages."""

    @property
    def degree(self) -> int:
        """Largest degree of its (piecewise) polynomials and of those of the second gradient's potential."""

    @property
    def piecewise_degree(self) -> int | None:
        """Degree of the gradient on every sub-triangle, or None where it is one polynomial on the whole cell."""

    def gradients(self, shapes: Shapes) -> ProjectedGradients:
        """Projected gradients of the basis; pieces are the sub-triangles in their order."""


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

    piecewise_degree: ClassVar[None] = None

    def gradients(self, shapes: Shapes) -> Gradients:
        """See :class:`ProjectionSpace`."""
        return Gradients.smooth(*gradient_projector(shapes.geometry, shapes.order, self.degree, shapes.elliptic_cad))


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

    piecewise_degree: ClassVar[None] = None

    def gradients(self, shapes: Shapes) -> Gradients:
        """See :class:`ProjectionSpace`."""
        geometry, k = shapes.geometry, shapes.order
        p_xi, p_eta = harmonic_fields(self.base, self.degree)
        mass = geometry.mass(self.degree)
        gram = p_xi @ mass @ p_xi.T + p_eta @ mass @ p_eta.T
        n_m = monomials.dimension(self.degree)
        boundary_x, boundary_y = geometry.boundary(k)
        rhs: Float = np.add(p_xi @ boundary_x[:, :n_m], p_eta @ boundary_y[:, :n_m])
        d_xi, d_eta = monomials.derivative_matrices(self.degree)
        n_lower = monomials.dimension(self.base - 1)
        divergence = (p_xi @ d_xi + p_eta @ d_eta)[:, :n_lower]
        rhs -= divergence @ moments_of_basis(geometry, k, self.base - 1, shapes.elliptic_cad)
        scale = 1.0 / np.sqrt(np.einsum("cff->cf", gram))[:, :, None]
        scaled = gram * scale * np.swapaxes(scale, 1, 2)
        solution = scale * np.linalg.solve(scaled, scale * rhs) / geometry.diameter_c[:, None, None]
        return Gradients.smooth(p_xi.T @ solution, p_eta.T @ solution)


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
