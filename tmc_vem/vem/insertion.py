"""Tangents of cells, and of sides between them, into a PETSc matrix.

Most cells have only nodes that this rank owns and that are free. Their tangents are added to the matrix' values in the
kernel, at positions that are looked up once: PETSc's own insertion searches every row for every entry, which costs as
much as the tangent itself. The others, along constraints and between ranks, go through ``MatSetValues``, which skips
constrained entries and sends what belongs to other ranks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat
from tmc_vem.support.petsc import PETSc
from tmc_vem.support.petsc_arrays import compressed_rows, in_place
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.blocks import CHUNK, Block
from tmc_vem.vem.kernel.batch import CellBatch, Tangents
from tmc_vem.vem.kernel.cells import CellKernel

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]


class Terms(Protocol):
    """Energies of equally many nodes each, with their tangents: of cells, or of sides between them."""

    @property
    def nodes_ca(self) -> Int32:
        """(n, n_basis) nodes of each."""

    def take(self, chosen: Int | slice) -> Terms:
        """Some of them."""

    def tangents(self, u_ni: Float) -> Float:
        """Their tangents (n, n_basis, 2, n_basis, 2) at displacements of the nodes."""

    def add_tangents(self, u_ni: Float, values: Float, position_cab: Int32, row_length_n: Int32) -> None:
        """Add them to the values of a matrix, see ``tmc_tangents`` in kernel_abi.h."""


@dataclass(frozen=True)
class CellTerms:
    """Cells of a block."""

    block: Block
    batch: CellBatch

    @property
    def nodes_ca(self) -> Int32:
        """Nodes of each cell."""
        return self.batch.nodes_ca

    def take(self, chosen: Int | slice) -> CellTerms:
        """Some of the cells."""
        return CellTerms(self.block, self.batch.take(chosen))

    def tangents(self, u_ni: Float) -> Float:
        """Tangents of the cells."""
        n = self.batch.n_basis
        dense = np.empty((self.batch.n_cells, n, 2, n, 2))
        self.block.kernel.cells(self.batch, u_ni, self.block.parameters, None, Tangents(dense))
        return dense

    def add_tangents(self, u_ni: Float, values: Float, position_cab: Int32, row_length_n: Int32) -> None:
        """Add the cells' tangents to the values of a matrix."""
        tangents = Tangents(None, values, position_cab, row_length_n)
        self.block.kernel.cells(self.batch, u_ni, self.block.parameters, None, tangents)


def add_products(
    terms: Terms, u_ni: Float, du_ni: Float, total_ni: Float, among: NDArray[np.bool_] | None = None
) -> None:
    """Add products of tangents at ``u_ni`` and ``du_ni`` to ``total_ni``, all (n_nodes, 2), without a matrix.

    Args:
        among: (n,) the terms that take part; all of them. Those where ``du_ni`` is zero are not computed.
    """
    moving = du_ni.any(axis=1)[terms.nodes_ca].any(axis=1)
    chosen = np.flatnonzero(moving if among is None else moving & among)
    for first in range(0, len(chosen), CHUNK):
        some = terms.take(chosen[first : first + CHUNK])
        nodes, n = some.nodes_ca, DISPLACEMENT.size(some.nodes_ca.shape[1])
        products = some.tangents(u_ni).reshape(-1, n, n) @ du_ni[nodes].reshape(-1, n, 1)
        np.add.at(total_ni, nodes, products.reshape(*nodes.shape, DISPLACEMENT.components))


@dataclass(frozen=True)
class _Direct:
    """Terms that go straight into the matrix, and where."""

    terms: Terms
    position_cab: Int32


@dataclass(frozen=True)
class _Others:
    """Terms that go through PETSc."""

    terms: Terms
    free_dofs_cn: NDArray[Any]  # over all ranks; -1 where constrained: PETSc skips those entries


