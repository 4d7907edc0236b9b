"""Run under mpirun: every cell, vertex, name and edge of a distributed mesh is that of the original."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_mesh import hanging, non_convex, voronoi

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.problems import Box

comm = MPI.COMM_WORLD


def decorated(mesh: PolygonMesh) -> PolygonMesh:
    """With regions, named points and named edges everywhere."""
    rng = np.random.default_rng(0)
    edges = mesh.edges.vertices_ev
    return PolygonMesh.from_cells(
        mesh.points_vx,
        list(mesh.cells()),
        rng.integers(0, 3, mesh.n_cells),
        ("a", "b", "c"),
        {f"p{v}": v for v in range(mesh.n_vertices)},
        {"all": edges, "reversed": edges[::2, ::-1], "none": np.empty((0, 2), dtype=int)},
    )


def check(mesh: PolygonMesh) -> dict[str, int]:
    part = distribute(comm, lambda: mesh)
    local, edges = part.mesh, part.edges
    assert (part.n_cells_global, part.n_vertices_global) == (mesh.n_cells, mesh.n_vertices)
    assert local.region_names == mesh.region_names
    assert np.array_equal(local.points_vx, mesh.points_vx[part.vertex_ids])  # to the last bit
    for c in range(local.n_cells):
        original = mesh.cell(part.cell_ids[c])
        assert np.array_equal(part.vertex_ids[local.cell(c)], original)  # same vertices, same first one, same direction
        assert local.region_c[c] == mesh.region_c[part.cell_ids[c]]
        assert part.plex.getConeSize(part.cell_points[c]) == len(original)
        loop = local.cell(c)
        sides = slice(local.cell_offsets[c], local.cell_offsets[c + 1])
        for s, (e, forward) in enumerate(zip(edges.cell_edges[sides], edges.forward[sides], strict=True)):
            ends = edges.vertices_ev[e] if forward else edges.vertices_ev[e][::-1]
            assert ends.tolist() == [loop[s], loop[(s + 1) % len(loop)]]
    # an edge runs in the same direction on all ranks: from its smaller to its larger vertex of the whole mesh
    assert (np.diff(part.vertex_ids[edges.vertices_ev], axis=1) > 0).all()
    # each cell on exactly one rank, each vertex and each edge on at least one
    cells = np.concatenate(comm.allgather(part.cell_ids))
    assert sorted(cells.tolist()) == list(range(mesh.n_cells))
    vertices = np.concatenate(comm.allgather(part.vertex_ids))
    assert set(vertices.tolist()) == set(range(mesh.n_vertices))
    for name, vertex in mesh.named_points.items():
        here = vertex in set(part.vertex_ids.tolist())
        assert (name in local.named_points) == here
        if here:
            assert part.vertex_ids[local.named_points[name]] == vertex
    for name, pairs in mesh.named_edges.items():
        assert local.named_edges[name].shape[1] == 2
        mine = part.vertex_ids[local.named_edges[name]]
        found = {tuple(sorted(pair)) for some in comm.allgather(mine.tolist()) for pair in some}
        assert found == {tuple(sorted(pair)) for pair in np.asarray(pairs).tolist()}
        present = {tuple(sorted(pair)) for pair in part.vertex_ids[edges.vertices_ev].tolist()}
        assert {tuple(sorted(pair)) for pair in mine.tolist()} == found & present
    return {"most": int(max(comm.allgather(local.n_cells))), "shared": len(vertices) - mesh.n_vertices}


meshes = {
    "voronoi": decorated(voronoi(40)),
    "hanging": decorated(hanging(4, 0.03)),
    "non_convex": decorated(non_convex()),
    "box": Box(cells=(20, 5)).make_mesh(),
    "fewer_cells_than_ranks": decorated(PolygonMesh.from_cells([(0, 0), (1, 0), (0, 1)], [[0, 1, 2]])),
}
report = {name: check(mesh) for name, mesh in meshes.items()}
if comm.rank == 0:
    print(json.dumps(report))
