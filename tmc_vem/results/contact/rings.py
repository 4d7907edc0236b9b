"""Closed outlines of solids: do they still bound the same bodies, none across or inside another?

The answer is yes at nearly every state of a run, and costs a sweep along the outline then. Only where it is no, the
bodies have to be looked at cell by cell.
"""

from __future__ import annotations

import itertools
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Int = NDArray[np.int64]


class Change(Enum):
    """What may have become of rings: nothing, they cross or touch, or one came to lie in or out of another."""

    NONE = 0
    CROSSED = 1
    NESTED = 2


class Rings:
    """Sides joined to closed rings.

    Args:
        sides_smx: (n_sides, m + 1, 2) points along the sides in the reference state.
        ends_s2: (n_sides, 2) numbers of their first and last points; a side goes on where another one begins.
    """

    def __init__(self, sides_smx: Float, ends_s2: Int) -> None:
        self._order, self._lengths = _loops(ends_s2)
        per_side = sides_smx.shape[1] - 1
        self._ring_of_point = np.repeat(np.arange(len(self._lengths)), self._lengths * per_side + 1)
        self._simple, self._ccw, self._nested = self._shape(sides_smx)

    def compare(self, sides_smx: Float) -> Change:
        """What has become of the rings.

        Args:
            sides_smx: (n_sides, m + 1, 2) points along the sides now.
        """
        if not self._simple:  # bodies that touch already in the reference state
            return Change.CROSSED
        simple, ccw, nested = self._shape(sides_smx)
        if not simple or (ccw != self._ccw).any():
            return Change.CROSSED
        return Change.NONE if nested == self._nested else Change.NESTED

    def thickness(self, sides_smx: Float) -> float:
        """Twice the area over the circumference of the thinnest body: the thickness of a long one."""
        import shapely

        polygons = shapely.polygons(shapely.linearrings(self._points(sides_smx), indices=self._ring_of_point))
        thickness = 2.0 * shapely.area(polygons) / shapely.length(polygons)
        return float(thickness[self._ccw].min(initial=np.inf))

    def _points(self, sides_smx: Float) -> Float:
        """(n_points, 2) points of all rings one after the other, each closed."""
        ordered = sides_smx[self._order][:, :-1]
        first = np.concatenate([[0], np.cumsum(self._lengths)])
        loops = [ordered[a:b].reshape(-1, 2) for a, b in itertools.pairwise(first)]
        return np.concatenate([part for loop in loops for part in (loop, loop[:1])])

    def _shape(self, sides_smx: Float) -> tuple[bool, NDArray[np.bool_], set[tuple[int, int]]]:
        """Whether the rings are simple, which run counter-clockwise, and which (first) lies inside which (second)."""
        import shapely

        points = self._points(sides_smx)
        if not np.isfinite(points).all():
            return False, np.zeros(len(self._lengths), dtype=np.bool_), set()
        rings = shapely.linearrings(points, indices=self._ring_of_point)
        if not shapely.is_simple(shapely.multilinestrings(rings)):
            return False, np.zeros(len(rings), dtype=np.bool_), set()
        polygons = shapely.polygons(rings)
        starts = shapely.points(points[np.searchsorted(self._ring_of_point, np.arange(len(rings)))])
        inner, outer = shapely.STRtree(polygons).query(starts, predicate="within")
        nested = {(a, b) for a, b in zip(inner.tolist(), outer.tolist(), strict=True) if a != b}
        return True, np.asarray(shapely.is_ccw(rings)), nested


def _loops(ends_s2: Int) -> tuple[Int, Int]:
    """Sides in the order in which they follow each other, ring after ring, and the number of sides of each ring."""
    from_vertex: dict[int, list[int]] = {}
    for side, start in enumerate(ends_s2[:, 0].tolist()):
        from_vertex.setdefault(start, []).append(side)
    last = ends_s2[:, 1].tolist()
    order: list[int] = []
    lengths: list[int] = []
    for start, leaving in from_vertex.items():
        while leaving:  # more than once only where bodies touch in a vertex
            begun, at = len(order), start
            while from_vertex.get(at):
                order.append(from_vertex[at].pop())
                at = last[order[-1]]
            lengths.append(len(order) - begun)
    return np.array(order, dtype=np.int64), np.array(lengths, dtype=np.int64)
