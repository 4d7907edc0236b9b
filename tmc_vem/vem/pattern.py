"""The matrix of a system, with the pattern of its cells and of what couples more than the nodes of a cell.

PETSc makes the same matrix from the DM, on any number of ranks, if there are cells alone; on one rank this takes half
the time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tmc_vem.support.distributed import Comm, Mat
from tmc_vem.support.petsc import PETSc
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


def parallel_matrix(
    comm: Comm, blocks: Sequence[Block], dm: Any, owned: tuple[int, int], number_n: Int, more: Iterable[Int]
) -> Mat:
    """Matrix over all ranks, zero, with an entry for every two degrees of freedom of a cell and of ``more``.

    The matrix of the DM would have no room for what couples beyond a cell.

    Args:
        comm: the ranks; all of them call this.
        blocks: this rank's cells.
        dm: numbers the degrees of freedom.
        owned: number over all ranks of the first node of this rank, and of the first one of the next.
        number_n: (n_nodes,) number over all ranks of the nodes that blocks and ``more`` name.
        more: other nodes (n, n_together) that are coupled.
    """
    starts, columns = node_pattern(blocks, len(number_n), more)
    pairs = np.column_stack([np.repeat(number_n, np.diff(starts)), number_n[columns]])
    first_r = np.array(comm.allgather(owned[0]))
    # ranks without nodes begin where the next one does: the last of those is the owner
    owner = np.searchsorted(first_r, pairs[:, 0], side="right") - 1
    received = comm.alltoall([pairs[owner == rank] for rank in range(comm.size)])
    rows, columns = np.unique(np.concatenate(received), axis=0).T
    n_owned = owned[1] - owned[0]
    n_row = np.bincount(rows - owned[0], minlength=n_owned)
    # both components of a node have the same columns
    dofs = DISPLACEMENT.dofs(columns).ravel()
    per_row = DISPLACEMENT.components * n_row
    begin = np.concatenate([[0], np.cumsum(per_row)])
    row = np.repeat(np.arange(n_owned), DISPLACEMENT.components)
    length = per_row[row]
    indptr = np.concatenate([[0], np.cumsum(length)])
    indices = dofs[np.arange(indptr[-1]) - np.repeat(indptr[:-1] - begin[row], length)]
    csr = (indptr.astype(PETSc.IntType), indices.astype(PETSc.IntType), np.zeros(len(indices)))
    size = (DISPLACEMENT.size(n_owned), PETSc.DETERMINE)
    matrix: Mat = PETSc.Mat().createAIJ((size, size), csr=csr, comm=comm)
    matrix.setBlockSize(DISPLACEMENT.components)
    lgmap = dm.getLGMap()
    matrix.setLGMap(lgmap, lgmap)
    matrix.setDM(dm)
    return matrix


def node_pattern(
    blocks: Sequence[Block], n_nodes: int, more: Iterable[Int] = ()
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Compressed rows of the graph of nodes that share a cell, or a row of ``more``: row starts (n_nodes + 1,) and
    sorted columns."""
    none = np.empty((0, 0), dtype=np.int32)  # of a rank without cells
    together = [none, *(block.batch.nodes_ca for block in blocks), *more]
    sizes = [np.full(len(nodes), nodes.shape[1]) for nodes in together]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    nodes = np.concatenate([nodes.ravel() for nodes in together])
    incidence = sparse.csr_matrix((np.ones(len(nodes), dtype=bool), nodes, offsets), shape=(len(offsets) - 1, n_nodes))
    graph = incidence.T.tocsr() @ incidence
    # symmetric: its columns are its rows, and transposing sorts in linear time
    by_column = graph.tocsc()
    return by_column.indptr, by_column.indices
