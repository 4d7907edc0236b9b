"""A step that ends far from where it was expected: halved while it is long, another branch where it is short."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_truss import Stop, Truss

from tmc_vem.solve.newton import NewtonResult, NewtonSolver
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import JUMP, Attempt, LoadStepper, StepperState, SteppingOptions

Seen = list[tuple[Any, Any, StepperState]]  # steps, states and positions
LONGEST = JUMP * SteppingOptions.smallest  # 1e-3 of the load


class Watch:
    """Admits everything, and counts what it is asked about."""

    def __init__(self) -> None:
        self.states = self.jumps = 0

    def refusal(self, u: Any, evaluation: Any) -> None:
        self.states += 1

    def refusal_of_jump(self, before: Any, after: Any) -> None:
        self.jumps += 1


def load(system: Truss, admission: Any = None, **options: Any) -> tuple[Any, Seen, LoadStepper]:
    """Load a system; the result, what was told of each step with copies of the states, and the stepper."""
    seen: Seen = []

    def keep(step: Any, states: States, position: StepperState) -> None:
        copy = States(states.vectors[-1])
        for control, vector in zip(states.controls, states.vectors, strict=True):
            copy.append(control, vector)
        seen.append((step, copy, position))

    stepper = LoadStepper(NewtonSolver(system, admission=admission), SteppingOptions(**options), keep)
    return stepper.run(system.create_vector()), seen, stepper


def test_half_a_step_stays_on_a_branch_that_turns_quickly() -> None:
    """In one of twenty steps the stop gives way, and the top moves 0.55 where 0.15 was expected."""
    stop, failed = Stop(), []
    solver = NewtonSolver(stop)
    steps: list[Any] = []
    tops: list[float] = []

    def keep(step: Any, states: Any, _: Any) -> None:
        steps.append(step)
        tops.append(float(states.vectors[-1].getArray(readonly=True)[0]))

    stepper = LoadStepper(solver, SteppingOptions(steps=20), keep, on_failure=lambda u: failed.append(u.norm()))
    assert stepper.run(stop.create_vector()).complete
    assert not any(step.jumped for step in steps)
    assert stop.load_at(np.array(tops)) == pytest.approx([step.load for step in steps], abs=1e-9)
    way = np.diff([0.0, *(step.load for step in steps)])
    halved = [bool(step.cut_backs) for step in steps]
    assert way[0] == pytest.approx(0.05)
    assert min(way[halved]) < 0.02
    assert np.diff([0.0, *tops])[halved].max() < 0.5
    assert solver.iterations_done == sum(len(step.newton.iterations) + step.wasted_iterations for step in steps)
    assert len(failed) == sum(halved)  # the first time at each step


def test_what_was_expected_is_remembered_until_the_far_state_s_time() -> None:
    _, seen, _ = load(Stop(), steps=20)
    known = [position for *_, position in seen if position.far_at > 0.0]
    assert seen[len(seen) - len(known) - 1][0].load == pytest.approx(0.3)
    assert [position.far_at for position in known] == pytest.approx([0.35] * len(known))
    assert [position.rate for position in known] == pytest.approx([3.0] * len(known))  # of the spring's end


def test_stepping_goes_on_from_the_middle_of_halved_steps() -> None:
    _, seen, _ = load(Stop(), steps=20)
    start = next(n for n, (step, *_) in enumerate(seen) if 0.31 < step.load < 0.33)
    _, states, position = seen[start]
    again: list[Any] = []
    stop = Stop()
    stepper = LoadStepper(NewtonSolver(stop), SteppingOptions(steps=20), lambda step, *_: again.append(step))
    u = states.vectors[-1].copy()
    assert stepper.run(u, states, position).complete
    assert [(step.load, step.cut_backs) for step in again] == [(s.load, s.cut_backs) for s, *_ in seen[start + 1 :]]


@pytest.mark.parametrize(
    ("stiffness", "options"), [(0.2, {}), (0.2, {"steps": 20}), (0.45, {"steps": 20}), (0.45, {"steps": 50})]
)
def test_a_branch_that_ends_is_left_where_it_ends(stiffness: float, options: dict[str, Any]) -> None:
    truss, watch = Truss(), Watch()
    truss.k = stiffness
    loads = truss.load_at(np.linspace(0.0, 1.0, 20001))
    highest = loads.max()
    result, seen, stepper = load(truss, watch, **options)
    assert result.complete
    (n,) = [n for n, (step, *_) in enumerate(seen) if step.jumped]
    assert seen[n - 1][0].load < highest < seen[n][0].load <= highest + LONGEST
    assert seen[n][0].load - seen[n - 1][0].load <= LONGEST * (1 + 1e-9)
    assert seen[n - 1][2].far_at > highest
    assert seen[n][2].far_at == 0.0  # nothing there is compared with the old branch
    assert len(seen[n][1]) == 1
    assert watch.jumps == 1
    assert stepper.solver.iterations_done == sum(len(s.newton.iterations) + s.wasted_iterations for s, *_ in seen)


def test_only_steps_that_are_long_for_their_options_are_halved() -> None:
    _, seen, _ = load(Stop(), steps=20, smallest=1e-3)
    (jump,) = [step for step, *_ in seen if step.jumped]
    assert jump.load == pytest.approx(0.35)
    assert jump.cut_backs == 0


def attempt(*, far: bool = False, moved: float = 0.0) -> Attempt:
    truss = Truss()
    return Attempt(NewtonResult(True, "", truss.energy(truss.create_vector())), far, None, 0.1, moved)


@pytest.mark.parametrize(
    ("found", "position", "taken", "halved"),
    [
        (attempt(far=True), StepperState(), LONGEST, False),
        (attempt(far=True), StepperState(), 1.01 * LONGEST, True),
        (attempt(moved=9.0), StepperState(), 0.1, False),
        (attempt(moved=0.5), StepperState(far_at=0.2, rate=2.0), 0.1, False),
        (attempt(moved=0.7), StepperState(far_at=0.2, rate=2.0), 0.1, True),
        (attempt(moved=0.7), StepperState(time=0.2, far_at=0.2, rate=2.0), 0.1, False),
        (attempt(moved=0.9e-3), StepperState(far_at=0.2), 0.1, False),  # less than 1e-3 of the size is never far
        (attempt(moved=1.1e-3), StepperState(far_at=0.2), 0.1, True),
    ],
)
def test_which_steps_are_halved(found: Attempt, position: StepperState, taken: float, halved: bool) -> None:
    stepper = LoadStepper(NewtonSolver(Truss()))
    assert stepper._to_be_halved(found, position, position.time + taken) is halved
