"""Whole runs under forces: beam theory, work and stored energy along a cycle, resumed runs, and past limit points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_forces import METHODS, ROLLERS, SOLID, Parts, discretised, plate
from helpers_truss import Truss

from tmc_vem import RunOptions, run
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.probes import Displacement
from tmc_vem.problems.wrapped import Loaded
from tmc_vem.results.run_result import RunResult
from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues
from tmc_vem.system.forces import BodyForce, FollowerPressure, PointForce, Spring, Traction
from tmc_vem.system.loaded import with_forces

CLAMP = (Prescribed("left", 1), Prescribed("left", 0))


@pytest.mark.parametrize("method", METHODS)
def test_a_cantilever_bends_as_the_beam_does(method: str) -> None:
    """A slender beam in plane strain under a force at its end: F L^3 / 3 E' I, and the shear."""
    if method == "fem":
        pytest.importorskip("dolfinx")
    K, mu, L, h, F = SOLID.values["K"], SOLID.values["mu"], 10.0, 0.5, 1e-6
    nu = (3 * K - 2 * mu) / (6 * K + 2 * mu)
    stiffness = 2 * mu / (1 - nu) * h**3 / 12  # E / (1 - nu^2) = 2 mu / (1 - nu)
    end = Traction("push", "right", (0.0, -F / h))
    probes = {"tip": Displacement("uy", "tip")}
    beam = Parts(lambda: plate(20, 1, L, h), CLAMP, [end], probes)
    result = run(beam, options=RunOptions(method, steps=1))
    assert result.complete, result.reason
    expected = F * L**3 / (3 * stiffness) + F * L / (5 / 6 * mu * h)
    assert result.history[-1].probes["tip"] == pytest.approx(-expected, rel=0.01)
    # the support carries it, and the balance of forces says so
    assert result.history[-1].reaction == pytest.approx(F, rel=1e-6)
    assert result.checks["imbalance"] < 1e-6


ACTING = (
    Traction("pull", "right", (0.5, 0.0)),
    FollowerPressure("water", "corner", 0.3),
    Spring("bed", "top", (0.5, 1.0)),
    BodyForce("weight", ("block",), (0.0, -0.2)),
)


def all_kinds() -> Any:
    return Loaded(Parts(plate, (Prescribed("bottom", 1), Prescribed("left", 0))), ACTING)


def runs(steps: int, path: tuple[float, ...] = (0.0, 1.0)) -> RunResult:
    result = run(all_kinds(), options=RunOptions(steps=steps, path=path))
    assert result.complete, result.reason
    return result


def test_work_is_stored_to_the_order_of_the_integration() -> None:
    """The trapezoidal rule: half the step, a quarter of the error; of the energy in springs as well."""
    errors = []
    for steps in (4, 8):
        result = runs(steps)
        balance = result.checks["energy_balance"]
        last = result.history[-1]
        assert balance["stored"] == pytest.approx(sum(last.energy.values()) + last.forces["bed"]["energy"])
        assert balance["work"] + balance["integration_error"] == pytest.approx(balance["stored"], rel=1e-12)
        errors.append(balance["integration_error"] / balance["stored"])
    assert abs(errors[0]) < 5e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, abs=0.3)
    assert last.forces["bed"]["energy"] > 0.02 * sum(last.energy.values())


def test_a_cycle_gives_all_work_back(tmp_path: Path) -> None:
    result = runs(4, (0.0, 1.0, 0.0))
    most = max(sum(record.energy.values()) for record in result.history)
    balance = result.checks["energy_balance"]
    assert most > 0.02
    assert abs(balance["work"]) < 1e-9 * most
    assert abs(balance["stored"]) < 1e-9 * most
    up, down = result.history[2], result.history[4]
    assert (up.load, down.load) == (0.75, 0.75)
    for name, measures in up.forces.items():
        assert down.forces[name] == pytest.approx(measures, rel=1e-8, abs=1e-12), name


