"""Problems entry by entry: limits on both sides, sizes of cells, conditions, what is doubtful, hints at two solids."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tmc_vem.energy import Energy
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Punch
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.box import _divided
from tmc_vem.problems.conditions import require_held
from tmc_vem.problems.examine import check_gaps, known_cause, of_displacements, of_moduli
from tmc_vem.problems.hints import CORNER, FLUSH, SHORT, Hint, _Scene, cause_at, hints, likely
from tmc_vem.problems.probes import Displacement, Gap, MeanJ
from tmc_vem.problems.wrapped import Probed, Wrapped
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed

STEEL = Material(K=20.0, mu=10.0)


def refused(message: str, make: Any, *arguments: Any, **named: Any) -> None:
    with pytest.raises(InputError) as caught:
        make(*arguments, **named)
    assert str(caught.value) == message


# -- benchmarks ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Punch(radius=2.0, size=0.1), "radius = 2 must be smaller than the width 2 of the block"),
        (lambda: Punch(radius=1.5, size=0.1, height=1.5), None),  # larger than high is no matter
        (lambda: Punch(radius=1.5, size=0.126),
         "size = 0.126 is too large for a punch of radius 1.5: use at most 0.125"),
        (lambda: Punch(radius=1.5, size=0.125), None),
        (lambda: Punch(radius=0.4, size=0.101), "size = 0.101 is too large for a punch of radius 0.4: use at most 0.1"),
        (lambda: Punch(height=0.4, size=0.101), "size = 0.101 is too large for a punch of radius 1: use at most 0.1"),
        (lambda: Punch(stiffness=11.0, uy=-1.6),
         "uy = -1.6 moves the stiff punch through the bottom of the block: use more than -1.6, or a larger gap0"),
        (lambda: Punch(stiffness=10.0, uy=-1.6), None),
        (lambda: Punch(stiffness=11.0, uy=-1.59), None),
        (lambda: Bodies(discs=20, size=0.1), None),
        (lambda: Bodies(discs=21), "21 half discs of radius 0.2 do not fit on a beam of length 8"),
        (lambda: Bodies(size=0.2), None),
        (lambda: Bodies(size=0.21, radius=0.3),
         "size = 0.21 is too large for a beam of thickness 0.2 and half discs of radius 0.3: use at most 0.2"),
        (lambda: Bodies(size=0.21, thickness=0.3),
         "size = 0.21 is too large for a beam of thickness 0.3 and half discs of radius 0.2: use at most 0.2"),
        (lambda: CBox(polygons_across=3), None),
        (lambda: CBox(polygons_across=64), None),
        (lambda: CBox(polygons_across=65), "polygons_across = 65: use 3 to 64"),
        (lambda: CBox(column_cells=64), None),
        (lambda: CBox(column_cells=65), "column_cells = 65: use 1 to 64"),
        (lambda: CBox(medium_refinement=65), "medium_refinement = 65: use 1 (none) to 64"),
        (lambda: CBox(medium_refinement=64, cells=(10, 5)), None),
        (lambda: CBox(cells=(10, 6)),
         "6 cells in y do not resolve the wall: 0.1 is 1.2 cells of 0.0833333; the paper's C-box takes multiples of 10 "
         "in x and of 5 in y"),
        (lambda: CBox(cells=(0, 5)), "cells = (0, 5): give the number of cells in x and in y, for example 20 10"),
        (lambda: CBox(wall=1.0, height=3.0), "wall = 1 leaves no cavity in a C-box of 1 x 3"),
        (lambda: Box(wall=0.25), "wall = 0.25 leaves no cavity in a box of 2 x 0.5"),
        (lambda: Box(cells=(0, 5)), "cells = (0, 5): give the number of cells in x and in y, for example 40 10"),
        (lambda: Box(cells=(30, 10)), "30 cells in x do not resolve the wall: 0.1 is 1.5 cells of 0.0666667; use a "
         "multiple of 20"),
        (lambda: Box(cells=(2, 5)),
         "2 cells in x do not resolve the wall: 0.1 is 0.1 cells of 1; use a multiple of 20"),
        (lambda: Box(cells=(5, 5), length=0.5, wall=0.1),
         "5 cells in x leave no node in the middle of the top, where the load is; use an even number"),
        (lambda: Box(medium_refinement=65), "medium_refinement = 65: use 1 (none) to 64"),
        (lambda: Box(medium_refinement=0), "medium_refinement = 0: use 1 (none) to 64"),
        (lambda: Box(cells=(20, 5), medium_refinement=64), None),
    ],
)  # fmt: skip
def test_limits_of_the_benchmarks(make: Any, message: str | None) -> None:
    if message is None:
        make()
    else:
        refused(message, make)


def test_discs_stand_alternately_and_the_cells_are_small_in_their_gaps() -> None:
    bodies = Bodies(discs=3, length=8.0, gap0=0.1, size=0.1)
    assert [place for centre in bodies.centers() for place in centre] == pytest.approx([2.0, 0.5, 4.0, -0.3, 6.0, 0.5])
    # in the middle of the gaps, 0.1 away, where the full size begins, and between two discs
    points = np.array([(2.0, 0.25), (4.0, -0.05), (6.1, 0.25), (2.0, 0.25 + 0.7 / 3), (3.0, 0.1)])
    assert bodies._size(points).tolist() == pytest.approx([0.03, 0.03, 0.06, 0.1, 0.1])
    assert Bodies(gap0=0.4)._size(np.array([(1.0, 0.4)])).tolist() == [0.1], "never larger than the size"


def test_conditions_of_discs() -> None:
    two = {(c.where, c.component, c.value) for c in Bodies(discs=2, uy=0.2).prescribed()}
    assert {("lower", 1, 0.2), ("lower", 0, 0.0), ("upper", 1, -0.2), ("upper", 0, 0.0), ("right", 0, 0.0)} <= two
    assert all(c.where != "lower" for c in Bodies(discs=1).prescribed())
    guided, free = Bodies(case=1).regions()["discs"], Bodies(case=2).regions()["discs"]
    assert (guided.hold, free.hold) == (None, "medium")


@pytest.mark.parametrize(
    ("problem", "conditions"),
    [
        (Box(cells=(20, 5)), ["support_left 0", "support_left 1", "support_right 1", "load 1"]),
        (CBox(), ["left 0", "left 1", "load 1"]),
        (Punch(), ["bottom 0", "bottom 1", "axis 0", "top 1"]),
        (Bodies(), ["left 0", "left 1", "upper 1", "lower 1", "right 0", "right 1", "upper 0", "lower 0"]),
        (Bodies(case=2), ["left 0", "left 1", "upper 1", "lower 1", "right_corner 1"]),
    ],
)
def test_conditions_in_the_order_in_which_messages_name_them(problem: Any, conditions: list[str]) -> None:
    assert [f"{condition.where} {condition.component}" for condition in problem.prescribed()] == conditions


def test_the_mesh_below_and_above_the_beam_is_medium() -> None:
    """Two half discs, one on each side: areas by region and side."""
    bodies = Bodies(discs=2, length=3.0, size=0.1)
    mesh = bodies.make_mesh()
    middle = np.array([mesh.points_vx[loop].mean(axis=0) for loop in mesh.cells()])
    names = np.array(mesh.region_names)[mesh.region_c]
    for name in ("medium", "discs"):
        y = middle[names == name, 1]
        assert (y.min() < 0.0, y.max() > 0.2) == (True, True)
        assert ((y > -0.3) & (y < 0.5)).all()
    assert middle[(names == "discs") & (middle[:, 1] > 0), 0] == pytest.approx(1.0, abs=0.2)
    assert middle[(names == "discs") & (middle[:, 1] < 0), 0] == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(("y", "size"), [(1.3, 0.1), (1.0, 0.1), (2.0, 0.1)])
def test_cells_of_the_punch(y: float, size: float) -> None:
    punch = Punch(size=0.1, gap0=0.1)
    assert punch._size(np.array([(0.0, 1.05), (0.1, 1.05), (0.0, 1.15)])).tolist() == pytest.approx(
        [0.06, 0.6 * (0.1 + 0.45 * 0.01), 0.6 * (0.1 + 0.45 * 0.01)]
    )
    assert punch._size(np.array([(5.0, y)])).tolist() == [size]
    assert punch.top == pytest.approx(2.1)


def test_lines_of_the_refined_medium_begin_and_end_at_the_wall() -> None:
    lines = np.linspace(0.0, 2.0, 21)
    assert _divided(lines, 0.1, 2) == pytest.approx(np.linspace(0.1, 1.9, 37))
    assert _divided(lines, 0.1 * (1 + 5e-10), 1) == pytest.approx(lines[1:-1])  # up to rounding
    assert _divided(lines, 0.1 * (1 + 5e-9), 1) == pytest.approx(lines[2:-2])
    assert _divided(lines, 0.2, 3) == pytest.approx(np.linspace(0.2, 1.8, 49))


def test_voronoi_cells_of_the_box_fit_into_its_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[float] = []
    monkeypatch.setattr("tmc_vem.mesh.make.voronoi.voronoi_mesh", lambda regions, size, points: sizes.append(size))
    Box(cells=(20, 5), cell_kind="voronoi").make_mesh()
    Box(cells=(40, 10), cell_kind="voronoi").make_mesh()
    assert sizes == pytest.approx([0.07, 1.2 * 2.0 / 40])


def test_inputs_of_the_benchmarks() -> None:
    assert Bodies(case=2, size=0.05, discs=2, gap0=0.2, uy=0.3, length=6.0, thickness=0.25, radius=0.15).inputs() == {
        "problem": "bodies", "case": 2, "size": 0.05, "discs": 2, "gap0": 0.2, "uy": 0.3, "length": 6.0,
        "thickness": 0.25, "radius": 0.15, "beam": {"K": 50.0, "mu": 10.0}, "disc": {"K": 50000.0, "mu": 10000.0},
        "medium": {"gamma": 1e-4, "alpha_r": 10.0, "beta": 0.0, "regulariser": "angle"},
    }  # fmt: skip
    assert Punch(size=0.2, stiffness=2.0, gap0=0.5, uy=-1.0, width=3.0, height=2.0, radius=0.9).inputs() == {
        "problem": "punch", "size": 0.2, "stiffness": 2.0, "gap0": 0.5, "uy": -1.0, "width": 3.0, "height": 2.0,
        "radius": 0.9, "material": {"K": 5.0 / 3.0, "mu": 5.0 / 14.0},
        "medium": {"gamma": 1e-4, "alpha_r": 1.0, "beta": 0.0, "regulariser": "angle"},
    }  # fmt: skip
    assert Box(cells=(60, 15), uy=-0.9, medium_refinement=2).inputs() == {
        "problem": "box", "cells": [60, 15], "uy": -0.9, "length": 2.0, "height": 0.5, "wall": 0.1,
        "medium_refinement": 2, "cell_kind": "quadrilaterals", "material": {"K": 20.0, "mu": 10.0},
        "medium": {"gamma": 1e-5, "alpha_r": 1.0, "beta": 5.0, "regulariser": "huhu_lulu"},
    }  # fmt: skip
    assert CBox(cells=(10, 5), polygons_across=4, column_cells=2, medium_refinement=3, uy=-0.4).inputs() == {
        "problem": "cbox", "cells": [10, 5], "medium_refinement": 3, "solid_cells": "polygons", "polygons_across": 4,
        "uy": -0.4, "length": 1.0, "height": 0.5, "wall": 0.1, "column_cells": 2,
        "material": {"K": 5.0 / 3.0, "mu": 5.0 / 14.0},
        "medium": {"gamma": 1e-5, "alpha_r": 1.0, "beta": 0.0, "regulariser": "angle"},
    }  # fmt: skip


def test_a_wrapped_problem_is_the_other_one() -> None:
    box = Box(cells=(20, 5))
    other = Wrapped(box)
    assert list(other.regions()) == ["solid", "medium"]
    for name in ("prescribed", "probes", "units", "load", "inputs"):
        assert getattr(other, name)() == getattr(box, name)()
    assert (other.name, other.make_mesh().n_cells) == ("box", 100)
    probed = Probed(box, {"side": Displacement("ux", "load")})
    assert list(probed.probes()) == ["gap", "side"]
    assert probed.inputs()["probes"] == {"side": {"probe": "Displacement", "component": "ux", "at": "load"}}
    refused("probes: gap: problem 'box' has one already; choose another name", Probed, box, {"gap": MeanJ("solid")})


# -- what is held, and what is doubtful ------------------------------------------------------------------------------


def hanging(hold: str | None) -> Any:
    """A solid in the middle of the medium, which is held; a third solid outside is held too."""
    lines = np.linspace(0.0, 1.0, 6)
    parts = [Rectangle("medium", 0.0, 1.0, 0.0, 1.0), Rectangle("inner", 0.4, 0.6, 0.4, 0.6),
             Rectangle("outer", 0.0, 1.0, 0.0, 0.2)]  # fmt: skip
    mesh = with_names(structured_quadrilaterals(lines, lines, parts), lines={"bottom": ((0, 0), (1, 0))})
    regions = {
        "medium": medium_region(Medium(), 10.0),
        "inner": solid_region(STEEL, hold),
        "outer": solid_region(STEEL),
    }
    return mesh, regions, [Prescribed("bottom", 0), Prescribed("bottom", 1)]


def test_a_solid_that_only_the_medium_holds_must_say_so() -> None:
    require_held(*hanging("medium"))
    refused(
        "only the medium holds region inner, around (0.5, 0.5), against moving in x and y and turning: add a support "
        'with ux and uy at one of its points or edges; if that is meant, say hold = "medium" in [regions.inner]',
        require_held, *hanging(None),
    )  # fmt: skip


NEARLY = "nearly incompressible (1000 or more): displacements may lock; compare with smaller cells or order 3"


@pytest.mark.parametrize(
    ("K", "mu", "words"),
    [
        (999.0, 1.0, None),
        (1000.0, 1.0, f"K / mu = 1000 / 1 = 1e+03, {NEARLY}"),
        (1.1e6, 1.0, "K / mu = 1.1e+06 / 1 = 1.1e+06, above 1e+06: nothing is that incompressible, so check the units "
         "of K and mu; elements lock, and load steps fail. Rubber has about 1e3 to 1e4"),
        (1e6, 1.0, f"K / mu = 1e+06 / 1 = 1e+06, {NEARLY}"),
        (1.1e-6, 1.0, None),
        (0.9e-6, 1.0, "K / mu = 9e-07 / 1 = 9e-07, below 1e-06: check the units of K and mu"),
    ],
)  # fmt: skip
def test_moduli(K: float, mu: float, words: str | None) -> None:
    assert of_moduli({"a": solid_region(Material(K, mu))}) == ([f"region 'a' has {words}"] if words else [])
    own = RegionEnergy(Energy("own", lambda F, G, p, m: 0.0, ("K", "mu"), ""), {"K": 1e9, "mu": 1.0})
    assert of_moduli({"own": own, "medium": medium_region(Medium(), 1.0)}) == []


def test_displacements_that_are_too_large() -> None:
    lines = np.linspace(0.0, 2.0, 2)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("a", 0.0, 2.0, 0.0, 2.0)])
    held = [Prescribed("a", 1, 0.0), Prescribed("b", 1, 1.5), Prescribed("c", 0, 9.0), Prescribed("d", 1, -2.5)]
    assert of_displacements(mesh, held, (0.0, 1.0)) == []  # nothing else is prescribed in x
    said = (
        "uy = 2.6 at 'd' is 2.08 times the size of the mesh (2): bodies cannot pass through each other, so check its "
        "unit and the geometry"
    )
    assert of_displacements(mesh, held, (0.0, 0.5, -1.04)) == [said]
    assert of_displacements(mesh, held, ()) == []
    assert of_displacements(mesh, [Prescribed("c", 0, 9.0), Prescribed("e", 0, 0.0)], (1.0,))[0].startswith("ux = 9")


def test_gaps_of_one_place() -> None:
    lines = np.linspace(0.0, 2.0, 2)
    mesh = with_names(structured_quadrilaterals(lines, lines, [Rectangle("a", 0, 2, 0, 2)]), {"p": (2.0, 0.0)})
    check_gaps(mesh, {"g": Gap("p", (2.0, 1e-8)), "q": Gap("p", "unknown"), "m": MeanJ("a")})
    refused(
        "probes: g: distance of p and (2, 1e-09) is 0 always, as both are at (2, 0): name points on the two surfaces "
        "that approach",
        check_gaps, mesh, {"g": Gap("p", (2.0, 1e-9))},
    )  # fmt: skip


# -- hints -----------------------------------------------------------------------------------------------------------


def strip(names: tuple[str, str], hard: float = 10.0) -> tuple[Any, Any]:
    """Two blocks, 1 wide and 0.4 high, with 0.2 of medium between them that ends flush."""
    x, y = np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 11)
    lower, upper = names
    parts = [Rectangle("gap", 0.0, 1.0, 0.0, 1.0), Rectangle(lower, 0.0, 1.0, 0.0, 0.4),
             Rectangle(upper, 0.0, 1.0, 0.6, 1.0)]  # fmt: skip
    mesh = with_names(
        structured_quadrilaterals(x, y, parts), lines={"bottom": ((0, 0), (1, 0)), "top": ((0, 1), (1, 1))}
    )
    return mesh, {
        lower: solid_region(STEEL), upper: solid_region(Material(K=2.0, mu=1.0)),
        "gap": medium_region(Medium(alpha_r=0.01), hard),
    }  # fmt: skip


MOVED = (Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 0), Prescribed("top", 1, -0.25))


@pytest.mark.parametrize("names", [("a", "b"), ("b", "a")])
def test_hints_name_each_solid_at_its_end_of_the_gap(names: tuple[str, str]) -> None:
    mesh, regions = strip(names)
    found = hints(mesh, regions, MOVED)
    flush = [hint for hint in found if hint.kind == FLUSH]
    assert len(flush) == 2
    for hint in flush:
        lower = min(range(2), key=lambda n: hint.places[n][1])
        assert hint.regions == ("gap", names[lower], names[1 - lower])
        assert [hint.places[n][1] for n in (lower, 1 - lower)] == pytest.approx([0.4, 0.6])
    (short,) = [hint for hint in found if hint.kind == SHORT]
    assert short.regions[0] == "gap"
    assert set(short.regions[1:]) == {"a", "b"}
    assert (short.width, short.where[1]) == (pytest.approx(0.2), pytest.approx(0.5))
    assert short.sentence == (
        f"alpha_r = 0.01 of region 'gap' has the length sqrt(alpha_r / mu) = {math.sqrt(0.001):.3g}, small against the "
        f"gap of 0.2 at ({short.where[0]:.4g}, 0.5), so the medium may fold and let bodies pass: use about 2.5 mu "
        "gap^2 = 1 (alpha = 2.5)"
    )


def test_how_far_bodies_come_near_each_other() -> None:
    """By components, the worst of all load factors, with what is free counted as 0."""
    mesh, regions = strip(("a", "b"))
    is_medium = np.array([name == "gap" for name in mesh.region_names])[mesh.region_c]
    held = (Prescribed("bottom", 1, 0.1), Prescribed("top", 1, -0.25), Prescribed("top", 0, 0.05))
    scene = _Scene(mesh, regions, held, (1.0,), is_medium)
    middle = np.array([mesh.points_vx[loop].mean(axis=0)[1] for loop in mesh.cells()])
    low, up = (int(scene.body_c[np.flatnonzero(chosen)[0]]) for chosen in (middle < 0.4, middle > 0.6))
    assert scene.moves_lbci[0][[low, up]].tolist() == [[[0.0, 0.0], [0.1, 0.1]], [[0.05, 0.05], [-0.25, -0.25]]]
    first, second = np.array([low, low, up, low]), np.array([up, up, low, up])
    direction = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
    assert scene.closing(first, second, direction) == pytest.approx([0.35, -0.05, 0.35, 0.8 * 0.35 - 0.6 * 0.05])
    worst = replace(scene, loads=(0.5, -2.0, 1.0))
    assert worst.closing(first, second, direction) == pytest.approx([0.35, 0.1, 0.35, 0.25])


def test_the_nearest_cause_within_a_gap_s_width() -> None:
    def hint(x: float, width: float) -> Hint:
        return Hint(CORNER, ((x, 0.0), (x, 1.0)), ("m",), width, True, f"at {x:g}")

    one, two = hint(0.0, 1.0), hint(3.0, 0.5)
    assert cause_at([one, two], (0.9, 0.0)) is one
    assert cause_at([one, two], (1.1, 1.0)) is None
    assert cause_at([one, two], (2.6, 1.0)) is two
    assert cause_at([one, two], (3.0, 1.5)) is two
    assert one.where == (0.0, 0.5)
    assert likely([one, replace(two, likely=False), replace(two, kind=FLUSH), one]) == ["at 0", "at 3"]


def test_the_cause_that_is_known_is_told_in_its_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, regions = strip(("a", "b"))
    problem: Any = SimpleNamespace(make_mesh=lambda: mesh, regions=lambda: regions, prescribed=lambda: MOVED)
    assert known_cause(problem, None) is None
    assert known_cause(problem, (0.5, 5.0)) is None
    assert "ends flush at (1, 0." in (known_cause(problem, (1.05, 0.55)) or "")
