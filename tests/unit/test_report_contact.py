"""Physical checks: overlaps, depths and gaps of states that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.fields import Fields, Polygons
from tmc_vem.report.contact import check_contact


def state(cells, displacement, regions=None, names=("solid", "medium")):
    """Fields of cells given by corners, with the side's middles between them; ``displacement``: (n, 2) -> (n, 2)."""
    points, loops = [], []
    for c, corners in enumerate(cells):
        loop = []
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            for p in (a, tuple(0.5 * (np.array(a) + b))):
                loop.append(len(points))
                points.append((*p, c))
        loops.append(loop)
    points = np.array(points)
    polygons = Polygons(
        points[:, :2],
        np.concatenate([[0], np.cumsum([len(loop) for loop in loops])]),
        np.concatenate(loops),
        np.array(regions or [0] * len(cells)),
        names,
    )
    zero = np.zeros(len(cells))
    return Fields(polygons, displacement(points), zero, zero, zero)


def square(x, y, size=1.0):
    return [(x, y), (x + size, y), (x + size, y + size), (x, y + size)]


LOWER, UPPER, BETWEEN = square(0, 0), square(0, 1.5), [(0, 1), (1, 1), (1, 1.5), (0, 1.5)]


def lowered(amount):
    return lambda p: np.column_stack([0 * p[:, 0], np.where(p[:, 1] >= 1.5, -amount, 0.0)])


def test_squares_apart():
    report = check_contact(state([LOWER, UPPER, BETWEEN], lowered(0.3), [0, 0, 1]))
    assert not report.interpenetrates
    assert report.contact_nodes == 0
    assert report.smallest_gap is None
    assert report.summary() == "no interpenetration, no contact"


def test_gap_of_squares_that_nearly_touch():
    report = check_contact(state([LOWER, UPPER, BETWEEN], lowered(0.49), [0, 0, 1]))
    assert not report.interpenetrates
    assert report.smallest_gap == pytest.approx(0.01)
    assert report.largest_gap == pytest.approx(0.01)
    assert report.contact_nodes == 2 * 9


@pytest.mark.parametrize("depth", [1e-6, 1e-3, 0.2])
def test_overlap_of_two_bodies(depth):
    wide = [(-1, 0), (2, 0), (2, 1), (-1, 1)]
    report = check_contact(state([wide, UPPER], lowered(0.5 + depth)))
    assert report.interpenetrates
    assert report.overlap_area == pytest.approx(depth, rel=1e-6)
    assert report.penetration_depth == pytest.approx(depth, rel=1e-6)
    assert report.penetration_point[1] == pytest.approx(1.0 - depth)
    assert "solids overlap" in report.summary()


def test_the_medium_may_do_what_it_likes():
    report = check_contact(state([LOWER, UPPER, BETWEEN], lowered(0.6), [0, 1, 1]))
    assert not report.interpenetrates


def test_self_contact_of_one_body():
    """A strip of ten squares bent round until its end overlaps its beginning."""
    cells = [square(x, 0) for x in range(10)]

    def bent(turns):
        def displacement(p):
            angle = 2 * np.pi * turns * p[:, 0] / 10
            radius = 2.0 + p[:, 1]
            return np.column_stack([radius * np.sin(angle), 4 - radius * np.cos(angle)]) - p[:, :2]

        return displacement

    assert not check_contact(state(cells, bent(0.98))).interpenetrates
    assert check_contact(state(cells, bent(0.98))).contact_nodes > 0
    over = check_contact(state(cells, bent(1.05)))
    assert over.interpenetrates
    assert over.overlap_area > 0.5


def test_sides_are_curves_through_their_nodes():
    """Two squares whose common side bulges: chords through different nodes would overlap, curves do not."""

    def bulge(p):
        return np.column_stack([0 * p[:, 0], np.where(np.abs(p[:, 1] - 1.0) < 1e-9, 0.2 * p[:, 0] * (1 - p[:, 0]), 0)])

    halves = [[(0, 1), (0.5, 1), (0.5, 2), (0, 2)], [(0.5, 1), (1, 1), (1, 2), (0.5, 2)]]
    apart = state([LOWER, *halves], bulge)
    assert check_contact(apart).overlap_area < 1e-3


def test_without_solids_there_is_nothing_to_report():
    report = check_contact(state([LOWER], lowered(0), [1]))
    assert report.as_dict()["interpenetrates"] is False


def test_cells_that_cross_themselves_are_measured_all_the_same():
    """A run that went astray is reported, not ended by the geometry library."""
    twist = state(  # both cells become bow ties, one across the other
        [LOWER, UPPER],
        lambda p: np.column_stack([np.where(p[:, 1] % 1.5 > 0.6, 1 - 2 * p[:, 0], 0), -1.3 * (p[:, 1] > 1.4)]),
    )
    assert check_contact(twist).overlap_area > 0.0
