"""Regions as unions, differences and intersections of simple shapes, with outlines exact to rounding.

Every shape is a closed outline of lines and arcs, so whether a point is inside is decided without approximation. The
curves of all shapes are cut where they meet; a piece bounds a region if the region is on one side of it only. So
nothing is approximated by polygons, and regions that touch share their curves.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import COINCIDE, Arc, Line, Point, Region
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_positive, require_within

Float = NDArray[np.float64]
Curve = Line | Arc

# How far beside a piece's middle its two sides are looked at, as a fraction of all shapes' extent.
BESIDE = 1e-7
# Lengths whose squares are numbers.
TINY, HUGE = 1e-100, 1e100


@dataclass(frozen=True)
class Shape:
    """Closed outline of lines and arcs in order, each starting where the one before ends."""

    curves: tuple[Curve, ...]

    def contains(self, point: Point) -> bool:
        """Whether a point is inside: a ray to its right crosses the outline an odd number of times."""
        x, y = point
        inside = False
        for (x0, y0), (x1, y1), circle, side in self._climbs:
            if (y0 > y) != (y1 > y):
                if circle is None:
                    crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
                else:
                    half = circle.radius**2 - (y - circle.center[1]) ** 2
                    crossing = circle.center[0] + side * math.sqrt(max(half, 0.0))
                inside ^= x < crossing
        return inside

    @cached_property
    def _climbs(self) -> list[tuple[Point, Point, Arc | None, float]]:
        """Pieces along which y only rises or only falls, with shared ends: start, end, arc, half of its circle."""
        starts = [curve.start for curve in self.curves]
        found: list[tuple[Point, Point, Arc | None, float]] = []
        for curve, start, end in zip(self.curves, starts, [*starts[1:], starts[0]], strict=True):
            if isinstance(curve, Line):
                found.append((start, end, None, 0.0))
                continue
            low, high = sorted((curve.first, curve.last))
            turns = [90.0 + 180.0 * n for n in range(math.ceil((low - 90.0) / 180.0), math.ceil((high - 90.0) / 180.0))]
            angles = [low, *(angle for angle in turns if angle > low), high]
            if curve.last < curve.first:
                angles.reverse()
            (cx, cy), r = curve.center, curve.radius
            corners = [start, *((cx, cy + r * math.sin(math.radians(a))) for a in angles[1:-1]), end]
            for (a, b), (p, q) in zip(itertools.pairwise(angles), itertools.pairwise(corners), strict=True):
                found.append((p, q, curve, math.copysign(1.0, math.cos(math.radians(0.5 * (a + b))))))
        return found


def disc(x: float, y: float, radius: float) -> Shape:
    """Disc about a point.

    Raises:
        InputError: the radius is not positive.
    """
    require_positive("radius", radius, "of a disc")
    require_within("radius", radius, TINY, HUGE)
    for value in (x, y):
        require_within("centre", value, -HUGE, HUGE)
    return Shape((Arc((x, y), radius, 0.0, 180.0), Arc((x, y), radius, 180.0, 360.0)))


def rectangle(x0: float, y0: float, x1: float, y1: float, rounded: float = 0.0) -> Shape:
    """Rectangle by two opposite corners, its own corners rounded if asked for.

    Raises:
        InputError: it has no area, or the radius does not fit.
    """
    a, b, c, d = min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)
    return polygon([(a, b), (c, b), (c, d), (a, d)], rounded)


def polygon(corners: Sequence[Point], rounded: float = 0.0) -> Shape:
    """Polygon by its corners in order, in either direction; ``rounded`` is the radius of all corners.

    Raises:
        InputError: fewer than 3 corners, sides that meet, no area, or a radius that does not fit between two corners.
    """
    import shapely

    for corner in corners:
        for value in corner:
            require_within("corner", value, -HUGE, HUGE)
    if len(corners) < 3:
        raise InputError(f"a polygon needs at least 3 corners, got {len(corners)}")
    outline = shapely.Polygon(corners)
    if not outline.is_valid or outline.area == 0.0:
        raise InputError(f"not a simple polygon: {shapely.is_valid_reason(outline)}")
    shortest = min(math.dist(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    require_within("shortest side", shortest, TINY, HUGE)
    if not (math.isfinite(rounded) and rounded >= 0.0):
        raise InputError(f"rounded = {rounded:g} must be a radius, 0 for sharp corners")
    if rounded == 0.0:
        return Shape(tuple(Line(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)))
    return Shape(tuple(_rounded(corners, rounded)))


def _rounded(corners: Sequence[Point], radius: float) -> list[Curve]:
    n = len(corners)
    arcs: list[Arc] = []
    used = []  # length of the sides that the arcs take at each corner
    for k, corner in enumerate(corners):
        back, ahead = (np.subtract(corners[m % n], corner) for m in (k - 1, k + 1))
        back, ahead = back / np.hypot(*back), ahead / np.hypot(*ahead)
        turn = float(ahead[1] * back[0] - ahead[0] * back[1])
        half = 0.5 * math.atan2(abs(turn), float(ahead @ back))  # half of the angle between the sides
        if half > 0.5 * math.pi - 1e-9:
            raise InputError(f"corner ({corner[0]:g}, {corner[1]:g}) is straight and cannot be rounded: leave it out")
        bisector = (back + ahead) / np.hypot(*(back + ahead))
        center = corner + radius / math.sin(half) * bisector
        first = math.degrees(math.atan2(*reversed((corner + radius / math.tan(half) * back - center).tolist())))
        swept = math.degrees(math.pi - 2.0 * half) * (1.0 if turn < 0.0 else -1.0)
        arcs.append(Arc((float(center[0]), float(center[1])), radius, first, first + swept))
        used.append(radius / math.tan(half))
    curves: list[Curve] = []
    for k, arc in enumerate(arcs):
        following = arcs[(k + 1) % n]
        side = math.dist(corners[k], corners[(k + 1) % n])
        if used[k] + used[(k + 1) % n] > side * (1.0 + COINCIDE):
            raise InputError(
                f"rounded = {radius:g} does not fit at corner ({corners[k][0]:g}, {corners[k][1]:g}): the side to the "
                f"next one has length {side:g}; use at most {radius * side / (used[k] + used[(k + 1) % n]):.4g}"
            )
        curves.append(arc)
        if math.dist(arc.end, following.start) > COINCIDE * side:
            curves.append(Line(arc.end, following.start))
    return curves


def combine(shapes: Mapping[str, Shape], regions: Mapping[str, str]) -> list[Region]:
    """Outlines of regions that are given as expressions such as ``"frame - disc + (left & right)"``.

    Args:
        shapes: by name.
        regions: expression by the region's name, with ``+`` for union, ``-`` for difference, ``&`` for intersection.

    Returns:
        One :class:`Region` for every connected part of each region.

    Raises:
        InputError: an expression cannot be read or has an unknown name, a region is empty, or two regions overlap.
    """
    inside = {name: _membership(name, text, shapes) for name, text in regions.items()}
    used = {name: shape for name, shape in shapes.items() if any(name in names for names, _ in inside.values())}
    curves = [curve for shape in used.values() for curve in shape.curves]
    ends = np.array([end for curve in curves for end in (curve.start, curve.end)])
    extent = float(np.ptp(ends, axis=0).max())
    pieces = _pieces(curves, COINCIDE * extent)
    sides = [[_beside(piece, side * BESIDE * extent) for side in (1.0, -1.0)] for piece in pieces]
    within = [[{name: shape.contains(point) for name, shape in used.items()} for point in pair] for pair in sides]
    found: list[Region] = []
    for name, (_, contains) in inside.items():
        directed = []
        for piece, (left, right) in zip(pieces, within, strict=True):
            if contains(left) != contains(right):
                directed.append(piece if contains(left) else _reversed(piece))
        if not directed:
            raise InputError(f"region '{name}' is empty: '{regions[name]}' leaves nothing")
        found += _parts(name, directed, COINCIDE * extent)
    for pair in within:
        for point in pair:
            owners = [name for name, (_, contains) in inside.items() if contains(point)]
            if len(owners) > 1:
                raise InputError(f"regions '{owners[0]}' and '{owners[1]}' overlap: subtract one from the other")
    return found


# -- expressions -------------------------------------------------------------------------------------------------------

Inside = Mapping[str, bool]


def _membership(region: str, text: str, shapes: Mapping[str, Shape]) -> tuple[set[str], Callable[[Inside], bool]]:
    """Names in an expression, and whether a point is in it, given in which shapes it is."""
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(
            f"region '{region}': '{text}' is no combination of shapes, such as 'frame - disc' or '(a + b) & c'"
        ) from None
    names: set[str] = set()

    def read(node: ast.expr) -> Callable[[Inside], bool]:
        if isinstance(node, ast.Name):
            if node.id not in shapes:
                known = ", ".join(shapes) or "none"
                raise InputError(f"region '{region}': there is no shape '{node.id}' (there are: {known})")
            name = node.id
            names.add(name)
            return lambda point: point[name]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.BitAnd):
            left, right = read(node.left), read(node.right)
            if isinstance(node.op, ast.Add):
                return lambda point: left(point) or right(point)
            if isinstance(node.op, ast.Sub):
                return lambda point: left(point) and not right(point)
            return lambda point: left(point) and right(point)
        raise InputError(f"region '{region}': '{ast.unparse(node)}' is neither a shape nor a combination by + - &")

    return names, read(tree)


# -- arrangement of the curves -----------------------------------------------------------------------------------------


def _pieces(curves: Sequence[Curve], tolerance: float) -> list[Curve]:
    """All curves cut where they meet; what several share comes once."""
    corners: list[Point] = []

    def corner(point: Point) -> Point:
        for other in corners:
            if math.dist(point, other) <= 10.0 * tolerance:
                return other
        corners.append(point)
        return point

    for curve in curves:
        corner(curve.start)
        corner(curve.end)
    for a, b in itertools.combinations(curves, 2):
        for point in _meetings(a, b, tolerance):
            corner(point)
    found: dict[tuple[Point, Point, int, int], Curve] = {}
    for curve in curves:
        stations = {corner(curve.start): 0.0, corner(curve.end): 1.0}
        for place in corners:
            t, distance = curve.parameter_of(place)
            if distance <= 10.0 * tolerance and place not in stations:
                stations[place] = t
        along = sorted(stations.items(), key=lambda station: station[1])
        for (p0, t0), (p1, t1) in itertools.pairwise(along):
            piece = curve.part(t0, t1, p0, p1)
            middle = np.round(piece.at(np.array([0.5]))[0] / (1e4 * tolerance)).astype(int).tolist()
            found.setdefault((min(p0, p1), max(p0, p1), middle[0], middle[1]), piece)
    return list(found.values())


def _meetings(a: Curve, b: Curve, tolerance: float) -> list[Point]:
    """Where two curves meet; ends are corners already, so those of curves that overlap need not be found."""
    if isinstance(a, Line) and isinstance(b, Line):
        candidates = _line_line(a, b)
    elif isinstance(a, Arc) and isinstance(b, Arc):
        candidates = _circle_circle(a, b, tolerance)
    elif isinstance(a, Line) and isinstance(b, Arc):
        candidates = _line_circle(a, b, tolerance)
    else:
        assert isinstance(a, Arc)
        assert isinstance(b, Line)
        candidates = _line_circle(b, a, tolerance)
    return [p for p in candidates if all(curve.parameter_of(p)[1] <= 10.0 * tolerance for curve in (a, b))]


def _line_line(a: Line, b: Line) -> list[Point]:
    (ax, ay), (bx, by) = np.subtract(a.end, a.start).tolist(), np.subtract(b.end, b.start).tolist()
    determinant = ax * by - ay * bx
    if abs(determinant) <= 1e-12 * a.length * b.length:
        return []
    dx, dy = b.start[0] - a.start[0], b.start[1] - a.start[1]
    s = (dx * by - dy * bx) / determinant
    return [(a.start[0] + s * ax, a.start[1] + s * ay)]


def _line_circle(line: Line, arc: Arc, tolerance: float) -> list[Point]:
    d = np.subtract(line.end, line.start) / line.length
    foot = float(np.dot(np.subtract(arc.center, line.start), d))
    nearest = np.asarray(line.start) + foot * d
    off = math.dist(nearest.tolist(), arc.center)
    if off > arc.radius + tolerance:
        return []
    if off > arc.radius - tolerance:  # they touch
        return [(float(nearest[0]), float(nearest[1]))]
    reach = math.sqrt(arc.radius**2 - off**2)
    return [(float(p[0]), float(p[1])) for p in (nearest - reach * d, nearest + reach * d)]


def _circle_circle(a: Arc, b: Arc, tolerance: float) -> list[Point]:
    distance = math.dist(a.center, b.center)
    if distance <= tolerance or distance > a.radius + b.radius + tolerance:
        return []
    along = (distance**2 + a.radius**2 - b.radius**2) / (2.0 * distance)
    if abs(along) > a.radius + tolerance:
        return []
    d = np.subtract(b.center, a.center) / distance
    foot = np.asarray(a.center) + along * d
    if abs(along) > a.radius - tolerance:  # they touch
        return [(float(foot[0]), float(foot[1]))]
    arm = math.sqrt(a.radius**2 - along**2) * np.array([-d[1], d[0]])
    return [(float(p[0]), float(p[1])) for p in (foot - arm, foot + arm)]


def _beside(piece: Curve, distance: float) -> Point:
    """Point to the left of a piece's middle (right of it for a negative distance)."""
    (x0, y0), (x1, y1) = piece.at(np.array([0.5 - 1e-6, 0.5 + 1e-6])).tolist()
    length = math.hypot(x1 - x0, y1 - y0)
    middle = piece.at(np.array([0.5]))[0]
    return (float(middle[0] - distance * (y1 - y0) / length), float(middle[1] + distance * (x1 - x0) / length))


