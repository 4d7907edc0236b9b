"""Physical checks: overlaps, depths and gaps of states that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from helpers_contact import slow_check

from tmc_vem.results.contact import distances, solids
from tmc_vem.results.contact.contact import ContactReport, Overlap, check_contact, find_overlap
from tmc_vem.results.contact.distances import closed_gaps, distances_beyond
from tmc_vem.results.contact.solids import Chains, Solids
from tmc_vem.system.fields import Fields, Polygons


def state(cells, displacement, regions=None, names=("solid", "medium"), order=2):
    """Fields of cells given by corners, with nodes along the sides between them; ``displacement``: (n, 2) -> (n, 2)."""
    points, loops = [], []
    for c, corners in enumerate(cells):
        loop = []
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            for p in [a, *(tuple(np.array(a) + n / order * (np.array(b) - a)) for n in range(1, order))]:
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
        ("medium",),
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
    assert report.summary() == "no interpenetration, no solids in contact"


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


@pytest.mark.parametrize("n", [2, 3, 5])
def test_what_is_covered_several_times_counts_as_often(n):
    """Squares side by side that are moved onto one another: all but one of them is too many."""
    cells = [square(2.0 * c, 0.0) for c in range(n)]
    onto = check_contact(state(cells, lambda p: np.column_stack([-2.0 * p[:, 2], 0.0 * p[:, 2]])))
    assert onto.overlap_area == pytest.approx(n - 1.0)
    half = check_contact(state(cells, lambda p: np.column_stack([-1.5 * p[:, 2], 0.0 * p[:, 2]])))
    assert half.overlap_area == pytest.approx(0.5 * (n - 1))
    if n == 3:  # the middle third is covered three times, both others twice
        third = check_contact(state(cells, lambda p: np.column_stack([-(5.0 / 3.0) * p[:, 2], 0.0 * p[:, 2]])))
        assert third.overlap_area == pytest.approx(3.0 - (1.0 + 2.0 / 3.0))


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


def grid(x, y, n, m, h):
    """n times m squares of side h."""
    return [square(x + i * h, y + j * h, h) for i in range(n) for j in range(m)]


def skewed(cells, amount, rng):
    """The same cells with their corners moved, equal ones by equal amounts."""
    moved = {corner: tuple(corner + amount * rng.uniform(-1, 1, 2)) for cell in cells for corner in cell}
    return [[moved[corner] for corner in cell] for cell in cells]


def waves(rng, amount):
    """A smooth motion of the plane, not one to one where the amount is large."""
    k, phase, a = rng.uniform(1.0, 3.0, (4, 2)), rng.uniform(0, 6, 4), rng.normal(0, amount, (4, 2))
    return lambda p: np.sin(p[:, :2] @ k.T + phase) @ a


def turned_strip(rng, order=2):
    """A strip bent round until its ends nearly meet, meet, or overlap."""
    cells = grid(0, 0, 8, 1, 1.0)
    turns = rng.uniform(0.95, 1.03)

    def displacement(p):
        angle, radius = 2 * np.pi * turns * p[:, 0] / 8, 1.5 + p[:, 1]
        return np.column_stack([radius * np.sin(angle), 4 - radius * np.cos(angle)]) - p[:, :2]

    return state(cells, displacement, order=order)


def two_bodies(rng, amount):
    """A body that comes down on another, both deformed; a third region is medium."""
    cells = [grid(0, 0, 4, 2, 0.5), grid(0.1, 1.3, 3, 2, 0.5), grid(3, 0, 1, 1, 1.0)]
    regions = [n for n, body in enumerate(cells) for _ in body]
    wave, down = waves(rng, amount), rng.uniform(0.2, 0.4)

    def displacement(p):
        return wave(p) + np.column_stack([0 * p[:, 0], np.where(p[:, 1] > 1.25, -down, 0.0)])

    return state(
        skewed([cell for body in cells for cell in body], 0.05, rng),
        displacement,
        regions,
        ("solid", "other", "medium"),
    )


def hidden(rng):
    """A small body within a large one: their outlines do not cross."""
    inner = grid(5, 0, 2, 2, 0.2)
    shift = rng.uniform(-0.2, 0.2, 2)
    return state(
        [square(0, 0, 2.0), *inner],
        lambda p: np.where(p[:, [0]] >= 5, np.array([-4.2, 0.8]) + shift, 0.0) + 0.01 * np.sin(3 * p[:, :2]),
    )


# what makes a state, and the order of its sides
CASES = {
    "strip": (turned_strip, 2),
    "cubic strip": (lambda rng: turned_strip(rng, 3), 3),
    "bodies": (lambda rng: two_bodies(rng, 0.03), 2),
    "folded bodies": (lambda rng: two_bodies(rng, 0.4), 2),
    "hidden body": (hidden, 2),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("seed", range(6))
def test_against_all_pairs(case, seed, monkeypatch):
    if seed % 2:  # in pieces
        monkeypatch.setattr(solids, "CELLS_AT_ONCE", 3)
        monkeypatch.setattr(solids, "PAIRS_AT_ONCE", 500)
        monkeypatch.setattr(distances, "PAIRS_AT_ONCE", 500)
    make, order = CASES[case]
    fields = make(np.random.default_rng(seed))
    fast, slow = check_contact(fields, order), slow_check(fields, order)
    assert fast.interpenetrates == slow.interpenetrates
    assert fast.contact_nodes == slow.contact_nodes
    assert (fast.penetration_point is None) == (fast.penetration_depth == 0.0)
    for name in (
        "overlap_area",
        "penetration_depth",
        *(("smallest_gap", "mean_gap", "largest_gap") * (slow.contact_nodes > 0)),
    ):
        assert getattr(fast, name) == pytest.approx(getattr(slow, name), rel=1e-8, abs=1e-11), name


def test_the_cases_have_all_that_the_check_looks_for():
    found, crossed = set(), 0
    for make, order in CASES.values():
        for seed in range(6):
            fields = make(np.random.default_rng(seed))
            report = check_contact(fields, order)
            found.add((report.interpenetrates, report.contact_nodes > 0))
            crossed += Solids(fields, fields.polygons.is_solid_c, order, 8).crossed().sum()
    assert found == {(True, True), (True, False), (False, True), (False, False)}
    assert crossed > 10


def test_bodies_that_touch_do_not_overlap():
    report = check_contact(state([LOWER, UPPER, BETWEEN], lowered(0.5), [0, 0, 1]))
    assert not report.interpenetrates
    assert report.contact_nodes == 18
    assert report.largest_gap == pytest.approx(0.0, abs=1e-15)


def test_a_cell_that_winds_twice_crosses_itself():
    """From its middle all of its outline is seen, counter-clockwise, but twice."""
    angles = 2 * np.pi * np.arange(10) / 10
    corners = [(float(x), float(y)) for x, y in zip(np.cos(angles), np.sin(angles), strict=True)]

    def wound(p):
        angle, radius = 2 * np.arctan2(p[:, 1], p[:, 0]), 1.0 - 0.1 * (p[:, 1] < -1e-9)
        return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) - p[:, :2]

    for displacement, crossed in ((lambda p: 0.1 * p[:, :2], False), (wound, True)):
        fields = state([corners], displacement)
        assert Solids(fields, fields.polygons.is_solid_c, 2, 8).crossed().tolist() == [crossed]


def test_only_cells_of_doubtful_shape_are_looked_at_one_by_one(monkeypatch):
    """A square, a ring with a slit, of which no point sees all, a bow tie, and one that has been turned over."""
    ring = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 1.1), (1, 1.1), (1, 2), (2, 2), (2, 1), (0, 1)]
    cells = [square(5, 0), ring, square(7, 0), square(9, 0)]

    def moved(p):
        tie, over = p[:, 2] == 2, p[:, 2] == 3
        return np.column_stack([-2 * (p[:, 0] - 7.5) * (tie * p[:, 1]) - 2 * (p[:, 0] - 9.5) * over, np.zeros(len(p))])

    looked_at = []
    real = solids._is_crossed
    monkeypatch.setattr(solids, "_is_crossed", lambda sides: looked_at.append(len(sides)) or real(sides))
    fields = state(cells, moved)
    found = Solids(fields, fields.polygons.is_solid_c, 2, 8)
    assert found.crossed().tolist() == [False, False, True, True]
    assert looked_at == [10, 4, 4]


def random_chains(rng, n=40, m=3, away=0.0):
    """Chains of very different sizes, some of whose points are shared; away from the origin."""
    before, now = (
        rng.uniform(0, 1, (n, 1, 2))
        + rng.choice([0.01, 0.1, 0.3], (n, 1, 1)) * rng.normal(0, 1, (n, m + 1, 2)).cumsum(axis=1)
        for _ in range(2)
    )
    before[1::2, 0], now[1::2, 0] = before[::2, -1], now[::2, -1]
    return Chains(3 * before + away, now - away, np.arange(n))


def all_distances(points, chains):
    """(n_points, n, m)"""
    pieces = shapely.linestrings(np.stack([chains[:, :-1], chains[:, 1:]], axis=2))
    return shapely.distance(shapely.points(points)[:, None, None], pieces)


@pytest.mark.parametrize("seed", range(10))
def test_closed_gaps_against_all_pairs(seed, monkeypatch):
    if seed % 2:
        monkeypatch.setattr(distances, "PAIRS_AT_ONCE", 1000)
    outline = random_chains(np.random.default_rng(seed), away=5.0 * (seed % 2))
    now, before = (all_distances(x[:, :-1].reshape(-1, 2), x) for x in (outline.now, outline.before))
    ids = outline.ids[:, :-1].reshape(-1, 1, 1)
    foreign = (ids != outline.ids[:, :-1]) & (ids != outline.ids[:, 1:])
    for closed, near in ((0.05, 0.5), (0.3, 0.1), (0.3, 3.0), (2.0, 0.2)):
        counts = (now < closed * before) & (now <= near) & foreign
        smallest = np.where(counts, now, np.inf).min(axis=(1, 2))
        expected = smallest[np.unique(ids, return_index=True)[1]]
        assert np.isfinite(expected).any()
        assert closed_gaps(outline, closed, near) == pytest.approx(expected[np.isfinite(expected)], rel=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_distances_beyond_against_all_pairs(seed, monkeypatch):
    if seed % 2:
        monkeypatch.setattr(distances, "PAIRS_AT_ONCE", 1000)
    rng = np.random.default_rng(seed)
    outline, body = random_chains(rng, away=5.0 * (seed % 2)), rng.integers(0, 2, 40)
    where = np.nonzero(rng.random(outline.now.shape[:2]) < 0.5)
    now, before = (all_distances(x[where], x) for x in (outline.now, outline.before))
    for own in (0.1, 1.0, 2.0):
        for bodies in (body, 0 * body):
            for closed in (0.0, 0.1, 0.5):
                around = (bodies[where[0]][:, None] == bodies)[..., None] & (before <= own)
                beyond, fold = distances_beyond(outline, where, bodies, own, closed)
                assert beyond == pytest.approx(np.where(around, np.inf, now).min(axis=(1, 2)), rel=1e-12)
                expected = np.where(around & (now < closed * before), now, np.inf).min(axis=(1, 2))
                assert fold == pytest.approx(expected, rel=1e-12)


# -- what is said ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overlap", "words"),
    [
        (Overlap(0.25, 0.5, 0.0, (1.0, 2.00001)), "depth 5.00e-01 at (1, 2), area 2.50e-01"),
        (Overlap(0.25, 0.0, 0.125, (1.0, 2.0)), "a corner closes on itself: depth 1.25e-01 at (1, 2), area 2.50e-01"),
        (Overlap(0.25, 0.5, 0.125), "depth 5.00e-01, area 2.50e-01"),
        (Overlap(), "depth 0.00e+00, area 0.00e+00"),
    ],
)
def test_overlap_in_words(overlap, words):
    assert overlap.summary() == words


@pytest.mark.parametrize(
    ("area", "depth", "exceeds"),
    [(0.0, 1.9e-6, False), (0.0, 2.1e-6, True), (3.9e-6, 0.0, False), (4.1e-6, 0.0, True), (4.1e-6, 2.1e-6, True)],
)
def test_how_much_overlap_is_too_much_in_a_domain_of_size_two(area, depth, exceeds):
    assert Overlap(area, depth, fold=1.0).exceeds(2.0) is exceeds


@pytest.mark.parametrize("values", [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5), (0.0, 0.0, 0.0)])
def test_each_kind_of_overlap_is_one(values):
    report = ContactReport(*values, None, 7, 0.125, 0.25, 0.5)
    assert report.interpenetrates is (values != (0.0, 0.0, 0.0))
    start = "solids overlap: " if any(values) else "no interpenetration; "
    assert report.summary().startswith(start)
    assert report.summary().endswith("; gap 1.250e-01 to 5.000e-01 at 7 nodes in contact")
    assert report.as_dict() == {
        "overlap_area": values[0], "penetration_depth": values[1], "fold_depth": values[2], "penetration_point": None,
        "contact_nodes": 7, "smallest_gap": 0.125, "mean_gap": 0.25, "largest_gap": 0.5,
        "interpenetrates": report.interpenetrates,
    }  # fmt: skip


def test_gaps_of_several_widths_and_the_place_of_the_deepest_point():
    """Two plates that nearly touch, 0.01 and 0.03 apart, and a wedge whose tip is 0.05 inside the lower one."""
    plates = [square(-3, 1.5), square(3, 1.5)]
    lower = [(-4, 0), (5, 0), (5, 1), (-4, 1)]
    wedge = [(0, 2.5), (0.5, 1.5), (1, 2.5)]

    def moved(p):
        down = np.select([p[:, 2] == 1, p[:, 2] == 2, p[:, 2] == 3], [0.49, 0.47, 0.55], 0.0)
        return np.column_stack([0 * down, -down])

    fields = state([lower, *plates, wedge], moved)
    report = check_contact(fields)
    assert (report.smallest_gap, report.largest_gap) == (pytest.approx(0.01), pytest.approx(0.03))
    assert report.penetration_depth == pytest.approx(0.05)
    assert report.penetration_point == pytest.approx((0.5, 0.95))
    solid = Solids(fields, fields.polygons.is_solid_c, 2, 8)
    found = find_overlap(solid, solid.chains(solid.outline()))
    assert (found.origin, found.cells) == (pytest.approx((0.5, 1.5)), (3, 0))
    assert found.area == pytest.approx(0.05 * 0.05 / 2)
    assert sorted(solid.bodies().tolist()) == [0, 1, 2, 3]
    assert solid.size == 9.0


def test_overlaps_that_are_rounding_are_none():
    """Corners that overlap by a square, in a domain of size 4: an area of 1.6e-11 is the limit."""
    wide = [(-1, 0), (1, 0), (1, 1), (-1, 1)]
    for side, area in ((3.9e-6, 0.0), (4.1e-6, 4.1e-6**2)):
        corners = state([wide, square(3, 1, 1e-3)], lambda p, a=side: p[:, 2:] * np.array([[-2.0 - a, -a]]))
        assert check_contact(corners).overlap_area == pytest.approx(area, rel=1e-3, abs=1e-20)


def test_bodies_are_cells_that_share_a_vertex():
    cells = [square(0, 0), square(1, 0), square(5, 5), square(1, 1), square(6, 6)]
    fields = state(cells, lambda p: 0 * p[:, :2], [0, 0, 0, 1, 0])
    assert Solids(fields, fields.polygons.is_solid_c, 2, 8).bodies().tolist() == [0, 0, 1, 1]
