"""A branch with limit points is followed through them: a truss with a known curve, and an arch under a soft pad."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_system import make_system, region
from helpers_truss import Truss
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
from tmc_vem.solve.budget import Budget
from tmc_vem.solve.newton import NewtonOptions, NewtonSolver
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control

Float = NDArray[np.float64]


def follow(system: Any, **options: Any) -> tuple[Any, list[Any], list[Float]]:
    steps: list[Any] = []
    found: list[Float] = []

    def keep(step: Any, states: Any, _: Any) -> None:
        steps.append(step)
        found.append(states.vectors[-1].getArray(readonly=True).copy())

    stepper = ArcLengthStepper(NewtonSolver(system), ArcOptions(**options), keep)
    return stepper.run(system.create_vector()), steps, found


def test_the_truss_is_followed_on_its_curve() -> None:
    truss = Truss()
    limits = truss.load_at(np.linspace(0.0, 2.5, 2001))
    turning = np.flatnonzero(np.diff(np.sign(np.diff(limits)))) + 1
    assert len(turning) == 2  # it snaps back
    highest, lowest = limits[turning]
    result, steps, found = follow(truss, largest=0.05)
    assert result.complete, result.reason
    tops = np.array([state[0] for state in found])
    loads = np.array([step.load for step in steps])
    assert loads == pytest.approx(truss.load_at(tops), abs=1e-9)
    assert np.diff(tops).min() > 0.0  # never back on the way it came
    assert loads[:-1].max() < 1.0
    assert loads[-1] == 1.0
    between = (tops > 0.5) & (tops < 1.6)
    assert loads[between].max() == pytest.approx(highest, abs=0.02)
    assert loads[between].min() == pytest.approx(lowest, abs=0.02)
    unstable = [step.newton.negative_pivots for step in steps]
    assert {n for n, load in zip(unstable, np.gradient(loads), strict=True) if load < -1e-3} == {1}
    assert unstable[0] == 0
    assert unstable[-1] == 0
    times = [step.time for step in steps]
    assert times == sorted(times)


def test_following_goes_on_from_where_it_stopped() -> None:
    whole = follow(Truss(), largest=0.1)[1]
    kept: list[Any] = []

    def keep(step: Any, states: Any, position: Any) -> None:
        if step.number == 7:
            kept.extend([states.vectors[-1].copy(), [v.copy() for v in states.vectors], states.controls[:], position])

    truss = Truss()
    ArcLengthStepper(NewtonSolver(truss), ArcOptions(largest=0.1), keep).run(truss.create_vector())
    u, vectors, controls, position = kept
    states = States(u)
    for control, vector in zip(controls, vectors, strict=True):
        states.append(control, vector)
    steps: list[Any] = []
    again = ArcLengthStepper(NewtonSolver(truss), ArcOptions(largest=0.1), lambda step, *_: steps.append(step))
    assert again.run(u, states, position).complete
    assert [step.load for step in steps] == pytest.approx([step.load for step in whole[7:]], rel=1e-12)


class Slowly(Truss):
    """The spring's end moves with a power of the load factor: slowly at first."""

    power = 1.5

    def prescribed(self, position: Control) -> Float:
        return np.array([self.depth * position.load**self.power])

    def prescribed_per_load(self, position: Control) -> Float:
        return np.array([self.power * self.depth * position.load ** (self.power - 1.0)])


def test_what_is_prescribed_may_be_any_function_of_the_load() -> None:
    result, steps, found = follow(Slowly(), largest=0.05)
    assert result.complete, result.reason
    tops, loads = np.array([state[0] for state in found]), np.array([step.load for step in steps])
    assert loads == pytest.approx(Truss().load_at(tops) ** (1 / Slowly.power), abs=1e-9)
    assert np.diff(loads).min() < 0.0  # through a limit point


def test_the_change_per_load_is_the_derivative_of_the_equilibrium() -> None:
    """Central differences of the state approach it with the square of the step."""
    truss = Slowly()
    solver, change = NewtonSolver(truss, NewtonOptions(residual=1e-13, correction=1e-13)), truss.create_vector()

    def equilibrium(load: float) -> Any:
        u = truss.create_vector()
        u.getArray()[:] = [0.1, 0.0]
        solver.set_prescribed(u, Control(load))
        assert solver.solve(u).converged
        return u

    worked, _ = solver.per_load(equilibrium(0.2), Control(0.2), change)
    assert worked
    errors = []
    for step in (0.02, 0.01, 0.005):
        slope = (equilibrium(0.2 + step) - equilibrium(0.2 - step)) * (0.5 / step)
        errors.append((slope - change).norm())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)


def test_a_branch_that_does_not_reach_the_load_ends() -> None:
    result, steps, _ = follow(Truss(), largest=0.01, max_steps=20)
    assert not result.complete
    assert len(steps) == 20
    assert "followed for 20 steps" in result.reason


