"""What is made of adapted runs afterwards: derivatives, checks, shapes that are too narrow for the file's cells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tmc_vem import check, run
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.sensitivity import of_directory
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

PAD = Path(__file__).parents[2] / "demos" / "problems" / "cbox_pad.toml"
SMALL = {"load.uy": -0.05, "mesh.size": 0.1}
MU = "regions.solid.solid.mu"
NARROW = """
name = "narrow"
gap = ["upper", "lower"]
[shapes]
upper = { rectangle = [0, 0.52, 1, 1] }
lower = { rectangle = [0, 0, 1, 0.5] }
between = { rectangle = [0, 0.5, 1, 0.52] }
[regions.upper]
shape = "upper"
solid = { K = 20, mu = 10 }
[regions.lower]
shape = "lower"
solid = { K = 20, mu = 10 }
[regions.medium]
shape = "between"
medium = { gamma = 1e-4, mu = 10, alpha_r = 1 }
[mesh]
size = 0.2
[points]
upper = [0.5, 0.52]
lower = [0.5, 0.5]
[edges]
top = { line = [[0, 1], [1, 1]] }
bottom = { line = [[0, 0], [1, 0]] }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.01
[solve.adapt]
of = "reaction"
tolerance = "5%"
"""


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


def test_shapes_that_are_too_narrow_for_the_cells_are_fitted(tmp_path: Path) -> None:
    file = tmp_path / "narrow.toml"
    file.write_text(NARROW)
    problem, options = read_problem(file)
    with pytest.raises(InputError, match="too narrow"):
        problem.make_mesh()
    other = fitted(problem)
    assert isinstance(other, OwnProblem)
    assert other.table.mesh.fit
    assert check(problem, options).n_cells == other.make_mesh().n_cells
    result = run(problem, None, options)
    assert result.complete
    assert result.adaptivity is not None
    assert result.adaptivity.reached


def test_what_can_be_meshed_is_left_as_it_is() -> None:
    problem, _ = read_problem(PAD)
    assert fitted(problem) is problem
    with pytest.raises(InputError, match="outline"):  # a fault that smaller cells do not mend
        fitted(read_problem(PAD, {"points.upper": [5.0, 5.0]})[0])


def test_a_check_refuses_what_a_run_would() -> None:
    problem, options = read_problem(PAD)
    with pytest.raises(InputError, match="'grip' is no result of problem 'cbox_pad': gap, reaction, energy"):
        check(problem, replace(options, adapt=AdaptSettings("grip")))
    assert check(problem, replace(options, adapt=AdaptSettings("gap"))).n_cells == 250
