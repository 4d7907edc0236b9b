"""Paths of loads and parameters, extrapolation, and limits on work."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from helpers_system import make_system, problem_system, region

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.mesh import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems.probes import Displacement
from tmc_vem.problems.wrapped import Probed
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.newton import NewtonResult, NewtonSolver
from tmc_vem.solve.path import DECADE, Control, ControlPath, load_path
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constraints import Prescribed


def block(uy: float = -0.3) -> Any:
    mesh = structured_quadrilaterals([0, 0.5, 1], [0, 0.5, 1], [Rectangle("solid", 0, 1, 0, 1)])
    mesh = with_names(mesh, lines={"bottom": ((0, 0), (1, 0)), "top": ((0, 1), (1, 1))})
    held = [Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 0), Prescribed("top", 1, uy)]
    return make_system(mesh, region("solid", K=20.0, mu=10.0), held)


def follow(system: Any, path: ControlPath, **options: Any) -> tuple[Any, list[Any], Any]:
    """Go along a path; the result, the steps and the last state."""
    steps: list[Any] = []
    u = system.create_vector()
    stepper = LoadStepper(NewtonSolver(system), SteppingOptions(**options), lambda step, *_: steps.append(step), path)
    return stepper.run(u), steps, u


# -- paths -----------------------------------------------------------------------------------------------------------


def test_time_is_the_load_where_the_load_rises() -> None:
    path = load_path()
    assert path.end == 1.0
    for time in (0.0, 0.1, 0.3, 1.0):
        assert path.at(time).load == time


def test_a_path_with_a_reversal() -> None:
    path = load_path((0.0, 1.0, 0.25, 0.5), stops=(0.5, 2.0))
    assert path.end == pytest.approx(2.0)
    assert path.times == pytest.approx([0.0, 1.0, 1.75, 2.0])
    assert [path.at(t).load for t in (0.5, 1.0, 1.5, 1.75, 1.9)] == pytest.approx([0.5, 1.0, 0.5, 0.25, 0.4])
    assert path.stops == pytest.approx([0.5, 1.0, 1.5, 1.75, 2.0])
    assert path.next_stop(0.0) == 0.5
    assert path.next_stop(0.5) == 1.0
    assert path.leg(1.0) == 1
    assert path.leg(path.end) == 2


def test_parameters_change_by_decades() -> None:
    path = ControlPath([Control(0.0, {"gamma": 1e-4}), Control(1.0, {"gamma": 1e-4}), Control(1.0, {"gamma": 1e-8})])
    assert path.end == pytest.approx(1.0 + 4 * DECADE)
    assert path.at(0.5) == Control(0.5, {"gamma": 1e-4})
    assert path.at(1.0 + DECADE).parameters["gamma"] == pytest.approx(1e-5, rel=1e-12)
    assert path.at(1.0 + DECADE).load == 1.0
    assert path.at(path.end).parameters["gamma"] == 1e-8  # exactly


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        ((0.0,), "needs two"),
        ((0.0, 0.0), "stays at"),
        ((0.0, 1.0, 1.0), "stays at"),
        ((0.0, np.nan), "load factor nan"),
    ],
)
def test_unusable_paths_are_refused(loads: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_path(loads)


# -- extrapolation ---------------------------------------------------------------------------------------------------


def vector(values: Any) -> Any:
    return PETSc.Vec().createWithArray(np.array(values, dtype=float))


@pytest.mark.parametrize("n_states", [1, 2, 3, 4, 6])
def test_extrapolation_is_exact_for_polynomials(n_states: int) -> None:
    times = np.cumsum([0.1, 0.2, 0.05, 0.3, 0.1, 0.2])[:n_states]
    states = States(vector([0.0, 0.0]))
    order = min(n_states - 1, 3)

    def curve(t: float) -> list[float]:
        return [1.0 + t**order, (2.0 - t) ** order]

    for t in times:
        states.append(np.array([t]), vector(curve(t)))
    assert list(states.orders(np.array([times[-1] + 0.3]))) == list(range(order, 0, -1))
    if order:
        out = vector([0.0, 0.0])
        states.extrapolate(np.array([times[-1] + 0.3]), order, out)
        assert out.getArray() == pytest.approx(curve(times[-1] + 0.3), rel=1e-12)


def test_states_beyond_a_corner_do_not_count() -> None:
    states = States(vector([0.0]))
    for t in (0.6, 0.8, 1.0):
        states.append(np.array([t, 0.0]), vector([t]))
    assert list(states.orders(np.array([0.7, 0.0]))) == [2, 1]  # back the same way: interpolation
    assert list(states.orders(np.array([1.0, 0.5]))) == []  # another direction
    states.append(np.array([0.9, 0.0]), vector([0.9]))
    assert list(states.orders(np.array([0.7, 0.0]))) == [1]  # 1.0 lies behind, those before it ahead again
    states.forget()
    assert len(states) == 1
    assert list(states.orders(np.array([0.7, 0.0]))) == []


# -- stepping along paths --------------------------------------------------------------------------------------------


def test_unloading_goes_back_the_same_way() -> None:
    result, steps, _ = follow(block(), load_path((0.0, 1.0, 0.5, 1.0), stops=(0.3, 0.5)))
    assert result.complete
    assert result.load == 1.0
    energy = {}
    for step in steps:
        energy.setdefault(round(step.load, 12), []).append(step.newton.evaluation.energy)
    for load, times in ((0.3, 1), (0.5, 2), (1.0, 2)):  # hit exactly, as often as the path passes
        assert len(energy[load]) == times
        assert np.ptp(energy[load]) < 1e-10 * energy[load][0]
    assert [step.time for step in steps] == sorted(step.time for step in steps)


def test_equal_steps_on_every_leg() -> None:
    result, steps, _ = follow(block(), load_path((0.0, 1.0, 0.5)), steps=4)
    assert result.complete
    assert [step.load for step in steps] == pytest.approx([0.25, 0.5, 0.75, 1.0, 0.875, 0.75, 0.625, 0.5])


def test_a_load_that_must_be_hit_does_not_shorten_the_steps_after_it() -> None:
    _, steps, _ = follow(block(), load_path((0.0, 1.0), stops=(0.301,)), largest=0.1)
    loads = np.array([0.0, *(step.load for step in steps)])
    after = np.flatnonzero(np.isclose(loads, 0.301, atol=1e-14))
    assert len(after) == 1
    assert loads[after[0] + 1] - loads[after[0]] == pytest.approx(0.1)


def test_continuation_ends_where_the_direct_way_ends() -> None:
    def box(gamma: float) -> Any:
        return problem_system(Box(cells=(20, 5), uy=-0.6, medium=Medium(gamma=gamma)))

    path = ControlPath([Control(0.0, {"gamma": 1e-3}), Control(1.0, {"gamma": 1e-3}), Control(1.0, {"gamma": 1e-5})])
    result, steps, continued = follow(box(1e-3), path)
    assert result.complete, result.reason
    assert steps[-1].control.parameters == {"gamma": 1e-5}
    gammas = [step.control.parameters["gamma"] for step in steps]
    assert gammas == sorted(gammas, reverse=True)
    assert sum(1e-5 < gamma < 1e-3 for gamma in gammas) >= 2
    direct_result, _, direct = follow(box(1e-5), load_path())
    assert direct_result.complete
    assert (continued - direct).norm() < 1e-8 * direct.norm()


def test_parameters_reach_the_energy() -> None:
    system = problem_system(Box(cells=(20, 5), medium=Medium(gamma=1e-3)))
    u = system.create_vector()
    u.getArray()[:] = np.random.default_rng(1).normal(size=u.getLocalSize()) * 1e-3
    before = system.energy(u).regions
    system.set_parameters({"gamma": 1e-2})
    after = system.energy(u).regions
    assert after["medium"].energy == pytest.approx(10.0 * before["medium"].energy, rel=1e-12)
    assert after["solid"].energy == before["solid"].energy


# -- limits ----------------------------------------------------------------------------------------------------------


def test_a_budget_ends() -> None:
    budget = Budget(iterations=3)
    budget.spend()
    budget.spend()
    with pytest.raises(OutOfBudget, match="limit of 3 Newton iterations"):
        budget.spend()
    with pytest.raises(OutOfBudget, match="limit of 0 seconds"):
        Budget(seconds=0.0).spend()


def test_a_limited_run_keeps_what_converged_and_goes_on(tmp_path: Any) -> None:
    box = Box(cells=(20, 5), uy=-0.4)
    whole = run(box)
    limited = run(box, tmp_path / "box", RunOptions(max_iterations=12, snapshots=0))
    assert not limited.complete
    assert "limit of 12 Newton iterations" in limited.reason
    assert 0 < limited.steps < whole.steps
    assert limited.newton_iterations == 12
    resumed = run(box, tmp_path / "box", RunOptions(snapshots=0), resume=True)
    assert resumed.complete
    assert resumed.gap == whole.gap
    assert [record.load for record in resumed.history] == [record.load for record in whole.history]


def test_continued_parameters_are_in_the_history_and_survive_a_stop(tmp_path: Any) -> None:
    box = Box(cells=(20, 5), uy=-0.4, medium=Medium(gamma=1e-5, alpha_r=0.5))
    options: dict[str, Any] = {"continuation": {"gamma": 1e-3, "alpha_r": 2.0}, "snapshots": 0}
    whole = run(box, options=RunOptions(**options))
    assert whole.complete
    assert whole.history[-1].parameters == {"gamma": 1e-5, "alpha_r": 0.5}
    assert whole.gap == pytest.approx(run(box).gap, rel=1e-8)
    stop = sum(record.load < 1.0 for record in whole.history) + 2  # within the continuation
    limit = sum(record.iterations + record.wasted_iterations for record in whole.history[:stop])
    run(box, tmp_path / "box", RunOptions(**options, max_iterations=limit))
    resumed = run(box, tmp_path / "box", RunOptions(**options), resume=True)
    assert resumed.gap == whole.gap
    read = type(resumed).read(tmp_path / "box")
    assert [record.parameters for record in read.history] == [record.parameters for record in whole.history]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"path": (0.5, 1.0)}, "must begin with 0"),
        ({"path": (0.0,)}, "needs two"),
        ({"path": (0.0, 1.0, 1.0)}, "stays at"),
        ({"continuation": {"beta": 1.0}}, "continuation has no 'beta'"),
        ({"continuation": {"gamma": -1.0}}, "continuation from gamma = -1 must be a positive number"),
        ({"continuation": {"gamma": 1e-5}}, "stays at"),
        ({"max_iterations": 0}, "max_iterations = 0 must be a positive number"),
        ({"max_seconds": np.inf}, "max_seconds = inf must be"),
        ({"output_loads": (np.nan,)}, "output load = nan must be a finite number"),
    ],
)
def test_options_are_checked(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run(Box(cells=(20, 5)), options=RunOptions(**options))


# -- a branch that ends ----------------------------------------------------------------------------------------------


def test_the_rest_of_a_path_with_a_stiffer_medium() -> None:
    path = load_path((0.0, 1.0, 0.5), stops=(0.8,)).stiffened(0.4, {"gamma": 1e-6}, 10.0)
    assert path is not None
    assert [corner.load for corner in path.corners] == pytest.approx([0.0, 0.4, 0.4, 1.0, 0.5, 0.5])
    assert [corner.parameters["gamma"] for corner in path.corners] == pytest.approx(
        [1e-6, 1e-6, 1e-5, 1e-5, 1e-5, 1e-6]
    )
    assert path.at(0.3) == Control(0.3, {"gamma": 1e-6})  # as before
    assert any(path.at(stop).load == pytest.approx(0.8) for stop in path.stops)
    again = path.stiffened(0.4 + DECADE + 0.1, {"gamma": 1e-6}, 100.0)
    assert again is not None
    assert [corner.parameters["gamma"] for corner in again.corners[-5:]] == pytest.approx(
        [1e-5, 1e-4, 1e-4, 1e-4, 1e-6]
    )
    assert path.stiffened(path.end - 0.1, {"gamma": 1e-6}, 10.0) is None  # nothing ahead but the softening


class Fragile:
    """A system whose medium, if too soft, has no equilibrium between two loads: its energy is not a number there."""

    def __init__(self, system: Any, low: float, high: float, stiff: float) -> None:
        self._system, self._low, self._high, self._stiff = system, low, high, stiff
        self.gamma = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._system, name)

    def set_parameters(self, values: Any) -> None:
        self.gamma = values.get("gamma", self.gamma)
        self._system.set_parameters(values)

    def residual(self, u: Any, out: Any) -> Any:
        found = self._system.residual(u, out)
        load = self._system.point_displacements(u, ["load"])[0, 1] / -0.5
        if self._low < load < self._high and self.gamma < self._stiff:
            out.scale(np.nan)
            return type(found)(np.nan, {name: type(r)(np.nan, np.nan) for name, r in found.regions.items()}, "J = nan")
        return found


def test_a_stiffer_medium_gets_past_a_load_where_the_branch_ends() -> None:
    """Descent and detour fail at that load as well; the rest of the path is gone with more gamma, and brought back."""

    def box() -> Any:
        return problem_system(Box(cells=(20, 5), uy=-0.5, medium=Medium(gamma=1e-5)))

    whole_way = box()
    exact = whole_way.create_vector()
    assert LoadStepper(NewtonSolver(whole_way)).run(exact).complete
    system, steps = Fragile(box(), 0.3, 0.8, 5e-5), []
    u = system.create_vector()
    stepper = LoadStepper(
        NewtonSolver(system), SteppingOptions(smallest=1e-3), lambda *seen: steps.append(seen), soften={"gamma": 1e-5}
    )
    assert stepper.run(u).complete
    assert (u - exact).norm() < 1e-8 * exact.norm()
    gammas = [step.control.parameters.get("gamma") for step, *_ in steps]
    assert gammas[0] is None
    assert max(gamma for gamma in gammas if gamma) == pytest.approx(1e-4)
    assert gammas[-1] == 1e-5
    # another stepper that starts from a position beyond goes on in the same way
    last = next(n for n, (step, *_) in enumerate(steps) if step.load > 0.9)
    position = steps[last][2]
    assert len(position.stiffer) == 1


def test_unloading_to_nothing_needs_no_more_iterations_than_other_steps() -> None:
    """Without load there are no reactions that a residual could be compared with."""
    result, steps, u = follow(block(), load_path((0.0, 1.0, 0.0)))
    assert result.complete
    assert steps[-1].load == 0.0
    assert len(steps[-1].newton.iterations) <= 5
    assert u.norm(3) < 1e-8


# -- parameters that reach the system --------------------------------------------------------------------------------


class Told:
    """A system that keeps the parameters that it is told."""

    def __init__(self, system: Any) -> None:
        self._system = system
        self.parameters: list[dict[str, float]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._system, name)

    def set_parameters(self, values: Any) -> None:
        self.parameters.append(dict(values))


def test_the_path_s_parameters_come_before_those_that_may_be_softened() -> None:
    system = Told(block())
    path = ControlPath([Control(0.0, {"gamma": 1e-3}), Control(1.0, {"gamma": 1e-3}), Control(1.0, {"gamma": 1e-5})])
    soften = {"gamma": 1e-5, "alpha_r": 2.0}
    u = system.create_vector()
    stepper = LoadStepper(NewtonSolver(system), SteppingOptions(steps=2), path=path, soften=soften)
    assert stepper.run(u).complete
    gammas = [told["gamma"] for told in system.parameters]
    assert gammas[:2] == [1e-3, 1e-3]  # the first leg
    assert len({round(math.log10(gamma), 3) for gamma in gammas}) == 3  # those of the ends of steps, and close to them
    ends = [gamma for gamma in gammas if min(abs(math.log10(gamma) - end) for end in (-3.0, -4.0, -5.0)) < 1e-12]
    assert ends == sorted(ends, reverse=True)
    assert gammas[-1] == 1e-5
    assert {told["alpha_r"] for told in system.parameters} == {2.0}


def test_a_detour_is_stiffer_than_the_path_is_there() -> None:
    """Where the path has a larger gamma than the problem, ten times the problem's would be softer, not stiffer."""
    system = Told(block())
    path = ControlPath([Control(0.0, {"gamma": 1e-2}), Control(1.0, {"gamma": 1e-2}), Control(1.0, {"gamma": 1e-5})])
    solver = NewtonSolver(system)
    stepper = LoadStepper(solver, SteppingOptions(), path=path, soften={"gamma": 1e-5})
    refused = NewtonResult(False, "for the test", system.energy(system.create_vector()))
    solver.solve = lambda u, **_: refused  # type: ignore[method-assign]
    u, trial = system.create_vector(), system.create_vector()
    assert not stepper._other_branch(u, trial, 0.2, 0.3).result.converged
    told = [parameters["gamma"] for parameters in system.parameters]
    assert min(told) == pytest.approx(1e-2)
    assert max(told) > 1e-2


