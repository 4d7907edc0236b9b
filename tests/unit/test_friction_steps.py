"""Steps of a slider with friction, whose curves are known: nothing across corners, nothing of failed steps, lengths."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers_truss import Truss
from numpy.typing import NDArray

from tmc_vem.solve.friction_steps import SHORTEST, FrictionRecord, FrictionSteps
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.path import load_path
from tmc_vem.solve.states import Beginning, States
from tmc_vem.solve.stepping import LoadStepper, StepperState, SteppingOptions
from tmc_vem.support.errors import InputError
from tmc_vem.system.friction_lag import Lag
from tmc_vem.system.point_values import PointValues

Float = NDArray[np.float64]

WHERE = np.array([[0.25, 0.5]])


class Slider(Truss):
    """A mass on a rough ground, pulled through a spring: tau = clip(tau_n + kt (v - v_n), -c(v_n), c(v_n)).

    The bound is c0 + c1 |v|, so that it is behind by c1 |v - v_n| while the mass slides.
    """

    k, kt, c0, c1, depth = 1.0, 50.0, 0.2, 0.0, 1.0

    def __init__(self) -> None:
        super().__init__()
        self.v, self.tau, self.advanced, self.gone_back = 0.0, 0.0, 0, 0

    def bound(self, v: float) -> float:
        return self.c0 + self.c1 * abs(v)

    def bars(self, v: Any) -> tuple[Any, Any, Any]:
        c = self.bound(self.v)
        trial = self.tau + self.kt * (v - self.v)
        over = max(abs(trial) - c, 0.0)
        energy = (trial**2 - over**2 - self.tau**2) / (2.0 * self.kt)
        return energy, float(np.clip(trial, -c, c)), self.kt if abs(trial) < c else 0.0

    def shear(self, u: Any) -> tuple[Float, Float]:
        return WHERE, np.array([self.bars(u.getArray(readonly=True)[0])[1]])

    def advance(self, u: Any) -> None:
        self.advanced += 1
        self._begin(u, float(self.shear(u)[1][0]))

    def remember_shear(self, u: Any, shear_at: Callable[[Float], Float]) -> None:
        self.gone_back += 1
        self._begin(u, float(shear_at(WHERE)[0]))

    def _begin(self, u: Any, tau: float) -> None:
        self.v = float(u.getArray(readonly=True)[0])
        c = self.bound(self.v)
        self.tau = float(np.clip(tau, -c, c))


class OfSlider(FrictionSteps):
    """Its lag: by how much the bound has changed."""

    def lag(self, begun: Beginning | None, u: Any) -> Lag:
        assert begun is not None
        slider: Any = self.system
        before, after = (slider.bound(float(vector.getArray(readonly=True)[0])) for vector in (begun.u, u))
        return Lag(abs(after - before), after)


Seen = list[tuple[Any, States, StepperState, float]]


def slide(
    slider: Slider, *loads: float, error: float = 0.01, states: Any = None, position: Any = None, u: Any = None,
    solver: NewtonSolver | None = None, **options: Any,
) -> tuple[Any, Seen]:  # fmt: skip
    """Go along a path; what was told of each step, with the pulling force."""
    seen: Seen = []

    def keep(step: Any, states: States, position: StepperState) -> None:
        v, d = states.vectors[-1].getArray(readonly=True)
        seen.append((step, states, position, slider.k * (d - v)))

    stepper = LoadStepper(
        solver or NewtonSolver(slider), SteppingOptions(**options), keep, load_path(loads or (0.0, 1.0)),
        friction=OfSlider(slider, error),  # type: ignore[arg-type]
    )  # fmt: skip
    u = slider.create_vector() if u is None else u
    return stepper.run(u, states, position), seen


def test_a_loop_is_that_of_coulomb_s_law() -> None:
    """It sticks with the stiffness of both springs, slides at 0.2, and so back; the steps hit the corners."""
    slider = Slider()
    result, seen = slide(slider, 0.0, 1.0, -0.5, 0.5, steps=25)
    assert result.complete
    stiffness = 1.0 / (1.0 / slider.k + 1.0 / slider.kt)
    force, load = 0.0, 0.0
    for step, _, _, found in seen:
        force = float(np.clip(force + stiffness * (step.load - load), -0.2, 0.2))
        assert found == pytest.approx(force, abs=1e-9)
        load = step.load
    assert [step.load for step, *_ in seen if step.number in (25, 50, 75)] == pytest.approx([1.0, -0.5, 0.5])


def test_each_step_begins_once_however_often_it_is_tried() -> None:
    slider, tried = Slider(), [0]
    solver = NewtonSolver(slider)
    predict = solver.predict

    def stubborn(*given: Any) -> bool:
        tried[0] += 1
        return tried[0] % 2 == 0 and predict(*given)

    solver.predict = stubborn  # type: ignore[method-assign]
    result, seen = slide(slider, solver=solver, steps=4, order=1)
    assert result.complete
    assert sum(step.cut_backs for step, *_ in seen) > 0
    assert slider.advanced == len(seen)
    assert slider.gone_back == 0


def test_nothing_is_extrapolated_across_a_corner() -> None:
    """Without friction a way back leads through the states before; with it, they say nothing."""
    lengths: list[int] = []

    def keep(step: Any, states: States, position: StepperState) -> None:
        lengths.append(len(states))

    slider = Slider()
    LoadStepper(
        NewtonSolver(slider), SteppingOptions(steps=5), keep, load_path((0.0, 1.0, 0.0)),
        friction=OfSlider(slider),  # type: ignore[arg-type]
    ).run(slider.create_vector())  # fmt: skip
    assert lengths == [2, 3, 4, 4, 1, 2, 3, 4, 4, 1]
    lengths.clear()
    LoadStepper(NewtonSolver(Slider()), SteppingOptions(steps=5), keep, load_path((0.0, 1.0, 0.0))).run(
        slider.create_vector()
    )
    assert lengths[4] == 4


def test_steps_are_as_long_as_the_tolerated_error() -> None:
    """While it slides, the bound grows by c1 = 1 times the way; it ends at about 0.7."""
    errors = {}
    for error in (0.02, 0.01):
        slider = Slider()
        slider.c1, slider.c0 = 1.0, 0.05
        result, seen = slide(slider, error=error)
        assert result.complete
        record = result.friction
        assert record.carried == pytest.approx(slider.bound(slider.v), abs=0.02)
        assert record.error <= error * (1.0 + 1e-6)
        way = np.diff([0.0, *(step.load for step, *_ in seen)])
        assert way.min() >= SHORTEST * error * (1.0 - 1e-9)
        errors[error] = len(seen)
    assert errors[0.01] == pytest.approx(2 * errors[0.02], rel=0.2)
    slider = Slider()
    slider.c1, slider.c0 = 1.0, 0.05
    equal, seen = slide(slider, steps=10)  # are left as they are
    assert len(seen) == 10
    assert equal.friction.error > 0.05


def test_a_step_that_fails_leaves_the_one_before_it() -> None:
    """Friction at the end is that with which the last step has converged, so that its force is in equilibrium."""
    slider = Slider()
    solver = NewtonSolver(slider)
    solve = solver.solve
    stop = [False]

    def failing(u: Any, **given: Any) -> Any:
        result = solve(u, **given)
        if not stop[0]:
            return result
        from dataclasses import replace

        return replace(result, converged=False, reason="enough", residual=None)

    solver.solve = failing  # type: ignore[method-assign]

    seen: list[tuple[float, float]] = []

    def keep(step: Any, states: States, position: StepperState) -> None:
        seen.append((slider.v, slider.tau))
        stop[0] = step.number == 7

    u = slider.create_vector()
    stepper = LoadStepper(
        solver, SteppingOptions(steps=10, smallest=1e-3), keep, friction=OfSlider(slider)  # type: ignore[arg-type]
    )  # fmt: skip
    result = stepper.run(u)
    assert not result.complete
    assert result.load == pytest.approx(0.7)
    assert slider.gone_back == 1
    assert (slider.v, slider.tau) == seen[-1]
    v, d = u.getArray(readonly=True)
    assert slider.bars(v)[1] == pytest.approx(slider.k * (d - v), abs=1e-9)
    assert "not a stiffer medium, as its friction would remain" in result.reason


def test_a_run_that_is_cut_short_goes_on_with_the_same_bits() -> None:
    _, wanted = slide(Slider(), 0.0, 1.0, 0.2, steps=8)
    slider = Slider()
    kept: list[tuple[States, StepperState]] = []

    def keep(step: Any, states: States, position: StepperState) -> None:
        if step.number == 11:
            copy = States(states.vectors[-1])
            for control, vector in zip(states.controls, states.vectors, strict=True):
                copy.append(control, vector)
            copy.beginning = states.beginning
            kept.append((copy, position))

    LoadStepper(
        NewtonSolver(slider), SteppingOptions(steps=8), keep, load_path((0.0, 1.0, 0.2)),
        friction=OfSlider(slider),  # type: ignore[arg-type]
    ).run(slider.create_vector())  # fmt: skip
    (states, position), again = kept[0], Slider()
    assert states.beginning is not None
    again.remember_shear(states.beginning.u, states.beginning.shear.at)
    _, rest = slide(again, 0.0, 1.0, 0.2, steps=8, states=states, position=position, u=states.vectors[-1].copy())
    assert [force for *_, force in rest] == [force for *_, force in wanted[11:]]


# -- rules ------------------------------------------------------------------------------------------------------------


def test_what_a_step_is_compared_with() -> None:
    steps = FrictionSteps(None, 0.02)
    assert not steps.is_there
    assert steps.begin(None) is None  # type: ignore[arg-type]
    assert steps.lag(None, None) == Lag()  # type: ignore[arg-type]
    assert steps.ratio(Lag(0.0, 0.0), FrictionRecord()) == 0.0
    assert steps.ratio(Lag(0.03, 1.0), FrictionRecord()) == pytest.approx(1.5)
    assert steps.ratio(Lag(0.03, 1.0), FrictionRecord(carried=3.0)) == pytest.approx(0.5)
    assert steps.ratio(Lag(0.03, 0.0), FrictionRecord(carried=3.0)) == pytest.approx(0.5)  # contact has ended


@pytest.mark.parametrize(
    ("ratio", "taken", "wanted"),
    [
        (1.0, 0.1, None), (1.1, 0.1, 0.05), (4.0, 0.1, 0.02), (100.0, 0.1, 0.01), (4.0, 0.002, None),
        (4.0, 0.0026, None), (4.0, 0.0027, 0.002), (100.0, 0.015, 0.002),
    ],
)  # fmt: skip
def test_how_a_step_is_shortened(ratio: float, taken: float, wanted: float | None) -> None:
    assert FrictionSteps(None, 0.02).shortened(ratio, taken, 1.0) == (None if wanted is None else pytest.approx(wanted))


def test_the_shortest_step_is_a_part_of_a_short_leg() -> None:
    steps = FrictionSteps(None, 0.02)
    assert steps.shortened(100.0, 0.0015, 0.5) == pytest.approx(0.001)
    assert steps.shortened(100.0, 0.0013, 0.5) is None
    assert steps.largest_next(100.0, 0.01, 0.5) == pytest.approx(0.001)
    assert steps.largest_next(100.0, 0.01, 3.0) == pytest.approx(0.002), "not more than of a leg of 1"
    assert FrictionSteps(None, 1e-6).largest_next(100.0, 1e-6, 1.0) == pytest.approx(4e-5), "as Newton's may be halved"


def test_the_shortest_step_may_be_stretched_to_a_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    """However far friction is behind: a step that was stretched is not made for once more, for ever."""
    tried: list[int] = []

    def lag(self: OfSlider, begun: object, u: object) -> Lag:
        tried.append(1)
        assert len(tried) < 100, "the same step again and again"
        return Lag(1.0, 1.0)

    monkeypatch.setattr(OfSlider, "lag", lag)
    result, seen = slide(Slider(), 0.0, 1.0, error=0.46)  # the shortest is 0.046, and the last is longer
    assert result.complete
    assert seen[-1][0].time - seen[-2][0].time > 0.046 * (1.0 + 1e-6)


def test_how_long_the_next_step_may_be() -> None:
    steps = FrictionSteps(None, 0.02)
    assert steps.largest_next(0.0, 0.1, 1.0) == math.inf
    assert steps.largest_next(0.4, 0.1, 1.0) == pytest.approx(0.2)
    assert steps.largest_next(1.6, 0.1, 1.0) == pytest.approx(0.05)
    assert steps.largest_next(100.0, 0.005, 1.0) == pytest.approx(0.002)


def test_what_is_remembered_of_all_steps() -> None:
    record = FrictionRecord()
    assert (record.error, record.checks()) == (0.0, {})
    record = record.with_step(Lag(0.1, 1.0), 0.5)
    assert record == FrictionRecord(1.0, 0.1, 0.5)
    record = record.with_step(Lag(0.05, 4.0), 0.7)
    assert record == FrictionRecord(4.0, 0.1, 0.5)
    record = record.with_step(Lag(0.2, 3.0), 0.9)
    assert record == FrictionRecord(4.0, 0.2, 0.9)
    assert record.checks() == {"friction_error": {"largest": pytest.approx(0.05), "load": 0.9}}


def test_values_at_points_are_found_by_their_coordinates() -> None:
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    values = PointValues(points, np.array([1.0, 2.0, 3.0]))
    assert values.at(points[::-1] + 1e-10).tolist() == [3.0, 2.0, 1.0]
    assert values.at(np.empty((0, 2))).shape == (0,)
    with pytest.raises(InputError, match=r"no friction is known at \(0, 0\.5\): it belongs to another mesh"):
        values.at(np.array([[0.0, 1.0], [0.0, 0.5]]))
    with pytest.raises(InputError, match=r"no friction is known at \(2, 0\)"):
        PointValues(np.empty((0, 2)), np.empty(0)).at(points[1:])


def test_corners_of_a_path() -> None:
    path = load_path((0.0, 1.0, 0.5), [0.75])
    assert [path.is_corner(time) for time in (0.0, 0.75, 1.0, 1.25, 1.5)] == [True, False, True, False, True]
