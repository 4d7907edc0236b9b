"""Tangents of elements into a PETSc matrix.

Most cells have only nodes that this rank owns and that are free. Their tangents are added to the matrix' values in the
kernel, at positions that are looked up once: PETSc's own insertion searches every row for every entry, which costs as
much as the tangent itself. The other cells, along constraints and between ranks, go through ``MatSetValuesLocal``,
which skips constrained entries and sends what belongs to other ranks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat
from tmc_vem.support.petsc import PETSc
from tmc_vem.support.petsc_arrays import compressed_rows, in_place
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.blocks import CHUNK, Block
from tmc_vem.vem.kernel.batch import CellBatch, Tangents

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]


@dataclass(frozen=True)
class _Part:
    """Cells of a block: those that go straight into the matrix, and the others with their degrees of freedom."""

    block: Block
    direct: CellBatch
    position_cab: Int32 | None
    others: CellBatch
    free_dofs_cn: NDArray[Any]  # -1 where constrained: PETSc skips those entries


class MatrixInsertion:
    """Where the tangents of all blocks go in matrices of one pattern.

    Args:
        blocks: all cells of this rank.
        matrix: an assembled matrix of the pattern; of a type other than AIJ, all cells go through PETSc.
        lgmap: PETSc's map from local to global degrees of freedom.
        is_constrained: of every local degree of freedom.
    """

    def __init__(self, blocks: Sequence[Block], matrix: Mat, lgmap: Any, is_constrained: NDArray[np.bool_]) -> None:
        n_nodes = DISPLACEMENT.n_nodes(len(is_constrained))
        first, last = matrix.getOwnershipRange()
        numbers = lgmap.apply(DISPLACEMENT.dof(np.arange(n_nodes)).astype(PETSc.IntType)).astype(np.int64)
        owned = (numbers >= first) & (numbers < last)
        free = owned & ~DISPLACEMENT.nodal(is_constrained).any(axis=1)
        self._column_n = np.where(owned, numbers - first, -1).astype(np.int32)
        structure = _structure(matrix)
        self._row_length_n = np.zeros(n_nodes, dtype=np.int32)
        self._n_values = 0
        start_n = np.zeros(n_nodes, dtype=np.int64)
        if structure is None:
            free[:] = False
        else:
            starts, columns = structure
            rows = self._column_n[owned]
            start_n[owned] = starts[rows]
            self._row_length_n[owned] = starts[rows + 1] - starts[rows]
            self._n_values = len(columns)
        self._parts = []
        for block in blocks:
            whole = free[block.batch.nodes_ca].all(axis=1)
            direct, others = (block.batch.take(np.flatnonzero(chosen)) for chosen in (whole, ~whole))
            positions = None
            if structure is not None and direct.n_cells:
                positions = block.kernel.positions(direct, start_n, self._row_length_n, self._column_n, structure[1])
            dofs = DISPLACEMENT.dofs(others.nodes_ca).reshape(others.n_cells, DISPLACEMENT.size(others.n_basis))
            dofs = np.where(is_constrained[dofs], -1, dofs).astype(PETSc.IntType)
            self._parts.append(_Part(block, direct, positions, others, dofs))

    def assemble(
        self, u_ni: Float, matrix: Mat, constrained: Int, together: Callable[[Callable[[], None]], None]
    ) -> None:
        """Tangent (56) at ``u_ni``, with the identity at the local degrees of freedom ``constrained`` of this rank.

        Args:
            u_ni: (n_nodes, 2) displacements of this rank's nodes.
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
        for part in self._parts:
            self._insert(part, u_ni, matrix)
        for dof in constrained.tolist():
            matrix.setValueLocal(dof, dof, 1.0, addv=PETSc.InsertMode.ADD_VALUES)

    def _add_directly(self, u_ni: Float, matrix: Mat) -> None:
        if any(part.direct.n_cells for part in self._parts):
            diagonal = _diagonal_block(matrix)
            values = in_place("MatSeqAIJGetArray", diagonal, self._n_values, np.float64)
            for part in self._parts:
                if part.direct.n_cells:
                    tangents = Tangents(None, values, part.position_cab, self._row_length_n)
                    part.block.kernel.cells(part.direct, u_ni, part.block.parameters, None, tangents)
            diagonal.stateIncrease()
            matrix.stateIncrease()

    def _insert(self, part: _Part, u_ni: Float, matrix: Mat) -> None:
        n = DISPLACEMENT.size(part.others.n_basis)
        for first in range(0, part.others.n_cells, CHUNK):
            chunk = part.others.take(slice(first, first + CHUNK))
            dense = np.empty((chunk.n_cells, n, n))
            part.block.kernel.cells(chunk, u_ni, part.block.parameters, None, Tangents(dense))
            dofs = part.free_dofs_cn[first : first + CHUNK]
            matrix.setValuesLocalRCV(dofs, dofs, dense, addv=PETSc.InsertMode.ADD_VALUES)


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