@pytest.mark.parametrize("name", ["gamma", "alpha_r"])
def test_a_run_with_continuation_is_one_with_that_parameter_until_full_load(name: str) -> None:
    """On the way its states are those of the other medium, at the end those of the problem."""
    end, start = {"gamma": 1e-4, "alpha_r": 1.0}, {"gamma": 1e-3, "alpha_r": 30.0}
    begin = {**end, name: start[name]}
    continued = run(
        Box(cells=(20, 5), uy=-0.2, medium=Medium(**end)), None, RunOptions(steps=2, continuation={name: start[name]})
    )
    other, plain = (
        run(Box(cells=(20, 5), uy=-0.2, medium=Medium(**m)), None, RunOptions(steps=2)) for m in (begin, end)
    )
    assert [step.load for step in continued.history] == [0.5, 1.0, 1.0, 1.0]
    for mine, theirs in zip(continued.history[:2], other.history, strict=True):
        assert mine.energy["medium"] == pytest.approx(theirs.energy["medium"], rel=1e-6)
        assert dict(mine.parameters) == {name: start[name]}
    assert continued.history[-1].energy["medium"] == pytest.approx(plain.history[-1].energy["medium"], rel=1e-6)
    assert dict(continued.history[-1].parameters) == {name: end[name]}
    assert other.history[-1].energy["medium"] > 1.05 * plain.history[-1].energy["medium"]


def test_the_displacement_has_the_sign_of_the_load() -> None:
    """Pushed, pulled and pushed again; the loaded node is where the record says."""
    problem = Probed(Box(cells=(20, 5), uy=-0.03), {"node": Displacement("uy", "load")})
    result = run(problem, None, RunOptions(steps=1, path=(0.0, 1.0, -0.5, 0.25)))
    assert [step.load for step in result.history] == [1.0, -0.5, 0.25]
    assert [step.displacement for step in result.history] == pytest.approx([-0.03, 0.015, -0.0075])
    assert [step.probes["node"] for step in result.history] == pytest.approx([-0.03, 0.015, -0.0075])
    assert [np.sign(step.reaction) for step in result.history] == [-1.0, 1.0, -1.0]
    assert [np.sign(step.load_force) for step in result.history] == [1.0, -1.0, 1.0]
