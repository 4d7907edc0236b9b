"""Outlines of a mesh's regions as straight lines, which other mesh generators can fill."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Pair = tuple[int, int]
Loop = list[tuple[int, bool]]  # runs, each with whether it is followed from its start


@dataclass(frozen=True)
class Face:
    """Connected part of a region: its loops, the outer one first, and the outer polygon (n, 2)."""

    region: int
    loops: list[Loop]
    polygon: Float

    def contains(self, point: Float) -> bool:
        """Whether a point is inside the outer loop."""
        return _inside(self.polygon, point)


@dataclass(frozen=True)
class TracedOutline:
    """Edges that border two regions or the outside, joined to straight runs.

    Attributes:
        runs: vertices of each run from end to end.
        names: names of the edges of each run.
        corners: vertices where runs end.
        faces: connected parts of the regions.
    """

    runs: list[list[int]]
    names: list[tuple[str, ...]]
    corners: set[int]
    faces: list[Face]


@dataclass(frozen=True)
class _Borders:
    """Border edges: end vertices, the regions to their left and right (-1 outside) and their names."""

    ends: dict[int, Pair]
    regions: dict[int, Pair]
    names: dict[int, tuple[str, ...]]
    at: dict[int, list[int]]


def trace_outline(mesh: PolygonMesh) -> TracedOutline:
    """Outlines of the regions; named points on them, corners, junctions and changes of name end a run.

    Raises:
        InputError: edges with a name lie inside a region.
    """
    borders = _borders(mesh)
    points = mesh.points_vx
    named = set(mesh.named_points.values())
    corners = {
        vertex
        for vertex, here in borders.at.items()
        if vertex in named or len(here) != 2 or not _straight(vertex, here, borders, points)
    }
    runs: list[list[int]] = []
    names: list[tuple[str, ...]] = []
    run_of: dict[Pair, tuple[int, bool]] = {}
    seen: set[int] = set()
    for edge in borders.ends:
        if edge in seen:
            continue
        run = _follow(edge, borders, corners, seen)
        for a, b in itertools.pairwise(run):
            run_of[(a, b)] = (len(runs), True)
            run_of[(b, a)] = (len(runs), False)
        runs.append(run)
        names.append(borders.names.get(edge, ()))
    faces: list[Face] = []
    for region in range(len(mesh.region_names)):
        faces += _faces(region, _loops(region, borders, points), run_of, points)
    return TracedOutline(runs, names, corners, faces)


def _borders(mesh: PolygonMesh) -> _Borders:
    edges = mesh.edges
    region_of_side = np.repeat(mesh.region_c, mesh.n_sides_c)
    left, right = np.full((2, len(edges)), -1)
    left[edges.cell_edges[edges.forward]] = region_of_side[edges.forward]
    right[edges.cell_edges[~edges.forward]] = region_of_side[~edges.forward]
    border = np.flatnonzero(left != right).tolist()
    ends = {e: (int(edges.vertices_ev[e, 0]), int(edges.vertices_ev[e, 1])) for e in border}
    at: dict[int, list[int]] = defaultdict(list)
    for e, pair in ends.items():
        for vertex in pair:
            at[vertex].append(e)
    number = {tuple(sorted(pair)): e for e, pair in ends.items()}
    names: dict[int, tuple[str, ...]] = {}
    for name, pairs in mesh.named_edges.items():
        for pair in np.sort(np.asarray(pairs).reshape(-1, 2), axis=1).tolist():
            edge = number.get(tuple(pair))
            if edge is None:
                raise InputError(
                    f"edges named '{name}' lie inside a region: a new mesh of the outlines would lose them"
                )
            names[edge] = (*names.get(edge, ()), name)
    return _Borders(ends, {e: (int(left[e]), int(right[e])) for e in border}, names, at)


def _straight(vertex: int, here: Sequence[int], borders: _Borders, points: Float) -> bool:
    """Whether two edges continue each other: same direction, same regions, same names."""
    first, second = here
    if borders.names.get(first) != borders.names.get(second):
        return False
    if set(borders.regions[first]) != set(borders.regions[second]):
        return False
    a, b = (points[_other(borders.ends[e], vertex)] - points[vertex] for e in here)
    return bool(abs(a[0] * b[1] - a[1] * b[0]) <= 1e-9 * np.hypot(*a) * np.hypot(*b) and a @ b < 0.0)


def _other(pair: Pair, vertex: int) -> int:
    return pair[1] if pair[0] == vertex else pair[0]


def _follow(edge: int, borders: _Borders, corners: set[int], seen: set[int]) -> list[int]:
    """Vertices of the straight run that an edge belongs to."""
    run = list(borders.ends[edge])
    seen.add(edge)
    for _ in range(2):
        while run[-1] not in corners:
            onward = next(e for e in borders.at[run[-1]] if e not in seen)
            seen.add(onward)
            run.append(_other(borders.ends[onward], run[-1]))
        run.reverse()
    return run


def _loops(region: int, borders: _Borders, points: Float) -> list[list[int]]:
    """Closed vertex loops around a region, which lies to their left."""
    onward: dict[int, list[int]] = defaultdict(list)
    for e, (a, b) in borders.ends.items():
        left, right = borders.regions[e]
        if left == region:
            onward[a].append(b)
        if right == region:
            onward[b].append(a)
    loops = []
    while onward:
        start = next(iter(onward))
        loop = [start]
        while True:
            choices = onward[loop[-1]]
            following = choices[0] if len(choices) == 1 else _same_part(loop, choices, points)
            choices.remove(following)
            if not choices:
                del onward[loop[-1]]
            if following == start:
                break
            loop.append(following)
        loops.append(loop)
    return loops


def _same_part(loop: Sequence[int], choices: Sequence[int], points: Float) -> int:
    """Where parts of a region touch in a point, stay with the part that was followed."""
    if len(loop) < 2:
        return choices[0]
    here = points[loop[-1]]
    back = points[loop[-2]] - here

    def turn(vertex: int) -> float:
        ahead = points[vertex] - here
        return (math.atan2(ahead[1], ahead[0]) - math.atan2(back[1], back[0])) % (2.0 * math.pi)

    return max(choices, key=turn)


def _faces(region: int, loops: list[list[int]], run_of: dict[Pair, tuple[int, bool]], points: Float) -> list[Face]:
    """Outer loops run counter-clockwise, holes clockwise; a hole belongs to the smallest outer loop around it."""
    polygons = [points[loop] for loop in loops]
    areas = [_area(polygon) for polygon in polygons]
    outer = [n for n, area in enumerate(areas) if area > 0.0]
    members: dict[int, list[int]] = {n: [n] for n in outer}
    for n, area in enumerate(areas):
        if area < 0.0:
            around = [o for o in outer if areas[o] > -area and _inside(polygons[o], polygons[n].mean(axis=0))]
            members[min(around, key=lambda o: areas[o])].append(n)
    return [Face(region, [_runs_along(loops[n], run_of) for n in part], polygons[o]) for o, part in members.items()]


def _runs_along(loop: Sequence[int], run_of: dict[Pair, tuple[int, bool]]) -> Loop:
    steps = [run_of[pair] for pair in zip(loop, [*loop[1:], loop[0]], strict=True)]
    return [step for n, step in enumerate(steps) if step != steps[n - 1]]


def _area(polygon: Float) -> float:
    following = np.roll(polygon, -1, axis=0)
    return float(0.5 * (polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]).sum())


def _inside(polygon: Float, point: Float) -> bool:
    """Whether a point is inside a polygon, by counting crossings of a ray."""
    following = np.roll(polygon, -1, axis=0)
    above, above_next = polygon[:, 1] > point[1], following[:, 1] > point[1]
    crossing = above != above_next
    a, b = polygon[crossing], following[crossing]
    x = a[:, 0] + (point[1] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((x > point[0]).sum() % 2)
