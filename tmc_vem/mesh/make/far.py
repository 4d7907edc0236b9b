"""Domains far from the origin, such as in map coordinates: meshed where rounding does no harm, and moved back."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import Arc, Entry, Point, Region, Size
from tmc_vem.mesh.make.polyline import Polyline
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

# Beyond this many times their size from the origin, domains are moved before they are meshed; nearer they stay.
FAR = 1e4


def origin_for(points: Float) -> Point | None:
    """A place with whole coordinates near points (n, 2) that lie far from the origin; None if they do not.

    Beyond about 1e10 times their size, coordinates cannot tell the points apart any more, and nothing helps.
    """
    if not len(points) or not np.isfinite(points).all():
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    size, away = float((high - low).max()), float(np.abs(points).max())
    if size <= 0.0 or away <= FAR * size or away > 1e10 * size:
        return None
    step = 10.0 ** math.floor(math.log10(size))
    x, y = (np.round(0.5 * (low + high) / step) * step).tolist()
    return (x, y)


def relative(value: float, origin: float) -> float:
    """A coordinate from the origin on, without the digits that rounding has left it: 4200000.45 - 4200000 is 0.45."""
    ulp = math.ulp(max(abs(value), abs(origin)))
    return round(value - origin, max(0, math.floor(-math.log10(ulp))))


def near(point: Sequence[float], origin: Point) -> Point:
    """A point from the origin on."""
    return relative(point[0], origin[0]), relative(point[1], origin[1])


def moved(mesh: PolygonMesh, by: Point) -> PolygonMesh:
    """The mesh, which is good, at another place."""
    return replace(mesh, points_vx=mesh.points_vx + by, validate=False)


def meshed_near_origin(mesher: Callable[..., PolygonMesh]) -> Callable[..., PolygonMesh]:
    """A function of regions, size and named points that meshes regions far from the origin at the origin."""

    @functools.wraps(mesher)
    def function(
        regions: Sequence[Region], size: Size, points: Mapping[str, Point] | None = None, **more: Any
    ) -> PolygonMesh:
        ends = [end for region in regions for curve in region.curves() for end in (curve.start, curve.end)]
        origin = origin_for(np.array(ends, dtype=float).reshape(-1, 2))
        if origin is None:
            return mesher(regions, size, points, **more)
        there = (lambda x: size(x + origin)) if callable(size) else size
        named = {name: near(point, origin) for name, point in (points or {}).items()}
        try:
            mesh = mesher([_near_region(region, origin) for region in regions], there, named, **more)
        except InputError as error:
            raise InputError(f"{error} (places are counted from ({origin[0]:.17g}, {origin[1]:.17g}) on)") from None
        return moved(mesh, origin)

    return function


def _near_region(region: Region, origin: Point) -> Region:
    def entry(of: Entry) -> Entry:
        if isinstance(of, Arc):
            return Arc(near(of.center, origin), of.radius, of.first, of.last)
        if isinstance(of, Polyline):
            return Polyline(tuple(near(point, origin) for point in of.points))
        return near(of, origin)

    return Region(region.name, [entry(e) for e in region.outline], [[entry(e) for e in hole] for hole in region.holes])
