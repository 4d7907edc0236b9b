"""Nodes of the displacement space: which belong to cells and names, and the cells as polygons through them."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem import compat
from tmc_vem.fem.mesh import FemMesh
from tmc_vem.mesh.geometry import areas
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import is_called
from tmc_vem.system.fields import Polygons
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.sides import Sides

Float = NDArray[np.float64]
Int = NDArray[np.int64]


class Nodes:
    """Nodes of a Lagrange space; degree of freedom ``2 node + component``. Owned nodes come first, then ghosts.

    Attributes:
        n_owned, n_local, n_global: nodes of this rank, with ghosts, and of all ranks.
        cell_nodes_ca: (n_cells, n_basis) nodes of the local cells, ghosts included.
        points_nx: (n_local, 2) coordinates.
    """

    def __init__(self, mesh: FemMesh, space: Any, order: int) -> None:
        self._mesh, self._space = mesh, space
        index_map = space.dofmap.index_map
        self.n_owned, self.n_global = int(index_map.size_local), int(index_map.size_global)
        self.n_local = self.n_owned + index_map.num_ghosts
        self.cell_nodes_ca: Int = compat.rows(space.dofmap.list, len(mesh.region_c)).astype(np.int64)
        self.points_nx: Float = np.array(space.tabulate_dof_coordinates())[: self.n_local, :2]
        layout = space.dofmap.dof_layout
        n_edges = len(compat.reference_edges(mesh.cell))
        self._edge_positions = [np.asarray(layout.entity_dofs(1, e)) for e in range(n_edges)]
        self.named = functools.cache(self._named)
        self.polygon_nodes = functools.cache(self._polygon_nodes)
        self.sides_cn = functools.cache(self._sides)

    def function(self) -> Any:
        """A new function of the space, zero."""
        return compat.function(self._space)

    def _named(self, where: str) -> Int:
        """Owned nodes of a named point or edge set (empty if they are on other ranks).

        Raises:
            InputError: the mesh has nothing of that name.
        """
        names, vertices_cv = self._mesh.names, self._mesh.vertices_cv
        vertices = [vertex for name, vertex in names.points.items() if is_called(name, where)]
        if not vertices and where not in names.edges:
            raise InputError(f"the mesh has neither a point nor edges named '{where}'")
        mark = self.function()
        here = mark.x.array
        if vertices:
            cells, corners = np.nonzero(np.isin(vertices_cv, vertices))
            here[DISPLACEMENT.dof(self.cell_nodes_ca[cells, corners])] = 1.0
        if where in names.edges:
            wanted = {tuple(pair) for pair in names.edges[where].tolist()}
            for pair, inner in zip(compat.reference_edges(self._mesh.cell), self._edge_positions, strict=True):
                ends = np.sort(vertices_cv[:, pair], axis=1).tolist()
                cells = np.array([c for c, key in enumerate(ends) if tuple(key) in wanted], dtype=np.int64)
                along = np.concatenate([pair, inner])
                here[DISPLACEMENT.dof(self.cell_nodes_ca[cells][:, along].ravel())] = 1.0
        # the owner of an end vertex may not have the edge itself
        compat.scatter_reverse(mark)
        nodes: Int = np.flatnonzero(DISPLACEMENT.nodal(mark.x.array)[: self.n_owned, 0] > 0.0)
        return nodes

    def sides_along(self, where: str) -> Sides:
        """Sides of this rank's own cells along named edges; none if the mesh has no such edges."""
        mesh, along = self._mesh, self.sides_cn()
        order = along.shape[1] // mesh.vertices_cv.shape[1]
        nodes = np.stack(
            [np.roll(along, -start, axis=1)[:, : order + 1] for start in range(0, along.shape[1], order)], axis=1
        )
        vertex_n = np.full(self.n_local, -1)
        vertex_n[self.cell_nodes_ca[:, : mesh.vertices_cv.shape[1]]] = mesh.vertices_cv
        ends = vertex_n[nodes[..., [0, -1]]]
        pairs = np.asarray(mesh.names.edges.get(where, np.empty((0, 2), dtype=np.int64))).reshape(-1, 2)
        key = np.array([1 + max(int(vertex_n.max(initial=0)), int(pairs.max(initial=0))), 1])
        cells, sides = np.nonzero(np.isin(np.sort(ends, axis=-1) @ key, pairs @ key))
        return Sides(
            nodes_sa=compat.global_nodes(self._space, nodes[cells, sides]),
            points_sax=self.points_nx[nodes[cells, sides]],
            ends_se=ends[cells, sides],
            cell_s=mesh.cell_ids[cells],
            region_s=np.array(mesh.names.regions)[mesh.region_c[cells]],
        )

    def sum_over_cells(self, values_cai: Float) -> Float:
        """Sum of element vectors (n_owned_cells, n_basis, 2) at the owned nodes (n_owned, 2), over all ranks."""
        nodes = self.cell_nodes_ca[: len(values_cai)]
        dofs = DISPLACEMENT.dofs(nodes).ravel()
        total = self.function()
        total.x.array[:] = np.bincount(dofs, weights=values_cai.ravel(), minlength=DISPLACEMENT.size(self.n_local))
        compat.scatter_reverse(total)
        owned: Float = DISPLACEMENT.nodal(total.x.array)[: self.n_owned].copy()
        return owned

    def polygons(self) -> Polygons:
        """This rank's cells as polygons through all nodes of their boundary."""
        nodes, sides = self.polygon_nodes(), self.sides_cn()
        position = np.full(self.n_local, -1, dtype=np.int64)
        position[nodes] = np.arange(len(nodes))
        mesh = self._mesh
        return Polygons(
            points_nx=self.points_nx[nodes],
            offsets=np.arange(len(sides) + 1) * sides.shape[1],
            connectivity=position[sides].ravel(),
            region_c=mesh.region_c[: mesh.n_owned],
            region_names=mesh.names.regions,
        )

    def _polygon_nodes(self) -> Int:
        """Nodes that the polygons' points are."""
        nodes: Int = np.unique(self.sides_cn())
        return nodes

    def _sides(self) -> Int:
        """(n_owned_cells, n_sides * order) nodes along the boundary of each cell, counter-clockwise."""
        mesh = self._mesh
        nodes = self.cell_nodes_ca[: mesh.n_owned]
        reference = [tuple(pair) for pair in compat.reference_edges(mesh.cell).tolist()]
        corners = compat.tensor_order(mesh.cell)
        columns = []
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            inner = nodes[:, self._edge_positions[reference.index((min(start, end), max(start, end)))]]
            distance = np.linalg.norm(self.points_nx[inner] - self.points_nx[nodes[:, start]][:, None], axis=2)
            columns += [nodes[:, [start]], np.take_along_axis(inner, np.argsort(distance, axis=1), axis=1)]
        sides: Int = np.concatenate(columns, axis=1)
        clockwise = areas(self.points_nx[sides]) < 0.0  # dolfinx may number a cell the other way round
        sides[clockwise] = np.roll(sides[clockwise][:, ::-1], 1, axis=1)  # a vertex stays the first
        return sides
