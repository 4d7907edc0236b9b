"""Paths, step sizes, and in which ways load stepping and arc length stop, on a system of two unknowns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_spring import Admission, Refusal, Spring, at
from mpi4py import MPI

from tmc_vem.solve.arclength import REMEDY as REMEDY_ALONG
from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.newton import NewtonResult, NewtonSolver
from tmc_vem.solve.path import ControlPath, load_path
from tmc_vem.solve.prediction import extrapolate
from tmc_vem.solve.sizes import StepSizes
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import REMEDY, LoadStepper, StepperState, SteppingOptions
from tmc_vem.support.errors import EvaluationError, InputError
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues

# -- paths and states ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        ([Control(0.0)], "a load path needs two load factors or more, for example 0 1 0"),
        ([Control(0.0), Control(math.inf)], "load factor inf of the load path: use a number from -1000 to 1000"),
        ([Control(0.0), Control(1001.0)], "load factor 1001 of the load path: use a number from -1000 to 1000"),
        ([Control(0.0), Control(-1001.0)], "load factor -1001 of the load path: use a number from -1000 to 1000"),
        (
            [Control(0.0, {"gamma": 0.0}), Control(1.0, {"gamma": 1.0})],
            "gamma = 0 on the load path must be a positive number",
        ),
        (
            [Control(0.0, {"gamma": 1.0}), Control(1.0, {"gamma": math.inf})],
            "gamma = inf on the load path must be a positive number",
        ),
        (
            [Control(0.0), Control(0.5), Control(0.5), Control(1.0)],
            "the load path stays at load factor 0.5: leave the repetition out",
        ),
    ],
)
def test_what_is_wrong_with_a_path_is_said(corners: list[Control], message: str) -> None:
    with pytest.raises(InputError) as caught:
        ControlPath(corners)
    assert str(caught.value) == message


def test_the_largest_loads_of_a_path_are_usable_and_the_default_is_zero_to_one() -> None:
    assert load_path((0.0, 1000.0, -1000.0)).times.tolist() == [0.0, 1000.0, 3000.0]
    assert [corner.load for corner in load_path().corners] == [0.0, 1.0]


def test_stops_are_where_a_leg_passes_them_and_not_at_its_corners() -> None:
    path = ControlPath(
        [Control(0.0, {"g": 1.0}), Control(1.0, {"g": 1.0}), Control(1.0, {"g": 10.0}), Control(-1.0, {"g": 10.0})],
        stops=(0.0, 0.5, 1.0, -0.5, 2.0),
    )
    assert path.times == pytest.approx([0.0, 1.0, 1.2, 3.2])
    assert path.stops == pytest.approx([0.5, 1.0, 1.2, 1.7, 2.2, 2.7, 3.2])
    assert [path.next_stop(t) for t in (0.0, 0.5, 1.1, 3.0, 3.2)] == pytest.approx([0.5, 1.0, 1.2, 3.2, 3.2])
    assert [path.leg(t) for t in (0.0, 0.9, 1.0, 1.2, 3.2)] == [0, 0, 1, 2, 2]
    assert path.start_of_leg(1.1) == 1.0
    assert path.at(1.1).parameters["g"] == pytest.approx(math.sqrt(10.0))
    assert path.at(2.2) == Control(pytest.approx(0.0, abs=1e-15), {"g": 10.0})


def test_a_path_along_which_load_and_parameter_change_together() -> None:
    path = ControlPath([Control(0.0, {"g": 1.0}), Control(0.3, {"g": 100.0})], stops=(0.15,))
    assert path.end == pytest.approx(0.5)  # 0.3 and two decades of 0.2
    assert path.stops == pytest.approx([0.25, 0.5])
    half = path.at(0.25)
    assert (half.load, half.parameters["g"]) == (pytest.approx(0.15), pytest.approx(10.0))


def test_as_many_states_are_kept_as_were_asked_for() -> None:
    states = States(at(0, 0), kept=2)
    for t in (0.0, 1.0, 2.0):
        states.append(np.array([t]), at(t, -t))
    assert [control.tolist() for control in states.controls] == [[1.0], [2.0]]
    assert [vector.getArray().tolist() for vector in states.vectors] == [[1.0, -1.0], [2.0, -2.0]]
    states.restart(np.array([5.0, 6.0]))
    assert [control.tolist() for control in states.controls] == [[5.0, 6.0]]
    assert [vector.getArray().tolist() for vector in states.vectors] == [[2.0, -2.0]]


# -- limits on work --------------------------------------------------------------------------------------------------


class Clock:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr("tmc_vem.solve.budget.time.monotonic", lambda: self.now)


@pytest.mark.parametrize("comm", [None, MPI.COMM_SELF])
def test_a_limit_of_time_ends_the_work(comm: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(monkeypatch)
    budget = Budget(iterations=10, seconds=2.5, comm=comm)
    budget.spend()
    clock.now += 2.4
    budget.spend()
    assert (budget.spent, budget.used_up) == (2, False)
    clock.now += 0.1
    with pytest.raises(OutOfBudget, match=r"^the limit of 2\.5 seconds is used up$"):
        budget.spend()
    assert budget.used_up


# -- load stepping ---------------------------------------------------------------------------------------------------


def run(system: Spring, path: ControlPath | None = None, **options: Any) -> tuple[Any, list[Any]]:
    steps: list[Any] = []
    stepper = LoadStepper(
        NewtonSolver(system), SteppingOptions(**options), lambda step, *_: steps.append(step), path or load_path()
    )
    return stepper.run(system.create_vector()), steps


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"steps": 1_000_001}, "1000001 load steps: use 1 to 1000000"),
        ({"first": 0.2}, "load step sizes need 0 < smallest <= first <= largest <= 1, got 1e-05, 0.2, 0.1"),
        ({"smallest": 0.0}, "load step sizes need 0 < smallest <= first <= largest <= 1, got 0, 0.01, 0.1"),
        ({"smallest": -1e-5}, "load step sizes need 0 < smallest <= first <= largest <= 1, got -1e-05, 0.01, 0.1"),
        ({"order": 0}, "extrapolation of order 0: use 1 to 5"),
        ({"order": 6}, "extrapolation of order 6: use 1 to 5"),
    ],
)
def test_step_sizes_are_checked(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        SteppingOptions(**options)
    assert str(caught.value) == message


def test_the_limits_of_step_sizes_themselves_are_allowed() -> None:
    assert SteppingOptions(steps=1_000_000, order=5).steps == 1_000_000
    assert SteppingOptions(steps=1, order=1, smallest=1.0, first=1.0, largest=1.0).first == 1.0


@pytest.mark.parametrize(
    ("largest", "stops", "expected"),
    [
        (0.4, (), [0.1, 0.3, 0.7, 1.0]),
        (0.2, (), [0.1, 0.3, 0.5, 0.7, 0.9, 1.0]),
        (0.22, (), [0.1, 0.3, 0.52, 0.74, 1.0]),  # 0.96 would leave a sliver
        (0.2, (0.42,), [0.1, 0.3, 0.42, 0.62, 0.82, 1.0]),  # the stop does not shorten the steps after it
        (0.25, (0.57,), [0.1, 0.3, 0.57, 0.82, 1.0]),  # a little longer, to hit it
    ],
)
def test_steps_grow_by_two_up_to_the_largest_and_hit_what_must_be_hit(
    largest: float, stops: tuple[float, ...], expected: list[float]
) -> None:
    result, steps = run(Spring(), load_path(stops=stops), first=0.1, largest=largest)
    assert [step.load for step in steps] == pytest.approx(expected, abs=1e-12)
    assert (result.complete, result.reason, result.load) == (True, "full load", 1.0)
    assert result.last is steps[-1]
    assert [step.number for step in steps] == list(range(1, len(expected) + 1))
    assert (result.failed_attempts, result.failed_iterations, result.refusal) == (0, 0, None)
    assert result.ordering != ""


@pytest.mark.parametrize(
    ("position", "target", "iterations", "cut", "size"),
    [
        (StepperState(0.2, 0.1), 0.3, 3, False, 0.2),  # grows
        (StepperState(0.2, 0.1), 0.3, 4, False, 0.1),  # as many as wanted
        (StepperState(0.2, 0.1), 0.3, 5, False, 0.08),  # shrinks in proportion
        (StepperState(0.2, 0.1), 0.3, 40, False, 0.05),  # to the half at most
        (StepperState(0.2, 0.1), 0.3, 3, True, 0.1),  # does not grow after a cut
        (StepperState(0.2, 0.1), 0.3, 5, True, 0.08),
        (StepperState(0.2, 0.1), 0.25, 4, False, 0.1),  # was short to hit something
        (StepperState(0.2, 0.1), 0.25, 5, False, 0.04),
        (StepperState(0.2, 0.2), 0.4, 3, False, 0.25),  # the largest
    ],
)
def test_the_next_size(position: StepperState, target: float, iterations: int, cut: bool, size: float) -> None:
    automatic, equal = (
        StepSizes(options, load_path()) for options in (SteppingOptions(largest=0.25), SteppingOptions(5))
    )
    taken = target - position.time
    assert automatic.following(position.size, taken, target, iterations, cut) == pytest.approx(size)
    assert equal.following(position.size, taken, target, iterations, cut) == pytest.approx(taken if cut else 0.2)


class Narrow(Spring):
    """Leaves room for steps of a certain length."""

    room = math.inf

    def max_step(self, u: Any, du: Any) -> float:
        return self.room / max(abs(float(du.getArray(readonly=True)[1])), 1e-300)


@pytest.mark.parametrize(
    ("room", "order", "found", "reached"),
    [(22.0, 3, True, 27.0), (21.0, 3, True, 21.0), (22.0, 2, True, 21.0), (14.0, 3, True, 15.0), (22.0, 1, True, 15.0),
     (7.7, 3, False, 15.0)],
)  # fmt: skip
def test_the_highest_extrapolation_that_stays_before_the_boundary_is_taken(
    room: float, order: int, found: bool, reached: float
) -> None:
    """States t^3 at 0, 1 and 2 on the way to 3: 27, 21 and 15 by cubic, parabola and line; the last one is 8."""
    system = Narrow()
    solver = NewtonSolver(system)
    states = States(at(0, 0))
    for t in (-1.0, 0.0, 1.0, 2.0):
        states.append(np.array([t]), at(0.0, t**3))
    u, trial = at(0.0, 8.0), at(0.0, 0.0)
    system.room = room
    assert bool(extrapolate(solver, u, states, np.array([3.0]), order, trial)) is found
    assert trial.getArray()[1] == pytest.approx(reached)


class Torn(Spring):
    """Has no equilibrium above a load: the potential cannot be evaluated there."""

    most = 0.52

    def residual(self, u: Any, out: Any) -> Evaluation:
        if u.getArray(readonly=True)[1] > self.most:
            raise EvaluationError("no inner point")
        return super().residual(u, out)


def test_an_end_is_said_with_all_that_was_tried() -> None:
    failed: list[float] = []
    system = Torn()
    stepper = LoadStepper(
        NewtonSolver(system), SteppingOptions(first=0.25, largest=0.25, smallest=1e-2), soften={"gamma": 1e-4},
        on_failure=lambda u: failed.append(float(u.getArray()[1])),
    )  # fmt: skip
    u = system.create_vector()
    result = stepper.run(u)
    assert not result.complete
    assert result.reason == (
        "no inner point; smallest J = 1 in cell 0. Tried: steps down to 0.01 of the load, extrapolated and tangent "
        f"predictors, descent to another equilibrium, gamma raised up to 1000 times to get past this load. {REMEDY}"
    )
    assert failed[:1] == [0.5]
    assert u.getArray()[1] == result.load == result.last.load
    assert 0.5 <= result.load <= 0.52
    told = [values["gamma"] for values in system.parameters]
    assert max(told) == pytest.approx(0.1)  # a thousand times
    assert told[0] == 1e-4


def test_without_anything_to_soften_nothing_of_it_is_said() -> None:
    result, steps = run(Torn(), first=0.25, largest=0.25, smallest=1e-2)
    assert result.reason == (
        "no inner point; smallest J = 1 in cell 0. Tried: steps down to 0.01 of the load, extrapolated and tangent "
        f"predictors, descent to another equilibrium. {REMEDY}"
    )
    assert [step.load for step in steps] == pytest.approx([0.25, 0.5, 0.515625])
    assert result.failed_attempts == 1, "0.0078 is too small already"
    assert [step.cut_backs for step in steps] == [0, 0, 4]


def test_a_predictor_that_inverts_the_mesh_is_said_with_the_place() -> None:
    system = Spring()
    system.reach, system.worst = 1.1, "J = 0.01 in cell 7"
    result, steps = run(system, first=0.5, largest=0.5, smallest=0.5)
    assert steps == [] or steps[0].jumped
    assert result.complete or "the predictor inverts the mesh (J = 0.01 in cell 7)" in result.reason


def test_a_refused_state_ends_with_its_own_advice() -> None:
    system, steps = Spring(), []
    solver = NewtonSolver(system, admission=Admission(0.2))
    stepper = LoadStepper(solver, SteppingOptions(first=0.25, largest=0.25, smallest=0.1), steps.append)  # type: ignore[arg-type]
    stepper.on_step = lambda step, *_: steps.append(step)
    result = stepper.run(system.create_vector())
    assert isinstance(result.refusal, Refusal)
    assert result.reason == (
        "bodies overlap; smallest J = 1 in cell 0. Tried: steps down to 0.1 of the load, extrapolated and tangent "
        "predictors, descent to another equilibrium. Use more medium"
    )
    assert [step.load for step in steps] == [0.25, 0.375]


def test_a_state_far_from_the_predicted_one_is_on_another_branch() -> None:
    """Far: three predicted increments and a thousandth of the size, both."""
    for x, size, far in ((4.5, 1.0, True), (3.5, 1.0, False), (4.5, 4000.0, False)):
        system = Spring()
        system.size = size
        solver = NewtonSolver(system)
        stepper = LoadStepper(solver)
        u, trial = at(0.0, 0.0), at(1.0, 0.0)
        evaluation = system.energy(u)

        def moved(out: Any, *, x: float = x, evaluation: Evaluation = evaluation, **_: Any) -> NewtonResult:
            out.setArray([x, 0.0])
            return NewtonResult(True, "converged", evaluation)

        solver.solve = moved  # type: ignore[method-assign]
        assert stepper._solve(u, trial, trial.copy()).far is far


def test_after_a_jump_the_states_before_it_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second of three steps finds a state on another branch."""
    kept, jumped, real = list[int](), list[bool](), LoadStepper._solve

    def solve(stepper: LoadStepper, u: Any, trial: Any, usual: Any) -> Any:
        attempt = real(stepper, u, trial, usual)
        return replace(attempt, far=len(kept) == 1)

    monkeypatch.setattr(LoadStepper, "_solve", solve)
    system = Spring()

    def keep(step: Any, states: States, position: StepperState) -> None:
        kept.append(len(states))
        jumped.append(step.jumped)

    stepper = LoadStepper(NewtonSolver(system, admission=Admission(1.0)), SteppingOptions(steps=3, smallest=0.01), keep)
    assert stepper.run(system.create_vector()).complete
    assert (kept, jumped) == ([2, 1, 2], [False, True, False])
    kept.clear()
    refusing = NewtonSolver(system, admission=Admission(1.0, 0.1))  # jumps of 1/6 are not admitted
    result = LoadStepper(refusing, SteppingOptions(steps=3, first=0.3, largest=0.3, smallest=0.3), keep).run(
        system.create_vector()
    )
    assert (result.complete, result.load, kept) == (False, pytest.approx(1 / 3), [2])
    assert result.reason.startswith("bodies overlap; ")


