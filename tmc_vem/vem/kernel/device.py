"""Cells as device kernels read them: the arrays of ``cells`` in cells_abi.cuh, made of a batch.

Where C kernels make all that they need of eight shapes at a time, device kernels read rows of derivatives that one of
them has made of all shapes before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.spaces import monomials

Array = NDArray[np.float64]
Int32 = NDArray[np.int32]


@dataclass(frozen=True)
class DeviceCells:
    """Arrays of cells for a device, C-contiguous; see cells_abi.cuh for the meaning.

    Attributes:
        shape_c: (n_cells,)
        nodes_ca: (n_cells, n_basis)
        piece_q: (n_points,)
        w_sq: (n_shapes, n_points)
        first_sqm: (n_shapes, n_points, n_first)
        second_sqm: (n_shapes, n_points, n_lower)
        first_strma: (n_shapes, n_pieces, 2, n_first, n_basis)
        second_srma: (n_shapes, 4, n_lower, n_basis); n_lower is 0 where there are no second derivatives.
        n_translated: see :class:`~tmc_vem.vem.kernel.batch.CellBatch`.
    """

    shape_c: Int32
    nodes_ca: Int32
    piece_q: Int32
    w_sq: Array
    first_sqm: Array
    second_sqm: Array
    first_strma: Array
    second_srma: Array
    n_translated: int

    @staticmethod
    def of_batch(batch: CellBatch) -> DeviceCells:
        """The arrays of a batch without friction; factors of its cells go to the kernels of points."""
        n_shapes = int(batch.shape_c.max(initial=-1)) + 1
        shapes = np.arange(n_shapes)
        gradients, (xi_sqx, w_sq) = batch.gradients(shapes), batch.points(shapes)
        rows = _derivatives(gradients.second_sxma, batch.inverse_h_s[:n_shapes])
        basis = np.broadcast_to(np.eye(batch.n_basis), (n_shapes, batch.n_basis, batch.n_basis))
        by_function = gradients.polynomials(basis)  # d/dx of all, then d/dy
        first_stmra = by_function.reshape(*by_function.shape[:3], 2, batch.n_basis)
        # monomials do not ask on which piece a point lies
        first_sqm = gradients.values(xi_sqx) if batch.pieces else monomials.values(gradients.degree, xi_sqx)
        second_sqm = monomials.values(monomials.degree_of(rows.shape[2]), xi_sqx)[:, :, : rows.shape[2]]
        return DeviceCells(
            shape_c=np.ascontiguousarray(batch.shape_c, dtype=np.int32),
            nodes_ca=np.ascontiguousarray(batch.nodes_ca, dtype=np.int32),
            piece_q=np.ascontiguousarray(batch.piece_q, dtype=np.int32),
            w_sq=np.ascontiguousarray(w_sq),
            first_sqm=np.ascontiguousarray(first_sqm.reshape(n_shapes, batch.n_points, -1)),
            second_sqm=np.ascontiguousarray(second_sqm),
            first_strma=np.ascontiguousarray(np.moveaxis(first_stmra, 3, 2)),
            second_srma=rows,
            n_translated=batch.n_translated,
        )


def _derivatives(second_sxma: Array, inverse_h_s: Array) -> Array:
    """Coefficients (n_shapes, 4, n_lower, n_basis) of the derivatives of both components by x, then of both by y."""
    table = monomials.raised(monomials.degree_of(second_sxma.shape[2]) - 1)
    by_direction = [
        second_sxma[:, :, table.position_mx[:, x]] * table.power_mx[:, x, None] * inverse_h_s[:, None, None, None]
        for x in (0, 1)
    ]
    return np.ascontiguousarray(np.concatenate(by_direction, axis=1), dtype=np.float64)
