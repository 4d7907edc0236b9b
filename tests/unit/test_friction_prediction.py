"""Where steps with friction start from, and how their length answers to the iterations that they take."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_rub import rub
from helpers_truss import Truss

from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.simulation import prepare, stepping_of
from tmc_vem.solve.friction_steps import MOST_ITERATIONS
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.path import load_path
from tmc_vem.solve.prediction import extrapolate
from tmc_vem.solve.sizes import StepSizes
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import LoadStepper


def stepper(friction: bool) -> LoadStepper:
    """With the options of a problem with friction, or without."""
    options = stepping_of(RunOptions(largest_step=1.0), friction=friction)
    return LoadStepper(NewtonSolver(Truss()), options, path=load_path((0.0, 1.0)))


@pytest.mark.parametrize(("friction", "coefficients"), [(True, [0.0, 0.0, -1.0, 2.0]), (False, [-1.0, 4.0, -6.0, 4.0])])
def test_steps_with_friction_start_from_the_last_two_states(friction: bool, coefficients: list[float]) -> None:
    moving = stepper(friction)
    u = moving.solver.system.create_vector()
    states, values = States(u), np.array([0.0, 1e-3, 1e-3, 3e-3])
    for n, value in enumerate(values):
        u.set(value)
        states.append(moving.path.vector(moving.path.at(0.1 * n)), u)
    trial: Any = u.duplicate()
    point = moving.path.vector(moving.path.at(0.4))
    assert extrapolate(moving.solver, u, states, point, moving.options.order, trial)
    np.testing.assert_allclose(trial.getArray(), coefficients @ values, rtol=1e-9)


@pytest.mark.parametrize(("friction", "iterations", "factor"), [
    (True, 39, 2.0), (True, 40, 1.0), (True, 50, 0.8), (False, 3, 2.0), (False, 5, 0.8), (False, 15, 0.5),
])  # fmt: skip
def test_steps_with_friction_may_take_more_iterations(friction: bool, iterations: int, factor: float) -> None:
    moving = stepper(friction)
    sizes = StepSizes(moving.options, moving.path)
    assert sizes.following(0.1, 0.1, 0.3, iterations, was_cut=False) == pytest.approx(0.1 * factor)


def test_slip_is_worth_more_iterations(tmp_path: Path) -> None:
    problem, options = read_problem(rub(tmp_path))
    assert prepare(problem, None, options).solver.options.max_iterations == MOST_ITERATIONS == 60
