"""Runs with friction: a loop of stick and slip; stopped ones go on with the same bits, on other ranks to rounding."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_process import clean_environment, tmc
from helpers_rub import MEDIUM, rub

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results import RunResult as Result
from tmc_vem.simulation import checkpoint, prepare
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.repeats import Repeats
from tmc_vem.solve.friction_steps import FrictionSteps
from tmc_vem.solve.stepping import LoadStepper, SteppingResult
from tmc_vem.support.errors import InputError

MAIN = "from tmc_vem.cli.main import main; main()"
STEPS = 2
SOFTER = MEDIUM.replace("gamma = 1e-5", "gamma = 1e-3")


Posed = tuple[OwnProblem, RunOptions]


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Posed:
    return read_problem(rub(tmp_path_factory.mktemp("rub"), f"steps = {STEPS}\nsnapshots = 0"))


@pytest.fixture(scope="module")
def whole(problem: Posed, tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return run(problem[0], tmp_path_factory.mktemp("whole") / "rub", problem[1])


@pytest.fixture(scope="module")
def with_limit(tmp_path_factory: pytest.TempPathFactory) -> tuple[Posed, RunResult]:
    """A shorter run, with the limit for gamma to 0."""
    there = tmp_path_factory.mktemp("limit")
    given = read_problem(
        rub(there, "steps = 2\nsnapshots = 0\nextrapolate_gamma = true", SOFTER, history="[[1, 0], [1.5, 1]]")
    )
    return given, run(given[0], there / "rub", given[1])


def numbers(result: RunResult) -> list[dict[str, Any]]:
    """All that is recorded of load steps and of states beside them, but for the time it took."""
    return [{**vars(record), "seconds": 0.0} for record in (*result.history, *result.lowered)]


def pulls(result: RunResult) -> dict[float, float]:
    return {round(record.load, 9): record.forces["slide"]["reaction"] for record in result.history}


def test_a_loop_of_stick_and_slip(whole: RunResult) -> None:
    """It creeps to Coulomb's 0.03, sticks on the way back as stiffly as at first, and is in equilibrium."""
    assert whole.complete
    found = pulls(whole)
    assert 0.027 < found[2.0] < 0.03
    first, back = found[1.5] - found[1.0], found[2.0] - found[2.5]  # half as far in a step
    assert first < 2.0 * back < 1.6 * first
    assert whole.checks["imbalance"] < 1e-8
    assert whole.inputs["medium"]["friction"] == 0.3
    assert whole.inputs["friction_error"] == 0.01
    error = whole.checks["friction_error"]
    assert error["largest"] == pytest.approx(0.11, abs=0.05)
    assert error["load"] in found
    (said,) = (text for text in whole.warnings if text.startswith("friction was 0.1"))
    assert "not 0.01: take more steps" in said


def test_friction_does_what_it_is_for(problem: Posed, tmp_path: Path, whole: RunResult) -> None:
    slippery = MEDIUM.replace("friction = 0.3", "friction = 0")
    given, options = read_problem(rub(tmp_path, f"steps = {STEPS}\nsnapshots = 0", slippery))
    free = run(given, None, options)
    assert abs(pulls(free)[2.0]) < 0.2 * pulls(whole)[2.0]
    assert "friction_error" not in free.checks
    assert "friction" not in free.inputs["medium"]
    assert "friction_error" not in free.inputs


class Killed(RuntimeError):
    """What a run ends with at once."""


class Killer(Monitor):
    """Ends a run in an iteration, and knows how many load steps it had."""

    def __init__(self, iterations: int) -> None:
        self.left = iterations

    def iterated(self, iteration: int, residual: float) -> None:
        self.left -= 1
        if self.left < 0:
            raise Killed


def in_pieces(posed: Posed, out: Path) -> tuple[RunResult, int]:
    """A run that is killed again and again, between any two iterations; and how often it was."""
    for kills in range(60):
        try:
            return run(posed[0], out, posed[1], monitor=Killer((20, 25, 15)[kills % 3]), resume=kills > 0), kills
        except Killed:
            assert (out / "checkpoint.npz").exists()
    raise AssertionError("it does not go on")


def test_stopped_runs_go_on_with_the_same_bits(problem: Posed, tmp_path: Path, whole: RunResult) -> None:
    result, kills = in_pieces(problem, tmp_path / "rub")
    assert kills > 3
    assert numbers(result) == numbers(whole)
    assert result.checks == whole.checks


