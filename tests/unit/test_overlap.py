"""Solids do not overlap: states in which they do are refused, wherever they come from."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_blocks import blocks
from helpers_system import interpolate, problem_system
from numpy.typing import NDArray

from tmc_vem import run
from tmc_vem.results.contact.contact import OVERLAP, Overlap
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.overlap import OverlapWatch, Refusal
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.solve.newton import NewtonResult, NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues

Float = NDArray[np.float64]
SQUEEZED = Evaluation(0.0, {"medium": RegionValues(0.0, 0.05)})
WIDE = Evaluation(0.0, {"medium": RegionValues(0.0, 0.5)})


@pytest.fixture
def system(tmp_path: Path) -> Any:
    return problem_system(read_problem(str(blocks(tmp_path, cells="quadrilaterals", size=0.2)))[0])


def lowered(amount: float) -> Any:
    """The upper block moved down as it is, the medium between them shared out."""
    return lambda x: np.column_stack([0.0 * x[:, 0], -amount * np.clip((x[:, 1] - 0.4) / 0.2, 0.0, 1.0)])


# -- the watch alone -------------------------------------------------------------------------------------------------


def test_states_with_and_without_overlap(system: Any) -> None:
    watch = OverlapWatch(system, ["medium"], 2)
    for amount, refused in ((0.1, False), (0.199, False), (0.2 + 0.5 * OVERLAP, False), (0.21, True), (0.3, True)):
        refusal = watch.refusal(interpolate(system, lowered(amount)), SQUEEZED)
        assert (refusal is not None) == refused, amount
    assert refusal is not None
    assert refusal.overlap.depth == pytest.approx(0.1)
    assert refusal.overlap.area == pytest.approx(0.1)
    assert set(refusal.regions) == {"low", "up"}
    names = system.regions
    for cell, name in zip(refusal.cells, refusal.regions, strict=True):
        assert names[system.distributed.mesh.region_c[cell]] == name
    assert "depth 1.00e-01" in refusal.sentence()
    assert "inside cell" in refusal.sentence()
    assert refusal.advice().startswith("Try smaller cells")


def test_the_advice_is_the_cause_that_is_known_for_the_place(system: Any) -> None:
    places: list[Any] = []

    def cause(place: Any) -> str | None:
        places.append(place)
        return "the medium ends there"

    watch = OverlapWatch(system, ["medium"], 2, cause=cause)
    refusal = watch.refusal(interpolate(system, lowered(0.3)), SQUEEZED)
    assert refusal is not None
    assert not places  # it is looked for when it is asked for
    assert refusal.advice() == "Known cause: the medium ends there"
    assert places == [refusal.overlap.origin]


def test_nothing_is_looked_at_before_the_medium_is_squeezed(system: Any) -> None:
    watch = OverlapWatch(system, ["medium"], 2)
    through = interpolate(system, lowered(0.3))
    assert not watch.refusal(through, WIDE)
    for min_j, refused in ((0.101, False), (0.099, True)):
        narrow = Evaluation(0.0, {"medium": RegionValues(0.0, min_j)})
        assert bool(OverlapWatch(system, ["medium"], 2).refusal(through, narrow)) == refused
    assert watch.refusal(through, SQUEEZED)
    assert watch.refusal(through, WIDE)  # from then on every state


def test_overlap_may_be_allowed(system: Any) -> None:
    watch = OverlapWatch(system, ["medium"], 2, tolerated=True)
    assert not watch.refusal(interpolate(system, lowered(0.3)), SQUEEZED)
    assert watch.crossed
    assert not watch.refusal(interpolate(system, lowered(0.1)), SQUEEZED)
    assert watch.crossed  # where a surface has come through, gaps keep their signs


def test_refused_states_give_gaps_no_sign(system: Any) -> None:
    watch = OverlapWatch(system, ["medium"], 2)
    assert watch.refusal(interpolate(system, lowered(0.3)), SQUEEZED)
    assert not watch.crossed
    points = [np.array([0.4, 0.6]), np.array([0.4, 0.4])]
    assert not watch.behind(interpolate(system, lowered(0.1)), points, points)


def test_a_body_beyond_the_other_is_behind_its_surface(system: Any) -> None:
    """No outline crosses any more, but one has."""
    watch = OverlapWatch(system, ["medium"], 2, tolerated=True)
    before, beyond = (interpolate(system, lowered(amount)) for amount in (0.1, 1.5))
    assert not watch.refusal_of_jump(before, beyond)
    assert not watch.refusal(beyond, SQUEEZED)
    points = [np.array([0.4, 0.6]), np.array([0.4, 0.4])]
    assert watch.behind(beyond, points, [points[0] - [0.0, 1.5], points[1]])
    # and after a resume
    record = StepRecord(1, 1.0, -1.0, {"gap": -1.3}, 0.0, 1, 0, 0, {"medium": 0.3}, {}, 0, False, 0.0)
    resumed = OverlapWatch(system, ["medium"], 2, tolerated=True)
    resumed.go_on([record])
    assert resumed.crossed
    assert not resumed.is_active
    resumed.go_on([dataclasses.replace(record, min_j={"medium": 0.099})])
    assert resumed.is_active


def test_a_jump_to_the_other_side_is_seen(system: Any) -> None:
    """Blocks that changed places do not overlap: that one went through the other shows in between."""
    watch = OverlapWatch(system, ["medium"], 2)
    before, near, beyond = (interpolate(system, lowered(amount)) for amount in (0.15, 0.19, 1.5))
    assert not watch.refusal(beyond, SQUEEZED)
    refusal = watch.refusal_of_jump(before, beyond)
    assert refusal is not None
    assert "passed through each other" in refusal.sentence()
    assert refusal.passed
    assert not watch.refusal_of_jump(before, near)


def test_a_fold_counts_by_its_area_only() -> None:
    size = 2.0
    assert not Overlap(area=0.5 * OVERLAP * size**2, fold=0.1).exceeds(size)
    assert Overlap(area=1.5 * OVERLAP * size**2, fold=0.1).exceeds(size)
    assert Overlap(depth=1.5 * OVERLAP * size).exceeds(size)
    assert "a corner closes on itself: depth 1.00e-01" in Refusal(Overlap(fold=0.1)).sentence()


# -- signs of gaps ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second", "amount", "behind"),
    [
        ((0.4, 0.6), (0.4, 0.4), 0.3, True),
        ((0.4, 0.4), (0.4, 0.6), 0.3, True),
        ((0.4, 0.6), (0.4, 0.4), 0.1, False),
        ((0.0, 0.6), (0.0, 0.4), 0.3, True),  # corners: the mean of both normals
        ((0.4, 0.8), (0.4, 0.4), 0.5, True),  # inside of a body: the normal of the other one
        ((0.4, 0.8), (0.4, 0.2), 0.7, False),  # neither on an outline: no sign
        ((0.4, 0.6), (0.4, 1.0), 0.3, False),  # behind it from the start: a thickness is no gap
    ],
)
def test_the_second_point_is_behind_the_surface_of_the_first(
    system: Any, first: tuple[float, float], second: tuple[float, float], amount: float, behind: bool
) -> None:
    watch = OverlapWatch(system, ["medium"], 2, tolerated=True)
    u = interpolate(system, lowered(amount))
    watch.refusal(u, SQUEEZED)
    origins = [np.array(first), np.array(second)]
    places = [origin + lowered(amount)(origin[None])[0] for origin in origins]
    assert watch.behind(u, origins, places) is behind


# -- in the solver ---------------------------------------------------------------------------------------------------


class Until:
    """Refuses every state beyond a load factor."""

    def __init__(self, system: Any, load: float) -> None:
        self.system, self.load, self.refusals = system, load, 0

    def refusal(self, u: Any, evaluation: Evaluation) -> Until | None:
        here = u.getArray(readonly=True)[self.system.constrained()]
        full = self.system.prescribed(Control(1.0))
        beyond = float(here @ full / (full @ full)) > self.load
        self.refusals += beyond
        return self if beyond else None

    def refusal_of_jump(self, before: Any, after: Any) -> None:
        return None

    def sentence(self) -> str:
        return "it is beyond"

    def advice(self) -> str:
        return "Stay here"


def test_a_refused_state_counts_as_a_failed_step(system: Any) -> None:
    until = Until(system, 0.3)
    steps: list[Any] = []
    stepper = LoadStepper(
        NewtonSolver(system, admission=until), SteppingOptions(smallest=1e-3), lambda step, *_: steps.append(step),
        soften={"gamma": 1e-4},
    )  # fmt: skip
    u = system.create_vector()
    result = stepper.run(u)
    assert not result.complete
    assert result.load == pytest.approx(0.3, abs=2e-3)
    assert result.load <= 0.3
    assert result.reason.startswith("it is beyond; smallest J")
    assert result.reason.endswith("Stay here")
    assert until.refusals > 5  # extrapolated and tangent predictors, descent, detours, a stiffer medium
    assert steps[-1].load == result.load


def test_a_refusal_counts_until_the_next_step_converges(system: Any) -> None:
    """What ends a run is not put down to a state that was refused long before."""
    until, steps = Until(system, -1.0), list[Any]()
    solver, u = NewtonSolver(system, admission=until), system.create_vector()
    nothing = NewtonResult(False, "for the test", system.energy(u))

    def refused(*_: Any) -> None:
        until.load = 1.0  # the first state only

    def reached(step: Any, *_: Any) -> None:
        steps.append(step)
        solver.solve = lambda u, **_: nothing  # type: ignore[method-assign]

    stepper = LoadStepper(solver, SteppingOptions(smallest=1e-3), reached, on_failure=refused)
    result = stepper.run(u)
    assert until.refusals >= 1
    assert [step.cut_backs for step in steps] == [1]
    assert not result.complete
    assert result.reason.startswith("for the test")
    assert result.refusal is None


# -- whole runs ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    here = tmp_path_factory.mktemp("blocks")
    problem, options = read_problem(str(blocks(here)))
    return run(problem, here / "run", options)


def test_blocks_do_not_pass_through_each_other(stopped: RunResult) -> None:
    """Which way out the run finds where the medium buckles depends on rounding; none may lead through the blocks."""
    result = stopped
    assert result.complete or "solids would" in result.reason
    checks = result.checks
    assert checks["penetration_depth"] <= OVERLAP
    assert checks["overlap_area"] <= OVERLAP
    assert (result.gap or 0.0) > 0.0
    assert result.directory is not None
    again = RunResult.read(result.directory)
    assert again.load == result.load
    assert again.history[-1].load_force == result.history[-1].load_force


def test_what_happens_if_they_may(tmp_path: Path) -> None:
    problem, options = read_problem(str(blocks(tmp_path, "allow_overlap = true", size=0.2)))
    result = run(problem, tmp_path / "run", options)
    assert result.complete
    assert result.inputs["allow_overlap"] is True
    assert result.gap == pytest.approx(-0.05, abs=2e-3)
    signs = [record.gap > 0.0 for record in result.history if record.gap is not None]
    assert signs == sorted(signs, reverse=True)
    balance = result.checks["energy_balance"]
    assert balance["lost"] > 0.0
    assert balance["stored"] == pytest.approx(
        balance["work"] + balance["parameters"] + balance["integration_error"] - balance["lost"], rel=1e-12
    )
    jumped = [record.step for record in result.history if record.jumped]
    assert {jump["step"] for jump in balance["jumps"]} <= {*jumped}


def test_a_resumed_run_is_looked_at_as_well(stopped: RunResult, tmp_path: Path) -> None:
    problem, options = read_problem(str(blocks(tmp_path)))
    parted = run(problem, tmp_path / "parts", replace(options, max_iterations=60))
    assert not parted.complete
    assert 0.6 < parted.load < 0.79  # where nothing depends on rounding yet
    resumed = run(problem, tmp_path / "parts", options, resume=True)
    before = [n for n, record in enumerate(stopped.history) if record.load < 0.79]
    assert resumed.history[before[-1]].energy == pytest.approx(stopped.history[before[-1]].energy, rel=1e-9)
    assert resumed.complete or "solids would" in resumed.reason
    assert resumed.checks["penetration_depth"] <= OVERLAP
    assert resumed.checks["overlap_area"] <= OVERLAP
