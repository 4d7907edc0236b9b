"""Sides between ranks: the faces of other ranks' cells, and the values of their nodes.

Both cells of a side are needed where its energy is computed, on the lower of the two ranks. The other one sends the
face of its cell once; afterwards only displacements and forces of its nodes travel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.facets.batch import Faces
from tmc_vem.vem.facets.faces import FaceTable

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Met:
    """A side of this rank whose other cell is on another rank, which has sent its face; nodes are global numbers."""

    side: int
    other: Faces


def edge_keys(distributed: DistributedMesh, sides: Int) -> Int:
    """(n, 2) original numbers of the ends of sides' edges, the smaller first: the same on all ranks."""
    ends = distributed.edges.vertices_ev[distributed.edges.cell_edges[sides]]
    keys: Int = np.sort(distributed.vertex_ids[ends], axis=1)
    return keys


def meet(
    distributed: DistributedMesh, table: FaceTable, sides: Int, region_s: Int, numbers_n: Int
) -> tuple[list[Met], Int]:
    """Find the other cells of sides that have one cell on this rank; all ranks call this.

    Args:
        distributed: the mesh.
        table: this rank's faces.
        sides: sides of media whose edge has one cell of a medium here.
        region_s: number of the medium of each.
        numbers_n: (n_nodes,) global number of each local node.

    Returns:
        The sides that are computed here, with their other face, and the positions among ``sides`` of those that have
        none on any rank: they are at the medium's edge.
    """
    comm = distributed.comm
    if comm.size == 1:
        return [], np.arange(len(sides))
    keys = [
        (int(a), int(b), int(region)) for (a, b), region in zip(edge_keys(distributed, sides), region_s, strict=True)
    ]
    here = {key: position for position, key in enumerate(keys)}
    outgoing: list[list[tuple[tuple[int, int, int], Faces]]] = [[] for _ in range(comm.size)]
    mine: dict[tuple[int, int, int], int] = {}
    shared = np.zeros(len(sides), dtype=bool)
    for rank, other in enumerate(comm.allgather(keys)):
        if rank == comm.rank:
            continue
        for key in other:
            if key in here:
                shared[here[key]] = True
                if rank < comm.rank:
                    outgoing[rank].append((key, _face(table, int(sides[here[key]]), numbers_n)))
                else:
                    mine[key] = int(sides[here[key]])
    met = [Met(mine[key], face) for part in comm.alltoall(outgoing) for key, face in part]
    return met, np.flatnonzero(~shared)


def _face(table: FaceTable, side: int, numbers_n: Int) -> Faces:
    """One face with global numbers of its nodes."""
    one = np.array([side])
    face = table.faces(one)
    return Faces(face.rows_fqra, numbers_n[face.nodes_fa], face.area_f, np.array([-1]), face.factor_fk)


class Halo:
    """Nodes of other ranks that sides of this rank need, numbered after this rank's own.

    Args:
        comm: the ranks.
        dofmap: this rank's nodes.
        global_nodes: global numbers of the others, sorted, each once.

    Attributes:
        is_used: whether any rank has such nodes; where none has, there is nothing to exchange.
    """

    def __init__(self, comm: Comm, dofmap: DofMap, global_nodes: Int) -> None:
        self.n_local = dofmap.n_nodes
        self._numbers = global_nodes
        self.is_used = sum(comm.allgather(len(global_nodes))) > 0
        if self.is_used:
            wanted = DISPLACEMENT.dofs(global_nodes).ravel().astype(PETSc.IntType)
            self._values: Any = PETSc.Vec().createSeq(len(wanted), comm=PETSc.COMM_SELF)
            like = dofmap.dm.getGlobalVec()
            self._scatter: Any = PETSc.Scatter().create(
                like, PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF), self._values, None
            )
            dofmap.dm.restoreGlobalVec(like)

    def local(self, global_nodes: Int) -> Int:
        """Numbers of such nodes on this rank."""
        return self.n_local + np.searchsorted(self._numbers, global_nodes)

    @property
    def n_nodes(self) -> int:
        """How many nodes there are in it."""
        return len(self._numbers)

    @property
    def numbers(self) -> Int:
        """Global numbers of the nodes."""
        return self._numbers

    def extended(self, u: Vec, u_ni: Float) -> Float:
        """Values (n_nodes + n_halo, 2): those of this rank's nodes, then those of the halo; all ranks call this."""
        self._scatter.scatter(u, self._values, PETSc.InsertMode.INSERT_VALUES, PETSc.ScatterMode.FORWARD)
        return np.concatenate([u_ni, DISPLACEMENT.nodal(self._values.getArray(readonly=True))])

    def add(self, total_ni: Float, out: Vec) -> None:
        """Add the values of the halo's nodes to a global vector; all ranks call this."""
        self._values.getArray()[:] = total_ni[self.n_local :].ravel()
        self._scatter.scatter(self._values, out, PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
