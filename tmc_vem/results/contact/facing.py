"""What each station of a surface faces in the deformed state: the nearest side in front of it that looks back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.traction import Traction

Float = NDArray[np.float64]
Int = NDArray[np.int64]

AHEAD = 0.5  # cosine of the largest angle between a station's normal and the way to what it faces
BACK = 0.5  # the same of both normals, which point at each other
TOUCHING = 0.1  # pieces that are as near as this part of their length are in front, whatever the angle
CANDIDATES = 6  # pieces, by the distance of their middles, among which the nearest is looked for
PIECES_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class Facing:
    """What stations face.

    Attributes:
        station_n: (n,) nearest station of the piece of a side that each faces, -1 where it faces nothing.
        gap_n: (n,) distance to that piece, not a number where there is none.
        ends_ne: (n, 2) stations at the ends of the piece, -1 where there is none.
        along_n: (n,) where on it, from 0 at its first end to 1.
    """

    station_n: Int
    gap_n: Float
    ends_ne: Int
    along_n: Float

    def at(self, values_nx: Float) -> Float:
        """(n, 2) what values of the stations are at the places that these face, 0 where they face nothing."""
        start, end = np.moveaxis(values_nx[self.ends_ne], 1, 0)
        there = start + self.along_n[:, None] * (end - start)
        return np.where((self.station_n >= 0)[:, None], there, 0.0)


@dataclass(frozen=True)
class _Pieces:
    """Straight pieces (m,) from each station to the next one of its side, in the deformed state."""

    first: Int
    last: Int
    start_px: Float
    arm_px: Float

    @cached_property
    def length_p(self) -> Float:
        length: Float = np.hypot(*self.arm_px.T)
        return length

    @cached_property
    def normal_px(self) -> Float:
        normal: Float = np.column_stack([self.arm_px[:, 1], -self.arm_px[:, 0]]) / self.length_p[:, None]
        return normal

    @cached_property
    def middle_px(self) -> Float:
        middle: Float = self.start_px + 0.5 * self.arm_px
        return middle

    def likely(self, point_nx: Float, normal_nx: Float) -> Int:
        """(n, CANDIDATES) pieces with the nearest middles of those that look back at points (n, 2), and are ahead of
        them or around them; -1 for fewer."""
        middle = self.middle_px
        squared = (point_nx**2).sum(axis=1)[:, None] + (middle**2).sum(axis=1) - 2.0 * (point_nx @ middle.T)
        ahead = normal_nx @ middle.T - (normal_nx * point_nx).sum(axis=1)[:, None]
        may_be = (ahead > 0.5 * AHEAD * np.sqrt(np.maximum(squared, 0.0))) | (squared <= self.length_p**2)
        may_be &= normal_nx @ self.normal_px.T <= -BACK
        squared[~may_be] = np.inf
        width = min(CANDIDATES, len(middle))
        nearest: Int = np.argpartition(squared, width - 1, axis=1)[:, :width]
        return np.where(np.isfinite(np.take_along_axis(squared, nearest, axis=1)), nearest, -1)


def facing(traction: Traction) -> Facing:
    """What the stations of a surface face, in the state of its traction."""
    surface, x = traction.surface, traction.points_nx
    first, last = surface.stations_sa[:, :-1].ravel(), surface.stations_sa[:, 1:].ravel()
    pieces = _Pieces(first, last, x[first], x[last] - x[first])
    found = Facing(np.full(len(x), -1), np.full(len(x), np.nan), np.full((len(x), 2), -1), np.zeros(len(x)))
    normal_nx = traction.normal_ni
    for rows in _chunks(len(x), len(first)):
        some = _nearest(pieces, np.arange(len(x))[rows], x[rows], normal_nx[rows])
        for name, values in vars(some).items():
            getattr(found, name)[rows] = values
    return found


def _nearest(pieces: _Pieces, number_n: Int, point_nx: Float, normal_nx: Float) -> Facing:
    """What points (n, 2) face, with their numbers among the stations."""
    likely = pieces.likely(point_nx, normal_nx)
    start, arm, length = pieces.start_px[likely], pieces.arm_px[likely], pieces.length_p[likely]
    along = np.clip(((point_nx[:, None] - start) * arm).sum(axis=-1) / length**2, 0.0, 1.0)
    way = start + along[..., None] * arm - point_nx[:, None]
    distance = np.hypot(way[..., 0], way[..., 1])
    ahead = (way * normal_nx[:, None]).sum(axis=-1) >= AHEAD * distance
    own = (pieces.first[likely] == number_n[:, None]) | (pieces.last[likely] == number_n[:, None])
    faces = (likely >= 0) & ~own & (ahead | (distance <= TOUCHING * length))
    distance = np.where(faces, distance, np.inf)
    best = distance.argmin(axis=1)[:, None]
    along, distance, piece = (np.take_along_axis(each, best, axis=1)[:, 0] for each in (along, distance, likely))
    ends = np.column_stack([pieces.first[piece], pieces.last[piece]])
    station = np.where(along < 0.5, ends[:, 0], ends[:, 1])
    found = np.isfinite(distance)
    return Facing(np.where(found, station, -1), np.where(found, distance, np.nan),
                  np.where(found[:, None], ends, -1), along)  # fmt: skip


def _chunks(n_points: int, n_pieces: int) -> Iterator[slice]:
    step = max(1, PIECES_AT_ONCE // max(1, n_pieces))
    return (slice(first, first + step) for first in range(0, n_points, step))
