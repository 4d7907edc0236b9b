"""Supports and loads leave nothing arbitrary: rigid motions, two values at a node, load on a support."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from helpers_mesh import voronoi

from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import free_parts
from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Punch
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.conditions import check_conditions, check_shared, require_cells, require_held
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
LINES = {"bottom": SQUARE[:2], "right": SQUARE[1:3], "top": SQUARE[2:], "left": (SQUARE[3], SQUARE[0])}
POINTS = {"a": SQUARE[0], "b": SQUARE[1], "c": SQUARE[2], "d": SQUARE[3]}


def square(scale: float = 1.0, shift: float = 0.0, turn: float = 0.0) -> PolygonMesh:
    """Unit square of 4 x 4 cells with names, scaled, moved and turned by a part of a turn."""
    x = np.linspace(0.0, 1.0, 5)
    mesh = with_names(structured_quadrilaterals(x, x, [Rectangle("block", 0.0, 1.0, 0.0, 1.0)]), POINTS, LINES)
    angle = 2.0 * np.pi * turn
    matrix = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return dataclasses.replace(mesh, points_vx=scale * (mesh.points_vx @ matrix + shift), validate=False)


def held(mesh: PolygonMesh, conditions: Sequence[tuple[str, str]]) -> Any:
    from tmc_vem.problems.conditions import held_components

    return held_components(mesh, [Prescribed(where, ("ux", "uy").index(what)) for where, what in conditions])


def motions(mesh: PolygonMesh, *conditions: tuple[str, str]) -> list[str]:
    return [part.motion for part in free_parts(mesh, np.ones(mesh.n_cells, bool), held(mesh, conditions))]


CASES: list[tuple[list[tuple[str, str]], str]] = [
    ([], "moving in x and y and turning"),
    ([("bottom", "uy")], "moving in x"),
    ([("bottom", "ux")], "moving in y and turning"),
    ([("bottom", "uy"), ("top", "uy")], "moving in x"),
    ([("left", "ux"), ("right", "ux")], "moving in y"),
    ([("a", "ux"), ("a", "uy")], "turning about (0, 0)"),
    ([("a", "ux"), ("d", "uy")], "turning about (0, 0)"),
    ([("bottom", "ux"), ("left", "uy")], "turning about (0, 0)"),
    ([("bottom", "ux"), ("b", "uy")], "turning about (1, 0)"),
    ([("a", "ux"), ("b", "ux")], "moving in y and turning"),
]
HELD: list[list[tuple[str, str]]] = [
    [("a", "ux"), ("a", "uy"), ("b", "uy")],
    [("a", "ux"), ("b", "uy"), ("c", "ux")],
    [("bottom", "ux"), ("bottom", "uy")],
    [("left", "ux"), ("a", "uy")],
    [("bottom", "uy"), ("a", "ux")],
]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e4])
@pytest.mark.parametrize(("conditions", "motion"), CASES)
def test_rigid_motions_are_found_in_any_unit_and_place(conditions, motion, scale, shift):
    (found,) = motions(square(scale, shift), *conditions)
    assert found.split(" about")[0] == motion.split(" about")[0]
    if scale == 1.0 and shift == 0.0:
        assert found == motion


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("conditions", HELD)
def test_few_conditions_are_enough(conditions, scale):
    assert motions(square(scale, 1e4), *conditions) == []


def test_rounding_does_not_hold():
    """The bottom of a square that is turned by 90 degrees is a line x = const up to rounding."""
    mesh = square(turn=0.25)
    assert motions(mesh, ("bottom", "uy"), ("a", "ux")) == ["turning about (0, 0)"]
    assert motions(mesh, ("bottom", "ux"), ("a", "uy")) == []
    (motion,) = motions(mesh, ("left", "uy"), ("b", "uy"))
    assert motion == "moving in x"
    noise = 1e-9 * np.random.default_rng(0).standard_normal((25, 2))
    noisy = dataclasses.replace(square(), points_vx=square().points_vx + noise, validate=False)
    assert motions(noisy, ("bottom", "ux"), ("a", "uy"))[0].startswith("turning about")


def test_two_neighbouring_nodes_hold_a_large_mesh():
    mesh = voronoi(300)
    start, end = mesh.edges.vertices_ev[0].tolist()
    component = int(np.ptp(mesh.points_vx[[start, end]], axis=0).argmin())
    mesh = dataclasses.replace(mesh, named_points={"a": start, "b": end}, validate=False)
    conditions = [("a", "ux"), ("a", "uy"), ("b", ("ux", "uy")[component])]
    assert motions(mesh, *conditions) == []


def islands(touching: bool) -> PolygonMesh:
    """Two unit squares, apart or with a common corner at (1, 1)."""
    x = np.array(SQUARE)
    if not touching:
        return PolygonMesh.from_cells(
            np.concatenate([x, x + 2.0]), [(0, 1, 2, 3), (4, 5, 6, 7)], (0, 1), ("one", "two"),
            {"a": 0, "b": 1, "c": 6, "e": 5},
        )  # fmt: skip
    points = np.concatenate([x, x[1:] + 1.0])
    return PolygonMesh.from_cells(
        points, [(0, 1, 2, 3), (2, 4, 5, 6)], (0, 1), ("one", "two"), {"a": 0, "b": 1, "c": 5}
    )


FIXED = [("a", "ux"), ("a", "uy"), ("b", "uy")]


def test_every_connected_part_is_looked_at():
    mesh = islands(touching=False)
    (part,) = free_parts(mesh, np.ones(2, bool), held(mesh, FIXED))
    assert (part.number, part.n_parts, part.middle) == (2, 2, (2.5, 2.5))
    assert part.motion == "moving in x and y and turning"
    assert motions(mesh, *FIXED, ("c", "ux"), ("c", "uy"), ("e", "ux")) == []


def test_a_body_turns_about_a_corner_that_it_shares_with_another():
    mesh = islands(touching=True)
    assert motions(mesh, *FIXED) == ["turning"]
    assert motions(mesh, *FIXED, ("c", "uy")) == []


SOLID = solid_region(Material(20.0, 10.0))
MEDIUM = medium_region(Medium(), 10.0)


def in_medium() -> tuple[PolygonMesh, dict[str, RegionEnergy]]:
    x = np.linspace(0.0, 1.0, 6)
    parts = [Rectangle("medium", 0.0, 1.0, 0.0, 1.0), Rectangle("plug", 0.4, 0.6, 0.4, 0.8)]
    mesh = with_names(structured_quadrilaterals(x, x, parts), {**POINTS, "p": (0.4, 0.8)}, {
        **LINES, "head": ((0.4, 0.8), (0.6, 0.8))})  # fmt: skip
    return mesh, {"medium": MEDIUM, "plug": SOLID}


def conditions(*given: tuple[str, str]) -> list[Prescribed]:
    return [Prescribed(where, ("ux", "uy").index(what)) for where, what in given]


def test_a_solid_that_only_the_medium_holds_is_refused_unless_the_problem_says_so():
    mesh, regions = in_medium()
    around = [("bottom", "ux"), ("bottom", "uy")]
    with pytest.raises(InputError) as error:
        require_held(mesh, regions, conditions(*around, ("head", "uy")))
    assert "only the medium holds region plug against moving in x" in str(error.value)
    assert 'hold = "medium" in [regions.plug]' in str(error.value)
    with pytest.raises(InputError, match=r"only the medium holds region plug against turning about \(0.4, 0.8\)"):
        require_held(mesh, regions, conditions(*around, ("p", "uy"), ("p", "ux")))
    require_held(mesh, regions, conditions(*around, ("head", "uy"), ("p", "ux")))
    regions["plug"] = dataclasses.replace(SOLID, hold="medium")
    require_held(mesh, regions, conditions(*around))
    with pytest.raises(InputError, match=r"nothing holds part 1 \(regions medium, plug\) against moving in x"):
        require_held(mesh, regions, conditions(("bottom", "uy")))


@pytest.mark.parametrize(
    "problem", [Box(cells=(20, 5)), CBox(), Punch(), Bodies(), Bodies(case=2), Bodies(discs=1, length=2.0)]
)
def test_the_benchmarks_are_held(problem):
    mesh = problem.make_mesh()
    require_held(mesh, problem.regions(), problem.prescribed())
    check_conditions(problem.prescribed(), problem.load())
    check_shared(mesh, problem.prescribed(), problem.load())


def test_only_case_2_needs_the_medium():
    assert {name for name, region in Bodies(case=2).regions().items() if region.hold} == {"discs"}
    assert not any(region.hold for region in Bodies(case=1).regions().values())
    free = {name: dataclasses.replace(region, hold=None) for name, region in Bodies(case=2).regions().items()}
    with pytest.raises(InputError, match=r"only the medium holds region discs, around .* against moving in x"):
        require_held(Bodies(case=2).make_mesh(), free, Bodies(case=2).prescribed())


LOAD = Prescribed("top", 1, -0.25)


@pytest.mark.parametrize(
    ("supports", "words"),
    [
        ([Prescribed("top", 1, 0.0)], ("'top'", "support uy = 0", "load uy = -0.25")),
        ([LOAD], ("'top'", "support uy = -0.25", "load uy = -0.25")),
        ([Prescribed("left", 0, 0.0), Prescribed("left", 0, 0.1)], ("'left'", "ux = 0 and ux = 0.1")),
    ],
)
def test_one_value_for_a_name(supports, words):
    with pytest.raises(InputError) as error:
        check_conditions([*supports, LOAD], LOAD)
    assert all(word in str(error.value) for word in words)


def test_something_must_move():
    still = Prescribed("top", 1, 0.0)
    with pytest.raises(InputError, match="nothing moves: the load uy = 0 at 'top'"):
        check_conditions([Prescribed("left", 0), still], still)
    check_conditions([Prescribed("left", 0, 0.1), still], still)
    check_conditions([Prescribed("left", 0), Prescribed("left", 0), LOAD], LOAD)


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (Prescribed("left", 1, 0.0), ("support uy = 0 at 'left'", "load uy = -0.25 at 'top'", "(0, 1)")),
        (Prescribed("c", 1, 0.0), ("support uy = 0 at 'c'", "(1, 1)")),
    ],
)
def test_one_value_for_a_node(other, words):
    mesh = square()
    with pytest.raises(InputError) as error:
        check_shared(mesh, [other, LOAD], LOAD)
    assert all(word in str(error.value) for word in words)
    check_shared(mesh, [dataclasses.replace(other, value=-0.25), LOAD], LOAD)
    check_shared(mesh, [dataclasses.replace(other, component=0), LOAD], LOAD)


def test_a_region_needs_cells():
    mesh = dataclasses.replace(square(), region_names=("block", "nowhere"))
    with pytest.raises(InputError, match="region 'nowhere' has no cells"):
        require_cells(mesh)
