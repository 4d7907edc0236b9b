"""Known causes of overlap that the geometry shows before anything is solved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Punch
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.problems.hints import CORNER, FLUSH, SHORT, THIN, cause_at, hints, likely
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.system.constraints import Prescribed

ROOT = Path(__file__).parents[2]
STEEL = Material(K=20.0, mu=10.0)
PUSHED = (Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 0), Prescribed("top", 1, -0.25))


def scene(
    upper: tuple[float, float] = (0.0, 1.0), lower: tuple[float, float] = (0.0, 1.0),
    medium: tuple[float, float] = (0.0, 1.0), around: float = 0.0, n: int = 20,
) -> PolygonMesh:  # fmt: skip
    """Two blocks from x to x, with medium between them over 0.2 and beside them up to ``around``."""
    x = np.linspace(-1.0, 2.0, 3 * n + 1)
    y = np.linspace(0.0, 1.0, n + 1)
    wide = Rectangle("medium", -around, 1.0 + around, 0.0, 1.0) if around else Rectangle("medium", *medium, 0.4, 0.6)
    parts = [
        Rectangle("nothing", -1.0, 2.0, 0.0, 1.0), wide, Rectangle("low", *lower, 0.0, 0.4),
        Rectangle("up", *upper, 0.6, 1.0),
    ]  # fmt: skip
    mesh = structured_quadrilaterals(x, y, parts)
    mesh = submesh(mesh, mesh.region_c != mesh.region_names.index("nothing"))
    return with_names(
        mesh, lines={"bottom": ((lower[0], 0.0), (lower[1], 0.0)), "top": ((upper[0], 1.0), (upper[1], 1.0))}
    )


def found(mesh: PolygonMesh, kind: str, alpha_r: float = 1.0, prescribed: Any = PUSHED, **more: Any) -> list[Any]:
    solid = solid_region(STEEL)
    regions = {"low": solid, "up": solid, "medium": medium_region(Medium(alpha_r=alpha_r), 10.0)}
    return [hint for hint in hints(mesh, regions, prescribed, **more) if hint.kind == kind]


def test_medium_that_ends_flush_is_found_with_its_ends_and_its_width():
    left, right = sorted(found(scene(), FLUSH), key=lambda hint: hint.where)
    assert sorted(right.places) == [pytest.approx((1.0, 0.4)), pytest.approx((1.0, 0.6))]
    assert left.where == pytest.approx((0.0, 0.5))
    assert right.width == pytest.approx(0.2)
    assert right.likely
    assert set(right.regions) == {"medium", "low", "up"}
    for words in ("medium ends flush at (1, 0.4)-(1, 0.6) between bodies that approach", "one gap width (0.2) beyond"):
        assert words in right.sentence


@pytest.mark.parametrize("beyond", [0.2, 0.4])
def test_a_margin_of_a_gap_width_is_enough(beyond: float):
    assert not found(scene(around=beyond), FLUSH)


def test_medium_that_ends_on_a_flat_or_inside_is_flush():
    on_flat = scene(upper=(0.2, 0.8), medium=(0.2, 0.8))
    assert sorted(hint.where for hint in found(on_flat, FLUSH)) == [
        pytest.approx((0.2, 0.5)),
        pytest.approx((0.8, 0.5)),
    ]
    assert len(found(scene(medium=(0.1, 0.9)), FLUSH)) == 2


@pytest.mark.parametrize("value", [-0.05, 0.25])
def test_bodies_that_stay_away_or_part_are_not_worth_a_warning(value: float):
    pulled = (*PUSHED[:3], replace(PUSHED[3], value=value))
    assert [hint.likely for hint in found(scene(), FLUSH, prescribed=pulled)] == [False, False]
    assert not likely(found(scene(), SHORT, 0.01, pulled))


def test_load_factors_beyond_one_and_below_zero_count():
    away = (*PUSHED[:3], replace(PUSHED[3], value=0.05))
    assert not any(hint.likely for hint in found(scene(), FLUSH, prescribed=away))
    assert all(hint.likely for hint in found(scene(), FLUSH, prescribed=away, loads=(0.0, -4.0)))


def test_a_free_side_that_is_held_across_is_symmetry():
    mesh = with_names(scene(), lines={"right": ((1.0, 0.0), (1.0, 1.0)), "left": ((0.0, 0.0), (0.0, 1.0))})
    assert len(found(mesh, FLUSH, prescribed=(*PUSHED, Prescribed("right", 0)))) == 1
    assert len(found(mesh, FLUSH, prescribed=(*PUSHED, Prescribed("right", 1)))) == 2
    assert not found(mesh, FLUSH, prescribed=(*PUSHED, Prescribed("right", 0), Prescribed("left", 0)))


def test_sharp_corners_in_front_of_a_surface():
    mesh = scene(upper=(0.2, 0.8), around=0.4)
    corners = [hint for hint in found(mesh, CORNER, alpha_r=0.01) if hint.likely]
    assert sorted(hint.where for hint in corners) == [pytest.approx((0.2, 0.6)), pytest.approx((0.8, 0.6))]
    assert "region 'up' at (0.2, 0.6) is sharp and meets region 'low', 0.2 away" in " ".join(likely(corners))
    assert "= 1" in corners[0].sentence  # 2.5 mu gap^2
    assert sum(hint.likely for hint in found(mesh, CORNER, alpha_r=1.0)) == 2


def test_a_corner_that_meets_a_corner_needs_enough_alpha_r():
    """As in the C-box, and for blocks of one width with medium around."""
    mesh = scene(around=0.4)
    for alpha_r, expected in ((0.99, True), (1.0, False)):
        corners = found(mesh, CORNER, alpha_r=alpha_r)
        assert [hint.likely for hint in corners] == [expected] * 4


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_regulariser_with_a_short_length_in_any_unit(scale: float):
    """The box of the paper with alpha_r = 0.1 has a third of the gap; a length of a quarter is short."""
    material = Material(20.0 * scale, 10.0 * scale)
    limit = 10.0 * (0.25 * 0.3) ** 2
    for alpha_r, count in ((1.01 * limit, 0), (0.99 * limit, 1)):
        box = Box(cells=(20, 5), material=material, medium=Medium(alpha_r=alpha_r * scale))
        box = replace(box, uy=-1.0)
        short = [hint for hint in hints(box.make_mesh(), box.regions(), box.prescribed()) if hint.kind == SHORT]
        assert len(short) == count
    assert f"= {2.5 * 10.0 * scale * 0.3**2:.3g} (alpha = 2.5)" in short[0].sentence


def test_a_single_cell_across_a_gap():
    assert not found(scene(n=20), THIN)
    (thin,) = found(scene(n=5), THIN)
    assert thin.width == pytest.approx(0.2)
    assert "size 0.1" in thin.sentence
    assert thin.likely


def test_a_single_layer_of_triangles_across_a_gap():
    mesh = scene(n=5)
    triangles = [t for a, b, c, d in mesh.cells() for t in ((a, b, c), (a, c, d))]
    cut = PolygonMesh.from_cells(
        mesh.points_vx, triangles, np.repeat(mesh.region_c, 2), mesh.region_names, mesh.named_points, mesh.named_edges
    )
    assert [hint.width for hint in found(cut, THIN)] == [pytest.approx(0.2)]


PROBLEMS = {
    "box": Box(), "box, 0.1": Box(medium=Medium(alpha_r=0.1)), "box, Voronoi": Box(cell_kind="voronoi"),
    "cbox": CBox(), "cbox to -1": CBox(uy=-1.0), "cbox, quadrilaterals": CBox(solid_cells="quadrilaterals"),
    "punch": Punch(), "punch, small gap": Punch(gap0=0.05, size=0.2),
    "bodies 1": Bodies(), "bodies 2": Bodies(case=2),
}  # fmt: skip


@pytest.mark.parametrize("name", PROBLEMS)
def test_nothing_is_said_about_the_benchmarks(name: str):
    problem = PROBLEMS[name]
    assert likely(hints(problem.make_mesh(), problem.regions(), problem.prescribed())) == []


@pytest.mark.parametrize("name", ["seal", "gripper", "blocks", "finger"])
def test_nothing_is_said_about_the_demo_problems(name: str):
    problem, _ = read_problem(ROOT / "demos" / "problems" / f"{name}.toml")
    assert likely(hints(problem.make_mesh(), problem.regions(), problem.prescribed())) == []


def test_no_more_than_three_of_a_kind_are_said():
    hint = found(scene(), FLUSH)[0]
    many = [replace(hint, sentence=f"place {n}") for n in range(5)]
    assert likely([*many, *many]) == ["place 0", "place 1", "place 2 (2 more such places)"]


def test_the_cause_at_a_place_of_overlap():
    causes = found(scene(), FLUSH)
    at = cause_at(causes, (0.97, 0.45))
    assert at is not None
    assert at.where == pytest.approx((1.0, 0.5))
    assert cause_at(causes, (0.5, 0.5)) is None
    assert cause_at([], (0.5, 0.5)) is None


def test_solids_alone_have_no_gaps():
    mesh = scene()
    solid = solid_region(STEEL)
    assert hints(mesh, {"low": solid, "up": solid, "medium": solid}, PUSHED) == []
