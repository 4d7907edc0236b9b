"""Adaptive runs that are killed or interrupted go on to the same bits, wherever that was."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import clean_environment, process, tmc

from tmc_vem import Box, RunOptions, run
from tmc_vem.adapt.rounds import Rounds, Standing
from tmc_vem.adapt.store import MESH, ROUNDS, STATE, RoundStore
from tmc_vem.results.records import ADAPT
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import BEGUN
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.checkpoint import BEFORE, CHECKPOINT
from tmc_vem.simulation.monitor import Monitor

COMMAND = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()"]
# four rounds: two at either load, the first of the second one with the mesh that the first one has led to
BOX = ["box", "--cells", "20", "5", "--uy", "-0.2", "--snapshots", "0", "--adapt", "gap", "--adapt-tolerance", "0.3%",
       "--adapt-at", "0.6", "--adapt-rounds", "1"]  # fmt: skip
# Ends without a word, as if it was killed, where it is told to: after round N, when the run on the last mesh begins, or
# after its step N.
DYING = """
import os, sys
from pathlib import Path
from tmc_vem.adapt import store
from tmc_vem.cli import main, progress
from tmc_vem.results.directory import RunDirectory
from tmc_vem.simulation import recorder

where, number, *arguments = sys.argv[1:]
number = int(number)

def dying(owner, name, when, after=False):
    method = getattr(owner, name)
    def replaced(self, *given, **more):
        if not after and when(self, *given): os.kill(os.getpid(), 9)
        result = method(self, *given, **more)
        if after and when(self, *given): os.kill(os.getpid(), 9)
        return result
    setattr(owner, name, replaced)

if where == "round":
    dying(store.RoundStore, "done", lambda self, round_, *_: round_.number == number, after=True)
if where == "state":  # between the files of a state
    dying(store.RoundStore, "_write", lambda self, rounds, **_: len(rounds) == number)
if where == "mesh":
    dying(store.RoundStore, "finished", lambda self, *_: True, after=True)
if where == "cleared":  # the last run has removed what is not kept, and has written nothing yet
    dying(RunDirectory, "clear", lambda self: bool(self._keep), after=True)
if where == "begun":
    dying(RunDirectory, "begin", lambda self, facts, **_: bool(self._keep), after=True)
if where == "step":
    dying(recorder.Recorder, "record", lambda self, step, *_: self.directory is not None
          and len(self.history) == number, after=True)
