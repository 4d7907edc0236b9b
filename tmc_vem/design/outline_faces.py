"""Smoothed outlines of a design as regions that mesh makers take: every border a curve that both its sides share."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.outline import polygons_of
from tmc_vem.design.outline_domain import STRAIGHT, Place
from tmc_vem.design.outline_smooth import Smoother
from tmc_vem.mesh.make.outline import Entry, Region
from tmc_vem.mesh.make.polyline import Polyline

Float = NDArray[np.float64]

# A curve is a straight line if its points are this close to one, as a fraction of its length.
ON_LINE = 1e-9


def faces_by_name(smoother: Smoother, lines: Sequence[Float], names: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    """The parts of the whole mesh, as shapely MultiPolygons by the names of the new regions.

    Args:
        smoother: knows what is solid.
        lines: smoothed outlines.
        names: of each design region, what its solid and its void are called; other regions keep theirs.
    """
    import shapely
    from shapely.geometry.polygon import orient

    found: dict[str, list[Any]] = {}
    for piece in smoother.domain.pieces(lines):
        region = smoother.domain.region_of(piece)
        if region in names:
            region = names[region][0 if smoother.is_solid(piece) else 1]
        found.setdefault(region, []).append(piece)
    whole = {name: polygons_of(shapely.union_all(pieces)) for name, pieces in found.items()}
    return {name: shapely.MultiPolygon([orient(part) for part in parts.geoms]) for name, parts in whole.items()}


def regions_of(faces: Mapping[str, Any], corners: Sequence[Place]) -> list[Region]:
    """Outlines for :func:`tmc_vem.mesh.make.voronoi.voronoi_mesh` and its like.

    Args:
        faces: shapely MultiPolygons by name, which share the vertices of their borders.
        corners: places on borders that stay vertices.
    """
    import shapely

    rings = [
        (name, [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)])
        for name, parts in faces.items()
        for polygon in parts.geoms
    ]
    neighbours: dict[Place, set[Place]] = {}
    for _, loops in rings:
        for loop in loops:
            places = list(map(tuple, loop.tolist()))
            for a, b in itertools.pairwise(places):
                neighbours.setdefault(a, set()).add(b)
                neighbours.setdefault(b, set()).add(a)
    breaks = set(corners) | {place for place, others in neighbours.items() if _turns(place, others)}
    return [
        Region(name, _entries(loops[0], breaks), [_entries(loop, breaks) for loop in loops[1:]])
        for name, loops in rings
    ]


def _turns(place: Place, others: set[Place]) -> bool:
    """Whether borders branch or turn at a vertex."""
    if len(others) != 2:
        return True
    a, b = (np.subtract(other, place) for other in others)
    return bool(-a @ b < STRAIGHT * np.hypot(*a) * np.hypot(*b))


def _entries(loop: Float, breaks: set[Place]) -> list[Entry]:
    """A closed loop (n + 1, 2) as curves between some of its vertices."""
    places = list(map(tuple, loop[:-1].tolist()))
    at = [n for n, place in enumerate(places) if place in breaks] or [places.index(min(places))]
    found: list[Entry] = []
    for first, last in zip(at, [*at[1:], at[0] + len(places)], strict=True):
        chain = np.array([places[n % len(places)] for n in range(first, last + 1)])
        if (chain[0] == chain[-1]).all():  # one corner or none: cut at the vertex farthest from it
            n = int(np.argmax(np.hypot(*(chain - chain[0]).T)))
            found += [_curve(chain[: n + 1]), _curve(chain[n:])]
        else:
            found.append(_curve(chain))
    return found


def _curve(chain: Float) -> Entry:
    """A point, from which a straight line goes on, or a polyline."""
    (x0, y0), (x1, y1) = chain[0].tolist(), chain[-1].tolist()
    length = np.hypot(x1 - x0, y1 - y0)
    off = (chain[:, 0] - x0) * (y1 - y0) - (chain[:, 1] - y0) * (x1 - x0)
    if np.abs(off).max() <= ON_LINE * length**2:
        return (x0, y0)
    return Polyline(tuple((x, y) for x, y in chain.tolist()))
