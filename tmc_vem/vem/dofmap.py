"""Numbering of the degrees of freedom of the virtual element space over all ranks, through DMPlex's section.

A node carries both displacement components. Nodes of a cell come in the order of the scalar degrees of freedom in
:mod:`tmc_vem.vem.spaces.projector`: vertices, points of the sides in the cell's direction, moments.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.layout import DISPLACEMENT

Int = NDArray[np.int64]


@dataclass(frozen=True)
class DofMap:
    """Local nodes of vertices, edges and cells; degree of freedom ``2 node + component``.

    Attributes:
        dm: DMPlex with the section; creates global and local vectors and matrices.
        vertex_nodes: (n_vertices,) local node of each vertex.
        edge_nodes: (n_edges, k - 1) local nodes along each edge, in the edge's own direction.
        cell_moments: (n_cells, k (k - 1) / 2) local nodes of each cell's moments.
        order: k.
        n_nodes: local nodes on this rank, shared ones included.
        n_dofs_global: degrees of freedom of the whole system.
    """

    dm: Any
    vertex_nodes: Int
    edge_nodes: Int
    cell_moments: Int
    order: int
    n_nodes: int
    n_dofs_global: int

    @staticmethod
    def create(distributed: DistributedMesh, order: int) -> DofMap:
        """Number the nodes of order ``order`` on a distributed mesh."""
        dm = distributed.plex.clone()
        n_edge, n_cell = order - 1, order * (order - 1) // 2
        section = PETSc.Section().create(comm=distributed.comm)
        section.setChart(*dm.getChart())
        parts = (
            (distributed.cell_points, n_cell),
            (distributed.vertex_points, 1),
            (distributed.edge_points, n_edge),
        )
        first, last = dm.getChart()
        nodes_p = np.zeros(last - first, dtype=np.int64)
        for points, nodes in parts:
            nodes_p[points - first] = nodes
            for point in points.tolist():
                section.setDof(point, DISPLACEMENT.size(nodes))
        section.setUp()
        dm.setSection(section)
        start_p = np.cumsum(nodes_p) - nodes_p  # a section numbers its points in the order of the chart
        cells, vertices, edges = (start_p[points - first][:, None] + np.arange(nodes) for points, nodes in parts)
        probe = dm.createGlobalVec()
        n_global = probe.getSize()
        probe.destroy()
        return DofMap(dm, vertices[:, 0], edges, cells, order, DISPLACEMENT.n_nodes(section.getStorageSize()), n_global)

    @cached_property
    def owned_range(self) -> tuple[int, int]:
        """First global degree of freedom of this rank, and first one of the next."""
        probe = self.dm.getGlobalVec()
        first, last = probe.getOwnershipRange()
        self.dm.restoreGlobalVec(probe)
        return first, last

    @cached_property
    def global_node_n(self) -> Int:
        """(n_nodes,) number of each local node over all ranks."""
        numbers = self.dm.getLGMap().apply(DISPLACEMENT.dof(np.arange(self.n_nodes)).astype(PETSc.IntType))
        return DISPLACEMENT.node(numbers.astype(np.int64))

    @cached_property
    def owned_node_n(self) -> Int:
        """(n_nodes,) place of each local node in this rank's part of a global vector, -1 if another rank owns it."""
        first, last = (DISPLACEMENT.n_nodes(bound) for bound in self.owned_range)
        owned = (self.global_node_n >= first) & (self.global_node_n < last)
        places: Int = np.where(owned, self.global_node_n - first, -1)
        return places

    def cell_nodes(self, distributed: DistributedMesh, cells: Int, n_sides: int) -> NDArray[np.int32]:
        """Nodes (n, n_basis) of cells with ``n_sides`` sides, in the order of the local basis."""
        sides = distributed.mesh.cell_offsets[cells][:, None] + np.arange(n_sides)
        vertices = self.vertex_nodes[distributed.mesh.cell_vertices[sides]]
        along = self.edge_nodes[distributed.edges.cell_edges[sides]]
        forward = distributed.edges.forward[sides]
        along = np.where(forward[..., None], along, along[..., ::-1])
        nodes = np.concatenate([vertices, along.reshape(len(cells), -1), self.cell_moments[cells]], axis=1)
        small: NDArray[np.int32] = nodes.astype(np.int32)
        return small
