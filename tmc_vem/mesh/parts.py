"""Parts of meshes and meshes with other names: everything a mesh carries comes along."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]


def submesh(mesh: PolygonMesh, cells: Int | Sequence[int] | NDArray[np.bool_]) -> PolygonMesh:
    """Mesh of some cells with the vertices they use; regions, named points and named edges that remain come along.

    Args:
        mesh: the whole mesh.
        cells: numbers of cells, or a mask over all cells.

    Raises:
        InputError: no cell is left.
    """
    chosen = np.asarray(cells)
    chosen = np.flatnonzero(chosen) if chosen.dtype == np.bool_ else chosen.astype(np.int64)
    if not len(chosen):
        raise InputError("a part of a mesh needs at least one cell, none was chosen")
    sizes = mesh.n_sides_c[chosen]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    entries = np.repeat(mesh.cell_offsets[chosen] - offsets[:-1], sizes) + np.arange(offsets[-1])
    loops = mesh.cell_vertices[entries]
    used, local = np.unique(loops, return_inverse=True)
    names = np.unique(mesh.region_c[chosen])
    number = np.full(mesh.n_vertices, -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    sides = _side_keys(local.astype(np.int64), offsets, len(used))
    named_edges = {}
    for name, pairs in mesh.named_edges.items():
        moved = number[pairs]
        keys = np.sort(moved, axis=1) @ np.array([len(used), 1])
        named_edges[name] = moved[(moved >= 0).all(axis=1) & np.isin(keys, sides)]
    return PolygonMesh(
        points_vx=mesh.points_vx[used],
        cell_offsets=offsets,
        cell_vertices=local,
        region_c=np.searchsorted(names, mesh.region_c[chosen]),
        region_names=tuple(mesh.region_names[n] for n in names),
        named_points={name: int(number[v]) for name, v in mesh.named_points.items() if number[v] >= 0},
        named_edges={name: pairs for name, pairs in named_edges.items() if len(pairs)},
        cell_data={name: values[chosen] for name, values in mesh.cell_data.items()},
    )


def with_names(
    mesh: PolygonMesh,
    points: Mapping[str, tuple[float, float]] | None = None,
    lines: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] | None = None,
) -> PolygonMesh:
    """The mesh with more named points, and with the edges along straight lines named.

    Args:
        mesh: any mesh.
        points: name and coordinates of a vertex.
        lines: name and the two ends of a straight line; all edges of the mesh on it get the name.

    Raises:
        InputError: there is no vertex at a point, or no edge on a line; the message has the name.
    """
    named_points, named_edges = dict(mesh.named_points), dict(mesh.named_edges)
    for name, position in (points or {}).items():
        try:
            named_points[name] = mesh.find_vertex(*position)
        except InputError as error:
            raise InputError(f"named point '{name}': {error}") from None
    tolerance = 1e-9 * float(np.ptp(mesh.points_vx, axis=0).max())
    for name, (start, end) in (lines or {}).items():
        origin, direction = np.array(start), np.array(end) - np.array(start)
        length = float(np.hypot(*direction))
        if length <= tolerance:
            raise InputError(f"named edges '{name}': the line from {start} to {end} has no length")
        tangent = direction / length
        arm = mesh.points_vx - origin
        along, off = arm @ tangent, arm @ np.array([-tangent[1], tangent[0]])
        on_line = (np.abs(off) <= tolerance) & (along >= -tolerance) & (along <= length + tolerance)
        pairs = mesh.edges.vertices_ev[on_line[mesh.edges.vertices_ev].all(axis=1)]
        if not len(pairs):
            raise InputError(f"named edges '{name}': no edge of the mesh lies on the line from {start} to {end}")
        named_edges[name] = pairs
    return replace(mesh, named_points=named_points, named_edges=named_edges, validate=False)


def _side_keys(loops: Int, offsets: Int, n_vertices: int) -> Int:
    """Sorted end vertices of every side as one number."""
    following = np.roll(loops, -1)
    following[offsets[1:] - 1] = loops[offsets[:-1]]
    keys: Int = np.minimum(loops, following) * n_vertices + np.maximum(loops, following)
    return keys
