"""Coarsening: families of cells become the cell again that they were cut from.

A family is joined if all its cells are there and marked. What is left of the vertices that refinement made is dropped
where no cell ends at them any more, so that joining everything gives the first mesh back, one level a call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.make.change import VALIDATED, CellTree, MeshChange, check_limits, marked_cells
from tmc_vem.mesh.make.loops import Loops, joined
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.validate import is_simple
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def coarsened(
    mesh: PolygonMesh,
    tree: CellTree,
    marked: Int | Sequence[int] | NDArray[np.bool_],
    *,
    max_hanging: int = 1,
    flat: float = 0.0,
) -> MeshChange:
    """Mesh with complete families of marked cells joined to what they were cut from, one level of them.

    A family stays as it is if a side of the joined cell had too many hanging nodes, if a named point or edge lies
    within it, or if its cells are in several regions. Of cell data that differ, the mean by areas is taken. Named
    points on its sides stay, as does a vertex that divides a named edge from one without that name. Vertices that were
    moved onto a curve are dropped when both sides are coarse.

    Args:
        mesh: a mesh that :func:`tmc_vem.mesh.make.refine.refined` made, or this function.
        tree: the one that came with it.
        marked: numbers of cells, or a mask over all cells.
        max_hanging: largest number of hanging nodes that coarsening may leave on a side.
        flat: as for refinement: vertices made by it, where the boundary turns by less (degrees), hang.

    Raises:
        InputError: a number is no cell, ``max_hanging`` is below 1, ``flat`` is out of range, or the tree is that of
            another mesh.
    """
    check_limits(max_hanging, flat)
    tree.check(mesh)
    families = _complete(mesh, tree, marked_cells(mesh, marked))
    rims = _rims(mesh, tree, families)
    kept_v = _needed_for_names(mesh)
    while True:
        joined_c = _numbers_of(families, len(tree.size_f))[tree.family_c]
        alive = ~_inside(mesh, joined_c)
        n_edges_v = np.bincount(mesh.edges.vertices_ev[alive].ravel(), minlength=mesh.n_vertices)
        drop_v = tree.born_v & ~kept_v & (n_edges_v == 2)
        outer = rims.kept(~drop_v[rims.vertices])
        bad = outer.overloaded(mesh.points_vx, tree.born_v, flat, max_hanging) | _broken(mesh.points_vx, outer)
        if not bad.any():
            break
        families, rims = families[~bad], rims.chosen(np.flatnonzero(~bad))
    if not (len(families) or drop_v.any()):
        return MeshChange(mesh, mesh.points_vx, np.arange(mesh.n_cells), tree)
    return _without(mesh, tree, families, outer, drop_v, alive)


def _complete(mesh: PolygonMesh, tree: CellTree, mask: Bool) -> Int:
    """Families all of whose cells are there and marked, in one region, without anything inside that has a name."""
    n = len(tree.size_f)
    in_one = tree.family_c >= 0
    family, region = tree.family_c[in_one], mesh.region_c[in_one]
    good: Bool = np.bincount(family[mask[in_one]], minlength=n) == tree.size_f
    low, high = np.full(n, len(mesh.region_names)), np.full(n, -1)
    np.minimum.at(low, family, region)
    np.maximum.at(high, family, region)
    good &= low == high

    inside = _inside(mesh, tree.family_c)
    left, _ = mesh.cells_of_edges
    for pairs in mesh.named_edges.values():
        edges = _edge_numbers(mesh, pairs)
        good[tree.family_c[left[edges[inside[edges]]]]] = False
    ends = mesh.edges.vertices_ev
    hidden = np.bincount(ends[~inside].ravel(), minlength=mesh.n_vertices) == 0
    hidden_named = np.zeros(mesh.n_vertices, dtype=bool)
    hidden_named[list(mesh.named_points.values())] = True
    at = (hidden & hidden_named)[mesh.cell_vertices]
    good[tree.family_c[np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)[at]]] = False
    return np.flatnonzero(good)


def _inside(mesh: PolygonMesh, group_c: Int) -> Bool:
    """(n_edges,) edges between two cells of one group, -1 for none."""
    left, right = mesh.cells_of_edges
    inside: Bool = (left >= 0) & (right >= 0) & (group_c[left] == group_c[right]) & (group_c[left] >= 0)
    return inside


def _numbers_of(chosen: Int, n: int) -> Int:
    """(n + 1,) place of each number among the chosen ones, -1 for others and for number -1, the last."""
    place = np.full(n + 1, -1)
    place[chosen] = np.arange(len(chosen))
    return place


def _rims(mesh: PolygonMesh, tree: CellTree, families: Int) -> Loops:
    """The outlines of families, from the first vertex of their parent on.

    Raises:
        InputError: they are no closed lines, as the tree is that of another mesh.
    """
    if not len(families):
        return Loops(np.zeros(1, dtype=np.int64), np.empty(0, dtype=np.int64))
    loops, n = Loops.of(mesh), mesh.n_vertices
    place_c = _numbers_of(families, len(tree.size_f))[tree.family_c]
    outer = ~_inside(mesh, place_c)[mesh.edges.cell_edges] & (place_c >= 0)[loops.loop_of_entry]
    sides = np.flatnonzero(outer)
    key = place_c[loops.loop_of_entry[sides]] * n + loops.vertices[sides]
    order = np.argsort(key)
    key, end = key[order], loops.vertices[loops.following[sides[order]]]
    following = np.minimum(np.searchsorted(key, key // n * n + end), len(key) - 1)
    first = np.minimum(np.searchsorted(key, np.arange(len(families)) * n + tree.first_f[families]), len(key) - 1)
    closed = (key[following] % n == end).all() and (key[first] % n == tree.first_f[families]).all()
    at, rows, columns = first, [first], [np.arange(len(families))]
    left = columns[0]
    while closed and len(left):
        at = following[at]
        going = at != first[left]
        at, left = at[going], left[going]
        rows.append(at)
        columns.append(left)
        closed = len(rows) <= len(key) + 1
    found, family = np.concatenate(rows), np.concatenate(columns)
    if not closed or len(found) != len(key):
        raise InputError("the tree does not go with the mesh: a family is not bounded by one closed line")
    around = np.argsort(family, kind="stable")
    return Loops.of_sizes(np.bincount(family, minlength=len(families)), key[found[around]] % n)


def _needed_for_names(mesh: PolygonMesh) -> Bool:
    """(n_vertices,) vertices with a name, and those where named edges end."""
    kept = np.zeros(mesh.n_vertices, dtype=bool)
    kept[list(mesh.named_points.values())] = True
    for pairs in mesh.named_edges.values():
        ends = mesh.edges.vertices_ev[np.unique(_edge_numbers(mesh, pairs))]
        kept |= np.bincount(ends.ravel(), minlength=mesh.n_vertices) % 2 == 1
    return kept


def _edge_numbers(mesh: PolygonMesh, pairs: Int) -> Int:
    ends, n = mesh.edges.vertices_ev, mesh.n_vertices
    low, high = np.sort(pairs, axis=1).T
    edges: Int = np.searchsorted(ends[:, 0] * n + ends[:, 1], low * n + high)
    return edges


def _broken(points: Float, loops: Loops) -> Bool:
    """Polygons that cross themselves, as vertices on a curve may make them."""
    broken = np.zeros(len(loops), dtype=bool)
    for which, vertices in loops.by_size():
        polygons = points[vertices]
        for n in np.flatnonzero(~star_shaped_about(polygons, centroids(polygons))).tolist():
            broken[which[n]] = not is_simple(polygons[n])
    return broken


def _without(mesh: PolygonMesh, tree: CellTree, families: Int, outer: Loops, drop_v: Bool, alive: Bool) -> MeshChange:
    """The mesh with some families joined to the given loops, and without some vertices."""
    place_c = _numbers_of(families, len(tree.size_f))[tree.family_c]
    members = np.flatnonzero(place_c >= 0)
    first = members[np.unique(place_c[members], return_index=True)[1]]
    rest = np.flatnonzero(place_c < 0)
    loops = Loops.of(mesh)
    origin = np.concatenate([rest, first])
    order = np.argsort(origin)
    together = joined([loops.kept(~drop_v[loops.vertices]).chosen(rest), outer]).chosen(order)
    origin = origin[order]
    used = np.unique(together.vertices)
    number = np.full(mesh.n_vertices, -1)
    number[used] = np.arange(len(used))
    new = PolygonMesh(
        mesh.points_vx[used], together.offsets, number[together.vertices], mesh.region_c[origin], mesh.region_names,
        {name: int(number[v]) for name, v in mesh.named_points.items()},
        {name: number[pairs] for name, pairs in _whole_edges(mesh, drop_v, alive).items()},
        {name: _means(mesh, values, place_c, first)[origin] for name, values in mesh.cell_data.items()},
        validate=len(origin) <= VALIDATED,
    )  # fmt: skip
    return MeshChange(new, new.points_vx, origin, _shrunk(tree, families, place_c, origin, used, number))


def _whole_edges(mesh: PolygonMesh, drop_v: Bool, alive: Bool) -> dict[str, Int]:
    """Named edges whose pieces are joined where a vertex is dropped."""
    ends = mesh.edges.vertices_ev[alive]
    beside: dict[int, list[int]] = {int(v): [] for v in np.flatnonzero(drop_v)}
    for a, b in ends[drop_v[ends].any(axis=1)].tolist():
        for v, other in ((a, b), (b, a)):
            if drop_v[v]:
                beside[v].append(other)

    def beyond(v: int, last: int) -> int:
        """The first vertex that stays, from one on away from another."""
        while v in beside:
            a, b = beside[v]
            v, last = (b if a == last else a), v
        return v

    named = {}
    for name, pairs in mesh.named_edges.items():
        cut = drop_v[pairs].any(axis=1) if len(pairs) else np.empty(0, dtype=bool)
        whole: dict[tuple[int, int], list[int]] = {}
        for row, (a, b) in enumerate(pairs.tolist()):
            if not cut[row]:
                whole[row, -1] = [a, b]
                continue
            a, b = beyond(a, b), beyond(b, a)
            whole.setdefault((-1 - min(a, b), max(a, b)), [a, b])
        named[name] = np.array(list(whole.values()), dtype=np.int64).reshape(-1, 2)
    return named


def _means(mesh: PolygonMesh, values: Float, place_c: Int, first: Int) -> Float:
    """Cell data with the mean of each family in its first cell, by areas; exactly the value that all have."""
    members = np.flatnonzero(place_c >= 0)
    place = place_c[members]
    if (values[members] == values[first[place]]).all():
        return values
    area = centroids_and_areas(mesh)[1]
    differs = np.bincount(place, values[members] != values[first[place]], len(first)) > 0
    mean = np.bincount(place, (area * values)[members]) / np.bincount(place, area[members])
    result = values.copy()
    result[first[differs]] = mean[differs]
    return result


def _shrunk(tree: CellTree, families: Int, place_c: Int, origin: Int, used: Int, number: Int) -> CellTree:
    """The tree without some families."""
    left = np.setdiff1d(np.arange(len(tree.size_f)), families)
    place_f = _numbers_of(left, len(tree.size_f))
    whole = place_c[origin] >= 0
    above = np.append(tree.above_f, -1)
    family = tree.family_c[origin]
    return replace(
        tree,
        family_c=place_f[np.where(whole, above[family], family)],
        level_c=tree.level_c[origin] - whole,
        born_v=tree.born_v[used],
        size_f=tree.size_f[left],
        above_f=place_f[tree.above_f[left]],
        first_f=number[tree.first_f[left]],
    )
