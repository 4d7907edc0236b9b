"""Curves through many points, for outlines that are known by points only, such as level lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True)
class Polyline:
    """One curve of straight pieces: nodes are put along it as its length asks for, not at its own points.

    Attributes:
        points: at least two, from its start to its end, which differ.

    Raises:
        InputError: there are fewer, or two that follow each other coincide.
    """

    points: tuple[Point, ...]

    def __post_init__(self) -> None:
        if len(self.points) < 2:
            raise InputError(f"a polyline needs at least 2 points, got {len(self.points)}")
        still = np.flatnonzero(np.diff(self._station_p) <= 0.0)
        if len(still):
            x, y = self.points[still[0]]
            raise InputError(f"a polyline stands still at ({x:g}, {y:g}): leave one of the two points out")

    @cached_property
    def _points_px(self) -> Float:
        return np.array(self.points, dtype=float)

    @cached_property
    def _station_p(self) -> Float:
        """(n_points,) length from the start to each point."""
        station: Float = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self._points_px, axis=0).T))])
        return station

    @property
    def start(self) -> Point:
        """Where it starts."""
        return self.points[0]

    @property
    def end(self) -> Point:
        """Where it ends."""
        return self.points[-1]

    @property
    def length(self) -> float:
        """Length."""
        return float(self._station_p[-1])

    def at(self, t: Float) -> Float:
        """Points (n, 2) at parameters 0 (start) to 1 (end), in proportion to the length."""
        along = np.asarray(t) * self.length
        return np.column_stack([np.interp(along, self._station_p, self._points_px[:, x]) for x in (0, 1)])

    def parameter_of(self, point: Point) -> tuple[float, float]:
        """Parameter of the nearest place on the curve, and its distance."""
        start, arm = self._points_px[:-1], np.diff(self._points_px, axis=0)
        length = np.diff(self._station_p)
        along = np.clip(((point - start) * arm).sum(axis=1) / length, 0.0, length)
        distance = np.hypot(*(start + (along / length)[:, None] * arm - point).T)
        nearest = int(distance.argmin())
        return float((self._station_p[nearest] + along[nearest]) / self.length), float(distance[nearest])

    def part(self, t0: float, t1: float, start: Point, end: Point) -> Polyline:
        """The piece between two parameters, with its ends given exactly."""
        t = self._station_p / self.length
        near = 1e-9  # points that close to an end are that end
        inside = [point for point, s in zip(self.points, t.tolist(), strict=True) if t0 + near < s < t1 - near]
        return Polyline((start, *inside, end))
