"""Cells ready for a kernel: the arrays of ``tmc_batch`` and ``tmc_tangents`` in kernel_abi.h as numpy arrays."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codegen.library import address
from tmc_vem.vem.kernel.friction_packs import FrictionPacks
from tmc_vem.vem.kernel.packs import LANES, packed
from tmc_vem.vem.kernel.pieces import Pieces
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.piecewise import PiecewiseGradients
from tmc_vem.vem.spaces.quadrature import at_pieces
from tmc_vem.vem.spaces.spaces import Gradients, ProjectedGradients

Array = NDArray[np.float64]
Int32 = NDArray[np.int32]


class BatchStruct(ctypes.Structure):
    """``tmc_batch``; a test compares the fields with the header."""

    _fields_ = (
        ("n_cells", ctypes.c_int64),
        *((name, ctypes.c_int32) for name in ("n_basis", "n_points", "n_pieces")),
        *((name, ctypes.c_int32) for name in ("n_first", "n_second", "n_lower", "n_translated")),
        *((name, ctypes.c_int32) for name in ("n_corners", "n_boundary", "n_inside", "n_trace", "n_piece_points")),
        *((name, ctypes.c_void_p) for name in ("raised_mx", "power_mx")),
        *((name, ctypes.c_void_p) for name in ("shape_c", "nodes_ca", "piece_q", "w_spq", "xi_spqx")),
        *((name, ctypes.c_void_p) for name in ("inverse_h_sp", "gradient_sptxma", "second_spxma")),
        *(
            (name, ctypes.c_void_p)
            for name in ("corners_spdx", "corner_tp", "raised_tmp", "trace_bj", "trace_value_bj")
        ),
        *((name, ctypes.c_void_p) for name in ("barycentric_qp", "piece_w_q", "bernstein_mq")),
        ("factor_ck", ctypes.c_void_p),
        ("friction_cpqk", ctypes.c_void_p),
        ("slip_damping", ctypes.c_void_p),
    )


class TangentsStruct(ctypes.Structure):
    """``tmc_tangents``."""

    _fields_ = tuple((n, ctypes.c_void_p) for n in ("dense_caibj", "values", "position_cab", "row_length_n"))


@dataclass(frozen=True)
class CellBatch:
    """Cells with equally many basis functions, pieces and quadrature points; see kernel_abi.h for the meaning.

    Arrays that end in ``spX`` hold shapes in packs of eight, (n_packs, ..., 8); :meth:`pack` makes them.

    Attributes:
        shape_c: (n_cells,) shape of each cell.
        nodes_ca: (n_cells, n_basis) nodes of each cell.
        piece_q: (n_points,) piece on which each quadrature point lies.
        inverse_h_sp, gradient_sp, second_sp: per pack of shapes; ``second_sp`` may be None for energies of F alone.
        w_sp, xi_sp: the same; None for piecewise polynomials, whose corners say both.
        gradient_degree, second_degree: of the polynomials.
        n_pieces: pieces of the projected gradient.
        n_translated: a translation by 1 is 1 in so many degrees of freedom, the first, and 0 in the others. Kernels
            take the translation of the first node out before they sum, which keeps a stiff body that moves far free
            of forces from rounding. 0 if a translation is something else.
        corners_sp: (n_packs, n_corners, 2, 8) vertices and hubs of piecewise polynomials in scaled coordinates; then
            ``gradient_sp`` has their coefficients inside the cells (n_packs, n_inside, n_basis, 8).
        pieces: what all cells with piecewise polynomials have in common.
        factor_ck: (n_cells, n_varying) what multiplies the parameters that vary from cell to cell.
        friction: of the cells, which changes between load steps; None for none.
        taken_from: cells that these were taken from, and which of them, where factors may change.
    """

    shape_c: Int32
    nodes_ca: Int32
    piece_q: Int32
    w_sp: Array | None
    xi_sp: Array | None
    inverse_h_sp: Array
    gradient_sp: Array
    second_sp: Array | None
    gradient_degree: int
    second_degree: int
    n_pieces: int
    n_translated: int = 0
    corners_sp: Array | None = None
    pieces: Pieces | None = None
    factor_ck: Array | None = None
    friction: FrictionPacks | None = None
    taken_from: tuple[CellBatch, NDArray[Any] | slice] | None = None

    @staticmethod
    def pack(
        shape_c: NDArray[Any],
        nodes_ca: NDArray[Any],
        piece_q: NDArray[Any],
        w_sq: Array,
        xi_sqx: Array,
        h_s: Array,
        gradient_stxma: Array,
        second_sxma: Array | None,
        n_translated: int = 0,
    ) -> CellBatch:
        """Batch of arrays with one entry per shape.

        Args:
            shape_c, nodes_ca, piece_q: see the class.
            w_sq: (n_shapes, n_points) quadrature weights (area).
            xi_sqx: (n_shapes, n_points, 2) quadrature points, scaled: ``(x - x_E) / h``.
            h_s: (n_shapes,) scales.
            gradient_stxma: (n_shapes, n_pieces, 2, dim P_l, n_basis) coefficients of the projected gradient.
            second_sxma: (n_shapes, 2, dim P_m, n_basis) coefficients of the polynomial vector field whose derivatives
                are the second gradient; the same array as ``gradient_stxma`` is kept once.
            n_translated: see the class.
        """
        gradient = packed(gradient_stxma)
        shared = second_sxma is not None and np.shares_memory(second_sxma, gradient_stxma)
        return CellBatch(
            shape_c=np.ascontiguousarray(shape_c, dtype=np.int32),
            nodes_ca=np.ascontiguousarray(nodes_ca, dtype=np.int32),
            piece_q=np.ascontiguousarray(piece_q, dtype=np.int32),
            w_sp=packed(w_sq),
            xi_sp=packed(xi_sqx),
            inverse_h_sp=packed(1.0 / h_s),
            gradient_sp=gradient,
            second_sp=gradient if shared else None if second_sxma is None else packed(second_sxma),
            gradient_degree=monomials.degree_of(gradient_stxma.shape[3]),
            second_degree=0 if second_sxma is None else monomials.degree_of(second_sxma.shape[2]),
            n_pieces=gradient_stxma.shape[1],
            n_translated=n_translated,
        )

    def take(self, cells: NDArray[Any] | slice) -> CellBatch:
        """Some of the cells, with all shapes."""
        return CellBatch(
            np.ascontiguousarray(self.shape_c[cells]), np.ascontiguousarray(self.nodes_ca[cells]), self.piece_q,
            self.w_sp, self.xi_sp, self.inverse_h_sp, self.gradient_sp, self.second_sp, self.gradient_degree,
            self.second_degree, self.n_pieces, self.n_translated, self.corners_sp, self.pieces,
            None if self.factor_ck is None else np.ascontiguousarray(self.factor_ck[cells]),
            None if self.friction is None else self.friction.take(cells),
            None if self.factor_ck is None else (self, cells),
        )  # fmt: skip

    def refresh(self) -> None:
        """Follow the cells that these were taken from in what changes during a run."""
        if self.friction is not None:
            self.friction.refresh()
        if self.taken_from is not None and self.factor_ck is not None:
            source, cells = self.taken_from
            source.refresh()
            assert source.factor_ck is not None
            self.factor_ck[:] = source.factor_ck[cells]

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.shape_c)

    @property
    def n_basis(self) -> int:
        """Scalar basis functions of a cell."""
        return self.nodes_ca.shape[1]

    @cached_property
    def n_nodes(self) -> int:
        """Nodes that there are at least: the largest number of a node and one."""
        return int(self.nodes_ca.max(initial=-1)) + 1

    @property
    def n_points(self) -> int:
        """Quadrature points of a cell."""
        return len(self.piece_q)

    @property
    def inverse_h_s(self) -> Array:
        """Inverse scales (n_shapes,); shapes beyond the last one repeat it."""
        return self.inverse_h_sp.ravel()

    def points(self, shapes: NDArray[Any]) -> tuple[Array, Array]:
        """Quadrature points (n, n_points, 2) of some shapes in scaled coordinates, and weights (n, n_points)."""
        if self.pieces is None:
            assert self.xi_sp is not None
            assert self.w_sp is not None
            return self._of(self.xi_sp, shapes).reshape(len(shapes), -1, 2), self._of(self.w_sp, shapes)
        assert self.corners_sp is not None
        corners_sdx = self._of(self.corners_sp, shapes)
        points, weights = at_pieces(corners_sdx[:, self.pieces.topology.corners_tp], self.pieces.rule)
        return points, weights / self.inverse_h_s[shapes, None] ** 2

    def gradients(self, shapes: NDArray[Any]) -> ProjectedGradients:
        """Projected gradients of some shapes; without a second gradient where there is none."""
        first = self._of(self.gradient_sp, shapes)
        if self.second_sp is None:
            second = np.empty((len(shapes), 2, 0, self.n_basis))
        else:
            second = self._of(self.second_sp, shapes).reshape(len(shapes), 2, -1, self.n_basis)
        if self.pieces is None:
            return Gradients(first, second)
        assert self.corners_sp is not None
        corners, h_s = self._of(self.corners_sp, shapes), 1.0 / self.inverse_h_s[shapes]
        return PiecewiseGradients(first, corners, h_s, self.pieces.topology, second)

    def values(self, shapes: NDArray[Any], gradients: ProjectedGradients) -> Array:
        """The polynomials of gradients at quadrature points of some shapes, see :class:`ProjectedGradients`; once,
        (1, 1, n, dim P_k), for all shapes and pieces where they are the same."""
        return gradients.values(self.points(shapes)[0]) if self.pieces is None else self.pieces.values_qm[None, None]

    @staticmethod
    def _of(values_sp: Array, shapes: NDArray[Any]) -> Array:
        chosen: Array = values_sp[shapes // LANES, ..., shapes % LANES]
        return chosen

    @property
    def nbytes(self) -> int:
        """Memory of all arrays."""
        arrays = {id(a): a.nbytes for a in vars(self).values() if isinstance(a, np.ndarray)}
        return sum(arrays.values())

    @cached_property
    def struct(self) -> BatchStruct:
        """What C reads; it points into the arrays of this object.

        Raises:
            ValueError: an array is not contiguous.
        """
        first, lower = self.gradient_degree, self.second_degree - 1
        table = monomials.raised(max(first, lower))
        numbers, arrays = ((0,) * 5, (None,) * 7) if self.pieces is None else (self.pieces.numbers, self.pieces.arrays)
        return BatchStruct(
            self.n_cells, self.n_basis, self.n_points, self.n_pieces, monomials.dimension(first),
            monomials.dimension(self.second_degree), monomials.dimension(lower), self.n_translated, *numbers,
            address(table.position_mx), address(table.power_mx), address(self.shape_c), address(self.nodes_ca),
            address(self.piece_q), address(self.w_sp), address(self.xi_sp), address(self.inverse_h_sp),
            address(self.gradient_sp), address(self.second_sp), address(self.corners_sp), *(address(a) for a in arrays),
            address(self.factor_ck),
            *((None, None) if self.friction is None else (address(a) for a in self.friction.arrays)),
        )  # fmt: skip


@dataclass(frozen=True)
class Tangents:
    """Where element tangents go: an array ``dense_caibj`` (n_cells, n_basis, 2, n_basis, 2), or a sparse matrix.

    Attributes:
        dense_caibj: overwritten.
        values: entries of the matrix, added to.
        position_cab: (n_cells, n_basis, n_basis) position in ``values`` of entry (2 a, 2 b) of a cell.
        row_length_n: entries of row ``2 n``; row ``2 n + 1`` has the same pattern.
    """

    dense_caibj: Array | None = None
    values: Array | None = None
    position_cab: Int32 | None = None
    row_length_n: Int32 | None = field(default=None)

    @property
    def struct(self) -> TangentsStruct:
        """What C reads.

        Raises:
            ValueError: an array is not contiguous.
        """
        arrays = (self.dense_caibj, self.values, self.position_cab, self.row_length_n)
        return TangentsStruct(*(address(a) for a in arrays))
