"""By hand: curves, nodes along outlines, outlines of meshes, refinement, the sizes that geometries of gmsh ask for."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.files import geo
from tmc_vem.mesh.make import narrow
from tmc_vem.mesh.make.narrow import narrow_place
from tmc_vem.mesh.make.outline import Arc, Line, Region, evaluate_size, make_skeleton
from tmc_vem.mesh.make.refine import refine
from tmc_vem.mesh.make.repair import repair
from tmc_vem.mesh.make.traced import trace_outline
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]


# -- curves ------------------------------------------------------------------------------------------------------------


def test_lines() -> None:
    line = Line((1.0, 1.0), (5.0, 4.0))
    assert line.at(np.array([0.0, 0.5, 1.0])).tolist() == [[1, 1], [3, 2.5], [5, 4]]
    assert line.length == 5.0
    assert line.parameter_of((3 - 0.6, 2.5 + 0.8)) == (pytest.approx(0.5), pytest.approx(1.0))
    assert line.parameter_of((0.0, 1.0)) == (0.0, 1.0)
    assert line.parameter_of((5.0, 6.0)) == (1.0, 2.0)
    assert line.part(0.2, 0.4, (7, 8), (9, 9)) == Line((7, 8), (9, 9))


@pytest.mark.parametrize(
    ("first", "last", "sign"), [(0.0, 90.0, 1), (90.0, 0.0, -1), (-270.0, -360.0, -1), (360.0, 450.0, 1)]
)
def test_arcs(first: float, last: float, sign: int) -> None:
    """A quarter of a circle about (1, 2), both ways round."""
    arc = Arc((1.0, 2.0), 2.0, first, last)
    ends = [[3, 2], [1, 4]][::sign]
    half = math.sqrt(2.0)
    assert [arc.start, arc.end] == [pytest.approx(end) for end in ends]
    assert arc.at(np.array([0.5]))[0] == pytest.approx([1 + half, 2 + half])
    assert arc.length == pytest.approx(math.pi)
    third = (1 + 3 * math.cos(math.radians(30)), 2 + 3 * math.sin(math.radians(30)))
    assert arc.parameter_of(third) == (pytest.approx(1 / 3 if sign > 0 else 2 / 3), pytest.approx(1.0))
    assert arc.parameter_of((3.0, 1.0))[0] == (0.0 if sign > 0 else 1.0)
    assert arc.parameter_of((3.0, 1.0))[1] == pytest.approx(1.0)
    assert arc.parameter_of((0.0, 4.0)) == (1.0 if sign > 0 else 0.0, pytest.approx(1.0))
    part = arc.part(0.25, 0.5, (0, 0), (1, 1))
    assert (part.center, part.radius) == ((1.0, 2.0), 2.0)
    assert (part.first, part.last) == (first + sign * 22.5, first + sign * 45)


@pytest.mark.parametrize(
    ("radius", "last", "message"),
    [
        (0.0, 90.0, "arc about (1, 2): radius = 0 must be a positive number"),
        (-1.0, 90.0, "arc about (1, 2): radius = -1 must be a positive number"),
        (math.inf, 90.0, "arc about (1, 2): radius = inf must be a positive number"),
        *((1.0, last, f"arc about (1, 2) runs from 10 to {last:g} degrees: use an angle between 0 and 360, and two "
           "arcs for a circle") for last in (10.0, 370.0, -350.0)),
    ],
)  # fmt: skip
def test_arcs_that_are_none(radius: float, last: float, message: str) -> None:
    with pytest.raises(InputError) as refused:
        Arc((1, 2), radius, 10.0, last)
    assert str(refused.value) == message
    assert Arc((1, 2), 1.0, 10.0, 369.9).length == pytest.approx(math.radians(359.9))


def test_outlines_of_regions() -> None:
    """Points that follow each other are joined; those that coincide, and ends of arcs, are not joined twice."""
    arc = Arc((2.0, 1.0), 1.0, -90.0, 90.0)
    region = Region("r", [(0, 0), (0, 1e-10), (2, 0), arc, (0, 2)], [SQUARE])
    assert region.curves()[:4] == [
        Line((0, 1e-10), (2, 0)), arc, Line(arc.end, (0, 2)), Line((0, 2), (0, 0)),
    ]  # fmt: skip
    assert region.curves()[4:] == [Line(a, b) for a, b in zip(SQUARE, SQUARE[1:] + SQUARE[:1], strict=True)]
    assert Region("r", [arc, (1, 1)]).polygon(per_curve=2).exterior.coords[:3] == [
        pytest.approx(point) for point in ((2, 0), (3, 1), (2, 2))
    ]
    assert Region("r", [*SQUARE], [[(0.5, 0.5), (1, 0.5), (1, 1)]]).polygon().area == pytest.approx(4 - 0.125)
    assert len(Region("r", [arc]).curves()) == 2
    for entries in ([], [(0, 0)], [(0, 0), (1, 1)], [(1, 1), (1, 1), (1, 1)]):
        with pytest.raises(InputError) as refused:
            Region("r", entries).curves()
        assert str(refused.value) == "region 'r': its outline needs at least 3 points, or an arc and a line"
    with pytest.raises(InputError, match=r"^region 'r': Self-intersection\[1 1\]$"):
        Region("r", [(0, 0), (2, 2), (2, 0), (0, 2)]).polygon()


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_sizes_are_positive(bad: float) -> None:
    points = np.array([[1.0, 2.0], [3.0, 4.5]])
    assert evaluate_size(0.5, points).tolist() == [0.5, 0.5]
    assert evaluate_size(lambda x: x[:, 1], points).tolist() == [2, 4.5]
    for size, place in ((bad, "(1, 2)"), (lambda x: np.where(x[:, 0] > 2, bad, 1.0), "(3, 4.5)")):
        with pytest.raises(InputError) as refused:
            evaluate_size(size, points)
        assert str(refused.value) == f"the size of cells is {bad:g} at {place}; it must be a positive number"


# -- nodes along outlines ----------------------------------------------------------------------------------------------


def test_nodes_along_shared_outlines() -> None:
    """A square beside half of another one's side: the shared side has its nodes once, and ends where either ends."""
    other = [(2.0, 0.0), (4.0, 0.0), (4.0, 1.0), (2.0, 1.0)]
    found = make_skeleton([Region("a", SQUARE), Region("b", other)], 0.5, {"p": (0.0, 1.2), "q": (4.0, 1.0)})
    nodes = found.nodes_nx
    assert nodes[:8].tolist() == [[0, 0], [2, 0], [2, 2], [0, 2], [4, 0], [4, 1], [2, 1], [0, 1.2]]
    assert dict(found.names) == {"p": 7, "q": 5}
    on_shared = nodes[(nodes[:, 0] == 2) & (nodes[:, 1] <= 1)]
    assert sorted(on_shared[:, 1].tolist()) == [0, 0.5, 1]
    lengths = np.hypot(*(nodes[found.segments_sn[:, 1]] - nodes[found.segments_sn[:, 0]]).T)
    assert len(found.segments_sn) == 4 + 2 + 2 + 4 + 2 + 2 + 4 + 2 + 4
    assert lengths.max() == pytest.approx(0.6)
    assert lengths.sum() == pytest.approx(8 + 5)
    graded = make_skeleton([Region("a", SQUARE)], lambda x: 0.1 + 0.2 * x[:, 0])
    low = np.sort(graded.nodes_nx[np.abs(graded.nodes_nx[:, 1]) < 1e-12][:, 0])
    count = math.log(0.5 / 0.1) / 0.2
    assert len(low) - 1 == round(count)
    exact = (0.1 * np.exp(0.2 * count * np.arange(len(low)) / (len(low) - 1)) - 0.1) / 0.2
    assert low == pytest.approx(exact, abs=1e-4)
    assert len(make_skeleton([Region("a", SQUARE)], 50.0).segments_sn) == 8  # two a side at least
    assert len(make_skeleton([Region("a", [Arc((0, 0), 1.0, 0.0, 180.0)])], 50.0).segments_sn) == 6  # three at arcs


