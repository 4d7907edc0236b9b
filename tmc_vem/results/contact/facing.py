"""What each station of a surface faces in the deformed state: the nearest side in front of it that looks back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.traction import Traction

Float = NDArray[np.float64]
Int = NDArray[np.int64]

AHEAD = 0.5  # cosine of the largest angle between a station's normal and the way to what it faces
BACK = 0.5  # the same of both normals, which point at each other
TOUCHING = 0.1  # sides that are as near as this part of their length are in front, whatever the angle
PIECES_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class Facing:
    """What stations face.

    Attributes:
        station_n: (n,) nearest station of the side that each faces, -1 where it faces nothing.
        gap_n: (n,) distance to that side, not a number where there is none.
    """

    station_n: Int
    gap_n: Float


def facing(traction: Traction) -> Facing:
    """What the stations of a surface face, in the state of its traction."""
    surface, x = traction.surface, traction.points_nx
    first, last = surface.stations_sa[:, :-1].ravel(), surface.stations_sa[:, 1:].ravel()
    start, arm = x[first], x[last] - x[first]
    long = np.hypot(*arm.T)
    normal = np.column_stack([arm[:, 1], -arm[:, 0]]) / long[:, None]
    station, gap = np.full(len(x), -1), np.full(len(x), np.nan)
    for rows in _chunks(len(x), len(first)):
        along = np.clip(((x[rows, None] - start) * arm).sum(axis=-1) / long**2, 0.0, 1.0)
        way = start + along[..., None] * arm - x[rows, None]
        distance = np.hypot(*np.moveaxis(way, -1, 0))
        own = traction.normal_ni[rows]
        ahead = np.einsum("npx,nx->np", way, own) >= AHEAD * distance
        own_piece = (first == np.arange(len(x))[rows, None]) | (last == np.arange(len(x))[rows, None])
        near = (distance <= TOUCHING * long) & ~own_piece
        back = own @ normal.T <= -BACK
        distance = np.where((ahead | near) & back, distance, np.inf)
        nearest = distance.argmin(axis=1)
        at = np.arange(len(nearest))
        found = np.isfinite(distance[at, nearest])
        chosen = np.where(along[at, nearest] < 0.5, first[nearest], last[nearest])
        station[rows] = np.where(found, chosen, -1)
        gap[rows] = np.where(found, distance[at, nearest], np.nan)
    return Facing(station, gap)


def _chunks(n_points: int, n_pieces: int) -> Iterator[slice]:
    step = max(1, PIECES_AT_ONCE // max(1, n_pieces))
    return (slice(first, first + step) for first in range(0, n_points, step))
