"""At which states there are derivatives: of runs in memory and in directories, on branches, along the path, or not."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from helpers_forces import Parts, plate
from helpers_sensitivity import SEAL, case_of, finer, own, wrong

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.problems import Box, Medium
from tmc_vem.sensitivity import SensitivityWarning, of_directory, sensitivities
from tmc_vem.sensitivity.at_end import solved
from tmc_vem.sensitivity.differences import central_differences, checked
from tmc_vem.sensitivity.numbers import rate, with_value
from tmc_vem.sensitivity.per_cell import per_cell
from tmc_vem.simulation.problem_file import problem_text, read_problem
from tmc_vem.support.errors import ConvergenceError, InputError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control

BOX = Box((20, 5), Medium(gamma=1e-3))
HELD = [{"at": "bottom", "ux": 0, "uy": 0}, {"at": "top", "ux": 0}]
LOADS = [
    {"name": "push", "at": "tip", "force": [0.02, -0.1], "history": [[0, 0], [1, 1.5]]},
    {"name": "down", "at": "top", "uy": -0.1, "history": [[0, 0], [0.5, 0.7], [1, 1]]},
]
ARCH = """
shapes.arch = { polygon = [[0, 0], [1, 0.12], [2, 0], [2, 0.04], [1, 0.16], [0, 0.04]] }
regions.arch = { shape = "arch", solid = { E = 100, nu = 0.3 } }
name = "arch"
mesh = { cells = "triangles", size = 0.08 }
points.crown = [1, 0.16]
edges.left = { line = [[0, 0], [0, 0.04]] }
edges.right = { line = [[2, 0], [2, 0.04]] }
support = [{ at = "left", ux = 0, uy = 0 }, { at = "right", ux = 0, uy = 0 }]
load = { name = "push", at = "crown", force = [0, -0.05] }
probes.crown = { displacement = "uy", at = "crown" }
"""
FRICTION = SEAL.replace("mu = 10, gamma", "mu = 10, friction = 0.2, gamma")
SHARED = SEAL.replace("mu = 10, gamma", "gamma").replace("E = 40, nu = 0.3", "K = 40, mu = 10")


def test_per_load_is_the_rate_along_the_path() -> None:
    """Of a dead load with a history, whose work changes by its amplitude too, and of contact forces."""
    case = case_of(own(SEAL, "load", "support", load=LOADS, support=HELD), steps=4)
    of = ("gap", "hold", "compliance", "energy", "push.displacement", "down.reaction", "contact.block.force_y", "cut")
    at = {h: replace(case, position=Control(1.0 + h)).nearby("load.down.uy", -0.1, of) for h in (-2e-3, -1e-3)}
    for name in of:
        once, twice = ((case.found.value(name) - at[h][name]) / -h for h in (-2e-3, -1e-3))
        assert case.found.per_load(name) == pytest.approx(2 * twice - once, rel=2e-4), name


@pytest.mark.parametrize("ranked", [False, True], ids=["file", "changed file"])
def test_directories_give_what_results_give(tmp_path: Path, ranked: bool) -> None:
    options = RunOptions(steps=4, snapshots=0)
    path = tmp_path / "plug.toml"
    path.write_text(problem_text(own(), options))
    problem, options = read_problem(path, {"regions.foot.solid.E": 30} if ranked else {})
    result = run(problem, tmp_path / "out", options)
    of, by = ("gap", "hold", "energy.medium"), ("regions.foot.solid.E", "load.uy", "regions.medium.medium.gamma")
    expected = sensitivities(result).table(of, by)
    for found in (sensitivities(RunResult.read(tmp_path / "out")), of_directory(tmp_path / "out", problem, options)):
        for a, b in zip(found.table(of, by).entries, expected.entries, strict=True):
            assert (a.of, a.by, a.number) == (b.of, b.by, b.number)
            assert (a.value, a.derivative) == pytest.approx((b.value, b.derivative), rel=1e-12)
    assert result.gradient("gap", "load.uy") == expected.entry("gap", "load.uy").derivative
    with pytest.raises(KeyError):
        expected.entry("gap", "gap")


def test_directories_of_benchmarks_need_the_problem(tmp_path: Path) -> None:
    result = run(BOX, tmp_path / "out", RunOptions(steps=8, snapshots=0))
    with pytest.raises(InputError, match=r"out has no problem.toml, as no run of a benchmark from Python has"):
        sensitivities(RunResult.read(tmp_path / "out"))
    again = of_directory(tmp_path / "out", BOX, RunOptions(steps=8, snapshots=0))
    assert again.gradient("gap", "uy") == pytest.approx(result.gradient("gap", "uy"), rel=1e-12)
    with pytest.raises(InputError, match="start anew"):
        of_directory(tmp_path / "out", replace(BOX, uy=-0.9), RunOptions(steps=8, snapshots=0))


def test_results_without_a_state_have_none() -> None:
    result = run(BOX, options=RunOptions(steps=8, snapshots=0, max_iterations=1))
    with pytest.raises(InputError, match="no step has converged"):
        result.gradient("gap", "uy")
    with pytest.raises(ConvergenceError, match="there are no derivatives"):
        solved(BOX, RunOptions(steps=8, snapshots=0, max_iterations=1))


def test_iterative_solvers_are_as_exact() -> None:
    """Although they solve to 1e-7 of a force only."""
    direct, iterative = (case_of(own(), steps=4, solver=solver).found for solver in ("direct", "iterative"))
    assert iterative.gradients.equilibrium.negative_pivots is None
    for by in ("regions.foot.solid.E", "regions.medium.medium.gamma", "load.uy"):
        assert iterative.gradient("hold", by) == pytest.approx(direct.gradient("hold", by), rel=1e-8)


def test_an_unstable_state_is_flagged() -> None:
    """A strut that stays straight, although it would buckle; its derivatives are right on that branch."""
    held = [Prescribed("left", 0), Prescribed("left", 1), Prescribed("right", 1)]
    strut = Parts(lambda: plate(10, 2, 4.0, 0.3), [Prescribed("right", 0, -0.3), *held])
    case = case_of(strut, steps=2)
    assert case.simulation.recorder.history[-1].negative_pivots
    (doubt,) = case.found.doubts
    assert "unstable (" in doubt
    with pytest.warns(SensitivityWarning, match="a run with other numbers may end on another one"):
        slope = case.found.gradient("reaction", "block.K")
    with warnings.catch_warnings():  # once is enough
        warnings.simplefilter("error")
        case.found.gradient("energy", "block.K")
    h = 1e-3
    up, down = (case.nearby("block.K", 3.0 + d, ["reaction"])["reaction"] for d in (h, -h))
    assert slope == pytest.approx((up - down) / (2 * h), rel=1e-6)


def test_a_state_behind_a_jump_is_flagged() -> None:
    case = case_of(own(ARCH))
    assert case.found.value("crown") < -0.25
    (doubt,) = case.found.doubts
    assert doubt.startswith("the state lies behind a jump at load factor 0.")
    with pytest.warns(SensitivityWarning, match="with other numbers the jump may not happen, or lead elsewhere"):
        table = case.found.table(["crown"], ["load.force.2", "regions.arch.solid.E"])
    assert table.doubts == case.found.doubts
    found = checked(table, case.problem, case.options, case.simulation.comm)
    assert all(entry.deviation is not None and entry.deviation < 1e-6 for entry in found.entries)


@pytest.mark.parametrize(
    ("of", "by", "message"),
    [
        ("gaap", "uy", "unknown result 'gaap' (did you mean 'gap'?): choose one of gap, displacement, reaction"),
        ("gap", "ux", "the problem has no 'ux': it has cells, medium, material, uy"),
        ("gap", "length", "'length' makes the mesh: there are derivatives by materials, media, displacements and "
         "loads, none by shapes"),
        ("gap", "medium_refinement", "'medium_refinement' makes the mesh"),
        ("gap", "material.E", "'material.E' is not given: name a number of the problem"),
        ("gap", "medium.regulariser", "'medium.regulariser' = 'huhu_lulu' is no number: name a number"),
        ("gap", "medium.elastic_slip", "nothing that is solved for changes with 'medium.elastic_slip'"),
        ("gap", "a..b", "is no name of an entry"),
        ("p_norm.J", "uy", "'p_norm.J' is no p-norm: write p_norm.FIELD.REGION"),
        ("contact.solid.half_width", "uy", "has no derivative: it goes by which nodes"),
    ],
)  # fmt: skip
def test_what_has_no_derivative_is_said_before_anything_is_solved(
    of: str, by: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tmc_vem.simulation.simulation.Simulation.go", lambda *_: pytest.fail("it was solved"))
    with pytest.raises(InputError) as error:
        solved(BOX, RunOptions(snapshots=0), [of], [by])
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("problem", "by", "message"),
    [
        (own(), "mesh.size", "'mesh.size' makes the mesh"),
        (own(), "points.tip.1", "'points.tip.1' makes the mesh"),
        (own(), "shapes.foot.rectangle.4", "'shapes.foot.rectangle.4' makes the mesh"),
        (own(), "probes.side.at.1", "nothing that is solved for changes with 'probes.side.at.1'"),
        (own(), "solve.steps", "has no 'steps'"),
        (own(), "load.uy", "'load.uy' belongs to no cells"),
        (own(FRICTION), "load.uy", "region 'medium' has friction"),
        (own(SEAL.replace("beta = 1", "beta = 0")), "regions.medium.medium.beta",
         "'regions.medium.medium.beta' cannot change alone (region 'medium' has another energy with other values)"),
        (own(SEAL.replace("beta = 1", "beta = 0")), "regions.medium.medium.log_j", "has another energy"),
        (own(SHARED), "regions.foot.solid.mu",
         "'regions.foot.solid.mu' cannot change alone (regions: medium: medium lacks 'mu'"),
    ],
)  # fmt: skip
def test_what_problem_files_have_no_derivative_by(problem, by: str, message: str) -> None:
    with pytest.raises(InputError) as error:
        solved(problem, RunOptions(snapshots=0), ["gap"], [by], in_cells=True)
    assert message in str(error.value)


@pytest.mark.parametrize("stiffness", [0.0, 1.0])
def test_numbers_at_an_end_of_their_range_have_derivatives(stiffness: float) -> None:
    text = SEAL.replace(
        "solid = { E = 40, nu = 0.3 }",
        f"solid = {{ E = 40, nu = 0.3 }}, stiffness = {stiffness}, "
        "medium = { mu = 10, gamma = 1e-1, alpha = 1, h = 0.2, beta = 1 }",
    ).replace("uy = -0.18", "uy = -0.05")
    case = case_of(own(text, "probes.cut"), steps=4)
    slope, h = case.found.gradient("hold", "regions.foot.stiffness"), 1e-4 if stiffness == 0.0 else -1e-4
    start, once, twice = (
        case.nearby("regions.foot.stiffness", stiffness + d, ["hold"])["hold"] for d in (0.0, h, h / 2)
    )
    assert slope == pytest.approx(2 * (twice - start) / (h / 2) - (once - start) / h, rel=1e-4)


def test_other_numbers_do_not_combine_shapes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = own()
    monkeypatch.setattr("tmc_vem.problems.own.combine", lambda *_: pytest.fail("shapes were combined"))
    moved = with_value(problem, "load.uy", -0.1)
    assert isinstance(moved, type(problem))
    assert (moved.load().value, problem.load().value) == (-0.1, -0.18)
    monkeypatch.undo()
    assert moved.make_mesh().points_vx.tolist() == problem.make_mesh().points_vx.tolist()
    lower = own(SEAL.replace("0, 0, 1, 0.3]", "0, 0, 1, 0.25]").replace("[0.5, 0.3]", "[0.5, 0.25]"))
    other = problem.with_table(lower.table)
    assert other.make_mesh().points_vx.tolist() == lower.make_mesh().points_vx.tolist()


@pytest.mark.parametrize("at", [0.3, 1.0])
def test_rates_of_formulas_are_exact_to_rounding(at: float) -> None:
    def function(x: float) -> np.ndarray:
        if x > 1.0:
            raise InputError("too large")
        return np.array([np.exp(2.0 * x), x**3, 5.0])

    assert rate(function, at) == pytest.approx([2.0 * np.exp(2.0 * at), 3.0 * at**2, 0.0], rel=1e-10, abs=1e-10)
    with pytest.raises(InputError, match="too large"):
        rate(function, 2.0)


def test_interior_penalties_and_supports_of_stages_are_refused() -> None:
    options = RunOptions(snapshots=0)
    penalty = replace(options, element=replace(options.element, interior_penalty="full"))
    with pytest.raises(InputError, match="--interior-penalty none, or"):
        solved(BOX, penalty, ["gap"], ["uy"])
    stages = own(
        SEAL, "support", stage=[{"name": "a", "begins": 0.0}, {"name": "b", "begins": 0.5}],
        support=[*HELD, {"at": "tip", "ux": 0, "stage": "a"}],
    )  # fmt: skip
    with pytest.raises(InputError, match="holds in some stages only"):
        solved(stages, options, ["gap"], ["regions.foot.solid.E"])


def test_formulas_of_cell_data_have_derivatives(tmp_path: Path, method: str) -> None:
    points = [[x, y, 0.0] for y in (0.0, 1.0) for x in (0.0, 1.0, 2.0)]
    data = {"soft": [np.array([1.0, 2.0])], "region": [np.zeros(2, dtype=np.int64)]}
    meshio.Mesh(points, [("quad", [[0, 1, 4, 3], [1, 2, 5, 4]])], cell_data=data).write(tmp_path / "a.vtu")
    (tmp_path / "a.toml").write_text(
        'name = "a"\nmesh = { file = "a.vtu" }\nedges.left = { line = [[0, 0], [0, 1]] }\n'
        'edges.right = { line = [[2, 0], [2, 1]] }\nload = { at = "right", ux = 0.1 }\n'
        'support = [{ at = "left", ux = 0, uy = 0 }]\n'
        'regions.region_0 = { solid = { K = 20, mu = 10 }, graded = { mu = "mu * soft" } }\n'
    )
    case = case_of(read_problem(tmp_path / "a.toml")[0], method)
    assert not wrong(case, ["reaction"], ["load.ux", "regions.region_0.solid.mu", "regions.region_0.solid.K"])
    by_cell = case.found.gradient("reaction", "regions.region_0.solid.mu", per_cell=True)
    assert np.sum(by_cell) == pytest.approx(case.found.gradient("reaction", "regions.region_0.solid.mu"), rel=1e-12)


def test_cells_that_are_cut_into_triangles_are_one_cell() -> None:
    pytest.importorskip("dolfinx")
    options = RunOptions("fem", snapshots=0, steps=8)
    whole, cut = (
        sensitivities(run(BOX, options=replace(options, fem=replace(options.fem, triangles=triangles))))
        for triangles in (False, True)
    )
    by_cell = np.asarray(cut.gradient("reaction", "material.mu", per_cell=True))
    assert by_cell.shape == np.shape(whole.gradient("reaction", "material.mu", per_cell=True))
    assert len(by_cell) == 100
    found = per_cell(cut, ["reaction"], ["material.mu"])
    assert found is not None
    assert found.fields.cell_fields["d(reaction)/d(mu)"].shape == (200,)
    assert found.fields.cell_fields["d(reaction)/d(mu)"].sum() == pytest.approx(by_cell.sum(), rel=1e-12)
    assert by_cell.sum() == pytest.approx(cut.gradient("reaction", "material.mu"), rel=1e-12)


def test_differences_need_runs_that_get_to_the_end(tmp_path: Path) -> None:
    case = case_of(BOX, steps=8)
    with pytest.raises(InputError, match="a run with a value nearby did not get to the full load"):
        central_differences(BOX, replace(case.options, max_iterations=2), ["gap"], "uy", case.simulation.comm)
    text = case.found.table(["gap"], ["solid.K"]).to_json({"more": [np.inf]})
    assert json.loads(text)["more"] == [None]


def test_units_are_those_of_result_and_number() -> None:
    problem = own(units={"length": "mm", "force": "N"})
    table = case_of(finer(problem, size=0.2), steps=4).found.table(
        ("gap", "hold", "reaction", "energy", "squeezed", "contact.block.force", "contact.block.moment",
         "p_norm.von_mises.foot"),
        ("regions.foot.solid.E", "regions.foot.solid.nu", "load.uy", "regions.medium.medium.alpha", "medium.alpha_r"),
    )  # fmt: skip
    units = {(entry.of, entry.by): entry.units for entry in table.entries}
    assert units["gap", "regions.foot.solid.E"] == ("mm", "N/mm^2", "mm^3/N")
    assert units["hold", "load.uy"] == ("N/mm", "mm", "N/mm^2")
    assert units["squeezed", "regions.foot.solid.nu"] == ("", "", "")
    assert units["squeezed", "load.uy"] == ("", "mm", "1/mm")
    assert (
        units["energy", "regions.foot.solid.nu"][2] == units["contact.block.moment", "regions.foot.solid.nu"][2] == "N"
    )
    assert units["p_norm.von_mises.foot", "medium.alpha_r"] == ("N/mm^2", "N", "1/mm^2")
    assert units["reaction", "load.uy"] == units["contact.block.force", "load.uy"]
    frame = table.to_pandas()
    assert frame.loc[("hold", "load.uy"), "derivative"] == table.entry("hold", "load.uy").derivative
    assert frame.loc[("hold", "load.uy"), "unit"] == "N/mm^2"
    assert list(frame.columns) == ["value", "number", "derivative", "elasticity", "unit"]
