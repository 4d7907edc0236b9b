"""How curves meet, join and turn; notches of outlines; sides in chunks; what a rank keeps of names."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh import interface as sides
from tmc_vem.mesh.between import Outline, _notches
from tmc_vem.mesh.make.outline import Arc, Curve, Line
from tmc_vem.mesh.make.shapes import (
    HUGE,
    TINY,
    _joined,
    _line_line,
    _loops,
    _meetings,
    _merged,
    _pieces,
    _turn,
    disc,
    polygon,
    signed_area,
)
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.spread.distribute import _edge_keys, _local_edges, _local_points
from tmc_vem.support.errors import InputError

CIRCLE = Arc((0.0, 0.0), 5.0, 0.0, 180.0)
NEXT = 1e-9


@pytest.mark.parametrize(
    ("a", "b", "points"),
    [
        (Line((0, 0), (4, 4)), Line((0, 2), (4, 0)), [(4 / 3, 4 / 3)]),
        (Line((0, 0), (1, 1)), Line((0, 4), (4, 0)), []),
        (Line((0, 0), (4, 0)), Line((0, 1), (4, 1)), []),
        (Line((-9, 3), (9, 3)), CIRCLE, [(-4, 3), (4, 3)]),
        (CIRCLE, Line((0, 3), (9, 3)), [(4, 3)]),
        (CIRCLE, Line((-9, 5), (9, 5)), [(0, 5)]),
        (CIRCLE, Line((-9, 5.1), (9, 5.1)), []),
        (CIRCLE, Line((-9, -3), (9, -3)), []),
        (CIRCLE, Arc((6.0, 0.0), 5.0, 0.0, 359.0), [(3, 4)]),
        (Arc((0.0, 0.0), 5.0, -170.0, 170.0), Arc((6.0, 0.0), 5.0, 1.0, 359.0), [(3, 4), (3, -4)]),
        (Arc((0.0, 0.0), 5.0, -90.0, 90.0), Arc((8.0, 0.0), 3.0, 90.0, 270.0), [(5, 0)]),
        (Arc((0.0, 0.0), 5.0, -90.0, 90.0), Arc((2.0, 0.0), 3.0, -90.0, 90.0), [(5, 0)]),
        (CIRCLE, Arc((20.0, 0.0), 5.0, 0.0, 180.0), []), (CIRCLE, Arc((0.5, 0.0), 1.0, 0.0, 180.0), []),
    ],
)  # fmt: skip
def test_where_curves_meet(a: Curve, b: Curve, points: list[tuple[float, float]]) -> None:
    found = sorted(_meetings(a, b, NEXT))
    assert len(found) == len(points)
    for place, point in zip(found, sorted(points), strict=True):
        assert place == pytest.approx(point, abs=1e-7)


def test_lines_that_hardly_cross() -> None:
    """The sine of the angle is above 1e-12, whatever the lengths."""
    for scale in (1.0, 1e4, 1e-4):
        for sine, n in ((3e-12, 1), (3e-13, 0)):
            a, b = Line((0, 0), (2 * scale, 0)), Line((0, -scale * sine), (2 * scale, scale * sine))
            assert len(_line_line(a, b)) == n


def test_curves_are_cut_where_they_meet_and_shared_ones_come_once() -> None:
    """Two squares with a common half side, a line across, and two arcs over the same ends."""
    upper, lower = Arc((1.0, 0.0), 1.0, 0.0, 180.0), Arc((1.0, 0.0), 1.0, 0.0, -180.0)
    curves = [Line((0, 0), (2, 0)), Line((2, 0), (1, 0)), Line((1, -1), (1, 2)), upper, lower]
    found = _pieces(curves, NEXT)
    ends = sorted(tuple(sorted((np.round(p.start, 9).tolist(), np.round(p.end, 9).tolist()))) for p in found)  # type: ignore[type-var]
    assert ends == [
        ([0, 0], [1, -1]), ([0, 0], [1, 0]), ([0, 0], [1, 1]), ([1, -1], [1, 0]), ([1, -1], [2, 0]), ([1, 0], [1, 1]),
        ([1, 0], [2, 0]), ([1, 1], [1, 2]), ([1, 1], [2, 0]),
    ]  # fmt: skip
    circle = _pieces([upper, lower, Arc((1.0, 0.0), 1.0, 180.0, 0.0)], NEXT)
    assert [(type(piece), round(float(piece.at(np.array([0.5]))[0, 1]))) for piece in circle] == [(Arc, 1), (Arc, -1)]


def square(*more: tuple[float, float]) -> list[Curve]:
    points = [(0.0, 0.0), *more, (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
    return [Line(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]


def test_what_goes_straight_on_is_one_curve() -> None:
    assert _merged(square((0.5, 0.0), (1.0, 0.0))) == square()
    rolled = square((1.0, 0.0))
    assert _merged([*rolled[1:], rolled[0]]) == square()
    halves: list[Curve] = [Arc((0, 0), 1.0, 0.0, 90.0), Arc((0, 0), 1.0, 90.0, 180.0), Line((-1, 0), (1, 0))]
    assert _merged(halves) == [Arc((0, 0), 1.0, 0.0, 180.0), Line((-1, 0), (1, 0))]
    for before, after, joined in (
        (Line((0, 0), (1, 0)), Line((1, 0), (2, 0.5)), None), (Line((0, 0), (1, 0)), halves[0], None),
        (Arc((0, 0), 1.0, 0.0, 180.0), Arc((0, 0), 1.0, 180.0, 360.0), None),
        (Arc((0, 0), 1.0, 0.0, 90.0), Arc((0, 0), 2.0, 90.0, 180.0), None),
        (Arc((0, 0), 1.0, 90.0, 0.0), Arc((0, 0), 1.0, 360.0, 300.0), Arc((0, 0), 1.0, 90.0, -60.0)),
    ):  # fmt: skip
        assert _joined(before, after) == joined


def test_turns_and_areas() -> None:
    ahead = Line((0, 0), (1, 0))
    assert _turn(ahead, Line((1, 0), (1, 3))) == pytest.approx(math.pi / 2)
    assert _turn(ahead, Line((1, 0), (2, -1))) == pytest.approx(-math.pi / 4)
    assert _turn(ahead, Arc((1, 1), 1.0, -90.0, 0.0)) == pytest.approx(0.0, abs=1e-5)
    assert sum(map(signed_area, square())) == pytest.approx(4.0)
    assert sum(map(signed_area, disc(3.0, 4.0, 2.0).curves)) == pytest.approx(4 * math.pi)
    assert signed_area(Arc((0, 0), 2.0, 90.0, 0.0)) == pytest.approx(-math.pi)


def test_loops_of_parts_that_touch() -> None:
    """Each keeps to itself; one that does not close is refused."""
    other = [Line((x + 2, y + 2), (s + 2, t + 2)) for (x, y), (s, t) in ((c.start, c.end) for c in square())]
    mixed: list[Curve] = [curve for pair in zip(square(), other, strict=True) for curve in pair]
    found = [[curve.start for curve in loop] for loop in _loops(mixed, NEXT)]
    assert sorted(map(len, found)) == [4, 4]
    with pytest.raises(InputError) as refused:
        _loops(square()[:3], NEXT)
    assert str(refused.value) == "the shapes' outlines do not close at (0, 2): two almost coincide there"


def test_limits_of_shapes() -> None:
    for radius in (TINY, HUGE):
        assert disc(0.0, 0.0, radius).curves[0].length == pytest.approx(math.pi * radius)
    for args, name in (((0.0, 0.0, 0.9e-100), "radius"), ((0.0, 0.0, 1.1e100), "radius"),
                       ((1.1e100, 0.0, 1.0), "centre"), ((0.0, -1.1e100, 1.0), "centre")):  # fmt: skip
        with pytest.raises(InputError, match=rf"^{name} = "):
            disc(*args)
    with pytest.raises(InputError, match=r"^corner = "):
        polygon([(0, 0), (1, 0), (0, 1.1e100)])
    with pytest.raises(InputError, match=r"^a polygon needs at least 3 corners, got 2$"):
        polygon([(0, 0), (1, 0)])


# -- outlines and sides ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "sharp"), [(0.7, True), (0.9, False)])
def test_notches_are_sharp_seen_from_outside(width: float, sharp: bool) -> None:
    """A square with a notch from above, of 2 atan(width / 2) degrees, and a point outwards that is none."""
    points = [[-2, 0], [2, 0], [2, 3], [width / 2, 2], [0, 1], [-width / 2, 2], [-2, 3], [0, -9]]
    mesh = PolygonMesh.from_cells(np.array(points, float), [[0, 1, 2, 3, 4, 5, 6], [0, 7, 1]])
    assert _notches(Outline.of(mesh)).tolist() == ([4] if sharp else [])


def test_sides_are_looked_at_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [[float(x), float(y)] for y in (0, 1) for x in range(5)]
    mesh = PolygonMesh.from_cells(points, [[x, x + 1, x + 6, x + 5] for x in range(4)])
    found = sides.interface(mesh, np.array([False, True, True, False]))
    at = np.array([[1.2, 0.5], [1.4, 0.25], [2.6, 0.75], [2.8, 0.5], [0.5, 0.5]])
    normals = np.repeat(np.array([[[1.0, 0.0], [-1.0, 0.0]]]), 5, axis=0)
    whole = found.seen(at), found.nearest(at, normals, 0.5, 0.5)
    assert whole[0].distance_n.tolist() == pytest.approx([0.2, 0.4, 0.4, 0.2, 2.5])
    for at_once in (1, 4, 7):
        monkeypatch.setattr(sides, "PAIRS_AT_ONCE", at_once)
        for one, other in zip(whole, (found.seen(at), found.nearest(at, normals, 0.5, 0.5)), strict=True):
            assert one.side_n.tolist() == other.side_n.tolist()
            assert one.point_nx.tolist() == other.point_nx.tolist()
            assert one.distance_n.tolist() == other.distance_n.tolist()
    assert [len(range(*rows.indices(5))) for rows in sides._chunks(5, 3)] == [2, 2, 1]


# -- ranks -------------------------------------------------------------------------------------------------------------


def test_names_of_a_rank() -> None:
    """Vertices 7, 3, 9 and 5 of the whole mesh are here, and edges between them."""
    here, ends = np.array([7, 3, 9, 5]), np.array([[0, 1], [2, 1], [3, 2]])
    assert _edge_keys(np.array([[3, 7], [7, 3], [2, 9]])).tolist() == [3 * 2**32 + 7, 3 * 2**32 + 7, 2 * 2**32 + 9]
    assert _local_points({"p": 9, "q": 4, "r": 7}, here) == {"p": 2, "r": 0}
    named: dict[str, Any] = {"e": np.array([[3, 7], [9, 5], [5, 7], [100, 101]]), "f": np.array([[9, 3]])}
    assert {name: pairs.tolist() for name, pairs in _local_edges(named, here, ends).items()} == {
        "e": [[0, 1], [3, 2]], "f": [[2, 1]],
    }  # fmt: skip
    assert (_local_points({}, here), _local_edges({}, here, ends)) == ({}, {})


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([[0, 1, 2, 3], [0, 1, 7]], "cell 1 refers to vertex 7; there are 4 vertices"),
        ([[0, 1, 2, -1], [0, 1, 3]], "cell 0 refers to vertex -1; there are 4 vertices"),
        ([[0, 1, 2, 3], [4, 1, 2]], "cell 1 refers to vertex 4; there are 4 vertices"),
    ],
)
def test_cells_of_vertices_that_are_not_there(cells: list[list[int]], message: str) -> None:
    with pytest.raises(InputError, match=rf"^{message}"):
        PolygonMesh.from_cells([[0, 0], [1, 0], [1, 1], [0, 1]], cells)
