"""Weld meshes that were made independently into one conforming polygon mesh by inserting hanging nodes.

Neither side's cells move: a vertex of one mesh that lies on a side of the other becomes a vertex of the cell there.
This is how polygons in the solid meet quadrilaterals of any density in the medium (figures 3 and 7 of Xu & Wriggers,
CMAME 450 (2026) 118611). A polygon does not mind vertices in the middle of a straight side; only its projection may
need a higher degree l, which the spectral test finds.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Vertices closer than this fraction of the mesh's size are one, and lie on a side if they are that close to it.
COINCIDE = 1e-9


def weld(meshes: Sequence[PolygonMesh], *, off_side: float = 0.0) -> PolygonMesh:
    """One conforming mesh of several meshes that fit together without overlap.

    Args:
        meshes: the parts; regions with the same name become one, named points and edges come along.
        off_side: how far (length) a vertex may be from the other mesh's side to be inserted in it. 0, the default, asks
            for straight interfaces that agree to rounding; along a curve that two meshes follow with different chords,
            give a bit more than the largest distance of the chords, and both sides then share all vertices.

    Raises:
        InputError: there is nothing to weld, a name means different points in two parts, or the result is no valid mesh
            (the message names the cell), for example because the parts overlap.
    """
    if not meshes:
        raise InputError("weld needs at least one mesh")
    points, label, starts = _merge_vertices(meshes)
    region_names = tuple(dict.fromkeys(name for mesh in meshes for name in mesh.region_names))
    start = np.concatenate([label[mesh.cell_vertices + s] for mesh, s in zip(meshes, starts, strict=True)])
    sizes = np.concatenate([mesh.n_sides_c for mesh in meshes])
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    region_c = np.concatenate(
        [np.array([region_names.index(n) for n in mesh.region_names])[mesh.region_c] for mesh in meshes]
    )
    named_points: dict[str, int] = {}
    for mesh, first in zip(meshes, starts, strict=True):
        for name, vertex in mesh.named_points.items():
            number = int(label[vertex + first])
            if named_points.setdefault(name, number) != number:
                a, b = points[named_points[name]], points[number]
                raise InputError(
                    f"named point '{name}' is at ({a[0]:g}, {a[1]:g}) in one mesh and at ({b[0]:g}, {b[1]:g}) in "
                    "another: rename one of them"
                )

    insertions = _hanging_nodes(points, start, offsets, max(off_side, _tolerance(points)))
    loops, new_offsets = _insert(start, offsets, insertions)
    named_edges: dict[str, Int] = {}
    for mesh, first in zip(meshes, starts, strict=True):
        for name, pairs in mesh.named_edges.items():
            split = _split_edges(label[pairs + first], start, offsets, insertions)
            known = named_edges.get(name, np.empty((0, 2), dtype=np.int64))
            named_edges[name] = np.unique(np.sort(np.concatenate([known, split]), axis=1), axis=0)
    return PolygonMesh(points, new_offsets, loops, region_c, region_names, named_points, named_edges)


def _tolerance(points: Float) -> float:
    return COINCIDE * float(np.ptp(points, axis=0).max())


def _merge_vertices(meshes: Sequence[PolygonMesh]) -> tuple[Float, Int, Int]:
    """Points without duplicates, the new number of every old vertex, and where each mesh's vertices start."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    stacked = np.concatenate([mesh.points_vx for mesh in meshes])
    starts = np.concatenate([[0], np.cumsum([mesh.n_vertices for mesh in meshes])])[:-1]
    pairs = cKDTree(stacked).query_pairs(_tolerance(stacked), output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(stacked),) * 2)
    _, component = connected_components(graph, directed=False)
    _, first, label = np.unique(component, return_index=True, return_inverse=True)
    return stacked[first], label.astype(np.int64), starts.astype(np.int64)


def _hanging_nodes(points: Float, start: Int, offsets: Int, tolerance: float) -> dict[int, list[int]]:
    """For sides on no other cell's side: the vertices strictly inside them, in order along the side."""
    import shapely

    end = np.roll(start, -1)
    end[offsets[1:] - 1] = start[offsets[:-1]]
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, inverse, counts = np.unique(low * len(points) + high, return_inverse=True, return_counts=True)
    free = np.flatnonzero(counts[inverse] == 1)  # sides on the boundary of the unwelded mesh
    candidates = np.unique(np.concatenate([start[free], end[free]]))
    sides = shapely.linestrings(points[np.stack([start[free], end[free]], axis=1)])
    tree = shapely.STRtree(sides)
    which, side = tree.query(shapely.points(points[candidates]), predicate="dwithin", distance=tolerance)
    vertex, s = candidates[which], free[side]
    a, b = points[start[s]], points[end[s]]
    along = np.einsum("nx,nx->n", points[vertex] - a, b - a) / np.einsum("nx,nx->n", b - a, b - a)
    inside = (vertex != start[s]) & (vertex != end[s]) & (along > 0.0) & (along < 1.0)
    found: dict[int, list[int]] = {}
    order = np.lexsort([along[inside], s[inside]])
    for side_number, v in zip(s[inside][order].tolist(), vertex[inside][order].tolist(), strict=True):
        found.setdefault(side_number, []).append(v)
    return found


def _insert(start: Int, offsets: Int, insertions: dict[int, list[int]]) -> tuple[Int, Int]:
    """Cell vertices and offsets with the hanging nodes after the first vertex of their side."""
    if not insertions:
        return start, offsets
    where = np.array([side + 1 for side, nodes in insertions.items() for _ in nodes])
    what = np.array([node for nodes in insertions.values() for node in nodes])
    added = np.zeros(len(start) + 1, dtype=np.int64)
    np.add.at(added, where, 1)
    return np.insert(start, where, what), offsets + np.cumsum(added)[offsets]


def _split_edges(pairs: Int, start: Int, offsets: Int, insertions: dict[int, list[int]]) -> Int:
    """Edges (n, 2) with those that got hanging nodes replaced by their pieces."""
    chains: dict[tuple[int, int], list[int]] = {}
    end = np.roll(start, -1)
    end[offsets[1:] - 1] = start[offsets[:-1]]
    for side, nodes in insertions.items():
        a, b = int(start[side]), int(end[side])
        chains[min(a, b), max(a, b)] = [a, *nodes, b]
    pieces = []
    for a, b in pairs.tolist():
        chain = chains.get((min(a, b), max(a, b)), [a, b])
        pieces += list(itertools.pairwise(chain))
    return np.array(pieces, dtype=np.int64).reshape(-1, 2)