def test_a_result_that_was_not_written_is_the_same(problem: Posed, tmp_path: Path, whole: RunResult) -> None:
    """All steps are done: friction is that of the last step all the same."""
    assert whole.directory is not None
    shutil.copytree(whole.directory, tmp_path / "rub")
    (tmp_path / "rub" / "result.json").unlink()
    again = run(problem[0], tmp_path / "rub", problem[1], resume=True)
    assert again.checks == whole.checks
    assert numbers(again) == numbers(whole)


def test_each_gamma_goes_the_whole_path(with_limit: tuple[Posed, RunResult], tmp_path: Path) -> None:
    (given, options), found = with_limit
    gammas = [record.parameters["gamma"] for record in found.lowered]
    assert gammas == pytest.approx([1e-3 / 10 ** (k / 2) for k in range(1, 5)], rel=1e-6)
    text = f"gamma = {gammas[0]!r}"
    rub(given.directory, "steps = 2\nsnapshots = 0", MEDIUM.replace("gamma = 1e-5", text), "[[1, 0], [1.5, 1]]")
    other, same = read_problem(given.directory / "rub.toml")
    alone = run(other, None, same).history[-1]
    assert found.lowered[0].forces["slide"]["reaction"] == pytest.approx(alone.forces["slide"]["reaction"], rel=1e-6)
    assert found.lowered[0].min_j["layer"] == pytest.approx(alone.min_j["layer"], rel=1e-6)
    assert {record.limit_of for record in found.lowered} == {found.history[-1].step}
    assert found.limit is not None
    assert found.limit.values["slide.reaction"].at[0] == found.history[-1].forces["slide"]["reaction"]
    assert found.limit.newton_iterations > 2 * sum(record.iterations for record in found.lowered)
    plain = run(given, None, replace(options, extrapolate_gamma=False))
    assert numbers(plain) == numbers(replace(found, lowered=()))
    checks = dict(found.checks)
    lowered = checks.pop("friction_error_lowered")
    assert checks == plain.checks
    assert 0.01 < lowered["largest"] < 0.5
    assert any(text.startswith("with lower gamma friction was up to") for text in found.warnings)


@pytest.mark.slow
def test_gammas_go_on_with_the_same_bits(with_limit: tuple[Posed, RunResult], tmp_path: Path) -> None:
    posed, whole = with_limit
    result, kills = in_pieces(posed, tmp_path / "rub")
    assert kills > 5
    assert numbers(result) == numbers(whole)
    assert result.limit is not None
    assert whole.limit is not None
    assert result.limit == whole.limit
    assert result.checks == whole.checks


def stopped_on_ranks(ranks: int, out: Path) -> Path:
    """Problem file of a run that was stopped on some ranks."""
    path = rub(out.parent, f"steps = {STEPS}\nsnapshots = 0")
    done = tmc("run", str(path), "--out", str(out), "--max-iterations", "75", "--quiet", ranks=ranks)
    assert done.returncode == 3, done.stderr
    return path


@pytest.mark.slow
def test_one_rank_goes_on_with_the_run_of_two(tmp_path: Path, whole: RunResult) -> None:
    given, options = read_problem(stopped_on_ranks(2, tmp_path / "rub"))
    found = run(given, tmp_path / "rub", options, resume=True)
    assert pulls(found) == pytest.approx(pulls(whole), rel=1e-6, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_go_on_with_each_other_s_runs(ranks: int, tmp_path: Path, whole: RunResult) -> None:
    stopped_on_ranks(ranks, tmp_path / "rub")
    done = tmc("resume", str(tmp_path / "rub"), "--max-iterations", "1000", "--quiet", ranks=5 - ranks)
    assert done.returncode == 0, done.stderr
    assert pulls(Result.read(tmp_path / "rub")) == pytest.approx(pulls(whole), rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_twenty_kills_leave_no_trace(tmp_path: Path) -> None:
    """Of the process itself, by SIGKILL, at any moment after its first new step."""
    path, out = rub(tmp_path, "steps = 25\nsnapshots = 0"), tmp_path / "rub"
    whole = run(*read_problem(path)[:1], None, read_problem(path)[1])
    rng, words = np.random.default_rng(20), ["run", str(path), "--out", str(out)]
    for _ in range(20):
        before = rows(out)
        process = subprocess.Popen([sys.executable, "-c", MAIN, *words, "--quiet"], env=clean_environment())
        deadline = time.monotonic() + 60.0
        while rows(out) <= before or not (out / "checkpoint.npz").exists():
            assert process.poll() is None, "the run has ended"
            assert time.monotonic() < deadline, "the run makes no progress"
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.02))
        process.kill()
        process.wait(timeout=60)
        words = ["resume", str(out)]
    assert tmc("resume", str(out), "--quiet").returncode == 0
    found = Result.read(out)
    assert [record.forces for record in found.history] == [record.forces for record in whole.history]
    assert found.checks == json.loads(json.dumps(whole.checks))


