"""What is made of adapted runs afterwards: derivatives, checks, shapes that are too narrow for the file's cells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tmc_vem import check, run
from tmc_vem.adapt.recovered import recovered_estimate
from tmc_vem.adapt.solved import loaded, prepared
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.wrapped import Loaded
from tmc_vem.sensitivity import of_directory
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted
from tmc_vem.simulation.adapted import on_adapted_mesh
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.forces import PointForce

PROBLEMS = Path(__file__).parents[2] / "demos" / "problems"
PAD, HERTZ = PROBLEMS / "cbox_pad.toml", PROBLEMS / "hertz.toml"
SMALL = {"load.uy": -0.05, "mesh.size": 0.1}
MU = "regions.solid.solid.mu"


def test_derivatives_of_an_adapted_run_are_those_on_its_mesh(tmp_path: Path) -> None:
    problem, options = read_problem(PAD, SMALL)
    adapted = run(problem, tmp_path / "run", replace(options, adapt=AdaptSettings("reaction", "3%")))
    assert adapted.adaptivity is not None
    assert len(adapted.adaptivity.rounds) > 1
    from_result = adapted.gradient("reaction", MU)
    assert of_directory(tmp_path / "run").gradient("reaction", MU) == pytest.approx(from_result, rel=1e-9)
    mesh = adapted.end.problem.mesh
    values = []
    for change in (-1e-3, 1e-3):
        other = read_problem(PAD, {**SMALL, MU: 0.35714285714285715 * (1.0 + change)})[0]
        values.append(run(OnMesh(other, mesh), None, options).reaction or np.nan)
    assert (values[1] - values[0]) / (2e-3 * 0.35714285714285715) == pytest.approx(from_result, rel=1e-5)
    with pytest.raises(InputError, match=r"'shapes\.c\.rectangle\.2' makes the mesh"):
        adapted.gradient("reaction", "shapes.c.rectangle.2")


def test_shapes_that_are_too_narrow_for_the_cells_are_fitted() -> None:
    problem, options = read_problem(HERTZ, {"mesh.refine": [], "load.uy": -0.001})
    options = replace(options, adapt=AdaptSettings("reaction", "5%"))
    with pytest.raises(InputError, match="too narrow"):
        problem.make_mesh()
    other, mesh = fitted(problem)
    assert isinstance(other, OwnProblem)
    assert other.table.mesh.fit
    assert check(problem, options).n_cells == mesh.n_cells
    result = run(problem, None, options)
    assert result.complete
    assert result.adaptivity is not None
    assert result.adaptivity.reached


def test_what_can_be_meshed_is_left_as_it_is() -> None:
    problem, _ = read_problem(PAD)
    assert fitted(problem)[0] is problem
    with pytest.raises(InputError, match="outline"):  # a fault that smaller cells do not mend
        fitted(read_problem(PAD, {"points.upper": [5.0, 5.0]})[0])


def test_a_check_refuses_what_a_run_would() -> None:
    problem, options = read_problem(PAD)
    with pytest.raises(InputError, match="'grip' is no result of problem 'cbox_pad': gap, reaction, energy"):
        check(problem, replace(options, adapt=AdaptSettings("grip")))
    assert check(problem, replace(options, adapt=AdaptSettings("gap"))).n_cells == 250


def test_a_damaged_mesh_is_said_to_be(tmp_path: Path) -> None:
    (tmp_path / "adapt").mkdir()
    (tmp_path / "adapt" / "mesh.npz").write_bytes(b"PK torn")
    problem, options = read_problem(PAD)
    with pytest.raises(InputError, match=r"mesh\.npz is damaged \(.*\): run it again with --overwrite"):
        on_adapted_mesh(tmp_path, problem, options)


def test_the_energy_of_recovered_errors_is_an_energy() -> None:
    """Prescribed displacements three times as large make it nine times as large; with forces its sign is not known."""
    found = []
    for uy in (-1e-5, -3e-5):
        problem, options = read_problem(PAD, {**SMALL, "load.uy": uy})
        mesh = problem.make_mesh()
        estimate = recovered_estimate(loaded(prepared(OnMesh(problem, mesh), options), mesh), ("energy",))
        assert -1.0 < estimate.errors["energy"] / estimate.values["energy"] < 0.0
        assert estimate.indicators["energy"].sum() == pytest.approx(-estimate.errors["energy"])
        found.append(estimate.errors["energy"])
    assert found[1] / found[0] == pytest.approx(9.0, rel=1e-2)
    pushed = Loaded(problem, [PointForce("push", "upper", (0.0, -1e-9))])
    estimate = recovered_estimate(loaded(prepared(OnMesh(pushed, mesh), options), mesh), ("energy",))
    assert "energy" not in estimate.errors
