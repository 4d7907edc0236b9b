"""Sizes of cells that vary: formulas of x and y, and functions of points; what is limited, refused, recorded."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_problem_file import SMALL, small

from tmc_vem import RunOptions, run
from tmc_vem.mesh.make.estimate import estimate
from tmc_vem.mesh.make.growing import STEP
from tmc_vem.mesh.make.limited import limited_size
from tmc_vem.mesh.make.outline import Region
from tmc_vem.problems.mesh_tables import MeshTable, RefineTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.shaped_mesh import size_of
from tmc_vem.simulation.problem_file import problem_text, read_problem, with_changes
from tmc_vem.study.compare import file_study
from tmc_vem.study.sweep import combinations
from tmc_vem.support.assignments import parse_changes, parse_choices
from tmc_vem.support.errors import InputError

UNIT = [Region("r", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])]
ELL = [Region("r", [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)])]
RANDOM = np.random.default_rng(5).random((3000, 2))
RADIAL = "0.03 + 0.2 * sqrt(x**2 + y**2)"


def radial(points: Any) -> Any:
    return 0.03 + 0.2 * np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2)


def larger(points: Any) -> Any:
    return 0.04 + 0.2 * np.sqrt(points[:, 0] ** 2 + points[:, 1] ** 2)


def problem(tmp_path: Path, size: Any, *, cells: str = "voronoi", **more: Any) -> OwnProblem:
    made = read_problem(small(tmp_path, SMALL.replace("triangles", cells)))[0]
    return with_changes(made, {"mesh.size": size, **{f"mesh.{name}": value for name, value in more.items()}})


# -- what meshes can have ----------------------------------------------------------------------------------------------


def test_what_is_not_too_steep_stays_as_it_is() -> None:
    size = limited_size(UNIT, lambda x: 0.02 + 0.3 * np.abs(x[:, 0] - 0.37), 0.3)
    assert callable(size)
    assert size(RANDOM).tolist() == (0.02 + 0.3 * np.abs(RANDOM[:, 0] - 0.37)).tolist()


@pytest.mark.parametrize("growth", [0.1, 0.3, 1.0])
def test_a_step_becomes_a_slope(growth: float) -> None:
    """From the small cells on, up to the rounding of sizes and where a sample is next to the step."""
    size = limited_size(UNIT, lambda x: np.where(x[:, 0] < 0.37, 0.01, 0.15), growth)
    assert callable(size)
    beyond = RANDOM[:, 0] - 0.37
    exact = np.where(beyond < 0.0, 0.01, np.minimum(0.15, 0.01 + growth * np.maximum(beyond, 0.0)))
    found = size(RANDOM)
    assert (found[beyond < 0.0] == 0.01).all()
    assert (found <= exact + 0.1 * 0.01 + growth * 0.01).all()
    assert (found >= exact / STEP).all()
    assert (np.abs(np.diff(found)) <= growth * np.hypot(*np.diff(RANDOM, axis=0).T) + 0.004).all()


def test_a_steep_cone_is_limited_from_its_tip_on() -> None:
    tip = np.array([0.613, 0.281])
    size = limited_size(UNIT, lambda x: 0.004 + 3.0 * np.hypot(*(x - tip).T), 0.3)
    assert callable(size)
    away = np.hypot(*(RANDOM - tip).T)
    far = away > 0.05
    assert size(RANDOM[far]) == pytest.approx(0.004 + 0.3 * away[far], abs=0.006)
    assert (size(RANDOM) <= 0.004 + 3.0 * away).all()


@pytest.mark.filterwarnings("ignore:invalid value")
def test_sizes_count_in_the_regions_only() -> None:
    """Negative where the L is not, and no number along a line beside it."""

    def size(x: Any) -> Any:
        return np.where((x > 1.01).all(axis=1), -1.0, 0.1) + 0.0 * np.sqrt(2.001 - x[:, 0])

    found = limited_size(ELL, size, 0.3)
    assert callable(found)
    assert (found(2.0 * RANDOM)[~(2.0 * RANDOM > 1.01).all(axis=1)] == 0.1).all()
    outside = found(np.array([(1.5, 1.5), (3.0, 0.5)]))
    assert (outside >= 0.1).all()
    assert np.isfinite(outside).all()
    assert estimate(ELL, found, 1.0, 1e6).n_cells == pytest.approx(300, rel=0.05)


@pytest.mark.parametrize(
    ("size", "words"),
    [
        (lambda x: x[:, 0] - 0.5, r"the size of cells is -0.5 at \(0, 0\); it must be a positive number"),
        (lambda x: 0.1 / (x[:, 1] < 0.9), r"the size of cells is inf at \(1, 0.9"),
        (
            lambda x: np.where(x[:, 0] < 0.99, 1e-9, 0.1),
            "1e-09 at .*, less than a millionth of the domain, which is 1 ",
        ),
        (lambda x: np.where(np.hypot(*(x - 0.4).T) < 0.1, -2.0, 0.1), r"is -2 at \(0.[345]\d*, 0.[345]\d*\)"),
        (lambda x: x, r"at 401 points is an array of shape \(401, 2\): give one number for each point"),
        (lambda x: "large", "is 'large', which are no numbers"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_sizes_that_are_none_are_refused_with_the_place(size: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        limited_size(UNIT, size, 0.3)


def test_one_number_is_that_of_all_points() -> None:
    size = limited_size(UNIT, lambda x: 0.2, 0.3)  # type: ignore[arg-type, return-value]
    assert callable(size)
    assert size(RANDOM).tolist() == [0.2] * len(RANDOM)


# -- problems ----------------------------------------------------------------------------------------------------------


def test_formulas_and_functions_make_the_same_mesh(tmp_path: Path) -> None:
    """Small cells at the origin, large ones at the opposite corner."""
    formula, function = (problem(tmp_path, size).make_mesh() for size in (RADIAL, radial))
    assert formula.points_vx == pytest.approx(function.points_vx, abs=1e-12)
    edges = formula.points_vx[formula.edges.vertices_ev]
    length, middle = np.hypot(*(edges[:, 1] - edges[:, 0]).T), edges.mean(axis=1)
    for low, high in ((0.0, 0.3), (1.0, 1.5)):
        near = (np.hypot(*middle.T) >= low) & (np.hypot(*middle.T) < high)
        assert length[near].mean() == pytest.approx(0.65 * radial(middle[near]).mean(), rel=0.25)


@pytest.mark.parametrize("cells", ["triangles", "quadrilaterals"])
def test_other_kinds_of_cells_have_them_too(cells: str, tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    uniform = problem(tmp_path, 0.03, cells=cells).make_mesh().n_cells
    varying = problem(tmp_path, RADIAL, cells=cells).make_mesh().n_cells
    assert varying < 0.3 * uniform


def test_what_makes_cells_smaller_still_combines(tmp_path: Path) -> None:
    points = np.array([(0.1, 0.0), (0.9, 0.0), (0.5, 0.5)])
    refine = (RefineTable((0.9, 0.0), 0.02),)
    size = size_of(MeshTable(size=RADIAL, refine=refine), UNIT)
    assert callable(size)
    refined = 0.02 + 0.3 * np.hypot(*(points - (0.9, 0.0)).T)
    assert size(points) == pytest.approx(np.minimum(radial(points), refined))
    with pytest.raises(InputError, match=r"too narrow for cells"):
        problem(tmp_path, "0.2 + 0.1 * x").make_mesh()
    assert problem(tmp_path, "0.2 + 0.1 * x", fit=True).make_mesh().n_cells > 40


def test_places_are_those_of_the_user_far_from_the_origin() -> None:
    far = size_of(MeshTable(size="0.01 + 0.1 * (x - 4e6)"), UNIT, (4e6, 0.0))
    assert callable(far)
    assert far(RANDOM) == pytest.approx(0.01 + 0.1 * RANDOM[:, 0], rel=1e-6)
    function = size_of(MeshTable(size=lambda x: 0.01 + 0.1 * (x[:, 0] - 4e6)), UNIT, (4e6, 0.0))
    assert callable(function)
    assert function(RANDOM).tolist() == far(RANDOM).tolist()


@pytest.mark.parametrize(
    ("size", "cells", "message"),
    [
        ("0.1 *", "voronoi", r"mesh: size: '0.1 \*' is no formula: numbers"),
        ("0.1 * z", "voronoi", r"size = '0.1 \* z': a formula has no 'z': it has x, y"),
        ("small", "voronoi", r"size = 'small': a formula has no 'small': it has x, y"),
        ("open('a')", "voronoi", r"size: .*has no 'open'"),
        ([0.1], "voronoi", r"size = \[0.1\] must be a number"),
        (True, "voronoi", r"size = True must be a number"),
        (0.0, "voronoi", r"size = 0 must be a positive number: of the cells, a length"),
        (RADIAL, "grid", r"size = '0.03 .*' and cells = 'grid' do not go together: all its cells are equal; give"),
        (radial, "grid", r"size = test_cell_size:radial and cells = 'grid' do not go together"),
    ],
)  # fmt: skip
def test_sizes_that_no_mesh_has(size: Any, cells: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        problem(tmp_path, size, cells=cells)


def test_values_are_refused_with_size_and_place(tmp_path: Path) -> None:
    for size, said in (("x - 0.5", "'x - 0.5'"), (lambda x: x[:, 0] - 0.5, "test_cell_size:test_values_.*<lambda>")):
        with pytest.raises(
            InputError, match=rf"^mesh: size = {said}: the size of cells is -0.5 at \(0, 0\); it must be"
        ):
            problem(tmp_path, size).make_mesh()
    with pytest.raises(
        InputError, match=r"cells, more than 1e\+06: cells down to size 2e-06, near \(.*\), on a domain"
    ):
        problem(tmp_path, "where(abs(x - 0.5) < 0.1, 0.000002, 0.1)").make_mesh()


def test_formulas_come_from_the_command_line_and_in_sweeps(tmp_path: Path) -> None:
    path = small(tmp_path)
    made, _ = read_problem(path, parse_changes([f"mesh.size={RADIAL}", "mesh.cells=voronoi"]))
    assert made.table.mesh.size == RADIAL
    assert made.inputs()["set"] == {"mesh.size": RADIAL, "mesh.cells": "voronoi"}
    choices = parse_choices([f'mesh.size={RADIAL}, 0.1, "max(0.05, x / 10)"'])
    sizes = [read_problem(path, values)[0].table.mesh.size for values in combinations(choices)]
    assert sizes == [RADIAL, 0.1, "max(0.05, x / 10)"]


def test_the_size_is_part_of_what_a_run_is_known_by(tmp_path: Path) -> None:
    """A function by its name and its values."""
    assert problem(tmp_path, RADIAL).inputs()["mesh"]["size"] == RADIAL
    assert problem(tmp_path, 0.1).inputs()["mesh"]["size"] == 0.1
    first, again, other = (problem(tmp_path, size).inputs() for size in (radial, radial, larger))
    assert first == again
    assert first["mesh"]["size"]["function"] == "test_cell_size:radial"
    assert re.fullmatch("[0-9a-f]{16}", first["mesh"]["size"]["values"])
    assert first["mesh"]["size"]["values"] != other["mesh"]["size"]["values"]
    assert first["set"]["mesh.size"] == "test_cell_size:radial"


def test_runs_write_formulas_and_no_functions(tmp_path: Path) -> None:
    of_formula, of_function = problem(tmp_path, "0.1 + 0.05 * x"), problem(tmp_path, lambda x: 0.1 + 0.05 * x[:, 0])
    options = RunOptions(steps=1)
    path = tmp_path / "written.toml"
    path.write_text(problem_text(of_formula, options))
    assert read_problem(path)[0].table.mesh == of_formula.table.mesh
    with pytest.raises(InputError, match=r"is a function of Python, which no file can have: write it as a formula"):
        problem_text(of_function, options)
    results = [run(of, tmp_path / name, options) for of, name in ((of_formula, "formula"), (of_function, "function"))]
    assert results[0].gap == results[1].gap
    assert (tmp_path / "formula" / "problem.toml").is_file()
    assert not (tmp_path / "function" / "problem.toml").exists()


@pytest.mark.parametrize("size", [RADIAL, radial])
def test_other_meshes_have_all_sizes_in_proportion(size: Any, tmp_path: Path) -> None:
    """Four times as many cells with half the sizes, from place to place."""
    made = problem(tmp_path, size, refine=[{"near": [0.9, 0.9], "size": 0.04}])
    half = made.with_size(0.5)
    mesh = half.table.mesh
    assert mesh.refine[0].size == 0.02
    of = size_of(mesh, UNIT)
    assert callable(of)
    assert of(RANDOM[:5] / 2.0) == pytest.approx(0.5 * radial(RANDOM[:5] / 2.0))
    assert half.make_mesh().n_cells / made.make_mesh().n_cells == pytest.approx(4.0, rel=0.15)
    assert half.inputs() != made.inputs()
    study = file_study(made, (2.0, 1.5, 1.0), RunOptions())
    assert [level.name for level in study.levels] == ["2 x size", "1.5 x size", "1 x size"]
    assert study.levels[-1].problems["fem"].table.mesh.cells == "triangles"  # type: ignore[attr-defined]
    assert made.table.mesh.nominal == 1.0
    assert MeshTable(size=0.2).nominal == 0.2