def test_a_problem_with_forces_says_so_in_its_inputs() -> None:
    problem = Loaded(all_kinds(), [PointForce("push", "tip", (0.0, 1.0))])
    assert [force.name for force in problem.forces()] == ["pull", "water", "bed", "weight", "push"]
    inputs = problem.inputs()
    assert inputs["problem"] == "parts"
    assert [each["kind"] for each in inputs["forces"]] == [
        "Traction", "FollowerPressure", "Spring", "BodyForce", "PointForce",
    ]  # fmt: skip
    assert inputs["forces"][-1] == {
        "kind": "PointForce", "name": "push", "where": "tip", "force": (0.0, 1.0), "amplitude": "Proportional()",
    }  # fmt: skip
    assert inputs["forces"][2]["amplitude"] == "Constant()"


def test_a_resumed_run_ends_bit_for_bit_where_the_whole_one_does(tmp_path: Path) -> None:
    options = RunOptions(largest_step=0.2, snapshots=0)
    whole = run(all_kinds(), options=options)
    cut = run(all_kinds(), tmp_path / "cut", replace(options, max_iterations=9))
    assert 1 < len(cut.history) < len(whole.history)
    again = run(all_kinds(), tmp_path / "cut", options, resume=True)
    for mine, theirs in zip(again.history, whole.history, strict=True):
        assert replace(mine, seconds=0.0, wasted_iterations=0, cut_backs=0) == replace(
            theirs, seconds=0.0, wasted_iterations=0, cut_backs=0
        )
    read = RunResult.read(tmp_path / "cut")
    assert [record.forces for record in read.history] == [record.forces for record in whole.history]
    assert read.history[-1].probes == {}


# -- past limit points -------------------------------------------------------------------------------------------------


class PushedTruss(Truss):
    """The truss pushed at its top by the force ``depth`` times the load factor, the spring's end held."""

    depth, k = 0.6, 0.2

    def __init__(self) -> None:
        super().__init__()
        self.load = 0.0

    def set_position(self, position: Control) -> None:
        self.load = position.load

    def prescribed(self, position: Control) -> Any:
        return np.array([0.0])

    def prescribed_per_load(self, position: Control) -> Any:
        return np.array([0.0])

    def add_residual_per_load(self, u: Any, position: Control, out: Any) -> None:
        out.getArray()[0] -= self.depth

    def energy(self, u: Any) -> Any:
        evaluation = super().energy(u)
        work = self.depth * self.load * u.getArray(readonly=True)[0]
        return replace(evaluation, energy=evaluation.energy - work)

    def residual(self, u: Any, out: Any) -> Any:
        super().residual(u, out)
        out.getArray()[0] -= self.depth * self.load
        return replace(self.energy(u), forces=self.depth * abs(self.load))

    def force_at(self, v: Any) -> Any:
        return (self.bars(v)[1] + self.k * v) / self.depth


def test_a_truss_is_followed_through_its_limit_points_under_a_force() -> None:
    truss = PushedTruss()
    loads, tops, lengths = [], [], []

    def keep(step: Any, states: Any, _: Any) -> None:
        loads.append(step.load)
        lengths.append(step.time)
        tops.append(float(states.vectors[-1].getArray(readonly=True)[0]))

    result = ArcLengthStepper(NewtonSolver(truss), ArcOptions(largest=0.5), keep).run(truss.create_vector())
    assert result.complete, result.reason
    assert (loads[-1], truss.load) == (1.0, 1.0)
    assert loads == pytest.approx(truss.force_at(np.array(tops)).tolist(), abs=1e-7)
    assert np.diff(loads).min() < 0.0 < np.diff(tops).min()
    # of the displacements the mean square counts, relative to a tenth of the size, which is 1; there is one node
    pieces = np.hypot(np.diff(loads), np.diff(tops) / 0.1)
    assert np.diff(lengths) == pytest.approx(pieces, rel=1e-9)
    fine = truss.force_at(np.linspace(0.0, 1.0, 2001)).max()
    assert 0.9 * fine < max(load for load, top in zip(loads, tops, strict=True) if top < 1.0) <= fine


