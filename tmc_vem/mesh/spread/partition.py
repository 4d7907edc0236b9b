"""Which rank has which cell, the same again for the same mesh: partitioners draw random numbers.

Systems of one problem that are made one after the other, for the load cases of a design or for derivatives at the end
of a run, then have the same nodes on every rank.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.distributed import Comm
from tmc_vem.support.petsc import PETSc

Int = NDArray[np.int64]

MOST = 8  # meshes whose partition is remembered

_known: OrderedDict[bytes, Int] = OrderedDict()  # on the root: the rank (n_cells,) of every cell


def key_of(comm: Comm, mesh: PolygonMesh | None, weight_c: Int | None) -> bytes:
    """What a partition depends on; nothing on other ranks than the root.

    Args:
        comm: ranks.
        mesh: on the root.
        weight_c: (n_cells,) weights of its cells.
    """
    if mesh is None or weight_c is None:
        return b""
    digest = hashlib.sha256(str(comm.size).encode())
    for array in (mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, weight_c):
        digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


def use_again(comm: Comm, plex: Any, key: bytes) -> None:
    """Have a DMPlex partitioned as a mesh of the same key was before, if there was one; called on all ranks."""
    rank_c = _known.get(key) if comm.rank == 0 else None
    if not comm.bcast(rank_c is not None):
        return
    sizes, cells = np.zeros(comm.size, dtype=PETSc.IntType), np.zeros(0, dtype=PETSc.IntType)
    if rank_c is not None:
        sizes[:] = np.bincount(rank_c, minlength=comm.size)
        cells = np.argsort(rank_c, kind="stable").astype(PETSc.IntType)
    partitioner = plex.getPartitioner()
    partitioner.setType(PETSc.Partitioner.Type.SHELL)
    partitioner.setShellPartition(comm.size, sizes, cells)


def remember(comm: Comm, key: bytes, cell_ids: Int) -> None:
    """Know which cells each rank has got; called on all ranks.

    Args:
        comm: ranks.
        key: of the mesh.
        cell_ids: (n_cells,) numbers in the mesh of this rank's cells.
    """
    parts = comm.gather(cell_ids)
    if parts is None:
        return
    rank_c = np.empty(sum(len(part) for part in parts), dtype=np.int64)
    for rank, part in enumerate(parts):
        rank_c[part] = rank
    _known[key] = rank_c
    while len(_known) > MOST:
        _known.popitem(last=False)