def test_attempts_that_led_to_nothing_are_counted() -> None:
    """With a tangent that is too stiff nothing converges in few iterations: steps are halved down to the smallest."""

    class Stiff(Truss):
        def jacobian(self, u: Any, out: Any) -> None:
            super().jacobian(u, out)
            out.scale(3.0)

    options = ArcOptions(first=0.1, smallest=0.002, max_iterations=3)
    solver = NewtonSolver(Stiff(), NewtonOptions())
    result = ArcLengthStepper(solver, options).run(solver.system.create_vector())
    assert (result.complete, result.load, result.last) == (False, 0.0, None)
    assert result.failed_attempts == 6, "0.1, 0.05, ... 0.003125"
    assert result.failed_iterations == solver.iterations_done > 2 * result.failed_attempts


@pytest.mark.parametrize("most", [1, 2, 7, 30])
def test_no_iteration_is_lost_when_the_budget_ends(most: int) -> None:
    solver, budget, steps = NewtonSolver(Truss()), Budget(iterations=most), list[Any]()
    stepper = ArcLengthStepper(
        solver, ArcOptions(), lambda step, *_: steps.append(step), lambda *_: budget.spend()
    )  # fmt: skip
    result = stepper.run(solver.system.create_vector())
    assert "Newton iterations" in result.reason
    done = sum(len(step.newton.iterations) + step.wasted_iterations for step in steps)
    assert done + result.failed_iterations == solver.iterations_done == most


def arch_system() -> Any:
    """Half of a shallow arch, its end clamped, under a soft pad on its crown; x = 0 is the axis of symmetry."""
    x, y, rise = np.linspace(0.0, 1.0, 17), np.array([0.0, 0.02, 0.12, 0.22]), 0.06
    parts = [
        Rectangle("arch", 0.0, 1.0, 0.0, y[1]),
        Rectangle("pad", 0.0, x[2], y[1], y[-1]),
        Rectangle("outside", x[2], 1.0, y[1], y[-1]),
    ]
    flat = structured_quadrilaterals(x, y, parts)
    flat = submesh(flat, flat.region_c != flat.region_names.index("outside"))
    lines = {
        "clamp": ((1.0, 0.0), (1.0, y[1])),
        "axis": ((0.0, 0.0), (0.0, y[-1])),
        "load": ((0.0, y[-1]), (x[2], y[-1])),
    }
    named = with_names(flat, {"crown": (0.0, y[1])}, lines)
    X, Y = named.points_vx.T
    mesh = PolygonMesh(
        np.column_stack([X, Y + rise * (1.0 + np.cos(np.pi * X)) / 2]), named.cell_offsets, named.cell_vertices,
        named.region_c, named.region_names, named_points=named.named_points, named_edges=named.named_edges,
    )  # fmt: skip
    energies = {"arch": region("solid", K=20.0, mu=10.0), "pad": region("solid", K=5e-4, mu=2e-4)}
    held = [Prescribed("clamp", 0), Prescribed("clamp", 1), Prescribed("axis", 0), Prescribed("load", 1, -0.24)]
    return make_system(mesh, energies, held)


def test_an_arch_snaps_through_and_is_followed_back() -> None:
    system = arch_system()
    crown: list[float] = []
    steps: list[Any] = []

    def keep(step: Any, states: Any, _: Any) -> None:
        steps.append(step)
        crown.append(float(system.point_displacements(states.vectors[-1], ["crown"])[0, 1]))

    result = ArcLengthStepper(NewtonSolver(system), ArcOptions(largest=0.05), keep).run(system.create_vector())
    assert result.complete, result.reason
    loads = np.array([step.load for step in steps])
    back = np.flatnonzero(np.diff(loads) < 0.0)
    assert loads[back[0]] - loads[back[-1] + 1] > 0.1  # the load went back ...
    assert crown[back[0]] > -0.1 > crown[-1]  # ... while the crown, 0.08 high, went through
    assert all(steps[n].newton.negative_pivots > 0 for n in back[1:-1])
    assert steps[back[0] - 1].newton.negative_pivots == 0
    assert steps[-1].newton.negative_pivots == 0
    # load control jumps there, to the same state beyond
    jumped: list[Any] = []
    u = system.create_vector()
    stepper = LoadStepper(NewtonSolver(system), SteppingOptions(), lambda step, *_: jumped.append(step))
    assert stepper.run(u).complete
    assert any(step.jumped for step in jumped)
    assert float(system.point_displacements(u, ["crown"])[0, 1]) == pytest.approx(crown[-1], rel=1e-6)


def test_the_length_of_the_branch_is_that_of_load_and_displacements() -> None:
    """By hand: the mean square of the displacements, relative to the largest prescribed one, and the load factor."""
    truss = Truss()
    result, steps, found = follow(truss, largest=0.05)
    assert result.complete
    states = np.column_stack([[step.load for step in steps], np.array(found) / truss.depth])
    pieces = np.diff(np.concatenate([np.zeros((1, 3)), states]), axis=0)
    expected = np.sqrt(pieces[:, 0] ** 2 + 0.5 * 2 * (pieces[:, 1:] ** 2).sum(axis=1))
    assert np.diff([0.0, *(step.time for step in steps)]) == pytest.approx(expected, rel=1e-9)
    assert expected[1:-1].max() < 1.4 * 0.05 + 1e-12  # of its part along the tangent
