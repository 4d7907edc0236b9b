"""What elements of one kind need: coefficients of the projected gradients, quadrature points and weights.

The coefficients take a third to a tenth of the memory of the six derivative rows at all points, which the kernel makes
from them for eight cells at a time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.projector import PolygonGeometry, elliptic_projector, value_projector
from tmc_vem.vem.spaces.quadrature import PieceRule
from tmc_vem.vem.spaces.rules import CellRule
from tmc_vem.vem.spaces.spaces import N_ROWS, ProjectedGradients, ProjectionSpace, Shapes

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Tables:
    """Projected basis and quadrature of shapes.

    Attributes:
        gradients: coefficients of the projected gradients.
        w_sq: (n_shapes, n_points) weights.
        xi_sqx: (n_shapes, n_points, 2) points in scaled coordinates.
        h_s: (n_shapes,) diameters, the scale.
        piece_q: (n_points,) piece of the gradient on which each point lies.
        on_pieces: the rule of every sub-triangle, where it is the same on all.
    """

    gradients: ProjectedGradients
    w_sq: Float
    xi_sqx: Float
    h_s: Float
    piece_q: Int
    on_pieces: PieceRule | None = None

    @property
    def n_basis(self) -> int:
        """Scalar basis functions."""
        return self.gradients.n_basis

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return self.gradients.nbytes + self.w_sq.nbytes + self.xi_sqx.nbytes + self.h_s.nbytes

    def take(self, chosen: Int | slice) -> Tables:
        """Those of some of the shapes."""
        return Tables(
            self.gradients.take(chosen),
            self.w_sq[chosen],
            self.xi_sqx[chosen],
            self.h_s[chosen],
            self.piece_q,
            self.on_pieces,
        )

    def rows(self, n_rows: int = N_ROWS) -> Float:
        """Derivatives (n_shapes, n_points, n_rows, n_basis): d1, d2, d1d1, d2d1, d1d2, d2d2, or the first two."""
        return self.gradients.rows(self.h_s, self.xi_sqx, self.piece_q, n_rows)


def tabulate(shapes: Shapes, space: ProjectionSpace, rule: CellRule) -> Tables:
    """Projected basis of every shape.

    Args:
        shapes: polygons.
        space: what gradients are projected on.
        rule: quadrature.
    """
    geometry = shapes.geometry
    xi = (rule.points_sqx - geometry.centroid_cx[:, None]) / geometry.diameter_c[:, None, None]
    pieces = np.zeros_like(rule.piece_q) if space.piecewise_degree is None else rule.piece_q
    return Tables(space.gradients(shapes), rule.w_sq, xi, geometry.diameter_c, pieces, rule.on_pieces)


def points_and_values(polygons_cvx: Float, k: int, xi_cqx: Float) -> tuple[Float, Float]:
    """Points (n_cells, n_points, 2) and the values (n_cells, n_points, n_basis) of Pi0_k of the basis there, for loads.

    Args:
        polygons_cvx: the cells.
        k: order.
        xi_cqx: points in scaled coordinates.
    """
    geometry = PolygonGeometry.of(polygons_cvx, k)
    values = monomials.values(k, xi_cqx) @ value_projector(geometry, k, elliptic_projector(geometry, k))
    points = geometry.centroid_cx[:, None] + geometry.diameter_c[:, None, None] * xi_cqx
    return points, values
