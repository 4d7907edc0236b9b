"""Rings: whether closed outlines still bound the same bodies."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from tmc_vem.results.contact.rings import Change, Rings

Float = NDArray[np.float64]


def outline(*loops: Float) -> tuple[Float, NDArray[np.int64]]:
    """Sides (n, 3, 2) of closed polygons with their midpoints, shuffled, and the numbers of their ends."""
    sides, ends, first = [], [], 0
    for loop in loops:
        following = np.roll(loop, -1, axis=0)
        sides.append(np.stack([loop, 0.5 * (loop + following), following], axis=1))
        number = first + np.arange(len(loop))
        ends.append(np.column_stack([number, np.roll(number, -1)]))
        first += len(loop)
    order = np.random.default_rng(1).permutation(first)
    return np.concatenate(sides)[order], np.concatenate(ends)[order]


def box(x: float, y: float, width: float = 1.0, height: float = 1.0) -> Float:
    return np.array([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def test_apart_touching_and_across() -> None:
    rings = Rings(*outline(box(0, 0), box(0, 1.5)))
    for shift, expected in ((0.0, Change.NONE), (-0.49, Change.NONE), (-0.5, Change.CROSSED), (-0.7, Change.CROSSED)):
        assert rings.compare(outline(box(0, 0), box(0, 1.5 + shift))[0]) is expected
    # the outline of neither crosses that of the other where one lies in the other, or beyond it
    assert rings.compare(outline(box(0, 0), box(0.25, 0.25, 0.5, 0.5))[0]) is Change.NESTED
    assert rings.compare(outline(box(0, 0), box(0, -1.5))[0]) is Change.NONE


def test_one_ring_that_crosses_itself_or_turns_over() -> None:
    rings = Rings(*outline(box(0, 0)))
    assert rings.compare(outline(box(0, 0)[[1, 0, 2, 3]])[0]) is Change.CROSSED
    assert rings.compare(outline(box(0, 0)[::-1])[0]) is Change.CROSSED
    assert rings.compare(outline(box(0, 0) * np.nan)[0]) is Change.CROSSED


def test_a_body_in_a_hole_stays_there() -> None:
    frame, hole, body = box(0, 0, 4, 4), box(1, 1, 2, 2)[::-1], box(1.5, 1.5)
    rings = Rings(*outline(frame, hole, body))
    assert rings.compare(outline(frame, hole, body + 0.3)[0]) is Change.NONE
    assert rings.compare(outline(frame, hole, body + 0.7)[0]) is Change.CROSSED
    assert rings.compare(outline(frame, hole, body + 9.0)[0]) is Change.NESTED


def test_bodies_that_touch_in_a_corner_from_the_start_are_always_looked_at() -> None:
    sides, ends = outline(box(0, 0), box(1, 1))
    ends[(ends == 4)] = 2  # the same vertex
    assert Rings(sides, ends).compare(sides) is Change.CROSSED


@pytest.mark.parametrize("seed", range(20))
def test_random_stars_against_shapely(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    before = [circle + np.array([3.0 * n, 0.0]) for n in range(3)]
    rings = Rings(*outline(*before))
    now = [circle * rng.uniform(0.3, 1.0, (12, 1)) + rng.uniform(0, 2.5, 2) for _ in range(3)]
    polygons = [shapely.Polygon(loop) for loop in now]
    apart = all(not a.intersects(b) for n, a in enumerate(polygons) for b in polygons[:n])
    assert (rings.compare(outline(*now)[0]) is Change.NONE) == apart


def test_thickness_of_the_thinnest_body() -> None:
    sides, ends = outline(box(0, 0, 10.0, 0.1), box(0, 5, 3.0, 3.0), box(1, 6)[::-1])
    assert Rings(sides, ends).thickness(sides) == pytest.approx(2 * 1.0 / 20.2)


def test_outlines_that_are_no_rings_have_no_shape() -> None:
    """Of two bodies: whether simple, which run counter-clockwise, what lies in what."""
    rings = Rings(*outline(box(0, 0), box(3, 0)))
    for broken in (box(0, 0) * np.nan, box(0, 0)[[1, 0, 2, 3]]):
        simple, ccw, nested = rings._shape(outline(broken, box(3, 0))[0])
        assert (simple, ccw.tolist(), nested) == (False, [False, False], set())
    simple, ccw, nested = rings._shape(outline(box(0, 0, 9.0, 9.0), box(3, 1)[::-1])[0])
    assert (simple, sorted(ccw.tolist()), len(nested)) == (True, [False, True], 1)


def test_rings_of_which_one_turns_over_are_looked_at_though_none_crosses() -> None:
    rings = Rings(*outline(box(0, 0), box(3, 0)))
    assert rings.compare(outline(box(0, 0), box(3, 0) * [-1.0, 1.0])[0]) is Change.CROSSED
