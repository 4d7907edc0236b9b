"""Searches for designs: derivatives of evaluations, load cases after failures, and what is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_design import cantilever
from mpi4py import MPI

from tmc_vem.design.evaluation import Evaluation
from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.load_case import LoadCase
from tmc_vem.design.optimise import Optimisation
from tmc_vem.design.projection import Projection
from tmc_vem.sensitivity.differences import TIGHT
from tmc_vem.support.errors import InputError

LIMITS = {"tip": {"at_least": -1}}
ALL = {
    "design.symmetry": {"y": 0.5},
    "design.passive": [{"is": "solid", "box": [1.7, 0.3, 2, 0.7]}, {"is": "void", "box": [0.8, 0.3, 1.2, 0.7]}],
    "design.limits": {"tip": {"at_least": -0.02}, "stored": {"of": "energy", "at_most": 1e-5}},
    "design.cases": [{"name": "down"}, {"name": "pull", "set": {"load.force": [0.002, 0.001]}, "weight": 2}],
    "load.force": [0, -0.004],
}


@pytest.mark.parametrize("kind", ["cone", "helmholtz", "none"])
def test_derivatives_of_an_evaluation(kind: str, tmp_path: Path) -> None:
    """Through symmetry, filter, projection and passive cells to two load cases, their sum and their limits."""
    problem, options = cantilever(tmp_path, {**ALL, "design.filter.kind": kind})
    evaluator = Evaluator(problem, options, MPI.COMM_WORLD)
    evaluator.project(Projection(2.0))
    for case in evaluator.cases.values():
        case._solver.options = TIGHT
    n = evaluator.parametrisation.n_variables
    random = np.random.default_rng(3)
    z, dz = random.uniform(0.3, 0.7, n), random.uniform(-1.0, 1.0, n)
    here = evaluator(z)
    assert evaluator.constraints == ("volume", "down.tip", "pull.tip", "down.stored", "pull.stored")

    def centre(h: float) -> Any:
        ahead, behind = evaluator(z + h * dz), evaluator(z - h * dz)
        return np.array([ahead.objective - behind.objective, *(ahead.constraints - behind.constraints)]) / (2.0 * h)

    slopes = np.array([here.gradient @ dz, *(here.jacobian @ dz)])
    once, twice = centre(4e-3), centre(2e-3)
    assert np.log2(np.abs(once - slopes) / np.abs(twice - slopes)).min() > 1.9
    np.testing.assert_allclose(twice + (twice - once) / 3.0, slopes, rtol=1e-6)


def test_a_load_that_stops_leaves_no_parameters(tmp_path: Path) -> None:
    """While gamma is continued, a load that is not applied in full ends with another gamma than that of the problem."""
    problem, options = cantilever(tmp_path)
    options = replace(options, continuation={"gamma": 1e-1})

    def made() -> LoadCase:
        return LoadCase("case", problem, options, ("compliance",), MPI.COMM_WORLD)

    stiffness_c, case = np.full(32, 0.2), made()
    expected = made().solve(stiffness_c)
    first = case.solve(stiffness_c)
    assert first is not None
    assert expected is not None
    case._options = replace(options, max_iterations=first.iterations - 3)
    assert case.solve(stiffness_c, from_start=True) is None
    assert "Newton iterations is used up; max_iterations is the limit for one design" in case.why_not
    case._options = options
    again = case.solve(stiffness_c)
    assert again is not None
    assert not again.from_start
    assert again.values["compliance"] == pytest.approx(expected.values["compliance"], rel=1e-8)


def test_a_steeper_projection_that_fails_ends_the_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The best design of the level before stays."""
    table = {"first": 1, "largest": 4, "every": 3}
    search = Optimisation(*cantilever(tmp_path, {"design.projection": table, "design.iterations": 9}))
    inner = Evaluator.__call__

    def failing(evaluator: Evaluator, z: Any) -> Evaluation:
        made = inner(evaluator, z)
        projection = evaluator.parametrisation.projection
        if projection is None or projection.beta < 2.0:
            return made
        evaluator.worth = replace(evaluator.worth, values={}, notes=("too steep",))  # type: ignore[type-var]
        return Evaluation.failed(len(z), 1)

    monkeypatch.setattr(Evaluator, "__call__", failing)
    result = search.go()
    assert "with beta = 2, the best design could not be evaluated (too steep)" in result.optimum.reason
    assert not result.optimum.converged
    assert result.projection == Projection(1.0)
    assert len(result.steps) == 4
    assert result.objective == min(step.iterate.evaluation.objective for step in result.steps)
    assert result.worth is not None
    assert result.worth.values["compliance"] == pytest.approx(result.objective, rel=1e-6)


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        ({"design.cases": [{"name": "fine", "set": {"mesh.size": 0.2}}]}, {}, "cases: fine: it has another mesh"),
        ({}, {"follow": True}, "follow does not go with a design"),
        ({}, {"max_iterations": 2}, r"first design could not be evaluated \(.*limit of 2 Newton iterations .*for one"),
        ({"design.method": "oc", "design.volume": None, "design.start": 0.5, "design.limits": LIMITS}, {},
         "method 'oc' is for a volume alone"),
    ],
)  # fmt: skip
def test_what_is_refused(changes: Mapping[str, Any], options: Mapping[str, Any], message: str, tmp_path: Path) -> None:
    problem, given = cantilever(tmp_path, changes)
    with pytest.raises(InputError, match=message):
        Optimisation(problem, replace(given, **options)).go()
