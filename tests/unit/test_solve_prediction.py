"""Slopes of the path, extrapolation along them, and how far it can be relied on: against curves that are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from helpers_spring import Spring, at
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import brentq

from tmc_vem import Box, Medium, RunOptions
from tmc_vem.simulation import discretise
from tmc_vem.solve.newton import Iteration, NewtonSolver
from tmc_vem.solve.path import DECADE, ControlPath, load_path
from tmc_vem.solve.prediction import SMALL_WAY, bend_of, reliable, slope_of
from tmc_vem.solve.states import Slope, States, hermite_weights
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import EvaluationError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues

Float = NDArray[np.float64]


def vector(values: Any) -> Any:
    return PETSc.Vec().createWithArray(np.atleast_1d(np.array(values, dtype=float)))


class Layer(Spring):
    """A face that a spring presses onto a layer of medium: of the gap l = 1 - x is left what the medium's pressure
    gamma (l^(-5/3) - l^(1/3)) holds against k (d - x), as between two flat faces."""

    k, gamma = 1.0, 1e-4

    def __init__(self) -> None:
        super().__init__(self._energy, self._gradient, self._hessian)

    def pressure(self, gap: float) -> float:
        return self.gamma * (gap ** (-5 / 3) - gap ** (1 / 3))

    def _energy(self, x: float, d: float) -> float:
        gap = 1.0 - x
        return 0.5 * self.k * (d - x) ** 2 + self.gamma * (1.5 * gap ** (-2 / 3) + 0.75 * gap ** (4 / 3))

    def _gradient(self, x: float, d: float) -> tuple[float, float]:
        return self.pressure(1.0 - x) - self.k * (d - x), self.k * (d - x)

    def _hessian(self, x: float, d: float) -> tuple[float, float, float]:
        gap = 1.0 - x
        return self.k + self.gamma * (5 / 3 * gap ** (-8 / 3) + gap ** (-2 / 3) / 3), -self.k, self.k

    def energy(self, u: Any) -> Evaluation:
        gap = 1.0 - float(u.getArray(readonly=True)[0])
        energy = self.of(*u.getArray(readonly=True).tolist()) if gap > 0.0 else math.nan
        return Evaluation(energy, {"layer": RegionValues(energy, gap)})

    def residual(self, u: Any, out: Any) -> Evaluation:
        evaluation = self.energy(u)
        return super().residual(u, out) if evaluation.admissible else evaluation

    def max_step(self, u: Any, du: Any) -> float:
        x, dx = float(u.getArray(readonly=True)[0]), float(du.getArray(readonly=True)[0])
        return (1.0 - x) / dx if dx > 0.0 else math.inf

    def set_parameters(self, values: Mapping[str, float]) -> None:
        super().set_parameters(values)
        self.gamma = values.get("gamma", self.gamma)

    def face(self, d: float) -> float:
        """x in equilibrium with d."""
        return float(brentq(lambda x: self._gradient(x, d)[0], -1.0, 1.0 - 1e-9, xtol=1e-15))

    def per_load(self, d: float) -> float:
        """Change of x per d there."""
        x = self.face(d)
        return self.k / self._hessian(x, d)[0]


# -- extrapolation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("known", [(1,), (2,), (1, 1), (1, 2), (2, 1), (2, 2), (1, 2, 2), (2, 2, 2), (1, 1, 2, 1)])
def test_weights_are_exact_for_as_many_powers_as_there_are_values(known: tuple[int, ...]) -> None:
    x, wanted, n = np.array([-0.7, -0.2, 0.1, 0.25])[: len(known)], 0.4, sum(known)
    of_values, of_slopes = hermite_weights(x, np.array(known), wanted)
    assert of_slopes[np.array(known) == 1].tolist() == [0.0] * known.count(1)
    found = [of_values @ x**m + of_slopes @ (m * x ** max(m - 1, 0)) for m in range(n + 1)]
    assert found[:n] == pytest.approx([wanted**m for m in range(n)], abs=1e-14)
    assert abs(found[n] - wanted**n) > 1e-4


def curve(t: float, order: int) -> float:
    return (t - 0.3) ** order - 2.0 * t


def curve_slope(t: float, order: int) -> float:
    return float(order * (t - 0.3) ** (order - 1) - 2.0)


@pytest.mark.parametrize(
    ("n_states", "orders"), [(1, [1]), (2, [3, 1]), (3, [5, 3, 1]), (4, [5, 3, 1]), (5, [5, 3, 1])]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_states_with_slopes_give_twice_the_order(n_states: int, orders: list[int], sign: float) -> None:
    """Slopes along the way back count with the other sign."""
    states, order = States(vector(0.0)), orders[0]
    times = np.array([0.0, 0.1, 0.3, 0.35, 0.5])[:n_states]
    for t in times:
        slope = Slope(np.array([sign, 0.0]), vector(sign * curve_slope(t, order)))
        states.append(np.array([t, 1.0]), vector(curve(t, order)), slope)
    wanted, out = times[-1] + 0.2, vector(0.0)
    point = np.array([wanted, 1.0])
    assert list(states.orders(point)) == orders
    assert states.knows_slope(point)
    states.extrapolate(point, order, out)
    assert out.getArray()[0] == pytest.approx(curve(wanted, order), rel=1e-12)
    lower = list(states.orders(point, slopes=False))
    assert lower == list(range(min(n_states, 4) - 1, 0, -1))
    if lower and order > 1:  # Lagrange's polynomial does not go through it
        states.extrapolate(point, lower[0], out, slopes=False)
        assert abs(out.getArray()[0] - curve(wanted, order)) > 1e-5


def test_slopes_count_along_their_line_only_and_end_with_the_branch() -> None:
    states = States(vector(0.0))
    for t in (0.0, 0.5):
        states.append(np.array([t, 0.0]), vector(t), Slope(np.array([1.0, 0.0]), vector(1.0)))
    assert list(states.orders(np.array([0.5, 0.2]))) == []
    assert not states.knows_slope(np.array([0.5, 0.2]))
    states.append(np.array([0.7, 0.0]), vector(0.7))  # one that is not known
    assert list(states.orders(np.array([0.9, 0.0]))) == [4, 2]
    states.append(np.array([0.8, 0.0]), vector(0.8), Slope(np.array([1.0, 0.0]), vector(1.0)))
    states.forget()
    assert states.slopes == [None]
    assert list(states.orders(np.array([0.9, 0.0]))) == []


def test_where_a_layer_closes_the_error_falls_with_the_sixth_power_of_the_step() -> None:
    """The gap there goes by gamma^(3/5); values and slopes are those of the law."""
    layer, errors = Layer(), []
    for h in (0.08, 0.04, 0.02):
        states, out = States(vector(0.0)), vector(0.0)
        for d in (1.3 - 2 * h, 1.3 - h, 1.3):
            states.append(np.array([d]), vector(layer.face(d)), Slope(np.array([1.0]), vector(layer.per_load(d))))
        states.extrapolate(np.array([1.3 + h]), 5, out)
        errors.append(abs(out.getArray()[0] - layer.face(1.3 + h)))
    assert 1.0 - layer.face(1.3) < 0.02
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates[0] > 5.0
    assert rates[1] == pytest.approx(6.0, abs=0.5)


# -- slopes -----------------------------------------------------------------------------------------------------------


def solved(layer: Layer, d: float, start: float) -> tuple[NewtonSolver, Any, Any]:
    solver, u = NewtonSolver(layer), at(start, d)
    solver.set_prescribed(u, Control(d))
    result = solver.solve(u)
    assert result.converged, result.reason
    return solver, u, result.residual


@pytest.mark.parametrize("d", [0.5, 0.95, 1.3])
def test_the_slope_of_a_state_needs_no_tangent_of_its_own(d: float) -> None:
    layer = Layer()
    solver, u, residual = solved(layer, d, 0.9 * layer.face(d))
    tangents = layer.tangents
    rate: Any = slope_of(solver, u, residual, Control(d + SMALL_WAY))
    assert layer.tangents == tangents
    assert rate.getArray() == pytest.approx([layer.per_load(d), 1.0], rel=1e-4)  # a difference over 1e-6


def test_factors_of_a_state_nearby_are_enough() -> None:
    """They are those for a gap that is 2 % larger, with which one solution is off by 5 %, and two by the square."""
    layer, d = Layer(), 1.3
    solver, u, residual = solved(layer, d, 0.9)
    near = u.copy()
    near.getArray()[0] -= 0.02 * (1.0 - near.getArray()[0])
    solver.linearise(near, Control(d))
    rate: Any = slope_of(solver, u, residual, Control(d + SMALL_WAY))
    error = abs(rate.getArray()[0] / layer.per_load(d) - 1.0)
    assert 1e-3 < error < 4e-3


def test_a_slope_that_the_factors_do_not_give_is_not_known() -> None:
    layer, d = Layer(), 1.3
    solver, u, residual = solved(layer, d, 0.9)
    ahead = Control(d + SMALL_WAY)
    solver.linearise(at(0.5, d), Control(d))  # far too soft
    assert slope_of(solver, u, residual, ahead) is None
    solver.linearise(u, Control(d))
    assert slope_of(solver, u, residual, ahead) is not None
    solver._shifted = True
    assert slope_of(solver, u, residual, ahead) is None
    solver._shifted = False
    iterative = NewtonSolver(layer, solver="iterative")  # it has no factors
    iterative.linearise(u, Control(d))
    assert slope_of(iterative, u, residual, ahead) is None

    def fails(*_: Any) -> Evaluation:
        raise EvaluationError("no inner point")

    layer.residual = fails  # type: ignore[method-assign]
    assert slope_of(solver, u, residual, ahead) is None
    layer.residual = lambda v, out: Evaluation(0.0, {"layer": RegionValues(0.0, -1.0)})  # type: ignore[method-assign]
    assert slope_of(solver, u, residual, ahead) is None


def test_slopes_are_along_the_path_whatever_changes_there() -> None:
    """Up, back a little, and then gamma by a decade: from each corner on along the next leg."""
    layer, found = Layer(), {}

    def keep(step: Any, states: States, _: Any) -> None:
        slope = states.slopes[-1]
        if slope is not None:
            found[step.time] = (slope.direction.tolist(), slope.rate.getArray().copy())

    gamma = layer.gamma
    corners = [Control(0.0, {"gamma": gamma}), Control(1.2, {"gamma": gamma}), Control(1.1, {"gamma": gamma})]
    path = ControlPath([*corners, Control(1.1, {"gamma": 0.1 * gamma})], stops=(0.6,))
    LoadStepper(NewtonSolver(layer), SteppingOptions(), keep, path).run(layer.create_vector())
    layer.gamma = gamma
    up, back = found[0.6], found[path.times[1]]
    assert (up[0], back[0]) == (pytest.approx([1.0, 0.0]), pytest.approx([-1.0, 0.0]))
    assert up[1] == pytest.approx([layer.per_load(0.6), 1.0], rel=1e-4)
    assert back[1] == pytest.approx([-layer.per_load(1.2), -1.0], rel=1e-4)
    direction, rate = found[path.times[2]]
    assert direction == pytest.approx([0.0, -1.0])
    x = layer.face(1.1)
    per_log = -math.log(10.0) / DECADE  # of gamma, per length of the path
    assert rate == pytest.approx([-layer.pressure(1.0 - x) * per_log / layer._hessian(x, 1.1)[0], 0.0], rel=1e-4)
    assert path.end not in found  # where nothing comes after


@pytest.mark.parametrize(("steps", "some"), [(20, True), (300, False)])
def test_equal_steps_that_are_short_need_no_slopes(steps: int, some: bool) -> None:
    """They take two iterations, or one, with states alone."""
    known: list[bool] = []
    stepper = LoadStepper(
        NewtonSolver(Layer()),
        SteppingOptions(steps=steps),
        lambda step, states, _: known.append(bool(states.slopes[-1])),
    )
    assert stepper.run(stepper.solver.system.create_vector()).complete
    assert any(known[3:]) is some


@pytest.mark.parametrize("slopes", [True, False])
def test_slopes_may_be_left_out(slopes: bool) -> None:
    seen: list[bool] = []
    stepper = LoadStepper(
        NewtonSolver(Layer()),
        SteppingOptions(slopes=slopes),
        lambda _, states, __: seen.append(bool(states.slopes[-1])),
    )
    assert stepper.run(stepper.solver.system.create_vector()).complete
    assert any(seen) is slopes


# -- how far it can be relied on --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("room", "part"), [(2.0, 1.0), (1.99, 0.95 * 0.995), (1.2, 0.95 * 0.6), (0.1, 0.25)])
def test_a_step_leaves_as_much_room_as_it_takes(room: float, part: float) -> None:
    system = Spring()
    system.reach = room
    states = States(at(0, 0))
    for t in (0.0, 1.0):
        states.append(np.array([t]), at(0.0, t), Slope(np.array([1.0]), at(0.0, 1.0)))
    assert reliable(NewtonSolver(system), at(0.0, 1.0), states, np.array([2.0]), 5, 0.0) == pytest.approx(part)


@pytest.mark.parametrize(
    ("bend", "order", "part"),
    [(0.0, 5, 1.0), (0.99, 5, 1.0), (1.01, 5, 0.95 * 1.01**-0.25), (16.0, 5, 0.95 / 2), (1e3, 5, 0.25), (1e3, 1, 1.0)],
)
def test_orders_of_extrapolation_differ_by_little(bend: float, order: int, part: float) -> None:
    """States t^4 / 60 at -1, 0, 1 and 2, and the slope there, on the way to 3: 75 without the first in place of 81,
    which is a tenth. Their difference goes by the fourth power of the step."""
    system, states = Spring(), States(at(0, 0))
    for t in (-1.0, 0.0, 1.0, 2.0):
        slope = Slope(np.array([1.0]), at(0.0, 4.0 * t**3 / 60.0)) if t == 2.0 else None
        states.append(np.array([t]), at(0.0, t**4 / 60.0), slope)
    last = at(0.0, 16.0 / 60.0)
    assert reliable(NewtonSolver(system), last, states, np.array([3.0]), order, bend) == pytest.approx(part)


def test_nothing_is_said_where_nothing_is_known() -> None:
    system, states = Spring(), States(at(0, 0))
    system.reach = 0.1
    for t in (0.0, 0.5):  # one state, and two without slopes
        states.append(np.array([t]), at(0.0, t))
        assert reliable(NewtonSolver(system), at(0.0, t), states, np.array([1.0]), 5, 9.0) == 1.0


def iterations(*corrections: float, step: float = 1.0) -> list[Iteration]:
    return [Iteration(1.0, 7.0, step if n == 0 else 1.0, c) for n, c in enumerate(corrections)]


@pytest.mark.parametrize(
    ("taken", "before", "bend"),
    [
        (iterations(1e-3, 1e-4, 1e-9), 7.0, 100.0),
        (iterations(1e-3), 7.0, 7.0),
        (iterations(), 7.0, 7.0),
        (iterations(0.0, 0.0), 7.0, 7.0),
        (iterations(1e-3, 1e-9, step=0.5), 7.0, 1e3),  # it did not shrink
        (iterations(1e-3, 1e-9, step=0.5), 5e3, 5e3),
    ],
)
def test_how_fast_the_tangent_turns(taken: list[Iteration], before: float, bend: float) -> None:
    assert bend_of(taken, before) == pytest.approx(bend)


# -- altogether -------------------------------------------------------------------------------------------------------


# in 200 equal steps, with two more corrections at the end
GAPS = {
    ("vem", 1e-5): 0.0020313902379250903, ("vem", 1e-6): 0.0005089534529757467,
    ("fem", 1e-5): 0.0020302794439668315, ("fem", 1e-6): 0.0005094486771433093,
}  # fmt: skip


@pytest.mark.parametrize("method", ["vem", "fem"])
@pytest.mark.parametrize(
    ("alpha_r", "gamma", "most", "steps"),
    [(1.0, 1e-5, {"vem": 50, "fem": 53}, 17), (0.1, 1e-6, {"vem": 86, "fem": 100}, 28)],
)
def test_iterations_of_the_box(method: str, alpha_r: float, gamma: float, most: dict[str, int], steps: int) -> None:
    """The same state at full load as by hundreds of small steps, in steps as short as with extrapolation of states
    alone, which takes 69 and 138 iterations in 18 and 32 (virtual elements; they now take 50 and 86)."""
    if method == "fem":
        pytest.importorskip("dolfinx")
    problem = Box(medium=Medium(gamma=gamma, alpha_r=alpha_r))
    solver = NewtonSolver(discretise(problem, RunOptions(method=method), MPI.COMM_WORLD))
    taken: list[Any] = []
    u = solver.system.create_vector()
    stepper = LoadStepper(solver, SteppingOptions(), lambda step, *_: taken.append(step))
    assert stepper.run(u).complete
    assert solver.iterations_done <= most[method]
    assert len(taken) >= steps
    system: Any = solver.system
    names = ("flange_top", "flange_bottom")
    top, bottom = system.point_coordinates(names) + system.point_displacements(u, names)
    assert float(np.hypot(*(top - bottom))) == pytest.approx(GAPS[method, gamma], rel=1e-9)


def test_a_layer_is_closed_in_fewer_iterations() -> None:
    """With states alone it takes 64 iterations in 22 steps."""
    layer, ends = Layer(), list[tuple[float, float]]()
    solver = NewtonSolver(layer)

    def keep(step: Any, states: States, _: Any) -> None:
        ends.append((step.load, float(states.vectors[-1].getArray(readonly=True)[0])))

    stepper = LoadStepper(solver, SteppingOptions(), keep, load_path((0.0, 1.5)))
    assert stepper.run(layer.create_vector()).complete
    assert [x for _, x in ends] == pytest.approx([layer.face(d) for d, _ in ends], abs=1e-9)
    assert solver.iterations_done <= 50
    assert len(ends) >= 20