def _reversed(piece: Curve) -> Curve:
    if isinstance(piece, Line):
        return Line(piece.end, piece.start)
    return Arc(piece.center, piece.radius, piece.last, piece.first)


# -- loops -------------------------------------------------------------------------------------------------------------


def _parts(name: str, directed: Sequence[Curve], tolerance: float) -> list[Region]:
    """Regions from pieces that have the inside to their left: outer loops run counter-clockwise, holes clockwise."""
    loops = _loops(directed, tolerance)
    shapes = [Shape(tuple(loop)) for loop in loops]
    areas = [sum(signed_area(curve) for curve in loop) for loop in loops]
    holes: dict[int, list[list[Point | Arc]]] = {n: [] for n, area in enumerate(areas) if area > 0.0}
    for n, area in enumerate(areas):
        if area < 0.0:
            middle = loops[n][0].at(np.array([0.5]))[0]
            around = [o for o in holes if areas[o] > -area and shapes[o].contains((middle[0], middle[1]))]
            holes[min(around, key=lambda o: areas[o])].append(_entries(loops[n]))
    return [Region(name, _entries(loops[n]), inner) for n, inner in holes.items()]


def _loops(directed: Sequence[Curve], tolerance: float) -> list[list[Curve]]:
    """Closed chains; where parts touch in a point, each keeps to itself by the sharpest turn to the left."""
    left = list(directed)
    loops = []
    while left:
        loop = [left.pop(0)]
        while math.dist(loop[-1].end, loop[0].start) > 100.0 * tolerance:
            here = loop[-1]
            choices = [c for c in left if math.dist(c.start, here.end) <= 100.0 * tolerance]
            if not choices:
                x, y = here.end
                raise InputError(f"the shapes' outlines do not close at ({x:g}, {y:g}): two almost coincide there")
            loop.append(max(choices, key=lambda c: _turn(here, c)))
            left.remove(loop[-1])
        loops.append(_merged(loop))
    return loops


