"""Distances between parts of an outline.

Circles round the sides tell which of them can matter; only the points of those are compared with each other, so that
the work grows with the length of the outline.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.solids import PAIRS_AT_ONCE, Chains

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class _Circles:
    """Circles (n,) that contain chains."""

    centre: Float
    radius: Float

    @staticmethod
    def around(chains: Float) -> _Circles:
        """Circles round chains (n, m + 1, 2)."""
        centre = 0.5 * (chains.min(axis=1) + chains.max(axis=1))
        return _Circles(centre, np.hypot(*np.moveaxis(chains - centre[:, None], -1, 0)).max(axis=1))

    def apart(self, first: Int, second: Int) -> tuple[Float, Float]:
        """Smallest and largest distance that points of two of them can have."""
        distance = np.hypot(*(self.centre[first] - self.centre[second]).T)
        both = self.radius[first] + self.radius[second]
        return distance - both, distance + both


def closed_gaps(outline: Chains, closed: float, near: float) -> Float:
    """Distances of the outline's points to parts of it that they have come close to.

    Args:
        outline: sides of the solids.
        closed: a part counts if it is closer than this fraction of its distance in the reference state ...
        near: ... and than this length.

    Returns:
        The smallest distance of each point to such a part, for the points that have one.
    """
    now, before = _Circles.around(outline.now), _Circles.around(outline.before)
    a, b = _neighbours(outline.now, near)
    (low, high), (low_before, high_before) = now.apart(a, b), before.apart(a, b)
    surely = high < closed * low_before
    bound = np.full(len(outline.now), near)
    np.minimum.at(bound, a[surely], high[surely])
    kept = (low < closed * high_before) & (low <= bound[a])
    a, b = a[kept], b[kept]
    ids = outline.ids
    smallest = np.full(int(ids.max()) + 1, np.inf)
    step = max(1, PAIRS_AT_ONCE // outline.now.shape[1] ** 2)
    for first in range(0, len(a), step):
        i, j = a[first : first + step], b[first : first + step]
        distance = _distances(outline.now[i, :-1], outline.now[j])
        origin = _distances(outline.before[i, :-1], outline.before[j])
        point = ids[i, :-1, None]
        counts = (distance < closed * origin) & (distance <= near)
        counts &= (point != ids[j, None, :-1]) & (point != ids[j, None, 1:])
        np.minimum.at(smallest, ids[i, :-1], np.where(counts, distance, np.inf).min(axis=2))
    found: Float = smallest[np.isfinite(smallest)]
    return found


def distances_beyond(
    outline: Chains, where: tuple[Int, Int], body: Int, own: float, closed: float
) -> tuple[Float, Float]:
    """Distances of some points of the outline to the parts of it that are not around them.

    Args:
        outline: sides of the solids.
        where: the points, as side and position in it.
        body: (n_sides,) which body a side belongs to.
        own: parts of the point's own body are around it up to this distance in the reference state.
        closed: such parts have closed on the point if they are now closer than this fraction of it, as the two flanks
            of a corner may.

    Returns:
        The smallest distance of each point to parts that are not around it, and to those that are and have closed on
        it; infinite where there are none.
    """
    now, before = _Circles.around(outline.now), _Circles.around(outline.before)
    beyond, fold = np.full((2, len(where[0])), np.inf)
    step = max(1, PAIRS_AT_ONCE // len(outline.now))
    for first in range(0, len(beyond), step):
        side, position = (index[first : first + step] for index in where)
        point, origin = outline.now[side, position], outline.before[side, position]
        foreign = body[side][:, None] != body
        to = np.hypot(*np.moveaxis(point[:, None] - now.centre, -1, 0))
        from_origin = np.hypot(*np.moveaxis(origin[:, None] - before.centre, -1, 0))
        surely = foreign | (from_origin - before.radius > own)
        bound = np.where(surely, to + now.radius, np.inf).min(axis=1)
        may_be_beyond = (foreign | (from_origin + before.radius > own)) & (to - now.radius <= bound[:, None])
        may_have_closed = to - now.radius < closed * np.minimum(own, from_origin + before.radius)
        n, s = np.nonzero(may_be_beyond | may_have_closed)
        distance = _distances(point[n, None], outline.now[s])[:, 0]
        distance_before = _distances(origin[n, None], outline.before[s])[:, 0]
        around = ~foreign[n, s][:, None] & (distance_before <= own)
        has_closed = around & (distance < closed * distance_before)
        np.minimum.at(beyond, first + n, np.where(around, np.inf, distance).min(axis=1))
        np.minimum.at(fold, first + n, np.where(has_closed, distance, np.inf).min(axis=1))
    return beyond, fold


def _neighbours(chains: Float, near: float) -> tuple[Int, Int]:
    """All pairs of chains (n, m + 1, 2) whose boxes are at most this far from each other."""
    import shapely

    low, high = chains.min(axis=1), chains.max(axis=1)
    first, second = shapely.STRtree(shapely.box(*(low - near).T, *(high + near).T)).query(shapely.box(*low.T, *high.T))
    return first, second


def _distances(points: Float, chains: Float) -> Float:
    """(n, p, m) distances of points (n, p, 2) to the pieces of chains (n, m + 1, 2)."""
    x, y = np.moveaxis(points[:, :, None] - chains[:, None, :-1], -1, 0)
    u, v = np.moveaxis(np.diff(chains, axis=1)[:, None], -1, 0)
    length = u * u + v * v
    along = np.divide(x * u + y * v, length, out=np.zeros_like(x), where=length > 0.0)
    np.clip(along, 0.0, 1.0, out=along)
    distance: Float = np.hypot(x - along * u, y - along * v)
    return distance
