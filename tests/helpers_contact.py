"""The check of the deformed solids as its definition says it: all cells united, every point against every side."""

from __future__ import annotations

from collections import Counter

import numpy as np
import shapely

from tmc_vem.results.contact.contact import CLOSED, NEAR, ROUNDING, ContactReport
from tmc_vem.system.fields import Fields


def slow_check(fields: Fields, order: int = 2, pieces: int = 8) -> ContactReport:
    """Report on the solids, slowly; sides have equidistant nodes."""
    polygons, places, loops = fields.polygons, {}, []
    names = polygons.region_names
    for c in range(polygons.n_cells):
        if not names[polygons.region_c[c]].startswith("medium"):
            loops.append(_loop(fields, polygons.cell(c), order, pieces, places))
    before, now = (np.array([place[n] for place in places.values()]) for n in (1, 2))
    size = np.ptp(before, axis=0).max()

    cells = [shapely.make_valid(shapely.Polygon(now[loop])) for loop in loops]
    overlap = sum(cell.area for cell in cells) - shapely.union_all(cells).area
    sides = [side for loop in loops for side in zip(loop, np.roll(loop, -1).tolist(), strict=True)]
    counts = Counter(frozenset(side) for side in sides)
    outline = np.array([side for side in sides if counts[frozenset(side)] == 1])
    pieces_now, pieces_before = shapely.linestrings(now[outline]), shapely.linestrings(before[outline])
    body = _bodies(loops)
    own = pieces * max(np.hypot(*(before[a] - before[b])) for a, b in outline)
    depth, fold, gaps = 0.0, 0.0, []
    for v in np.unique(outline).tolist():
        distance = shapely.distance(shapely.Point(now[v]), pieces_now)
        origin = shapely.distance(shapely.Point(before[v]), pieces_before)
        inside = any(v not in loop and cell.contains(shapely.Point(now[v])) for loop, cell in zip(loops, cells))  # noqa: B905
        if inside:
            beyond = np.array([body[a] != body[v] for a, _ in outline]) | (origin > own)
            away = distance[beyond].min(initial=np.inf)
            flank = distance[~beyond & (distance < CLOSED * origin)].min(initial=np.inf)
            if flank < away:
                fold = max(fold, float(flank))
            elif away < np.inf:
                depth = max(depth, float(away))
        closed = (distance < CLOSED * origin) & (distance <= NEAR * size) & (outline != v).all(axis=1)
        if closed.any():
            gaps.append(float(distance[closed].min()))
    return ContactReport(
        overlap if overlap > ROUNDING * size**2 else 0.0, depth, fold, None, len(gaps),
        *((min(gaps), float(np.mean(gaps)), max(gaps)) if gaps else (None, None, None)),
    )  # fmt: skip


def _loop(fields: Fields, nodes: np.ndarray, order: int, pieces: int, places: dict) -> list[int]:
    """Numbers of the points along a cell's sides; new places get one, with both positions."""
    loop = []
    positions = [x[nodes] for x in (fields.polygons.points_nx, fields.polygons.points_nx + fields.displacement_ni)]
    t, s = np.linspace(0.0, 1.0, order + 1), np.arange(pieces) / pieces
    for first in range(0, len(nodes), order):
        along = [(first + n) % len(nodes) for n in range(order + 1)]
        before, now = (np.column_stack([np.polyval(c, s) for c in np.polyfit(t, x[along], order).T]) for x in positions)
        before[0], now[0] = (x[first] for x in positions)
        for key, *at in zip(map(tuple, np.round(before * 1e6).astype(int).tolist()), before, now, strict=True):
            loop.append(places.setdefault(key, (len(places), *at))[0])
    return loop


def _bodies(loops: list[list[int]]) -> dict[int, int]:
    """Body of every point: cells that share one are of the same."""
    groups: list[set[int]] = []
    for loop in loops:
        joined = set(loop)
        for group in [group for group in groups if group & joined]:
            joined |= group
            groups.remove(group)
        groups.append(joined)
    return {v: n for n, group in enumerate(groups) for v in group}