def _merged(loop: Sequence[Curve]) -> list[Curve]:
    """The loop with what goes straight on, or on along one circle, as one curve: no node is forced where they join."""
    found: list[Curve] = []
    for curve in loop:
        joined = _joined(found[-1], curve) if found else None
        found[-1 if joined else len(found) :] = [joined or curve]
    joined = _joined(found[-1], found[0]) if len(found) > 2 else None
    return [joined, *found[1:-1]] if joined else found


def _joined(before: Curve, after: Curve) -> Curve | None:
    """Two curves that follow each other as one, if they are of one line or circle."""
    if isinstance(before, Line) and isinstance(after, Line):
        return Line(before.start, after.end) if abs(_turn(before, after)) < COINCIDE else None
    if isinstance(before, Arc) and isinstance(after, Arc):
        angle = before.last - before.first + after.last - after.first
        if (before.center, before.radius) == (after.center, after.radius) and 0.0 < abs(angle) < 359.0:
            return Arc(before.center, before.radius, before.first, before.first + angle)
    return None


def _turn(before: Curve, after: Curve) -> float:
    (ax, ay), (bx, by) = _direction(before, 1.0), _direction(after, 0.0)
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def _direction(curve: Curve, t: float) -> Point:
    low, high = (t, t + 1e-6) if t == 0.0 else (t - 1e-6, t)
    (x0, y0), (x1, y1) = curve.at(np.array([low, high])).tolist()
    return (x1 - x0, y1 - y0)


def signed_area(curve: Curve) -> float:
    """Contribution to the area of a loop: of the triangle to the origin, and of an arc's segment."""
    (x0, y0), (x1, y1) = curve.start, curve.end
    area = 0.5 * (x0 * y1 - x1 * y0)
    if isinstance(curve, Arc):
        angle = math.radians(curve.last - curve.first)
        area += 0.5 * curve.radius**2 * (angle - math.sin(angle))
    return area


def _entries(loop: Sequence[Curve]) -> list[Point | Arc]:
    return [curve if isinstance(curve, Arc) else curve.start for curve in loop]
