"""Middles of edges are moved onto the curves that the edges follow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Ends of an edge on a curve are at most this fraction of the mesh's extent away from it.
NEAR = 1e-6
# An edge is the chord of a piece of a curve that is longer than it by this factor at most, and as far away from its
# middle as this fraction of the edge: an arc of 60 degrees has 1.047 and 0.134.
LONGER, AWAY = 1.05, 0.15
# A middle that is off by less than this fraction of the mesh's extent stays where it is.
ROUNDING = 1e-13


class Followed(Protocol):
    """What has to be known of a curve, such as those of :mod:`tmc_vem.mesh.make.outline`."""

    def at(self, t: Float) -> Float:
        """Points (n, 2) at parameters 0 to 1."""
        ...

    def parameter_of(self, point: tuple[float, float]) -> tuple[float, float]:
        """Parameter of the nearest place on the curve, and its distance."""
        ...


def onto_curves(points_vx: Float, ends_ev: Int, curves: Sequence[Followed]) -> tuple[Float, Bool]:
    """Where the middles (n_edges, 2) of edges go, and which of them move.

    Args:
        points_vx: (n_vertices, 2) coordinates.
        ends_ev: (n_edges, 2) ends of edges.
        curves: an edge with both ends on one of them follows it, if it is a chord of 60 degrees at most.
    """
    middle = 0.5 * (points_vx[ends_ev[:, 0]] + points_vx[ends_ev[:, 1]])
    target, best = middle.copy(), np.full(len(ends_ev), np.inf)
    extent = float(np.ptp(points_vx, axis=0).max())
    used = np.unique(ends_ev)
    for curve in curves:
        near = used[_in_box(points_vx[used], curve, NEAR * extent)]
        t_v, distance_v = np.zeros(len(points_vx)), np.full(len(points_vx), np.inf)
        for v in near.tolist():
            t_v[v], distance_v[v] = curve.parameter_of(_point(points_vx[v]))
        off = distance_v[ends_ev].max(axis=1)
        closed = float(np.hypot(*np.diff(curve.at(np.array([0.0, 1.0])), axis=0)[0])) <= NEAR * extent
        for e in np.flatnonzero((off <= NEAR * extent) & (off < best)).tolist():
            found = _middle_on(curve, t_v[ends_ev[e]], points_vx[ends_ev[e]], closed)
            if found is not None:
                target[e], best[e] = found, off[e]
    return target, np.hypot(*(target - middle).T) > ROUNDING * extent


def _middle_on(curve: Followed, t_n: Float, ends_nx: Float, closed: bool) -> Float | None:
    """The place of the curve nearest to the middle of its chord; None if the edge is no chord of it."""
    low, high = float(t_n.min()), float(t_n.max())
    if closed and high - low > 0.5:  # across the seam
        low, high = high, low + 1.0
    piece = curve.at(np.linspace(low, high, 17) % 1.0 if high > 1.0 else np.linspace(low, high, 17))
    chord = float(np.hypot(*(ends_nx[1] - ends_nx[0])))
    if np.hypot(*np.diff(piece, axis=0).T).sum() > LONGER * chord:
        return None
    t, distance = curve.parameter_of(_point(ends_nx.mean(axis=0)))
    if distance > AWAY * chord or not (low < t < high or low < t + 1.0 < high):
        return None
    place: Float = curve.at(np.array([t]))[0]
    return place


def _in_box(points_nx: Float, curve: Followed, tolerance: float) -> Bool:
    """Which points may lie on a curve."""
    table = curve.at(np.linspace(0.0, 1.0, 65))
    margin = float(np.hypot(*np.diff(table, axis=0).T).max()) + tolerance
    inside: Bool = ((points_nx >= table.min(axis=0) - margin) & (points_nx <= table.max(axis=0) + margin)).all(axis=1)
    return inside


def _point(x: Float) -> tuple[float, float]:
    return float(x[0]), float(x[1])