def test_what_stopped_is_left_at_its_last_load() -> None:
    """Whatever was tried beyond: the forces that are checked at the end are those of the last state."""
    truss = PushedTruss()
    solver = NewtonSolver(truss)
    result = ArcLengthStepper(solver, ArcOptions(max_steps=3)).run(truss.create_vector())
    assert not result.complete
    assert truss.load == result.load > 0.0
    seen = []
    truss.depth = 0.2  # below the limit
    stepper = LoadStepper(
        NewtonSolver(truss), SteppingOptions(steps=4), lambda step, *_: seen.append((step.load, truss.load))
    )
    assert stepper.run(truss.create_vector()).complete
    assert seen == [(load, load) for load in (0.25, 0.5, 0.75, 1.0)]
    # a run that has nothing left to do is at its end
    u = truss.create_vector()
    states, position = stepper.start(u)
    truss.load = 0.0
    assert stepper.run(u, states, replace(position, time=1.0)).complete
    assert truss.load == 1.0


def test_the_potential_is_as_exact_as_what_it_is_the_difference_of() -> None:
    regions = {"a": RegionValues(3.0, 1.0), "b": RegionValues(1.0, 1.0)}
    assert [Evaluation(energy, regions).magnitude for energy in (1e-9, 4.0, -5.0)] == [4.0, 4.0, 5.0]


def arch() -> PolygonMesh:
    """A shallow arch of 12 x 1 cells, clamped at both ends, its crown named."""
    flat = plate(12, 1, 2.0, 0.05)
    X, Y = flat.points_vx.T
    points = np.column_stack([X, Y + 0.1 * np.sin(np.pi * X / 2.0) ** 2])
    return PolygonMesh(
        points, flat.cell_offsets, flat.cell_vertices, flat.region_c, flat.region_names,
        {"crown": flat.find_vertex(1.0, 0.05)}, flat.named_edges,
    )  # fmt: skip


def test_an_arch_snaps_through_under_a_force_and_is_followed() -> None:
    """The limit load of both methods, and load control jumps there with the loss that the balance says."""
    pytest.importorskip("dolfinx")
    ends = [Prescribed(where, component) for where in ("left", "right") for component in (0, 1)]
    force, limits = PointForce("push", "crown", (0.0, -4e-4)), []
    for method in METHODS:
        system = with_forces(discretised(method, arch(), ends), [force])
        loads: list[float] = []
        crown: list[float] = []

        def keep(step: Any, states: Any, _: Any, system: Any = system, loads: Any = loads, crown: Any = crown) -> None:
            loads.append(step.load)
            crown.append(float(system.point_displacements(states.vectors[-1], ["crown"])[0, 1]))

        result = ArcLengthStepper(NewtonSolver(system), ArcOptions(largest=0.1), keep).run(system.create_vector())
        assert result.complete, result.reason
        back = int(np.flatnonzero(np.diff(loads) < 0.0)[0])
        limits.append(loads[back])
        assert 0.3 < loads[back] < 0.9
        assert crown[back] > -0.1 > crown[-1]
        assert np.diff(crown).max() < 0.0
    assert limits[0] == pytest.approx(limits[1], rel=0.03)


def test_a_jump_under_a_force_loses_energy() -> None:
    probes = {"crown": Displacement("uy", "crown")}
    ends = [Prescribed(where, component) for where in ("left", "right") for component in (0, 1)]
    problem = Parts(arch, ends, [PointForce("push", "crown", (0.0, -4e-4))], probes)
    result = run(problem, options=RunOptions())
    assert result.complete, result.reason
    (jump,) = result.checks["energy_balance"]["jumps"]
    assert 0.3 < jump["load"] < 0.9
    assert jump["lost"] > 100.0 * jump["uncertainty"] > 0.0
    assert result.history[-1].probes["crown"] < -0.1


def test_rollers_hold_what_springs_do_not() -> None:
    """Of springs, the components with a stiffness hold; a load that is 0 moves something if a force acts."""
    bed = Spring("bed", "left", (0.0, 1.0))
    problem = Parts(plate, (Prescribed("left", 0),), [bed, PointForce("push", "tip", (0.01, 0.0))])
    result = run(problem, options=RunOptions(steps=1))
    assert result.complete, result.reason
    assert result.history[-1].forces["push"]["force_x"] == 0.01
    assert ROLLERS[0] == Prescribed("left", 0)
