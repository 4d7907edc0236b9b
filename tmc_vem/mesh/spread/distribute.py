"""Distribute a polygon mesh over MPI ranks with PETSc's DMPlex.

The root rank holds the mesh; DMPlex partitions it, moves the cells, and later numbers the degrees of freedom. PETSc has
no cell type for a general polygon: marking every cell as a "ghost cell of a finite volume method" is the one that its
distribution carries through unharmed (3.18). What belongs to cells and vertices (regions, coordinates, original
numbers) travels along as fields. Work, not cells, is spread evenly: a cell counts the square of its number of sides,
times the cost of its region. The root drops the whole mesh as soon as it is spread.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import Edges, PolygonMesh
from tmc_vem.mesh.spread import partition
from tmc_vem.mesh.spread.plex import cone_sizes, cones, set_cell_types, set_cone_sizes
from tmc_vem.support.distributed import Comm
from tmc_vem.support.parallel import from_root, on_root
from tmc_vem.support.petsc import PETSc

Int = NDArray[np.int64]


@dataclass(frozen=True)
class DistributedMesh:
    """The cells of one rank and the DMPlex that knows how they hang together with those of other ranks.

    Attributes:
        comm: communicator of all ranks.
        mesh: this rank's cells with the vertices they use; named points and edges are those present here.
        edges: this rank's edges, in their DMPlex direction, which is the same on all ranks that share them.
        plex: the distributed DMPlex.
        cell_points, vertex_points, edge_points: DMPlex points of the local cells, vertices and edges.
        cell_ids, vertex_ids: numbers in the mesh as it was before distribution.
        n_cells_global, n_vertices_global: sizes of the whole mesh.
        cost_c: expected work of each local cell, which the partitioner has balanced.
    """

    comm: Comm
    mesh: PolygonMesh
    edges: Edges
    plex: Any
    cell_points: Int
    vertex_points: Int
    edge_points: Int
    cell_ids: Int
    vertex_ids: Int
    n_cells_global: int
    n_vertices_global: int
    cost_c: NDArray[np.float64]


def distribute(
    comm: Comm, make_mesh: Callable[[], PolygonMesh], costs: Mapping[str, float] | None = None
) -> DistributedMesh:
    """Make the mesh on the root rank and distribute its cells, each to exactly one rank.

    Args:
        comm: communicator; with one rank the same code runs.
        make_mesh: called on rank 0 only.
        costs: work of a cell by region, relative to the others, 1 by default.

    Raises:
        Exception: whatever ``make_mesh`` raises, on every rank.
    """
    mesh = on_root(comm, make_mesh)
    plex, cell_field, vertex_field = _serial_plex(comm, mesh)
    key = b""
    if comm.size > 1:
        weight_c = None if mesh is None else np.rint(10.0 * cell_costs(mesh, costs or {})).astype(np.int64)
        key = partition.key_of(comm, mesh, weight_c)
        plex.setSection(_weights(comm, plex, weight_c))
        partition.use_again(comm, plex, key)
    migration = plex.distribute()
    (region_names, named_points, named_edges, data), sizes = from_root(comm, partial(_names_and_sizes, mesh))
    cells = _distribute_field(comm, plex, migration, 0, cell_field, 2 + len(data))
    vertices = _distribute_field(comm, plex, migration, len(cell_field), vertex_field, 3)
    if comm.size > 1:
        partition.remember(comm, key, cells[:, 1].astype(np.int64))
    n_cells_global, n_vertices_global = sizes
    del mesh, cell_field, vertex_field

    cell_points = np.arange(*plex.getHeightStratum(0))
    edge_points = np.arange(*plex.getDepthStratum(1))
    vertex_points = np.arange(*plex.getDepthStratum(0))
    vertex_ids = vertices[:, 2].astype(np.int64)
    offsets, cell_edges, forward, edges_ev, cell_vertices = _read_cones(plex, cell_points, edge_points, vertex_points)
    local = PolygonMesh(
        points_vx=vertices[:, :2],
        cell_offsets=offsets,
        cell_vertices=cell_vertices,
        region_c=cells[:, 0].astype(np.int64),
        region_names=region_names,
        named_points=_local_points(named_points, vertex_ids),
        named_edges=_local_edges(named_edges, vertex_ids, edges_ev),
        cell_data={name: cells[:, 2 + n] for n, name in enumerate(data)},
        validate=False,  # the whole mesh was validated on the root
    )
    counts = np.bincount(cell_edges, minlength=len(edges_ev))
    return DistributedMesh(
        comm, local, Edges(edges_ev, cell_edges, forward, counts), plex, cell_points, vertex_points, edge_points,
        cells[:, 1].astype(np.int64), vertex_ids, n_cells_global, n_vertices_global, cell_costs(local, costs or {}),
    )  # fmt: skip


def cell_costs(mesh: PolygonMesh, costs: Mapping[str, float]) -> NDArray[np.float64]:
    """Expected work (n_cells,) of each cell: the square of its number of sides times the cost of its region."""
    of_region = np.array([costs.get(name, 1.0) for name in mesh.region_names])
    work: NDArray[np.float64] = mesh.n_sides_c**2 * of_region[mesh.region_c]
    return work


def _names_and_sizes(
    mesh: PolygonMesh | None,
) -> tuple[tuple[tuple[str, ...], dict[str, int], dict[str, Int], tuple[str, ...]], tuple[int, int]]:
    """Names of regions, points, edges and cell data, and the numbers of cells and vertices, of the mesh on rank 0."""
    assert mesh is not None
    names = mesh.region_names, dict(mesh.named_points), dict(mesh.named_edges), tuple(mesh.cell_data)
    return names, (mesh.n_cells, mesh.n_vertices)


def _weights(comm: Comm, plex: Any, weight_c: Int | None) -> Any:
    """Section whose numbers of degrees of freedom the partitioner takes for the weights of cells."""
    section = PETSc.Section().create(comm=comm)
    section.setChart(*plex.getChart())
    if weight_c is not None:
        for cell, weight in enumerate(weight_c.tolist()):
            section.setDof(cell, weight)
    section.setUp()
    return section


def _serial_plex(comm: Comm, mesh: PolygonMesh | None) -> tuple[Any, NDArray[Any], NDArray[Any]]:
    """DMPlex with all points on rank 0, and per point its cell data (n, 2 or more) or vertex data (n, 3)."""
    plex = PETSc.DMPlex().create(comm=comm)
    plex.setDimension(2)
    if mesh is None:
        plex.createLabel("celltype")
        plex.setChart(0, 0)
        plex.symmetrize()
        plex.stratify()
        return plex, np.empty((0, 2)), np.empty((0, 3))

    edges, n_cells, n_vertices = mesh.edges, mesh.n_cells, mesh.n_vertices
    first_vertex, first_edge = n_cells, n_cells + n_vertices
    end = first_edge + len(edges)
    plex.setChart(0, end)
    set_cone_sizes(plex, 0, mesh.n_sides_c.tolist())
    set_cone_sizes(plex, first_edge, [2] * len(edges))
    plex.setUp()
    n_sides = len(edges.cell_edges)
    cone, orientation = cones(plex, n_sides + 2 * len(edges))
    cone[:n_sides] = edges.cell_edges + first_edge
    orientation[:n_sides] = np.where(edges.forward, 0, -1)
    cone[n_sides:] = edges.vertices_ev.ravel() + first_vertex
    orientation[n_sides:] = 0
    plex.symmetrize()
    plex.stratify()
    kinds = PETSc.DM.PolytopeType
    set_cell_types(
        plex,
        [(kinds.FV_GHOST, 0, n_cells), (kinds.POINT, first_vertex, first_edge), (kinds.SEGMENT, first_edge, end)],
    )
    cell_field = np.column_stack([mesh.region_c, np.arange(n_cells), *mesh.cell_data.values()]).astype(float)
    vertex_field = np.column_stack([mesh.points_vx, np.arange(n_vertices)])
    return plex, cell_field, vertex_field


def _distribute_field(
    comm: Comm, plex: Any, migration: Any, first_point: int, values: NDArray[np.float64], width: int
) -> NDArray[np.float64]:
    """Move rank 0's values (n, width) of consecutive points of the serial DMPlex to where the points went."""
    if migration is None:  # one rank: nothing moved
        return values
    section = PETSc.Section().create(comm=comm)
    section.setChart(first_point, first_point + len(values))
    for point in range(first_point, first_point + len(values)):
        section.setDof(point, width)
    section.setUp()
    vector = PETSc.Vec().createWithArray(values.ravel().copy(), comm=PETSc.COMM_SELF)
    _, moved = plex.distributeField(migration, section, vector)
    # a section numbers its points in the order of the chart
    here: NDArray[np.float64] = moved.getArray(readonly=True).reshape(-1, width).copy()
    return here