class MatrixInsertion:
    """Where the tangents of all terms go in matrices of one pattern.

    Args:
        terms: of this rank.
        kernel: any, for looking up positions; None if there are no terms.
        matrix: an assembled matrix of the pattern; of a type other than AIJ, all terms go through PETSc.
        number_n: (n_nodes,) number over all ranks of each node.
        is_constrained: of every degree of freedom of these nodes.
    """

    def __init__(
        self,
        terms: Sequence[Terms],
        kernel: CellKernel | None,
        matrix: Mat,
        number_n: Int,
        is_constrained: NDArray[np.bool_],
    ) -> None:
        n_nodes = len(number_n)
        first, last = matrix.getOwnershipRange()
        numbers = DISPLACEMENT.dof(number_n)
        owned = (numbers >= first) & (numbers < last)
        free = owned & ~DISPLACEMENT.nodal(is_constrained).any(axis=1)
        column_n = np.where(owned, numbers - first, -1).astype(np.int32)
        structure = _structure(matrix)
        self._row_length_n = np.zeros(n_nodes, dtype=np.int32)
        self._n_values = 0
        start_n = np.zeros(n_nodes, dtype=np.int64)
        if structure is None:
            free[:] = False
        else:
            starts, columns = structure
            rows = column_n[owned]
            start_n[owned] = starts[rows]
            self._row_length_n[owned] = starts[rows + 1] - starts[rows]
            self._n_values = len(columns)
        self._direct: list[_Direct] = []
        self._others: list[_Others] = []
        for each in terms:
            whole = free[each.nodes_ca].all(axis=1)
            direct, others = (each if chosen.all() else each.take(np.flatnonzero(chosen)) for chosen in (whole, ~whole))
            if structure is not None and kernel is not None and whole.any():
                place = kernel.positions(direct.nodes_ca, start_n, self._row_length_n, column_n, structure[1])
                self._direct.append(_Direct(direct, place))
            if not whole.all():
                dofs = DISPLACEMENT.dofs(others.nodes_ca).reshape(len(others.nodes_ca), -1)
                known = DISPLACEMENT.dofs(number_n[others.nodes_ca]).reshape(dofs.shape)
                self._others.append(_Others(others, np.where(is_constrained[dofs], -1, known).astype(PETSc.IntType)))

    def assemble(
        self, u_ni: Float, matrix: Mat, constrained: Int, together: Callable[[Callable[[], None]], None]
    ) -> None:
        """Tangent (56) at ``u_ni``, with the identity at the local degrees of freedom ``constrained`` of this rank.

        Args:
            u_ni: (n_nodes, 2) displacements of the nodes.
            matrix: one of the pattern.
            constrained: local degrees of freedom.
            together: calls a function that does not communicate, and raises on all ranks what it raises on one.
        """
        matrix.zeroEntries()
        try:
            together(lambda: self._insert_others(u_ni, matrix, constrained))
        finally:
            matrix.assemble()
        together(lambda: self._add_directly(u_ni, matrix))

    def _insert_others(self, u_ni: Float, matrix: Mat, constrained: Int) -> None:
        for part in self._others:
            for first in range(0, len(part.free_dofs_cn), CHUNK):
                chunk = slice(first, first + CHUNK)
                dofs = part.free_dofs_cn[chunk]
                dense = part.terms.take(chunk).tangents(u_ni).reshape(*dofs.shape, dofs.shape[1])
                matrix.setValuesRCV(dofs, dofs, dense, addv=PETSc.InsertMode.ADD_VALUES)
        for dof in constrained.tolist():
            matrix.setValueLocal(dof, dof, 1.0, addv=PETSc.InsertMode.ADD_VALUES)

    def _add_directly(self, u_ni: Float, matrix: Mat) -> None:
        if self._direct:
            diagonal = _diagonal_block(matrix)
            values = in_place("MatSeqAIJGetArray", diagonal, self._n_values, np.float64)
            for part in self._direct:
                part.terms.add_tangents(u_ni, values, part.position_cab, self._row_length_n)
            diagonal.stateIncrease()
            matrix.stateIncrease()


def _diagonal_block(matrix: Mat) -> Mat:
    return matrix.getDiagonalBlock() if matrix.getType() == PETSc.Mat.Type.MPIAIJ else matrix


def _structure(matrix: Mat) -> tuple[Int, Int32] | None:
    """Row starts and columns of this rank's diagonal block, or None if it has no compressed rows with node pairs."""
    if matrix.getType() not in (PETSc.Mat.Type.SEQAIJ, PETSc.Mat.Type.MPIAIJ):
        return None
    starts, columns = compressed_rows(_diagonal_block(matrix))
    lengths = np.diff(starts)
    if len(columns) >= 2**31 or (lengths[::2] != lengths[1::2]).any():
        return None
    return starts.astype(np.int64), columns.astype(np.int32, copy=False)