def test_named_places_are_on_outlines() -> None:
    """Up to a millionth of the domain; rounded ones move to the outline, or to an end of it that is as near."""
    regions = [Region("a", SQUARE)]
    for place, at in (
        ((1.0, 1e-10), (1, 1e-10)), ((1.0, 1e-7), (1, 0)), ((1e-7, -1e-7), (0, 0)), ((1.0, 1.9e-6), (1, 0)),
    ):  # fmt: skip
        found = make_skeleton(regions, 1.0, {"p": place})
        assert found.nodes_nx[found.names["p"]] == pytest.approx(at, abs=1e-12)
    with pytest.raises(InputError) as refused:
        make_skeleton(regions, 1.0, {"p": (1.0, 2.1e-6)})
    assert str(refused.value) == (
        "named point 'p' at (1, 2.1e-06) is on no region's outline: the nearest place on one is (1, 0)"
    )


def test_narrow_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cells must fit across: of a strip of 0.5, and of the gap of 0.3 between two squares."""
    strip = Region("strip", [(0, 0), (3, 0), (3, 0.5), (0, 0.5)])
    assert narrow_place([strip], make_skeleton([strip], 0.25), 0.25) is None
    assert narrow_place([strip], make_skeleton([strip], 0.26), 0.26) == (
        "the interface near (0, 0.25) is not resolved: region 'strip' is 0.5 wide there, too narrow for cells of size "
        "0.26; two must fit across, so use a size of 0.25 or less there (refine), or make it wider"
    )
    two = [Region("a", SQUARE), Region("b", [(2.3, 0), (4, 0), (4, 2), (2.3, 2)])]
    said = narrow_place(two, make_skeleton(two, 0.2), 0.2)
    assert said is not None
    assert said.startswith("the interface near (2.15, 0) is not")
    assert "the gap between regions is 0.3 wide there, too narrow for cells of size 0.2; " in said
    assert "a size of 0.15 or less" in said
    assert narrow_place(two, make_skeleton(two, 0.15), 0.149) is None
    monkeypatch.setattr(narrow, "PAIRS_AT_ONCE", 1)
    assert narrow_place(two, make_skeleton(two, 0.2), 0.2) == said


# -- outlines of meshes ------------------------------------------------------------------------------------------------


def frame() -> PolygonMesh:
    """Nine squares, of which the middle one is another region, and a corner one as well."""
    lines = [[x, y] for y in range(4) for x in range(4)]
    cells = [[4 * j + i, 4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4] for j in range(3) for i in range(3)]
    return PolygonMesh.from_cells(
        lines, cells, [0, 0, 0, 0, 1, 0, 0, 0, 1], ("out", "in"), {"p": 2, "inner": 5},
        {"low": np.array([[1, 0], [1, 2]]), "left": np.array([[0, 4]]), "all": np.array([[0, 4]])},
    )  # fmt: skip


def test_outlines_are_traced() -> None:
    traced = trace_outline(frame())
    assert sorted(tuple(min(run, run[::-1])) for run in traced.runs) == [
        (0, 1, 2), (0, 4), (2, 3), (3, 7, 11), (4, 8, 12), (5, 6), (5, 9), (6, 10), (9, 10), (10, 11), (10, 14),
        (11, 15), (12, 13, 14), (14, 15),
    ]  # fmt: skip
    names = {tuple(min(run, run[::-1])): name for run, name in zip(traced.runs, traced.names, strict=True)}
    assert {run: name for run, name in names.items() if name} == {(0, 1, 2): ("low",), (0, 4): ("left", "all")}
    assert traced.corners == {0, 2, 3, 4, 5, 6, 9, 10, 11, 12, 14, 15}

    def walked(loop: list[tuple[int, bool]]) -> list[int]:
        found: list[int] = []
        for run, forward in loop:
            found += (traced.runs[run] if forward else traced.runs[run][::-1])[:-1]
        return found

    def area(vertices: list[int]) -> float:
        x, y = np.array([(v % 4, v // 4) for v in vertices], dtype=float).T
        return float(0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())

    found = sorted((face.region, [area(walked(loop)) for loop in face.loops]) for face in traced.faces)
    assert found in ([(0, [8.0, -1.0]), (1, [1.0]), (1, [1.0])], [(0, [7.0]), (1, [1.0]), (1, [1.0])])
    whole = next(face for face in traced.faces if face.region == 0)
    assert whole.contains(np.array([0.5, 0.5]))
    assert not whole.contains(np.array([2.5, 2.5]))
    assert not whole.contains(np.array([-0.5, 0.5]))
    inside = PolygonMesh.from_cells(
        frame().points_vx, [loop.tolist() for loop in frame().cells()], None, ("x",), None, {"e": np.array([[5, 6]])}
    )
    with pytest.raises(InputError) as refused:
        trace_outline(inside)
    assert str(refused.value) == "edges named 'e' lie inside a region: a new mesh of the outlines would lose them"


def test_parts_that_touch_in_a_point_are_apart() -> None:
    """Two squares of a region, corner to corner, beside two of another: four faces of one loop each."""
    points = [[x, y] for y in range(3) for x in range(3)]
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    traced = trace_outline(PolygonMesh.from_cells(points, cells, [0, 1, 1, 0], ("a", "b")))
    assert sorted((face.region, len(face.loops)) for face in traced.faces) == [(0, 1), (0, 1), (1, 1), (1, 1)]
    for face in traced.faces:
        inside = [face.contains(np.array([x, y])) for x in (0.5, 1.5) for y in (0.5, 1.5)]
        assert inside.count(True) == 1
        assert np.ptp(face.polygon, axis=0).tolist() == [1, 1]
    assert list(map(len, traced.runs)) == [2] * 12
    assert traced.corners >= {1, 3, 4, 5, 7}


# -- repairs -----------------------------------------------------------------------------------------------------------


def test_repairs_by_hand() -> None:
    """A square beside two others with a doubled corner: clockwise, with a node on its side and one in no cell."""
    points = [[9, 9], [0, 0], [1, 0], [1, 1], [0, 1], [1, 0], [2, 0], [2, 0.5], [1, 0.5], [2, 1], [1, 1 + 1e-5]]
    cells = [[4, 3, 2, 1], [5, 6, 7, 8], [8, 7, 9, 10]]
    mesh = PolygonMesh(
        np.array(points, dtype=float), np.arange(4) * 4, np.concatenate(cells), np.array([1, 0, 0]), ("a", "b"),
        {"first": 1, "far": 0, "near": 10}, {"e": np.array([[2, 3], [3, 10], [0, 1]]), "top": np.array([[10, 9]])},
        validate=False,
    )  # fmt: skip
    good = repair(mesh)
    assert good.points_vx.tolist() == [[0, 0], [1, 0], [0, 1], [2, 0], [2, 0.5], [1, 0.5], [2, 1], [1, 1 + 1e-5]]
    assert [loop.tolist() for loop in good.cells()] == [[0, 1, 5, 7, 2], [1, 3, 4, 5], [5, 4, 6, 7]]
    assert (good.region_c.tolist(), good.region_names) == ([1, 0, 0], ("a", "b"))
    assert dict(good.named_points) == {"first": 0, "near": 7}
    assert {name: pairs.tolist() for name, pairs in good.named_edges.items()} == {
        "e": [[1, 5], [5, 7]],
        "top": [[6, 7]],
    }


# -- refinement --------------------------------------------------------------------------------------------------------


def row(n: int) -> PolygonMesh:
    points = [[2.0 * x, 2.0 * y] for y in (0, 1) for x in range(n + 1)]
    cells = [[x, x + 1, x + n + 2, x + n + 1] for x in range(n)]
    return PolygonMesh.from_cells(
        points, cells, [1, 0, 0, 0][:n], ("a", "b"), {"p": 1}, {"low": np.array([[1, 0], [1, 2]])}
    )


def test_refinement_by_hand() -> None:
    """The left of two squares: four children from its first corner on, a hanging node on the other, edges in pieces."""
    mesh = refine(row(2), [0])
    assert mesh.points_vx[:6].tolist() == row(2).points_vx.tolist()
    assert mesh.points_vx[6:].tolist() == [[1, 0], [2, 1], [1, 2], [0, 1], [1, 1]]
    assert [loop.tolist() for loop in mesh.cells()] == [
        [9, 0, 6, 10], [6, 1, 7, 10], [7, 4, 8, 10], [8, 3, 9, 10], [1, 2, 5, 4, 7],
    ]  # fmt: skip
    assert (mesh.region_c.tolist(), mesh.region_names, dict(mesh.named_points)) == ([1] * 4 + [0], ("a", "b"), {"p": 1})
    assert {name: pairs.tolist() for name, pairs in mesh.named_edges.items()} == {"low": [[1, 6], [6, 0], [1, 2]]}
    again = refine(mesh, np.array([False, True, False, False, False]))  # beside it, three on a side of the last
    assert again.n_cells == 4 + 3 + 4
    assert refine(mesh, [1], max_hanging=3).n_cells == 4 + 3 + 1
    other = refine(mesh, [4])  # the hanging node is the middle of its side
    assert other.n_vertices == mesh.n_vertices + 4
    assert other.n_cells == 8
    assert refine(row(2), []).n_cells == 2


@pytest.mark.parametrize(
    ("marked", "options", "message"),
    [
        ([0], {"max_hanging": 0}, "max_hanging = 0: a refined cell leaves one hanging node, use 1 or more"),
        ([0, 2], {}, "cells 0 to 2 are marked, but cells run from 0 to 1"),
        ([-1, 1], {}, "cells -1 to 1 are marked, but cells run from 0 to 1"),
        (np.ones(3, dtype=bool), {}, "the mask has 3 entries for 2 cells"),
    ],
)  # fmt: skip
def test_refinement_that_is_refused(marked: Any, options: dict[str, int], message: str) -> None:
    with pytest.raises(InputError) as refused:
        refine(row(2), marked, **options)
    assert str(refused.value) == message


@pytest.mark.parametrize(("at", "inserted"), [(0.31, False), (0.69, False), (0.29, True), (0.71, True), (0.5, False)])
def test_hanging_nodes_near_the_middle_halve_a_side(at: float, inserted: bool) -> None:
    points = [[0, 0], [at, 0], [1, 0], [1, 1], [0, 1]]
    mesh = refine(PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4]]), [0])
    assert mesh.n_vertices == 5 + 3 + 1 + inserted
    assert mesh.n_cells == 4
    middle = mesh.points_vx[np.abs(mesh.points_vx[:, 1]) < 1e-12][:, 0].max()
    assert middle == 1.0
    new = [x for x, y in mesh.points_vx[5:].tolist() if y == 0.0]
    assert new == ([pytest.approx((at + (1 if at < 0.5 else 0)) / 2)] if inserted else [])
    dart = PolygonMesh.from_cells([[0, 0], [4, 3], [8, 0], [4, 3.5]], [[0, 1, 2, 3]])
    with pytest.raises(InputError, match=r"^cell 0 cannot be refined: it is not star-shaped about its centroid$"):
        refine(dart, [0])


# -- sizes of geometries -----------------------------------------------------------------------------------------------


class Gmsh:
    """As much of gmsh as the estimate asks: surfaces with their boxes, and numbers of nodes along their curves."""

    def __init__(self, surfaces: dict[int, tuple[tuple[float, ...], list[int]]]) -> None:
        self.surfaces, self.options = surfaces, {geo.SIZE_MIN: 0.25}
        self.said: list[Any] = []
        self.option = self.model = self.mesh = self

    def getNumber(self, name: str) -> float:
        return self.options[name]

    def setNumber(self, name: str, value: float) -> None:
        self.said.append(value)
        self.options[name] = value

    def getBoundingBox(self, dimension: int, tag: int) -> tuple[float, ...]:
        return (0, 0, 0, 40, 80, 0) if tag < 0 else self.surfaces[tag][0]

    def getEntities(self, dimension: int) -> list[tuple[int, int]]:
        return [(dimension, tag) for tag in self.surfaces]

    def getBoundary(self, of: list[tuple[int, int]], oriented: bool) -> list[tuple[int, int]]:
        assert not oriented
        return [(1, n) for n in self.surfaces[of[0][1]][1]]

    def getNodes(self, dimension: int, n: int, **options: bool) -> tuple[Any, Any, Any]:
        assert options == {"includeBoundary": True, "returnParametricCoord": False}
        return None, np.zeros(3 * n), None

    def generate(self, dimension: int) -> None:
        self.said.append(f"generate {dimension}")

    def clear(self) -> None:
        self.said.append("clear")


@pytest.mark.parametrize(
    ("surfaces", "n_cells"),
    [
        ({1: ((0, 0, 0, 2, 1, 0), [11, 6, 11, 6])}, geo.TRIANGLES * 2.0 / 0.2**2),
        ({1: ((0, 0, 0, 2, 1, 0), [2, 1, 0, 2])}, geo.TRIANGLES * 2.0 / 1.5**2),
        ({1: ((3, 1, 0, 5, 2, 0), [11, 6, 11, 6]), 7: ((0, 0, 0, 8, 8, 0), [5, 5, 5, 5])},
         geo.TRIANGLES * (2.0 / 0.2**2 + 64.0 / 2.0**2)),
        ({1: ((0, 0, 0, 2, 0, 0), [11, 11])}, 10.0), ({1: ((0, 0, 0, 0, 0, 0), [5, 3])}, 3.0),
    ],
)  # fmt: skip
def test_cells_of_a_geometry_are_estimated(surfaces: Any, n_cells: float, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Any] = []
    monkeypatch.setattr(geo, "check_cells", lambda *values: found.append(values))
    for limit, smallest in ((100.0, 0.8), (1000.0, 0.25)):
        gmsh = Gmsh(surfaces)
        geo._check_curves(gmsh, limit)
        assert found.pop() == (
            pytest.approx(n_cells), limit,
            "going by the nodes that it asks for along its curves; use larger sizes in it",
        )  # fmt: skip
        assert gmsh.said == [smallest, "generate 1", 0.25, "clear"]
