"""Outlines of a design made smooth, at the same volume: what lies inside the design regions moves, borders do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.outline import is_closed
from tmc_vem.design.outline_domain import MARGIN, Domain, Place
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

# Distance of points along outlines, and from a border up to which an outline goes straight to it, in cells.
SPACING, STRAIGHT_ON = 0.5, 0.6
# Taubin's weights, which leave long waves alone: there and back.
THERE, BACK = 0.5, -0.53
# Lines meet borders at an angle of at least this cosine, and turn by at most that of the second one, or they are cut
# off at this fraction of the pieces there.
SLANTED, SHARP, CUT = np.cos(np.radians(65.0)), np.cos(np.radians(70.0)), 0.3
# Points of lines are at least this far from each other, in cells.
CLOSE = 0.25
# Volumes are one up to this fraction.
SAME_VOLUME = 1e-6


@dataclass(frozen=True)
class Smoother:
    """Outlines of a solid within its design regions, and what they become.

    Attributes:
        solid: shapely MultiPolygon.
        domain: what is around.
        cell: size of the design's cells, a length.
        options: of the smoothing.
        through: places that outlines which come near pass through, or end at.
    """

    solid: Any
    domain: Domain
    cell: float
    options: ExtractOptions
    through: Sequence[Place] = ()

    def smooth(self) -> list[Float]:
        """Outlines as points (n, 2), those that are closed with their first point again at the end.

        Raises:
            InputError: the volume changes by more than the options allow.
        """
        wanted = float(self.solid.area)
        length = sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in self._lines)
        offset, lines = 0.0, self._moved(0.0)
        for _ in range(6):
            error = self.volume(lines) - wanted
            if abs(error) <= SAME_VOLUME * wanted or not length:
                break
            offset = float(np.clip(offset - error / length, -0.5 * self.cell, 0.5 * self.cell))
            lines = self._moved(offset)
        change = self.volume(lines) / wanted - 1.0
        if abs(change) > self.options.volume:
            raise InputError(
                f"smoothing changes the volume of the solid by {100.0 * change:.2g} %, from {wanted:.6g}: use fewer "
                f"passes than smoothing = {self.options.smoothing}, or allow it (volume = {abs(change):.1g})"
            )
        return lines

    def volume(self, lines: Sequence[Float]) -> float:
        """Area of the solid that outlines enclose."""
        return float(sum(face.area for face in self.faces(lines)))

    def faces(self, lines: Sequence[Float]) -> list[Any]:
        """Polygons of the solid that outlines enclose: those that are mostly in the solid given."""
        return [face for face in self.domain.pieces(lines) if self.is_solid(face)]

    def is_solid(self, face: Any) -> bool:
        """Whether a piece of the mesh is more in the solid than out of it."""
        return bool(face.intersection(self.solid).area > 0.5 * face.area)

    @cached_property
    def _lines(self) -> list[Float]:
        """Outlines as they are, smoothed, without what they need at their ends."""
        lines = [resampled(line, SPACING * self.cell) for line in free_lines(self.solid, self.domain)]
        return [taubin(line, self.options.smoothing) for line in lines]

    def _moved(self, offset: float) -> list[Float]:
        """Outlines moved out of the solid by a distance, simplified, up to the borders and through the named points."""
        import shapely

        found = []
        for line in self._lines:
            end = self._ended(offset_line(line, offset), (line[0], line[-1]))
            if end is not None:
                simple = shapely.LineString(end).simplify(self.options.tolerance * self.cell, preserve_topology=True)
                clear = self._clear(spaced(shapely.get_coordinates(simple), CLOSE * self.cell))
                found.append(blunted(spaced(clear, CLOSE * self.cell)))
        return self._through(found)

    def _ended(self, line: Float, ends: tuple[Float, Float]) -> Float | None:
        """An open line that meets the borders at right angles; None if it runs along one all the way."""
        import shapely

        if is_closed(line):
            return line
        runs = self.domain.run_lines
        points = shapely.points(line)
        which = [int(np.argmin(shapely.distance(runs, shapely.Point(end)))) for end in ends]
        far = [shapely.distance(runs[run], points) >= STRAIGHT_ON * self.cell for run in which]
        both = np.flatnonzero(far[0] & far[1])
        if len(both):
            first = int(np.flatnonzero(far[0])[0]) if which[0] != which[1] else int(both[0])
            last = int(np.flatnonzero(far[1])[-1]) if which[0] != which[1] else int(both[-1])
            inner = line[first : last + 1] if first <= last else line[[len(line) // 2]]
        elif which[0] == which[1]:
            return None
        else:
            inner = line[[len(line) // 2]]
        feet = [self._foot(inner[0], which[0]), self._foot(inner[-1], which[1])]
        ups = [self._upright(feet[0], inner[0], which[0]), self._upright(feet[1], inner[-1], which[1])]
        for up in ups:  # what comes near to where the line goes upright would turn back there
            if up is not None:
                away = np.hypot(*(inner - up).T) > SPACING * self.cell
                inner = inner[away] if away.any() else inner[[len(inner) // 2]]
        before, after = ([] if up is None else [up] for up in ups)
        whole = np.array([feet[0], *before, *inner, *after, feet[1]])
        kept: Float = whole[np.r_[True, (np.diff(whole, axis=0) != 0.0).any(axis=1)]]
        return kept if len(kept) > 1 else None

    def _upright(self, foot: Float, to: Float, run: int) -> Float | None:
        """A point straight above a foot, if the line from there would be slanted; None else, or without room."""
        import shapely

        line, d = self.domain.run_lines[run], STRAIGHT_ON * self.cell
        along = float(line.project(shapely.Point(foot)))
        ends = [line.interpolate(np.clip(along + s * 0.05 * d, 0.0, line.length)) for s in (-1.0, 1.0)]
        tangent = np.subtract(*(shapely.get_coordinates(end)[0] for end in ends))
        tangent = tangent / np.hypot(*tangent)
        if abs((to - foot) @ tangent) <= SLANTED * np.hypot(*(to - foot)):
            return None
        normal = np.array([-tangent[1], tangent[0]])
        ups = [foot + s * d * normal for s in (-1.0, 1.0)]
        inside = [up for up in ups if self.domain.room.covers(shapely.LineString([foot + 0.01 * (up - foot), up]))]
        return min(inside, key=lambda up: float(np.hypot(*(up - to)))) if inside else None

    def _foot(self, point: Float, run: int) -> Float:
        """Where a line from a point meets a run: straight on, not close to a corner, and at a named point nearby."""
        import shapely

        line = self.domain.run_lines[run]
        margin = MARGIN * self.cell
        along = float(line.project(shapely.Point(point)))
        ends = shapely.get_coordinates(line)[[0, -1]]
        if not line.is_closed:
            along = float(np.clip(along, min(margin, 0.5 * line.length), line.length - min(margin, 0.5 * line.length)))
        foot: Float = shapely.get_coordinates(line.interpolate(along))[0]
        for place in self.through:
            near = np.hypot(*(foot - place)) <= 1.01 * margin
            at_end = (np.hypot(*(ends - place).T) <= self.domain.tolerance).any()
            if near and at_end and self.domain.is_straight_at(place):
                return np.array(place)
        return foot

    def _clear(self, line: Float) -> Float:
        """The line without coming as close to borders as gaps that are closed are wide, except at its ends."""
        import shapely

        width, room = self.options.narrowest * self.cell, self.domain.room
        ways = shapely.get_coordinates(shapely.shortest_line(room.boundary, shapely.points(line))).reshape(-1, 2, 2)
        way = ways[:, 1] - ways[:, 0]
        length = np.hypot(*way.T)
        near = (length < width) & (length > self.domain.tolerance)
        if not is_closed(line):
            near[[0, -1]] = False
        inwards = np.where(shapely.contains_xy(room, line), 1.0, -1.0) / np.maximum(length, self.domain.tolerance)
        moved = np.where(near[:, None], ways[:, 0] + width * inwards[:, None] * way, line)
        for corner in self.domain.turns:
            shape = shapely.LineString(moved)
            away = shape.distance(shapely.Point(corner))
            if not 10.0 * self.domain.tolerance < away < width:
                continue
            along = shape.project(shapely.Point(corner))
            station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(moved, axis=0).T))])
            n = int(np.searchsorted(station, along))
            if 0 < n < len(moved) and min(along - station[n - 1], station[n] - along) > CLOSE * self.cell:
                moved = np.insert(moved, n, shapely.get_coordinates(shape.interpolate(along))[0], axis=0)
            arm = moved - corner
            reach = np.hypot(*arm.T)
            near = reach < width
            if not is_closed(moved):
                near[[0, -1]] = False
            moved = np.where(near[:, None], corner + arm * (width / np.maximum(reach, 1e-300))[:, None], moved)
        return moved

    def _through(self, lines: list[Float]) -> list[Float]:
        """Lines that pass through the named points near them that are inside the design regions."""
        import shapely

        border = self.domain.room.boundary
        for place in self.through:
            if not lines or border.distance(shapely.Point(place)) <= self.domain.tolerance:
                continue
            away = [np.hypot(*(line - place).T) for line in lines]
            nearest = int(np.argmin([a[1:-1].min(initial=np.inf) for a in away]))
            line = shapely.LineString(lines[nearest])
            if line.distance(shapely.Point(place)) <= MARGIN * self.cell:
                lines[nearest] = _put(lines[nearest], np.array(place))
        return lines


def free_lines(solid: Any, domain: Domain) -> list[Float]:
    """Outlines (n, 2) of a solid, which is on their left, without what lies on the borders of the design regions."""
    import shapely
    from shapely.geometry.polygon import orient

    border = domain.room.boundary
    shapely.prepare(border)
    found: list[Float] = []
    for polygon in solid.geoms:
        oriented = orient(polygon)
        for ring in (oriented.exterior, *oriented.interiors):
            points = shapely.get_coordinates(ring)
            probes = np.stack([points[:-1], 0.5 * (points[:-1] + points[1:]), points[1:]], axis=1)
            on = shapely.dwithin(border, shapely.points(probes), 10.0 * domain.tolerance).all(axis=1)
            found += _stretches(points, on)
    return found


def _stretches(ring: Float, on: Bool) -> list[Float]:
    """Parts of a closed ring (n + 1, 2) between segments (n,) that are on a border."""
    if not on.any():
        return [ring]
    n = len(on)
    start = int(np.flatnonzero(on)[0])
    order = (start + np.arange(n)) % n
    free = ~on[order]
    steps = np.diff(np.r_[0, free.astype(int), 0])
    found = []
    for first, last in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
        found.append(np.concatenate([ring[order[first:last]], ring[[order[last - 1] + 1]]]))
    return found


def resampled(line: Float, spacing: float) -> Float:
    """Points at equal distances along a line, at least four pieces; its ends stay."""
    station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    n = max(4, round(station[-1] / spacing))
    along = np.linspace(0.0, station[-1], n + 1)
    points: Float = np.column_stack([np.interp(along, station, line[:, x]) for x in (0, 1)])
    points[0], points[-1] = line[0], line[-1]
    return points


def taubin(line: Float, passes: int) -> Float:
    """Points moved towards the middle of their neighbours and a little farther back, again and again: waves of up to
    about six points vanish, longer ones stay as they are (Taubin, SIGGRAPH 1995). The ends of open lines stay."""
    points: Float = line.copy()
    closed = is_closed(line)
    for _ in range(passes):
        for weight in (THERE, BACK):
            if closed:
                ring = points[:-1]
                ring = ring + weight * (0.5 * (np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0)) - ring)
                points = np.concatenate([ring, ring[:1]])
            else:
                points[1:-1] += weight * (0.5 * (points[:-2] + points[2:]) - points[1:-1])
    return points


def spaced(line: Float, least: float) -> Float:
    """The line without points that are closer than a distance to the one before; its ends stay."""
    kept = [line[0]]
    for point in line[1:-1]:
        if np.hypot(*(point - kept[-1])) >= least and np.hypot(*(point - line[-1])) >= least:
            kept.append(point)
    return np.array([*kept, line[-1]]) if len(kept) > 2 or not is_closed(line) else line


def blunted(line: Float) -> Float:
    """The line with its sharp turns cut off."""
    points = line
    for _ in range(5):
        ring = np.concatenate([points[-2:-1], points]) if is_closed(points) else np.concatenate([points[:1], points])
        before, after = points - ring[:-1], np.roll(points, -1, axis=0) - points
        if is_closed(points):
            after[-1] = points[1] - points[0]
        cosine = (before * after).sum(axis=1) / np.maximum(np.hypot(*before.T) * np.hypot(*after.T), 1e-300)
        sharp = cosine < SHARP
        if not is_closed(points):
            sharp[[0, -1]] = False
        if not sharp.any():
            return points
        cut: list[Float] = []
        for n in range(len(points) - is_closed(points)):
            cut += [points[n] - CUT * before[n], points[n] + CUT * after[n]] if sharp[n] else [points[n]]
        points = np.array([*cut, cut[0]] if is_closed(points) else cut)
    return points


def offset_line(line: Float, distance: float) -> Float:
    """A line moved to its right by a distance, every point along the mean normal of its pieces."""
    if distance == 0.0:
        return line
    arm = np.diff(line, axis=0)
    normal = np.column_stack([arm[:, 1], -arm[:, 0]]) / np.hypot(*arm.T)[:, None]
    first, last = (normal[-1:], normal[:1]) if is_closed(line) else (normal[:1], normal[-1:])
    mean = np.concatenate([first, normal]) + np.concatenate([normal, last])
    moved: Float = line + distance * mean / np.maximum(np.hypot(*mean.T), 1e-12)[:, None]
    if is_closed(line):
        moved[-1] = moved[0]
    return moved


def _put(line: Float, place: Float) -> Float:
    """The line through a place: its nearest point that is no end of an open line is moved there."""
    moved: Float = line.copy()
    closed = is_closed(line)
    inner = np.arange(len(line) - 1) if closed else np.arange(1, len(line) - 1)
    if not len(inner):
        return np.stack([line[0], place, line[-1]])
    nearest = int(inner[np.hypot(*(line[inner] - place).T).argmin()])
    moved[nearest] = place
    if closed and nearest == 0:
        moved[-1] = place
    return moved
