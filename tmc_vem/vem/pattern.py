"""The matrix of a system, with the pattern of its cells and of what couples more than the nodes of a cell.

PETSc makes the same matrix from the DM, on any number of ranks, if there are cells alone; on one rank this takes half
the time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from tmc_vem.support.distributed import Mat
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.blocks import Block

Int = NDArray[Any]


def serial_matrix(blocks: Sequence[Block], dm: Any, n_nodes: int, more: Iterable[Int] = ()) -> Mat:
    """Sequential AIJ matrix, zero, with an entry for every two degrees of freedom of a cell.

    Args:
        blocks: the cells.
        dm: numbers the degrees of freedom.
        n_nodes: how many nodes there are.
        more: other nodes (n, n_together) that are coupled.
    """
    starts, columns = node_pattern(blocks, n_nodes, more)
    size, block = DISPLACEMENT.size(n_nodes), DISPLACEMENT.components
    # only the pattern is expanded, with one byte for a value; PETSc takes the arrays as they are
    pairs = np.ones((len(columns), block, block), dtype=bool)
    expanded = sparse.bsr_matrix((pairs, columns, starts), shape=(size, size)).tocsr()
    indptr, indices = (a.astype(PETSc.IntType, copy=False) for a in (expanded.indptr, expanded.indices))
    csr = (indptr, indices, np.zeros(len(indices)))
    matrix: Mat = PETSc.Mat().createAIJWithArrays((size, size), csr, comm=PETSc.COMM_SELF)
    matrix.setBlockSize(block)
    lgmap = dm.getLGMap()
    matrix.setLGMap(lgmap, lgmap)
    matrix.setDM(dm)
    return matrix


def parallel_matrix(blocks: Sequence[Block], dm: Any, n_owned: int, number_n: Int, more: Iterable[Int]) -> Mat:
    """Matrix over all ranks, zero, with an entry for every two degrees of freedom of a cell and of ``more``.

    Args:
        blocks: this rank's cells.
        dm: numbers the degrees of freedom, and says what type a matrix has.
        n_owned: nodes that this rank owns.
        number_n: (n_nodes,) number over all ranks of the nodes that blocks and ``more`` name.
        more: other nodes (n, n_together) that are coupled.
    """
    starts, columns = node_pattern(blocks, len(number_n), more)
    rows = np.repeat(number_n, np.diff(starts))
    pairs = DISPLACEMENT.dofs(rows)[:, :, None], DISPLACEMENT.dofs(number_n[columns])[:, None, :]
    i, j = (side.ravel().astype(PETSc.IntType) for side in np.broadcast_arrays(*pairs))
    size = DISPLACEMENT.size(n_owned)
    matrix: Mat = PETSc.Mat().create(comm=dm.getComm())
    matrix.setSizes(((size, None), (size, None)), bsize=DISPLACEMENT.components)
    matrix.setType(dm.getMatType())
    matrix.setPreallocationCOO(i, j)
    lgmap = dm.getLGMap()
    matrix.setLGMap(lgmap, lgmap)
    matrix.setDM(dm)
    return matrix


def node_pattern(
    blocks: Sequence[Block], n_nodes: int, more: Iterable[Int] = ()
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Compressed rows of the graph of nodes that share a cell, or a row of ``more``: row starts (n_nodes + 1,) and
    sorted columns."""
    together = [*(block.batch.nodes_ca for block in blocks), *more]
    sizes = [np.full(len(nodes), nodes.shape[1]) for nodes in together]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    nodes = np.concatenate([nodes.ravel() for nodes in together])
    incidence = sparse.csr_matrix((np.ones(len(nodes), dtype=bool), nodes, offsets), shape=(len(offsets) - 1, n_nodes))
    graph = incidence.T.tocsr() @ incidence
    # symmetric: its columns are its rows, and transposing sorts in linear time
    by_column = graph.tocsc()
    return by_column.indptr, by_column.indices