def rows(out: Path) -> int:
    history = out / "history.csv"
    return len(history.read_text().splitlines()) if history.exists() else 0


def test_steps_are_made_for_the_error(tmp_path: Path) -> None:
    given, options = read_problem(rub(tmp_path, "snapshots = 0", history="[[1, 0], [1.5, 0.5]]"))
    counts = []
    for error in (0.04, 0.01):
        result = run(given, None, replace(options, friction_error=error))
        assert result.complete
        assert result.checks["friction_error"]["largest"] < error
        assert not any(text.startswith("friction was") for text in result.warnings)
        counts.append(len(result.history))
    assert counts[1] > 1.2 * counts[0]


def test_what_goes_along_a_path_with_friction(tmp_path: Path) -> None:
    given, options = read_problem(rub(tmp_path, "friction_error = 0.02\nextrapolate_gamma = true"))
    simulation = prepare(given, None, options)
    stepper, repeats = simulation._stepper(SimpleNamespace(), SimpleNamespace())  # type: ignore[arg-type]
    assert isinstance(stepper, LoadStepper)
    assert stepper.soften == {}  # no detour over a stiffer medium
    assert stepper.friction == FrictionSteps(simulation.system, 0.02)
    assert (stepper.options.target_iterations, stepper.solver.options.max_iterations) == (40, 60)
    assert isinstance(repeats, Repeats)
    again = repeats._stepper(0.1)
    assert (again.friction, again.jumps) == (stepper.friction, False)
    first, smallest = (0.1 * each for each in (stepper.options.first, stepper.options.smallest))
    assert again.options == replace(stepper.options, first=first, smallest=smallest)
    assert repeats._stepper(1e-6).options.first == pytest.approx(1e-4 * stepper.options.first)
    assert [corner.load for corner in again.path.corners] == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 2.0, 3.0]
    assert [corner.parameters["gamma"] for corner in again.path.corners] == pytest.approx([1e-6] * 8)
    simulation.recorder.history.append(SimpleNamespace(step=3, jumped=True))  # type: ignore[arg-type]
    repeats.descend(simulation.system.create_vector())
    assert simulation.recorder.lowered.done == {3: "the run jumped to another branch before"}


def test_a_path_with_a_gamma_that_fails_ends_the_repetitions(with_limit: tuple[Posed, RunResult]) -> None:
    (given, options), whole = with_limit
    simulation = prepare(given, None, options)
    _, repeats = simulation._stepper(SimpleNamespace(check=lambda: None), SimpleNamespace(used_up=False))  # type: ignore[arg-type]
    assert isinstance(repeats, Repeats)
    simulation.recorder.history.append(whole.history[-1])
    ended = SteppingResult(0.25, False, "nothing works", failed_iterations=9)
    repeats._stepper = lambda factor: SimpleNamespace(run=lambda *_: ended)  # type: ignore[assignment, method-assign, return-value]
    repeats.descend(simulation.system.create_vector())
    lowered = simulation.recorder.lowered
    assert lowered.done == {whole.history[-1].step: "nothing works (at load 0.25, gamma = 0.000316)"}
    assert lowered.failed_iterations == 9


# -- checkpoints -------------------------------------------------------------------------------------------------------


def test_checkpoints_have_the_shear_with_its_points(whole: RunResult) -> None:
    assert whole.directory is not None
    found = checkpoint.Checkpoint.read(whole.directory)
    n_points = len(found.points_px)
    assert found.shear_kp.shape == (1, n_points)
    assert n_points == 4 * 16
    assert np.abs(found.shear_kp).max() > 0.0
    assert ((found.points_px[:, 1] > 0.0) & (found.points_px[:, 1] < 0.05)).all()


def test_parts_of_ranks_have_their_own_points(tmp_path: Path) -> None:
    labels, state = np.zeros((1, 3)), np.zeros((2, 1, 2))
    points, shear = np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([[1.0, 2.0]])
    name = "checkpoint-part-000001-1.npz"
    other = checkpoint.Checkpoint({}, labels, state, points + 1.0, 10.0 * shear)
    parts = {name: other.write_part(tmp_path, name)}
    checkpoint.Checkpoint({"n": 1}, labels, state, points, shear).write(tmp_path, parts)
    again = checkpoint.Checkpoint.read(tmp_path)
    assert again.points_px.tolist() == [[0.1, 0.2], [0.3, 0.4], [1.1, 1.2], [1.3, 1.4]]
    assert again.shear_kp.tolist() == [[1.0, 2.0, 10.0, 20.0]]
    damaged = dict(np.load(tmp_path / name))
    damaged["shear_kp"] = damaged["shear_kp"] + 1.0
    np.savez(tmp_path / name, **damaged)
    with pytest.raises(InputError, match="checksum is wrong"):
        checkpoint.Checkpoint.read(tmp_path)


