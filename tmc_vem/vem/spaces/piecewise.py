"""Gradients of continuous piecewise polynomials of degree k + 1, kept as Bernstein coefficients.

A coefficient on the boundary is a fixed combination of the values on one side, so only those inside are stored, and
each once, though several sub-triangles have it: a third of the memory that polynomials of all sub-triangles would take.
Their gradients are ``grad w = (k + 1) sum_m B_m sum_p grad lambda_p w_(m + e_p)`` with the Bernstein polynomials B_m of
degree k, whose values at the points of a rule are the same on all triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces.quadrature import PieceRule
from tmc_vem.vem.spaces.spaces import N_FIRST_ROWS, N_ROWS, second_rows
from tmc_vem.vem.spaces.triangulation import (
    barycentric_exponents,
    barycentric_gradients,
    bernstein,
    boundary_coefficients,
    coefficient_numbers,
)

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Topology:
    """How the sub-triangles of cells hang together; there is one object for each.

    Attributes:
        order: k.
        corners_tp: (n_triangles, 3) vertices of the polygon at their corners, and hubs from n_sides on.
        numbers_tn: (n_triangles, n) Bernstein coefficient of the continuous function on every sub-triangle.
        known_ba: (n_boundary, n_sides k) the coefficients on the boundary, the first ones, by the values there.
        n_coefficients: how many there are.
    """

    order: int
    corners_tp: Int
    numbers_tn: Int
    known_ba: Float
    n_coefficients: int

    @staticmethod
    def of(corners_tp: Int, n_sides: int, order: int) -> Topology:
        """That of ``n_sides``-gons whose sub-triangles have these corners."""
        return _topology(np.ascontiguousarray(corners_tp, dtype=np.int64).tobytes(), n_sides, order)

    @cached_property
    def raised_tmp(self) -> Int:
        """(n_triangles, dim P_k, 3) the coefficient ``m + e_p`` of every B_m of degree k on every sub-triangle."""
        upper = {tuple(row): n for n, row in enumerate(barycentric_exponents(self.order + 1).tolist())}
        local = [
            [upper[tuple(a + (p == i) for i, a in enumerate(row))] for p in range(3)]
            for row in barycentric_exponents(self.order).tolist()
        ]
        return self.numbers_tn[:, local]

    @cached_property
    def traces(self) -> tuple[Int, Float]:
        """Degrees of freedom (n_boundary, k + 1) that each coefficient on the boundary depends on, and by how much."""
        n_boundary, width = len(self.known_ba), self.order + 1
        node_bj, value_bj = np.zeros((n_boundary, width), dtype=np.int64), np.zeros((n_boundary, width))
        for b, row in enumerate(self.known_ba):
            (found,) = np.nonzero(row)
            node_bj[b, : len(found)], value_bj[b, : len(found)] = found, row[found]
        return node_bj, value_bj


@lru_cache(maxsize=256)
def _topology(corners: bytes, n_sides: int, order: int) -> Topology:
    corners_tp = np.frombuffer(corners, dtype=np.int64).reshape(-1, 3)
    numbers_tn, n_coefficients = coefficient_numbers(corners_tp, n_sides, order + 1)
    return Topology(order, corners_tp, numbers_tn, boundary_coefficients(n_sides, order + 1, order), n_coefficients)


@dataclass(frozen=True)
class PiecewiseGradients:
    """Gradients of piecewise polynomials of shapes with one topology, and second gradients of one polynomial a cell.

    Attributes:
        inside_sba: (n_shapes, n_inside, n_basis) coefficients of the basis that are not on the boundary.
        corners_sdx: (n_shapes, n_corners, 2) vertices, then hubs, in scaled coordinates.
        h_s: (n_shapes,) diameters, the scale.
        topology: of the sub-triangles.
        second_sxma: (n_shapes, 2, dim P_m, n_basis), see :class:`tmc_vem.vem.spaces.spaces.Gradients`.
    """

    inside_sba: Float
    corners_sdx: Float
    h_s: Float
    topology: Topology
    second_sxma: Float

    @property
    def n_basis(self) -> int:
        """Scalar basis functions."""
        return self.inside_sba.shape[2]

    @property
    def n_pieces(self) -> int:
        """Sub-triangles."""
        return len(self.topology.corners_tp)

    @property
    def degree(self) -> int:
        """Degree k of the gradients."""
        return self.topology.order

    @property
    def nbytes(self) -> int:
        """Memory of the arrays that stay."""
        return self.inside_sba.nbytes + self.corners_sdx.nbytes + self.second_sxma.nbytes

    def take(self, chosen: Int | slice) -> PiecewiseGradients:
        """Those of some of the shapes."""
        return PiecewiseGradients(
            self.inside_sba[chosen], self.corners_sdx[chosen], self.h_s[chosen], self.topology, self.second_sxma[chosen]
        )

    def values(self, xi_sqx: Float) -> Float:
        """Bernstein polynomials (n_shapes, n_pieces, n, dim P_k) at points (n_shapes, n_pieces n, 2)."""
        n_shapes = len(xi_sqx)
        triangles = self.corners_sdx[:, self.topology.corners_tp]
        slopes, _ = barycentric_gradients(triangles)
        points = xi_sqx.reshape(n_shapes, self.n_pieces, -1, 2)
        from_corner = points - triangles[:, :, None, 0]
        two = from_corner @ np.swapaxes(slopes[:, :, 1:], 2, 3)
        three = np.concatenate([1.0 - two.sum(axis=3, keepdims=True), two], axis=3)
        return bernstein(self.topology.order, three.reshape(-1, 3)).reshape(*three.shape[:3], -1)

    def polynomials(self, u_sai: Float) -> Float:
        """Coefficients (n_shapes, n_pieces, dim P_k, 2 n) of the gradients of functions, d/dx of all, then d/dy.

        Args:
            u_sai: (n_shapes, n_basis, n) degrees of freedom of each shape's own functions.
        """
        n_values = self.topology.known_ba.shape[1]
        coefficients = np.concatenate([self.topology.known_ba @ u_sai[:, :n_values], self.inside_sba @ u_sai], axis=1)
        return self._gradients(coefficients)

    def rows(self, h_s: Float, xi_sqx: Float, piece_q: NDArray[np.integer[Any]], n_rows: int = N_ROWS) -> Float:
        """See :meth:`tmc_vem.vem.spaces.spaces.Gradients.rows`."""
        n_points = xi_sqx.shape[1]
        if not np.array_equal(piece_q, np.repeat(np.arange(self.n_pieces), n_points // self.n_pieces)):
            raise ValueError("all pieces must have equally many points, one piece after the other")
        first = self._rows(self.values(xi_sqx))
        if n_rows == N_FIRST_ROWS:
            return first
        return np.concatenate([first, second_rows(self.second_sxma, h_s, xi_sqx)], axis=2)

    def rows_of_rule(self, rule: PieceRule) -> Float:
        """First derivatives (n_shapes, n_points, 2, n_basis) at the points of a rule, piece by piece."""
        return self._rows(bernstein(self.topology.order, rule.barycentric_qp))

    def _rows(self, values_qm: Float) -> Float:
        known, n_shapes = self.topology.known_ba, len(self.inside_sba)
        basis = np.zeros((n_shapes, self.topology.n_coefficients, self.n_basis))
        basis[:, : len(known), : known.shape[1]] = known
        basis[:, len(known) :] = self.inside_sba
        return (values_qm @ self._gradients(basis)).reshape(n_shapes, -1, N_FIRST_ROWS, self.n_basis)

    def _gradients(self, coefficients_sbi: Float) -> Float:
        """Coefficients (n_shapes, n_pieces, dim P_k, 2 n) of gradients from those of functions (n_shapes, n_b, n)."""
        slopes_stpx, _ = barycentric_gradients(self.corners_sdx[:, self.topology.corners_tp])
        slopes_stpx *= (self.topology.order + 1) / self.h_s[:, None, None, None]
        raised, n = self.topology.raised_tmp, coefficients_sbi.shape[2]
        origin = coefficients_sbi[:, raised[..., 0]]
        along = [coefficients_sbi[:, raised[..., p]] - origin for p in (1, 2)]
        gradients = np.empty((*origin.shape[:3], 2, n))
        for x in (0, 1):
            first, second = (slopes_stpx[:, :, p, x, None, None] for p in (1, 2))
            np.multiply(first, along[0], out=gradients[:, :, :, x])
            gradients[:, :, :, x] += second * along[1]
        return gradients.reshape(*origin.shape[:3], 2 * n)
