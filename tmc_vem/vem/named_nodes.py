"""Nodes of a virtual element mesh at named points and along named edges."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import is_called
from tmc_vem.vem.dofmap import DofMap

Float = NDArray[np.float64]


def marked_here(distributed: DistributedMesh, dofmap: DofMap, where: str) -> Float:
    """(n_nodes,) 1 at this rank's nodes of a named point or edge set, as far as this rank knows; all ranks call this.

    Raises:
        InputError: no rank has anything of that name.
    """
    mesh = distributed.mesh
    vertices = [vertex for name, vertex in mesh.named_points.items() if is_called(name, where)]
    if not distributed.comm.allreduce(bool(vertices) or where in mesh.named_edges, op=MPI.LOR):
        raise InputError(f"the mesh has neither a point nor edges named '{where}'")
    here = np.zeros(dofmap.n_nodes)
    here[dofmap.vertex_nodes[vertices]] = 1.0
    pairs = mesh.named_edges.get(where)
    if pairs is not None and len(pairs):
        ordered = {tuple(sorted(pair)): e for e, pair in enumerate(distributed.edges.vertices_ev.tolist())}
        edges = [ordered[tuple(sorted(pair))] for pair in pairs.tolist()]
        here[dofmap.vertex_nodes[np.unique(pairs)]] = 1.0
        here[dofmap.edge_nodes[edges].ravel()] = 1.0
    return here