# -- arc length ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"smallest": 0.0}, "arc lengths need 0 < smallest <= first <= largest, got 0, 0.01, 0.1"),
        ({"first": 0.2}, "arc lengths need 0 < smallest <= first <= largest, got 1e-06, 0.2, 0.1"),
        ({"smallest": 0.02}, "arc lengths need 0 < smallest <= first <= largest, got 0.02, 0.01, 0.1"),
    ],
)
def test_arc_lengths_are_checked(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        ArcOptions(**options)
    assert str(caught.value) == message
    assert ArcOptions(smallest=0.1, first=0.1).largest == 0.1


def along(system: Spring, change: Callable[[Spring], None] | None = None, after: int = 1, **options: Any) -> Any:
    """Follow; the system changes after some steps."""
    steps: list[Any] = []

    def keep(step: Any, *_: Any) -> None:
        steps.append(step)
        if change and step.number == after:
            change(system)

    return ArcLengthStepper(NewtonSolver(system), ArcOptions(**options), keep).run(system.create_vector()), steps


def ended(why: str, smallest: str) -> str:
    return f"{why}; smallest J = 1 in cell 0. Tried: steps along the branch down to {smallest}. {REMEDY_ALONG}"


@pytest.mark.parametrize(("reach", "gets_on"), [(1.12, True), (1.1, False)])
def test_a_predictor_along_the_branch_stays_before_the_boundary(reach: float, gets_on: bool) -> None:
    result, steps = along(
        Spring(), lambda system: setattr(system, "reach", reach), first=0.1, largest=0.1, smallest=0.05
    )
    assert result.complete is gets_on
    if not gets_on:
        assert result.reason == ended("the predictor inverts the mesh", "0.05")
        assert (len(steps), result.failed_attempts, result.failed_iterations, result.load) == (1, 2, 0, 0.1)


def test_a_first_step_whose_predictor_inverts_the_mesh() -> None:
    system = Spring()
    system.reach = 1.0
    result, _ = along(system, first=0.1, smallest=0.1)
    assert result.reason == ended("the predictor inverts the mesh (J = 1 in cell 0)", "0.1")
    assert (result.load, result.last, result.failed_attempts) == (0.0, None, 1)


def test_a_tangent_that_cannot_be_factorised_ends_the_branch() -> None:
    def loose(system: Spring) -> None:
        system.hessian = lambda x, d: (0.0, -1.0, 1.0)

    result, _ = along(Spring(), loose, first=0.1, smallest=0.06)
    assert result.reason == ended("the tangent could not be factorised", "0.06")


def test_an_inadmissible_state_ends_the_branch() -> None:
    def inverted(system: Spring) -> None:
        def energy(u: Any) -> Evaluation:
            return Evaluation(0.0, {"spring": RegionValues(0.0, -1.0)}, "J = -1 in cell 2")

        system.energy = energy  # type: ignore[method-assign]

    result, _ = along(Spring(), inverted, first=0.1, smallest=0.06)
    assert result.reason.startswith("inadmissible state (J = -1 in cell 2); smallest J = -1 in cell 2. Tried: ")


def test_iterations_along_the_branch_are_limited_and_said() -> None:
    def wrong(system: Spring) -> None:
        system.hessian = lambda x, d: (20.0, -1.0, 1.0)

    result, _ = along(Spring(), wrong, first=0.1, smallest=0.06, max_iterations=3)
    assert "no convergence along the branch in 3 iterations (residual " in result.reason
    assert result.failed_iterations == 3


def test_steps_of_a_straight_branch() -> None:
    """x = d/2: a unit of load moves the mean square of (1/2, 1), 1.25: a length of 1.5 in all."""
    result, steps = along(Spring(), first=0.1, largest=0.4)
    ratio = math.sqrt(1.0 + 1.25)
    sizes = [0.1 * ratio, 0.15, 0.225, 0.3375, 0.4]
    assert result.complete
    times = np.cumsum(sizes).tolist()
    assert [step.time for step in steps] == pytest.approx([*times, ratio])
    assert [step.load for step in steps] == pytest.approx([*(time / ratio for time in times), 1.0])
    assert [step.number for step in steps] == [1, 2, 3, 4, 5, 6]
    assert steps[-1].load == 1.0
    result, steps = along(Spring(), first=0.1, largest=0.4, max_steps=3)
    assert (result.reason, len(steps)) == ("the branch was followed for 3 steps", 3)


# -- what is prescribed, whatever the predictor says -----------------------------------------------------------------


class Curved(Spring):
    """What is prescribed is no polynomial of the load, so that extrapolations miss it."""

    def prescribed(self, position: Control) -> Any:
        return np.array([math.expm1(position.load)])

    def prescribed_per_load(self, position: Control) -> Any:
        return np.array([math.exp(position.load)])


def test_states_have_what_is_prescribed_exactly() -> None:
    for make in (LoadStepper, ArcLengthStepper):
        system, seen = Curved(), list[tuple[float, float]]()

        def keep(step: Any, states: States, _: Any, seen: list[tuple[float, float]] = seen) -> None:
            seen.append((step.load, float(states.vectors[-1].getArray(readonly=True)[1])))

        options: Any = SteppingOptions(steps=6) if make is LoadStepper else ArcOptions(first=0.2, largest=0.4)
        stepper: Any = make(NewtonSolver(system), options, keep)
        assert stepper.run(system.create_vector()).complete
        assert [d for _, d in seen] == [math.expm1(load) for load, _ in seen]


def test_looking_for_another_branch_leaves_the_state_as_it_is() -> None:
    system = Spring(
        lambda x, d: 0.5 * (d - x) ** 2 + x**4 / 4, lambda x, d: (x - d + x**3, d - x),
        lambda x, d: (1 + 3 * x * x, -1, 1),
    )  # fmt: skip
    stepper = LoadStepper(NewtonSolver(system))
    u, trial = at(0.25, 0.5), at(0.0, 0.0)
    found = stepper._other_branch(u, trial, 0.5, 0.75)
    assert (found.result.reason, found.far) == ("converged", True)
    assert u.getArray().tolist() == [0.25, 0.5]
    x, d = trial.getArray().tolist()
    assert (d, x + x**3) == (0.75, pytest.approx(0.75))


def test_the_direction_of_a_branch_is_that_at_its_last_load() -> None:
    """Not at its length so far, where what is prescribed changes faster."""
    system, loads, asked = Curved(), [0.0], list[float]()
    solver = NewtonSolver(system)
    real = solver.per_load
    solver.per_load = lambda u, position, out: (asked.append(position.load), real(u, position, out))[1]  # type: ignore[method-assign]
    stepper = ArcLengthStepper(solver, ArcOptions(first=0.2, largest=0.4), lambda step, *_: loads.append(step.load))
    assert stepper.run(system.create_vector()).complete
    assert set(loads[1:-1]) <= set(asked)