sys.exit(main._run(["run", *arguments]))
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "box"
    done = tmc("run", *BOX, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert [each["load"] for each in rounds(out)] == [0.6, 0.6, 1.0, 1.0]
    return out


def rounds(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((out / ADAPT / ROUNDS).read_text())["rounds"]
    return [{name: value for name, value in each.items() if name != "seconds"} for each in found]


def require_same(out: Path, whole: Path) -> None:
    """All of the mesh, the rounds, and the result, bit for bit."""
    with np.load(out / ADAPT / MESH) as one, np.load(whole / ADAPT / MESH) as other:
        assert set(one) == set(other)
        for name in other:
            assert np.array_equal(one[name], other[name]), name
    assert rounds(out) == rounds(whole)
    first, second = RunResult.read(out), RunResult.read(whole)
    assert first.complete
    for one, other in zip(first.history, second.history, strict=True):
        for name in ("load", "gap", "reaction", "energy", "min_j", "iterations"):
            assert getattr(one, name) == getattr(other, name), name
    assert list(first.warnings) == list(second.warnings)
    assert first.inputs == second.inputs
    names = [sorted(path.name for path in (each / ADAPT).iterdir()) for each in (out, whole)]
    assert names[0] == names[1]
    entries = [{path.name for path in each.iterdir()} - {BEFORE} for each in (out, whole)]
    assert entries[0] == entries[1]


@pytest.mark.parametrize(
    ("where", "number"),
    [
        ("round", 0), ("round", 1), ("round", 2), ("state", 3), ("mesh", 0), ("cleared", 0), ("begun", 0), ("step", 1),
    ],
)  # fmt: skip
def test_a_run_that_was_killed_ends_as_one_that_was_not(where: str, number: int, tmp_path: Path, whole: Path) -> None:
    out = tmp_path / "box"
    killed = process(["-c", DYING, where, str(number), *BOX, "--out", str(out)])
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    result = RunResult.read(out)
    assert result.state == "interrupted"
    assert f"'tmc-vem resume {out}' goes on" in result.reason
    assert (out / CHECKPOINT).exists() == (where == "step")
    done = tmc("resume", str(out))
    assert done.returncode == 0, done.stderr
    if where != "round" or number > 0:
        assert "round 0," not in done.stderr  # nothing is done again
    require_same(out, whole)


def test_before_the_first_state_there_is_nothing_to_go_on_from(tmp_path: Path) -> None:
    out = tmp_path / "box"
    assert process(["-c", DYING, "state", "0", *BOX, "--out", str(out)]).returncode == -signal.SIGKILL
    done = tmc("resume", str(out))
    assert done.returncode == 2
    assert "no checkpoint to go on from: run it again with --overwrite" in done.stderr
    assert done.stderr.count("\n") == 1
    assert tmc("run", *BOX, "--out", str(out), "--overwrite", "--adapt-rounds", "1").returncode == 0


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_during_rounds_says_how_to_go_on(number: int, code: int, tmp_path: Path, whole: Path) -> None:
    """Wherever it is: in a load step, an estimate, or while files are written."""
    out = tmp_path / "box"
    running = subprocess.Popen(
        [*COMMAND, "run", *BOX, "--out", str(out)], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env=clean_environment(),
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while not (out / ADAPT / ROUNDS).exists():
        assert time.monotonic() < deadline
        assert running.poll() is None
        time.sleep(0.002)
    running.send_signal(number)
    _, errors = running.communicate(timeout=60)
    assert running.returncode == code, errors
    assert "Traceback" not in errors
    assert errors.rstrip().endswith(f"stopped by {signal.Signals(number).name}; 'tmc-vem resume {out}' goes on")
    assert signal.Signals(number).name in RunResult.read(out).reason
    assert not list(out.rglob(".unfinished-*"))
    assert tmc("resume", str(out)).returncode == 0
    require_same(out, whole)


def test_ctrl_c_while_the_first_mesh_is_loaded(tmp_path: Path) -> None:
    """There is nothing to go on from yet, and that is not promised."""
    out = tmp_path / "box"
    running = subprocess.Popen(
        [*COMMAND, "run", "box", "--cells", "80", "20", "--adapt", "gap", "--out", str(out)],
        stderr=subprocess.PIPE, text=True, env=clean_environment(),
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while not (out / BEGUN).exists():
        assert time.monotonic() < deadline
        time.sleep(0.002)
    time.sleep(0.2)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    assert errors.rstrip().endswith("stopped by SIGINT")
    assert RunResult.read(out).state == "interrupted"


def test_a_run_that_could_not_be_adapted_is_adapted_when_it_goes_on(tmp_path: Path) -> None:
    """A limit of iterations has ended the first mesh; without it rounds are made, and what was solved is dropped."""
    out, problem = tmp_path / "box", Box(cells=(20, 5), uy=-0.1)
    options = RunOptions(adapt=AdaptSettings(of="gap", tolerance="1%"))
    short = run(problem, out, RunOptions(adapt=options.adapt, max_iterations=4))
    assert short.cut_short
    again = run(problem, out, RunOptions(adapt=options.adapt, max_iterations=4), resume=True)
    assert again.cut_short
    assert again.load > short.load  # it does get on
    expected = run(problem, options=options)
    result = run(problem, out, options, resume=True)
    assert result.complete
    assert result.adaptivity.reached
    assert result.n_cells == expected.n_cells
    assert [each.gap for each in result.history] == [each.gap for each in expected.history]


def test_where_rounds_stand_is_kept_bit_for_bit(tmp_path: Path) -> None:
    """The state, and all that the next round depends on."""
    problem = Box(cells=(20, 5), uy=-0.05)
    options = RunOptions(adapt=AdaptSettings(of="gap", at=(0.5, 1.0)))
    store = RoundStore(tmp_path, problem, options, {"a": 1}, Monitor())
    standing = Rounds(problem, options, (0.5, 1.0), store).begin()
    standing = replace(standing, before={"energy": 0.1}, target=1, at_target=2, missed=("why",))
    standing.solved.simulation.solver.last_shift = 0.1 + 0.2
    store.stands(standing)
    again = store.restored()
    assert isinstance(again, Standing)
    for name in ("before", "target", "at_target", "rounds", "missed"):
        assert getattr(again, name) == getattr(standing, name), name
    for name, values in vars(standing.tree).items():
        assert np.array_equal(getattr(again.tree, name), values), name
    one, other = again.solved, standing.solved
    assert one.simulation.solver.last_shift == 0.1 + 0.2
    assert (one.position, one.found, one.iterations) == (other.position, other.found, other.iterations)
    assert np.array_equal(one.u.getArray(readonly=True), other.u.getArray(readonly=True))
    assert one.values() == other.values()


def test_other_inputs_are_refused(tmp_path: Path) -> None:
    from tmc_vem.support.errors import InputError

    out, options = tmp_path / "box", RunOptions(adapt=AdaptSettings(of="gap", tolerance="2%"))
    run(Box(cells=(20, 5), uy=-0.05), out, options)
    with pytest.raises(InputError, match=r"adapt.tolerance = 2%, not 1%: start anew"):
        run(Box(cells=(20, 5), uy=-0.05), out, RunOptions(adapt=AdaptSettings(of="gap")), resume=True)
    assert not list((out / ADAPT).glob(f"*-{STATE}"))
