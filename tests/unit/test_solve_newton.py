"""Newton's method and load stepping on small problems."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import grid, voronoi
from helpers_system import CLAMPED, interpolate, make_system, problem_system, region

from tmc_vem.mesh import Rectangle, structured_quadrilaterals
from tmc_vem.problems import Box, Medium
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.solve.newton import NewtonOptions, NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control

SOLID = region("solid", K=20.0, mu=10.0)


def block(uy, ux=0.0):
    """A clamped block whose top moves as a whole."""
    mesh = structured_quadrilaterals([0, 0.5, 1], [0, 0.5, 1], [Rectangle("solid", 0, 1, 0, 1)])
    named = {"bottom": [(0, 1), (1, 2)], "top": [(6, 7), (7, 8)]}
    mesh = type(mesh)(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, ("solid",), named_edges=named
    )
    conditions = [Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 0, ux), Prescribed("top", 1, uy)]
    return make_system(mesh, SOLID, conditions)


def small_box(uy=-1.0, **medium):
    return problem_system(Box(cells=(20, 5), uy=uy, medium=Medium(**{"gamma": 1e-3, **medium})))


def predicted(solver):
    """First guess at full load, from rest."""
    u, guess = solver.system.create_vector(), solver.system.create_vector()
    assert solver.predict(u, Control(1.0), guess)
    return guess


class Watched:
    """A system that keeps the evaluations of all states that were asked for."""

    def __init__(self, system):
        self._system = system
        self.seen = []

    def __getattr__(self, name):
        return getattr(self._system, name)

    def residual(self, u, out):
        self.seen.append(self._system.residual(u, out))
        return self.seen[-1]


def test_converges_quadratically():
    system = small_box(uy=-0.05)
    solver = NewtonSolver(system, NewtonOptions(residual=1e-11, correction=1e-12, reuse=0.0))
    u = predicted(solver)
    result = solver.solve(u)
    assert result.converged, result.reason
    assert result.negative_pivots == 0
    corrections = [i.correction for i in result.iterations if i.correction > 1e-14]
    assert len(corrections) >= 3
    # the last ones above rounding: each correction is about the square of the one before
    for before, after in zip(corrections[-3:-1], corrections[-2:], strict=True):
        assert after < 50.0 * before**2 + 1e-13
    assert all(i.step == 1.0 for i in result.iterations[-3:])


@pytest.mark.parametrize("uy", [-0.1, -0.3])
def test_a_tangent_is_used_again_near_the_solution_only(uy):
    """Fewer tangents, the same state; never one older than an iteration, never after a large correction."""
    states, tangents = [], []
    for reuse in (0.0, 1e-5):
        system = small_box(uy=uy)
        calls = []
        original = system.jacobian
        system.jacobian = lambda u, out, calls=calls, original=original: (calls.append(1), original(u, out))[1]
        solver = NewtonSolver(system, NewtonOptions(correction=1e-9, reuse=reuse))
        u = predicted(solver)
        calls.clear()
        result = solver.solve(u)
        assert result.converged, result.reason
        states.append(u.getArray().copy())
        tangents.append((len(calls), len(result.iterations)))
    assert tangents[0][0] == tangents[0][1]
    saved = tangents[1][1] - tangents[1][0]
    assert 1 <= saved <= tangents[1][1] // 2
    assert states[1] == pytest.approx(states[0], abs=1e-9)


def test_result_is_an_equilibrium():
    system = small_box(uy=-0.1)
    solver = NewtonSolver(system)
    u = predicted(solver)
    result = solver.solve(u)
    assert result.converged
    residual = result.residual
    free = residual.getArray().copy()
    free[system.constrained()] = 0.0
    assert np.abs(free).max() < 1e-8 * np.abs(residual.getArray()).max()
    # reactions balance: all forces add up to zero, and what pushes at the top is carried by the two supports
    load = system.reaction(residual, "load", 1)
    supports = [system.reaction(residual, where, 1) for where in ("support_left", "support_right")]
    assert load < -1e-3
    assert load + sum(supports) == pytest.approx(0.0, abs=1e-9 * abs(load))
    assert system.reaction(residual, "support_left", 0) == pytest.approx(0.0, abs=1e-9 * abs(load))
    # moments about the left support: lever arms in the deformed state
    arm = 1.0 + system.point_displacements(u, ["load"])[0, 0]
    span = 2.0 + system.point_displacements(u, ["support_right"])[0, 0]
    assert load * arm + supports[1] * span == pytest.approx(0.0, abs=1e-8 * abs(load))


def test_a_result_keeps_its_residual_whatever_is_solved_later():
    system = small_box(uy=-0.1)
    solver = NewtonSolver(system)
    u = predicted(solver)
    result = solver.solve(u)
    reaction = system.reaction(result.residual, "load", 1)
    further = system.create_vector()
    assert solver.predict(u, Control(1.2), further)
    assert system.reaction(solver.solve(further).residual, "load", 1) != pytest.approx(reaction, rel=1e-2)
    assert system.reaction(result.residual, "load", 1) == reaction
    far = interpolate(system, lambda x: -2.0 * x * [1, 0])
    assert solver.solve(far).residual is None  # it has not converged


def test_every_iteration_is_told_with_the_number_of_those_before():
    system, told = small_box(uy=-0.2), []
    solver = NewtonSolver(system)
    stepper = LoadStepper(solver, SteppingOptions(steps=2), on_iteration=lambda *said: told.append(said))
    result = stepper.run(system.create_vector())
    assert result.complete
    assert [done for _, done in told] == list(range(1, solver.iterations_done + 1))
    assert [iteration for iteration, _ in told][-len(result.last.newton.iterations) :] == list(
        result.last.newton.iterations
    )
    assert result.last.number == 2
    assert result.linear_iterations == solver.linear_iterations > 0


def test_reaction_is_the_derivative_of_the_energy():
    energies, reactions = [], []
    loads = [-0.1 - 1e-4, -0.1, -0.1 + 1e-4]
    for uy in loads:
        system = block(uy, 0.3)
        solver = NewtonSolver(system)
        u = predicted(solver)
        result = solver.solve(u)
        energies.append(result.evaluation.energy)
        reactions.append(system.reaction(result.residual, "top", 1))
    slope = (energies[2] - energies[0]) / (loads[2] - loads[0])
    assert reactions[1] == pytest.approx(slope, rel=1e-6)


def test_no_state_beyond_the_admissible_ones_is_evaluated():
    """From a state so far away that full corrections would invert cells."""
    watched = Watched(make_system(voronoi(16), region("solid", K=5 / 3, mu=5 / 14), CLAMPED))
    u = interpolate(watched._system, lambda x: x @ np.array([[0.2, -0.1], [0.3, 0.15]]))
    noise = np.random.default_rng(4).normal(size=u.getLocalSize()) * 0.01
    noise[watched.constrained()] = 0.0
    u.getArray()[:] += noise
    assert watched.energy(u).admissible
    result = NewtonSolver(watched, NewtonOptions(max_iterations=40)).solve(u)
    assert result.converged, result.reason
    assert min(iteration.step for iteration in result.iterations) < 0.9
    assert all(evaluation.admissible for evaluation in watched.seen)


def test_newton_keeps_prescribed_displacements():
    system = make_system(voronoi(9), SOLID, CLAMPED)
    u = interpolate(system, lambda x: 0.1 * np.sin(3 * x[:, ::-1]))
    before = u.getArray()[system.constrained()].copy()
    assert NewtonSolver(system).solve(u).converged
    assert u.getArray()[system.constrained()].tolist() == before.tolist()


def test_inadmissible_start_is_reported():
    system = make_system(voronoi(9), SOLID, CLAMPED)
    result = NewtonSolver(system).solve(interpolate(system, lambda x: -2.0 * x * [1, 0]))
    assert not result.converged
    assert "inadmissible" in result.reason
    assert "J = -1 in cell" in result.reason


def test_iteration_limit_is_reported():
    system = block(-0.3)
    solver = NewtonSolver(system, NewtonOptions(max_iterations=1))
    u = predicted(solver)
    result = solver.solve(u)
    assert not result.converged
    assert "no convergence in 1 iteration" in result.reason
    assert len(result.iterations) == 1


def test_predictor_is_exact_to_first_order():
    """Its distance from the equilibrium falls with the square of the load."""
    distances = []
    for scale in (0.2, 0.1, 0.05):
        system = block(-0.4 * scale, 0.3 * scale)
        solver = NewtonSolver(system, NewtonOptions(residual=1e-12, correction=1e-12))
        u, predicted = system.create_vector(), system.create_vector()
        assert solver.predict(u, Control(1.0), predicted)
        predicted.copy(u)
        assert solver.solve(u).converged
        distances.append((u - predicted).norm())
    observed = np.log2(np.array(distances[:-1]) / distances[1:])
    assert observed[-1] == pytest.approx(2.0, abs=0.15)


def test_predictor_reports_an_inversion():
    system = block(-1.5)
    solver = NewtonSolver(system)
    assert not solver.predict(system.create_vector(), Control(1.0), system.create_vector())


@pytest.mark.parametrize("steps", [1, 3, 7])
def test_equal_steps_hit_their_loads(steps):
    system = block(-0.2)
    reached = []
    stepper = LoadStepper(
        NewtonSolver(system), SteppingOptions(steps=steps), lambda step, *_: reached.append((step.number, step.load))
    )
    result = stepper.run(system.create_vector())
    assert result.complete
    assert [n for n, _ in reached] == list(range(1, steps + 1))
    assert [load for _, load in reached] == pytest.approx([(i + 1) / steps for i in range(steps)], abs=1e-14)
    assert reached[-1][1] == 1.0


def test_equal_steps_that_fail_are_cut_and_the_equal_loads_still_hit():
    system = small_box(uy=-0.8)
    steps = []
    stepper = LoadStepper(NewtonSolver(system), SteppingOptions(steps=3), lambda step, *_: steps.append(step))
    stepper.solver.options = NewtonOptions(max_iterations=4)
    u = system.create_vector()
    result = stepper.run(u)
    assert result.complete, result.reason
    assert sum(step.cut_backs for step in steps) > 0
    assert all(step.wasted_iterations > 0 for step in steps if step.cut_backs)
    loads = [step.load for step in steps]
    assert loads == sorted(loads)
    for target in (1 / 3, 2 / 3, 1.0):
        assert min(abs(load - target) for load in loads) < 1e-12
    assert system.point_displacements(u, ["load"])[0, 1] == pytest.approx(-0.8, abs=1e-14)


def test_state_does_not_depend_on_the_steps():
    found = []
    for options in (SteppingOptions(steps=10), SteppingOptions(steps=4), SteppingOptions(first=0.1, largest=0.5)):
        system = block(-0.25, 0.4)
        u = system.create_vector()
        assert LoadStepper(NewtonSolver(system), options).run(u).complete
        found.append(u.getArray().copy())
    assert found[1] == pytest.approx(found[0], abs=1e-8)
    assert found[2] == pytest.approx(found[0], abs=1e-8)


def test_automatic_steps_grow_and_stay_below_the_largest():
    system, steps = block(-0.2), []
    options = SteppingOptions(first=0.02, largest=0.15)
    LoadStepper(NewtonSolver(system), options, lambda step, *_: steps.append(step)).run(system.create_vector())
    sizes = np.diff([0.0] + [step.load for step in steps])
    assert sizes[0] == pytest.approx(0.02)
    assert sizes[1] == pytest.approx(0.04)  # doubles
    assert sizes[:-1].max() <= 0.15 + 1e-12  # the last one may take up a sliver
    assert steps[-1].load == 1.0


@pytest.mark.parametrize("options", [SteppingOptions(smallest=1e-3), SteppingOptions(steps=10, smallest=1e-3)])
def test_an_impossible_load_ends_with_the_last_converged_state(options):
    """The top of the block is pushed below its bottom."""
    system, steps = block(-1.4), []
    states = []

    def keep(step, converged, _):
        steps.append(step)
        states.append(converged.vectors[-1].getArray().copy())

    u = system.create_vector()
    solver = NewtonSolver(system)
    result = LoadStepper(solver, options, keep).run(u)
    assert not result.complete
    assert 0.3 < result.load < 1.0 / 1.4
    assert result.load == steps[-1].load
    assert "steps down to 0.001 of the load" in result.reason
    assert result.failed_attempts > 0
    assert u.getArray().tolist() == states[-1].tolist()
    assert system.energy(u).admissible
    assert solver.solve(u).converged  # and it is an equilibrium


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"steps": 0}, r"0 load steps: use 1 to 1000000"),
        ({"steps": -3}, r"-3 load steps"),
        ({"first": 0.0}, r"load step sizes need 0 < smallest <= first <= largest <= 1"),
        ({"first": 0.2}, r"load step sizes need"),
        ({"largest": 1.5}, r"load step sizes need"),
        ({"smallest": 0.05}, r"load step sizes need"),
        ({"smallest": float("nan")}, r"load step sizes need"),
    ],
)
def test_stepping_options_are_checked(arguments, message):
    with pytest.raises(InputError, match=message):
        SteppingOptions(**arguments)


def test_box_closes_its_gap():
    """20 x 5 cells to full load with the medium of the paper: complete, and the flanges do not penetrate."""
    system = problem_system(Box(cells=(20, 5), medium=Medium(gamma=1e-4)))
    u, gaps = system.create_vector(), []

    def keep(step, states, _):
        top, bottom = system.point_displacements(states.vectors[-1], ["flange_top", "flange_bottom"])
        gaps.append(0.3 + top[1] - bottom[1])

    result = LoadStepper(NewtonSolver(system), on_step=keep).run(u)
    assert result.complete, result.reason
    assert np.diff(gaps).max() < 0.0
    assert 2e-3 < gaps[-1] < 2e-2  # 8.1e-3 on 20 x 10 cells


def test_linear_solver_solves_and_counts_negative_pivots():
    system = make_system(grid(2, 2), SOLID, CLAMPED)
    matrix, u = system.create_matrix(), system.create_vector()
    system.jacobian(u, matrix)
    solver = LinearSolver(matrix, system.comm)
    exact, rhs, found = (system.create_vector() for _ in range(3))
    exact.getArray()[:] = np.arange(exact.getLocalSize())
    matrix.mult(exact, rhs)
    assert solver.solve(rhs, found)
    assert (found - exact).norm() < 1e-10 * exact.norm()
    assert solver.negative_pivots() == 0
    matrix.scale(-1.0)  # new values in the same matrix must be factorised anew
    assert solver.solve(rhs, found)
    assert (found + exact).norm() < 1e-10 * exact.norm()
    assert solver.negative_pivots() == matrix.getSize()[0]
    solver.destroy()