def _read_cones(
    plex: Any, cell_points: Int, edge_points: Int, vertex_points: Int
) -> tuple[Int, Int, NDArray[np.bool_], Int, Int]:
    """CSR offsets, edges and directions of the local cells, ends of the edges, vertices of the cells."""
    first_edge, first_vertex = (points[0] if len(points) else 0 for points in (edge_points, vertex_points))
    offsets = np.concatenate([[0], np.cumsum(cone_sizes(plex, cell_points))]).astype(np.int64)
    n_sides = int(offsets[-1])
    # cells come first in the chart, then vertices, which have no cone, then edges
    cone, orientation = cones(plex, n_sides + 2 * len(edge_points))
    cell_edges = cone[:n_sides].astype(np.int64) - first_edge
    forward = orientation[:n_sides] >= 0
    edges_ev = cone[n_sides:].reshape(-1, 2).astype(np.int64) - first_vertex
    return offsets, cell_edges, forward, edges_ev, edges_ev[cell_edges, np.where(forward, 0, 1)]


def _local_points(named_points: Mapping[str, int], vertex_ids: Int) -> dict[str, int]:
    if not named_points:
        return {}
    local = {int(v): n for n, v in enumerate(vertex_ids.tolist())}
    return {name: local[vertex] for name, vertex in named_points.items() if vertex in local}


def _local_edges(named_edges: Mapping[str, Int], vertex_ids: Int, edges_ev: Int) -> dict[str, Int]:
    """Named edges whose edge (not only its end vertices) is on this rank, in local vertices."""
    if not named_edges:
        return {}
    here = _edge_keys(vertex_ids[edges_ev])
    order = np.argsort(here)
    found = {}
    for name, pairs in named_edges.items():
        keys = _edge_keys(np.asarray(pairs).reshape(-1, 2))
        place = np.searchsorted(here, keys, sorter=order)
        at = order[place[place < len(order)]]
        found[name] = edges_ev[at[here[at] == keys[place < len(order)]]]
    return found


def _edge_keys(pairs: Int) -> Int:
    """One number (n,) for every pair (n, 2) of vertices, whatever their order."""
    keys: Int = (pairs.min(axis=1) << 32) + pairs.max(axis=1)
    return keys
