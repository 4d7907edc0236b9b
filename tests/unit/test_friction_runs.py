"""Runs with friction: a loop of stick and slip; stopped ones go on with the same bits, on other ranks to rounding."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import tmc
from helpers_rub import MEDIUM, rub

from tmc_vem import RunOptions, RunResult, run
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results import RunResult as Result
from tmc_vem.simulation import checkpoint, prepare
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

STEPS = 4
FACTS = ("seconds", "directory")


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> tuple[OwnProblem, RunOptions]:
    path = rub(tmp_path_factory.mktemp("rub"), f"steps = {STEPS}\nsnapshots = 0\nextrapolate_gamma = true")
    return read_problem(path)


@pytest.fixture(scope="module")
def whole(problem: tuple[OwnProblem, RunOptions], tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    """With the limit for gamma to 0, of which nothing is seen in the load steps."""
    return run(problem[0], tmp_path_factory.mktemp("whole") / "rub", problem[1])


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
    first, back = found[1.25] - found[1.0], found[2.0] - found[2.25]
    assert back == pytest.approx(0.25 * 0.5 / 0.25 * first / 2 * 1.15, rel=0.15)  # half as far in a step
    assert whole.checks["imbalance"] < 1e-8
    assert whole.inputs["medium"]["friction"] == 0.3
    assert whole.inputs["friction_error"] == 0.01
    error = whole.checks["friction_error"]
    assert error["largest"] == pytest.approx(0.05, abs=0.03)
    assert error["load"] in found
    assert any(text.startswith("friction was 0.0") and "not 0.01" in text for text in whole.warnings)


def test_friction_does_what_it_is_for(problem: tuple[OwnProblem, RunOptions], tmp_path: Path, whole: RunResult) -> None:
    slippery = MEDIUM.replace("friction = 0.3", "friction = 0")
    given, options = read_problem(rub(tmp_path, f"steps = {STEPS}\nsnapshots = 0", slippery))
    free = run(given, None, options)
    assert abs(pulls(free)[2.0]) < 0.2 * pulls(whole)[2.0]
    assert "friction_error" not in free.checks
    assert "friction" not in free.inputs["medium"]
    assert "friction_error" not in free.inputs


def test_stopped_runs_go_on_with_the_same_bits(
    problem: tuple[OwnProblem, RunOptions], tmp_path: Path, whole: RunResult
) -> None:
    """Stopped on the load path, and on the paths with lower gamma."""
    given, options = problem
    short = replace(options, max_iterations=75)
    result, stops = run(given, tmp_path / "rub", short), [0]
    while not result.complete:
        assert result.cut_short
        stops.append(len(result.history))
        result = run(given, tmp_path / "rub", short, resume=True)
    assert len(stops) > 4
    assert stops.count(len(whole.history)) > 1
    assert numbers(result) == numbers(whole)
    assert result.checks == whole.checks
    assert result.limit is not None
    assert whole.limit is not None
    assert result.limit.values == whole.limit.values


def test_a_result_that_was_not_written_is_the_same(
    problem: tuple[OwnProblem, RunOptions], tmp_path: Path, whole: RunResult
) -> None:
    """All steps are done, and so are the lower gammas: friction is that of the last step all the same."""
    assert whole.directory is not None
    shutil.copytree(whole.directory, tmp_path / "rub")
    (tmp_path / "rub" / "result.json").unlink()
    again = run(*problem[:1], tmp_path / "rub", problem[1], resume=True)
    assert again.checks == whole.checks
    assert numbers(again) == numbers(whole)


def test_each_gamma_goes_the_whole_path(
    problem: tuple[OwnProblem, RunOptions], tmp_path: Path, whole: RunResult
) -> None:
    gammas = [record.parameters["gamma"] for record in whole.lowered]
    assert gammas == pytest.approx([1e-5 / 10 ** (k / 2) for k in range(1, 5)], rel=1e-6)
    alone, options = read_problem(
        rub(tmp_path, f"steps = {STEPS}\nsnapshots = 0", MEDIUM.replace("gamma = 1e-5", f"gamma = {gammas[1]!r}"))
    )
    other, beside = run(alone, None, options), whole.lowered[1]
    assert beside.forces["slide"]["reaction"] == pytest.approx(other.history[-1].forces["slide"]["reaction"], rel=1e-6)
    assert beside.min_j["layer"] == pytest.approx(other.history[-1].min_j["layer"], rel=1e-6)
    assert whole.limit is not None
    limit = whole.limit.values["slide.reaction"]
    assert limit.at[0] == whole.history[-1].forces["slide"]["reaction"]
    assert whole.limit.newton_iterations > 4 * sum(record.iterations for record in whole.lowered)


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_agree_and_go_on_with_each_other_s_runs(
    ranks: int, problem: tuple[OwnProblem, RunOptions], tmp_path: Path, whole: RunResult
) -> None:
    path = rub(tmp_path, f"steps = {STEPS}\nsnapshots = 0")
    first = tmc("run", str(path), "--out", str(tmp_path / "rub"), "--max-iterations", "70", "--quiet", ranks=ranks)
    assert first.returncode == 1, first.stderr
    done = tmc("resume", str(tmp_path / "rub"), "--max-iterations", "1000", "--quiet", ranks=5 - ranks)
    assert done.returncode == 0, done.stderr
    found = Result.read(tmp_path / "rub")
    assert found.complete
    wanted = pulls(whole)
    assert pulls(found) == pytest.approx(wanted, rel=1e-6, abs=1e-9)


def test_steps_are_made_for_the_error(tmp_path: Path) -> None:
    given, options = read_problem(rub(tmp_path, "snapshots = 0", history="[[1, 0], [1.5, 0.5]]"))
    counts = []
    for error in (0.08, 0.04):
        result = run(given, None, replace(options, friction_error=error))
        assert result.complete
        assert result.checks["friction_error"]["largest"] < error
        assert not any(text.startswith("friction was") for text in result.warnings)
        counts.append(len(result.history))
    assert counts[1] > 1.2 * counts[0]


# -- checkpoints -------------------------------------------------------------------------------------------------------


def test_checkpoints_have_the_shear_with_its_points(whole: RunResult) -> None:
    assert whole.directory is not None
    found = checkpoint.Checkpoint.read(whole.directory)
    n_points = len(found.points_px)
    assert found.shear_kp.shape == (1, n_points)
    assert n_points == 2 * 16
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
    text = path.read_text().replace(
        "layer = { rectangle = [0, 0, 1, 0.05] }",
        "layer = { rectangle = [0, 0, 0.5, 0.05] }\nother = { rectangle = [0.5, 0, 1, 0.05] }",
    )
    more = MEDIUM.replace("friction = 0.3", "friction = 0.6, elastic_slip = 0.1")
    path.write_text(text.replace("[mesh]", f'[regions.other]\nshape = "other"\nmedium = {{ {more} }}\n[mesh]'))
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
