"""Outlines of plane regions from lines, arcs and polylines, and nodes along them at the distance of a size field."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.polyline import Polyline
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Point = tuple[float, float]
Field = Callable[[Float], Float]
Size = float | Field

# Ends of curves closer than this fraction of the domain are one point.
COINCIDE = 1e-9
# Named points may be this far off their outline, as a fraction of the domain: coordinates are rounded.
ROUNDED = 1e-6
_TABLE = 401  # places where the size field is read along a curve, at least
_MOST_STATIONS = 1_000_000  # and beyond which no more are added


@dataclass(frozen=True)
class Line:
    """Straight line between two points."""

    start: Point
    end: Point

    def at(self, t: Float) -> Float:
        """Points (n, 2) at parameters 0 (start) to 1 (end)."""
        points: Float = np.outer(1.0 - t, self.start) + np.outer(t, self.end)
        return points

    @property
    def length(self) -> float:
        """Length."""
        return math.dist(self.start, self.end)

    def parameter_of(self, point: Point) -> tuple[float, float]:
        """Parameter of the nearest place on the line, and its distance."""
        a, d = np.array(self.start), np.subtract(self.end, self.start)
        t = float(np.clip(np.dot(np.subtract(point, a), d) / np.dot(d, d), 0.0, 1.0))
        return t, float(np.hypot(*(a + t * d - point)))

    def part(self, t0: float, t1: float, start: Point, end: Point) -> Line:
        """The piece between two parameters, with its ends given exactly."""
        return Line(start, end)


@dataclass(frozen=True)
class Arc:
    """Circular arc.

    Attributes:
        center, radius: of the circle.
        first, last: angles of its ends in degrees; it runs counter-clockwise if ``last`` is larger.
    """

    center: Point
    radius: float
    first: float
    last: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise InputError(f"arc about {self.center}: radius = {self.radius:g} must be a positive number")
        if not 0.0 < abs(self.last - self.first) < 360.0:
            raise InputError(
                f"arc about {self.center} runs from {self.first:g} to {self.last:g} degrees: use an angle between 0 "
                "and 360, and two arcs for a circle"
            )

    def at(self, t: Float) -> Float:
        """Points (n, 2) at parameters 0 (start) to 1 (end)."""
        angle = np.radians(self.first + (self.last - self.first) * t)
        points: Float = self.center + self.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        return points

    @property
    def start(self) -> Point:
        """Where it starts."""
        x, y = self.at(np.zeros(1))[0].tolist()
        return (x, y)

    @property
    def end(self) -> Point:
        """Where it ends."""
        x, y = self.at(np.ones(1))[0].tolist()
        return (x, y)

    @property
    def length(self) -> float:
        """Length."""
        return self.radius * math.radians(abs(self.last - self.first))

    def parameter_of(self, point: Point) -> tuple[float, float]:
        """Parameter of the nearest place on the arc, and its distance."""
        x, y = np.subtract(point, self.center)
        span = self.last - self.first
        turn = (math.degrees(math.atan2(y, x)) - self.first) * math.copysign(1.0, span) % 360.0
        t = turn / abs(span) if turn <= abs(span) else (0.0 if 360.0 - turn < turn - abs(span) else 1.0)
        return t, float(np.hypot(*(self.at(np.array([t]))[0] - point)))

    def part(self, t0: float, t1: float, start: Point, end: Point) -> Arc:
        """The piece between two parameters."""
        span = self.last - self.first
        return Arc(self.center, self.radius, self.first + span * t0, self.first + span * t1)


Curve = Line | Arc | Polyline
Entry = Point | Arc | Polyline


@dataclass(frozen=True)
class Region:
    """Plane region by its outline.

    Attributes:
        name: of the region in the mesh; several may share one.
        outline: points, arcs and polylines in order around the region, in either direction; points, and ends of arcs
            and polylines, that follow each other are joined by straight lines.
        holes: outlines of holes.
    """

    name: str
    outline: Sequence[Entry]
    holes: Sequence[Sequence[Entry]] = ()

    def curves(self) -> list[Curve]:
        """All boundary curves.

        Raises:
            InputError: the outline has no area to go round.
        """
        return [curve for loop in (self.outline, *self.holes) for curve in self._loop(loop)]

    def _loop(self, entries: Sequence[Entry]) -> list[Curve]:
        curves: list[Curve] = []
        ends: list[tuple[Point, Point]] = [
            (e.start, e.end) if isinstance(e, Arc | Polyline) else ((float(e[0]), float(e[1])),) * 2 for e in entries
        ]
        extent = max((math.dist(ends[0][0], end) for pair in ends for end in pair), default=0.0)
        for n, entry in enumerate(entries):
            if isinstance(entry, Arc | Polyline):
                curves.append(entry)
            here, there = ends[n][1], ends[(n + 1) % len(ends)][0]
            if math.dist(here, there) > COINCIDE * extent:
                curves.append(Line(here, there))
        if len(curves) < 2 or extent == 0.0 or (len(curves) == 2 and all(isinstance(c, Line) for c in curves)):
            raise InputError(f"region '{self.name}': its outline needs at least 3 points, or an arc and a line")
        return curves

    def polygon(self, per_curve: int = 64) -> Any:
        """Shapely polygon; arcs are approximated."""
        import shapely

        t = np.linspace(0.0, 1.0, per_curve + 1)

        def without_end(curve: Curve) -> Float:
            if isinstance(curve, Polyline):
                return np.array(curve.points[:-1])
            return curve.at(t[:-1] if isinstance(curve, Arc) else t[:1])

        def ring(entries: Sequence[Entry]) -> Float:
            return np.concatenate([without_end(curve) for curve in self._loop(entries)])

        polygon = shapely.Polygon(ring(self.outline), [ring(hole) for hole in self.holes])
        if not polygon.is_valid:
            raise InputError(f"region '{self.name}': {shapely.is_valid_reason(polygon)}")
        return polygon


@dataclass(frozen=True)
class Skeleton:
    """Nodes along all outlines and the straight segments between them.

    Attributes:
        nodes_nx: (n_nodes, 2), on the curves.
        segments_sn: (n_segments, 2) nodes.
        names: nodes that have a name.
    """

    nodes_nx: Float
    segments_sn: Int
    names: Mapping[str, int] = field(default_factory=dict)


def evaluate_size(size: Size, points: Float) -> Float:
    """Size (n,) at points.

    Raises:
        InputError: it is not positive somewhere.
    """
    h = np.full(len(points), float(size)) if isinstance(size, (int, float)) else np.asarray(size(points), dtype=float)
    bad = np.flatnonzero(~(np.isfinite(h) & (h > 0.0)))
    if len(bad):
        x, y = points[bad[0]]
        raise InputError(f"the size of cells is {h[bad[0]]:g} at ({x:g}, {y:g}); it must be a positive number")
    return h


def make_skeleton(
    regions: Sequence[Region], size: Size, points: Mapping[str, Point] | None = None, *, turn: float = 360.0
) -> Skeleton:
    """Nodes along the outlines; where regions share a curve, or a part of one, they share its nodes.

    Args:
        regions: which may touch, but not overlap.
        size: length of the segments, a number or a function of points (n, 2).
        points: names for places on the outlines; a node is put at each.
        turn: largest angle of an arc from node to node, in degrees.

    Raises:
        InputError: a named point is on no outline, or the size is not positive.
    """
    curves = [curve for region in regions for curve in region.curves()]
    ends = np.array([end for curve in curves for end in (curve.start, curve.end)])
    tolerance = COINCIDE * float(np.ptp(ends, axis=0).max())
    corners = _Corners(tolerance)
    for end in ends.tolist():
        corners.number((end[0], end[1]))
    names = {}
    for name, place in (points or {}).items():
        nearest = min(curves, key=lambda curve: curve.parameter_of(place)[1])
        t, distance = nearest.parameter_of(place)
        if distance > tolerance:
            x, y = nearest.at(np.array([t]))[0].tolist()
            if distance > tolerance * ROUNDED / COINCIDE:
                raise InputError(
                    f"named point '{name}' at ({place[0]:.12g}, {place[1]:.12g}) is on no region's outline: the "
                    f"nearest place on one is ({x:.12g}, {y:.12g})"
                )
            place = min([nearest.start, nearest.end, (x, y)], key=lambda p: math.dist(p, place) > 2.0 * distance)
        names[name] = corners.number(place)

    pieces: dict[tuple[int, int, float, float], Curve] = {}
    for curve in curves:
        for piece in _split(curve, corners, tolerance):
            a, b = corners.number(piece.start), corners.number(piece.end)
            middle = np.round(piece.at(np.array([0.5]))[0] / (10.0 * tolerance)) + 0.0
            pieces.setdefault((min(a, b), max(a, b), *middle.tolist()), piece)

    at_arc = {n for key, piece in pieces.items() if isinstance(piece, Arc) for n in key[:2]}
    nodes = [np.array(corners.points)]
    segments = []
    n_nodes = len(corners.points)
    for piece in pieces.values():
        a, b = corners.number(piece.start), corners.number(piece.end)
        at_least = 3 if {a, b} & at_arc else 2
        if isinstance(piece, Arc):
            at_least = max(at_least, math.ceil(abs(piece.last - piece.first) / turn))
        inner = _spaced(piece, size, at_least)
        chain = np.array([a, *range(n_nodes, n_nodes + len(inner)), b])
        nodes.append(inner)
        n_nodes += len(inner)
        segments.append(np.column_stack([chain[:-1], chain[1:]]))
    return Skeleton(np.concatenate(nodes), np.concatenate(segments), names)


class _Corners:
    """Numbers ends of curves; those that coincide are one."""

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self.points: list[Point] = []

    def number(self, point: Point) -> int:
        for n, other in enumerate(self.points):
            if math.dist(point, other) <= self.tolerance:
                return n
        self.points.append((float(point[0]), float(point[1])))
        return len(self.points) - 1


def _split(curve: Curve, corners: _Corners, tolerance: float) -> list[Curve]:
    """Pieces of a curve between all corners on it."""
    cuts = []
    for corner in corners.points:
        t, distance = curve.parameter_of(corner)
        if distance <= tolerance and tolerance < t * curve.length < curve.length - tolerance:
            cuts.append((t, corner))
    stations = [(0.0, curve.start), *sorted(cuts), (1.0, curve.end)]
    return [
        curve.part(t0, t1, p0, p1) for (t0, p0), (t1, p1) in itertools.pairwise(stations)
    ]  # fmt: skip


def _spaced(curve: Curve, size: Size, at_least: int) -> Float:
    """Nodes (n, 2) inside a curve whose distances follow the size field."""
    t, h = sizes_along(curve, size)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (1.0 / h[1:] + 1.0 / h[:-1]) * np.diff(t) * curve.length)])
    n = max(at_least, round(count[-1]))
    inner = np.interp(np.arange(1, n) / n * count[-1], count, t)
    return curve.at(inner)


def sizes_along(curve: Curve, size: Size) -> tuple[Float, Float]:
    """Parameters (n,) of stations along a curve, and the sizes there: where a size varies, no two are farther from each
    other than the smaller size, so that a place with small cells between them shows."""
    t = np.linspace(0.0, 1.0, _TABLE)
    h = evaluate_size(size, curve.at(t))
    while callable(size) and len(t) < _MOST_STATIONS:
        wide = np.flatnonzero(np.diff(t) * curve.length > np.minimum(h[1:], h[:-1]))
        if not len(wide):
            break
        between = 0.5 * (t[wide] + t[wide + 1])
        h = np.insert(h, wide + 1, evaluate_size(size, curve.at(between)))
        t = np.insert(t, wide + 1, between)
    return t, h
