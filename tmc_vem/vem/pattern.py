"""The matrix of a system on one rank, with the pattern of its cells.

PETSc makes the same matrix from the DM, on any number of ranks, but on one rank this takes half the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tmc_vem.support.distributed import Mat
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.blocks import Block


def serial_matrix(blocks: Sequence[Block], dm: Any, n_nodes: int) -> Mat:
    """Sequential AIJ matrix, zero, with an entry for every two degrees of freedom of a cell."""
    starts, columns = node_pattern(blocks, n_nodes)
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


def node_pattern(blocks: Sequence[Block], n_nodes: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Compressed rows of the graph of nodes that share a cell: row starts (n_nodes + 1,) and sorted columns."""
    sizes = [np.full(block.batch.n_cells, block.batch.n_basis) for block in blocks]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    nodes = np.concatenate([block.batch.nodes_ca.ravel() for block in blocks])
    incidence = sparse.csr_matrix((np.ones(len(nodes), dtype=bool), nodes, offsets), shape=(len(offsets) - 1, n_nodes))
    graph = incidence.T.tocsr() @ incidence
    # symmetric: its columns are its rows, and transposing sorts in linear time
    by_column = graph.tocsc()
    return by_column.indptr, by_column.indices
