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
from tmc_vem.design.outline_domain import Domain, Place
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]

# Distance of points along outlines, and from a border up to which an outline goes straight to it, in cells.
SPACING, STRAIGHT_ON = 0.5, 0.6
# Outlines end at least this far from corners, and pass through named points that are as near, in cells.
MARGIN = 0.6
# Taubin's weights, which leave long waves alone: there and back.
THERE, BACK = 0.5, -0.53
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
                found.append(shapely.get_coordinates(simple))
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
        start, end = self._foot(inner[0], which[0]), self._foot(inner[-1], which[1])
        whole = np.concatenate([[start], inner, [end]])
        kept: Float = whole[np.r_[True, (np.diff(whole, axis=0) != 0.0).any(axis=1)]]
        return kept if len(kept) > 1 else None

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