# -- refusals ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("solve", "message"),
    [
        ("follow = true", r"follow does not go with friction \(in region 'layer'\), which depends on the way"),
        ("continuation = { gamma = 1e-4 }", "continuation in gamma does not go with friction .*leave it out"),
        ("continuation = { alpha_r = 2 }", "continuation in alpha_r does not go with friction"),
        ('extrapolate_gamma = "path"', "extrapolate_gamma = 'path' does not go with friction .*use extrapolate_gamma"),
        ("extrapolate_gamma = true\n[[stage]]\nname = 'all'\nbegins = 0", r"and \[\[stage\]\] together"),
        ("friction_error = 0", "solve: friction_error = 0: use a part of the largest friction, above 0 and up to 1"),
        ("friction_error = 1.5", "solve: friction_error = 1.5: use"),
        ("friction_error = nan", "solve: friction_error = nan: use"),
    ],
)
def test_what_does_not_go_with_friction(solve: str, message: str, tmp_path: Path) -> None:
    from tmc_vem.simulation.plan import control_path

    history = "[[0, 0], [1, 1]]" if "follow" in solve else "[[1, 0], [2, 1]]"
    with pytest.raises(InputError, match=message):
        control_path(*read_problem(rub(tmp_path, solve, history=history)))
    slippery = rub(tmp_path, solve, MEDIUM.replace("friction = 0.3", "friction = 0.0"), history)
    if not solve.startswith("friction_error"):
        try:
            control_path(*read_problem(slippery))
        except InputError as error:
            assert "friction" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("friction = -0.1", "friction = -0.1 must be 0 or a positive number: a coefficient such as 0.3"),
        ("friction = nan", "friction = nan must be 0 or a positive number"),
        ("friction = inf", "friction = inf must be 0 or a positive number"),
        ("friction = true", "friction = True must be a number"),
        ('friction = "0.3"', "friction = '0.3' must be a number"),
        ("friction = 0.3, elastic_slip = 0", "elastic_slip = 0 must be positive: the slip, in widths of"),
        ("friction = 0.3, elastic_slip = -1", "elastic_slip = -1 must be positive"),
        ("friction = 0.3, elastic_slip = inf", "elastic_slip = inf must be positive"),
        ("elastic_slip = nan", "elastic_slip = nan must be positive"),
    ],
)
def test_bad_coefficients_are_refused(entry: str, message: str, tmp_path: Path) -> None:
    medium = MEDIUM.replace("friction = 0.3", entry)
    with pytest.raises(InputError, match=rf"rub.toml: regions: (medium|layer): .*{message}"):
        read_problem(rub(tmp_path, medium=medium))


def test_friction_in_a_solid_is_refused(tmp_path: Path) -> None:
    path = rub(tmp_path)
    path.write_text(path.read_text().replace("nu = 0.3 }", "nu = 0.3, friction = 0.3 }"))
    with pytest.raises(InputError, match="regions: block: solid has no 'friction'"):
        read_problem(path)


def test_several_media_have_their_own_coefficients(tmp_path: Path) -> None:
    path = rub(tmp_path)
    text = path.read_text()
    layers = [
        Rectangle("layer", 0.0, 0.5, 0.0, 0.05), Rectangle("other", 0.5, 1.0, 0.0, 0.05),
        Rectangle("block", 0.0, 1.0, 0.05, 0.25),
    ]  # fmt: skip
    write_mesh(structured_quadrilaterals([0.0, 0.5, 1.0], [0.0, 0.05, 0.25], layers), tmp_path / "rub.vtu")
    more = MEDIUM.replace("friction = 0.3", "friction = 0.6, elastic_slip = 0.1")
    path.write_text(text.replace("[mesh]", f"[regions.other]\nmedium = {{ {more} }}\n[mesh]"))
    given, options = read_problem(path)
    laws = {name: region.friction for name, region in given.regions().items()}
    assert laws["block"] is None
    assert laws["layer"] is not None
    assert laws["other"] is not None
    assert (laws["layer"].coefficient, laws["layer"].elastic_slip) == (0.3, 0.2)
    assert (laws["other"].coefficient, laws["other"].elastic_slip) == (0.6, 0.1)
    system = prepare(given, None, options).system
    coefficients = {
        each.points.region: each.law.friction.coefficient for each in system.friction_states(system.create_vector())
    }
    assert coefficients == {"layer": 0.3, "other": 0.6}
