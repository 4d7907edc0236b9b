"""Batches: finished runs are found again, whatever ended the batch before; a failure stops nothing else."""

from __future__ import annotations

import fcntl
import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from helpers_process import clean_environment

from tmc_vem.problems import Box, Medium
from tmc_vem.results.lock import DirectoryLock
from tmc_vem.simulation import RunOptions
from tmc_vem.simulation.provenance import sources
from tmc_vem.study.batch import LOCK, Job, Observer, Outcome, run_batch
from tmc_vem.support.errors import InputError

FAST = RunOptions(snapshots=0)


def job(uy: float = -0.02, gamma: float = 1e-4, label: str = "box") -> Job:
    return Job(label, Box(cells=(20, 5), uy=uy, medium=Medium(gamma=gamma)), FAST)


class Recorder(Observer):
    def __init__(self) -> None:
        self.reused = -1
        self.outcomes: list[Outcome] = []
        self.fractions: list[float] = []

    def started(self, n_jobs: int, n_reused: int) -> None:
        self.reused = n_reused

    def advanced(self, fraction: float, seconds_left: float | None, running: object) -> None:
        self.fractions.append(fraction)

    def finished(self, outcome: Outcome, n_done: int, seconds_left: float | None) -> None:
        self.outcomes.append(outcome)


def test_finished_runs_are_not_repeated(tmp_path: Path) -> None:
    first, second = Recorder(), Recorder()
    jobs = [job(-0.02), job(-0.01), job(-0.02)]
    results = run_batch(jobs, tmp_path, observer=first)
    assert [outcome.job.problem.inputs()["uy"] for outcome in results] == [-0.02, -0.01, -0.02]
    assert len(first.outcomes) == 2  # equal jobs are done once
    assert 0.0 < first.fractions[0] <= first.fractions[-1] <= 1.0
    assert all(outcome.result and outcome.result.complete and not outcome.reused for outcome in first.outcomes)
    again = run_batch(jobs, tmp_path, observer=second)
    assert (second.reused, second.outcomes) == (2, [])
    assert all(outcome.reused for outcome in again)


def test_other_inputs_are_another_run(tmp_path: Path) -> None:
    assert len({job().name, job(gamma=1e-5).name, job(uy=-0.03).name}) == 3
    assert job(uy=-1).name == job(uy=-1.0).name
    (outcome,) = run_batch([job()], tmp_path)
    assert outcome.result is not None
    # a result whose inputs were changed by hand does not pass for this run
    path = tmp_path / job().name / "result.json"
    data = json.loads(path.read_text())
    data["inputs"]["uy"] = -0.5
    path.write_text(json.dumps(data))
    recorder = Recorder()
    run_batch([job()], tmp_path, observer=recorder)
    assert recorder.reused == 0
    assert json.loads(path.read_text())["inputs"]["uy"] == -0.02


@pytest.mark.parametrize("kept", ["older", None])
def test_a_run_of_other_sources_is_done_again(tmp_path: Path, kept: str | None) -> None:
    """What an earlier state of the program has computed does not pass for what this one does."""
    run_batch([job()], tmp_path)
    path = tmp_path / job().name / "result.json"
    data = json.loads(path.read_text())
    assert data["versions"]["sources"] == sources()
    data["versions"]["sources"] = kept
    path.write_text(json.dumps(data))
    recorder = Recorder()
    run_batch([job()], tmp_path, observer=recorder)
    assert recorder.reused == 0
    assert json.loads(path.read_text())["versions"]["sources"] == sources()


def test_a_run_that_was_cut_off_is_done_again(tmp_path: Path) -> None:
    left = tmp_path / job().name
    (left / "fields").mkdir(parents=True)
    (left / "history.csv").write_text("step,load\n1,")
    (outcome,) = run_batch([job()], tmp_path)
    assert outcome.result is not None
    assert outcome.result.complete


def test_a_failure_does_not_stop_the_others(tmp_path: Path) -> None:
    user_file = tmp_path / "broken.py"
    user_file.write_text("def broken(F, G, p, m):\n    return m.sqrt(F[0][0] - 2) * G[0][0][0] ** 2\n")
    bad = Job("bad", Box(cells=(20, 5), medium=Medium(regulariser=f"{user_file}:broken")), FAST)
    outcomes = run_batch([bad, job()], tmp_path / "runs")
    assert outcomes[0].result is None
    assert "no finite number" in outcomes[0].error
    assert outcomes[1].result is not None


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_process_that_dies_before_it_begins_is_started_once_more(
    deaths: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands = []

    def start(command: list[str], **options: Any) -> subprocess.Popen[bytes]:
        commands.append(command)
        dies = [sys.executable, "-c", "import sys; sys.exit('no session directory')"]
        return genuine(dies if len(commands) <= deaths else command, **options)

    genuine = subprocess.Popen
    monkeypatch.setattr("tmc_vem.study.batch.subprocess.Popen", start)
    (outcome,) = run_batch([job()], tmp_path)
    assert len(commands) == 2
    assert outcome.error == ("" if deaths == 1 else "no session directory")
    assert (outcome.result is None) == (deaths == 2)


def test_two_batches_do_not_share_a_directory(tmp_path: Path) -> None:
    with (tmp_path / LOCK).open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="another tmc-vem is at work"):
            run_batch([job()], tmp_path)


def test_a_directory_in_use_by_a_single_run_is_left_alone(tmp_path: Path) -> None:
    used = tmp_path / job(-0.01).name
    used.mkdir()
    (used / "history.csv").write_text("step,load\n")
    lock = DirectoryLock(used)
    outcomes = run_batch([job(-0.01), job(-0.02)], tmp_path)
    lock.release()
    assert outcomes[0].result is None
    assert "is in use by process" in outcomes[0].error
    assert (used / "history.csv").exists()
    assert outcomes[1].result is not None
    assert run_batch([job(-0.01)], tmp_path)[0].result is not None


def test_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="0 processes"):
        run_batch([], tmp_path, processes=0)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        run_batch([], tmp_path / "file" / "runs")


BATCH = """
import sys
from pathlib import Path
from tmc_vem.study.batch import Job, run_batch
from tmc_vem.problems import Box
from tmc_vem.simulation import RunOptions
jobs = [Job("box", Box(cells=(20, 5), uy=-0.02 - 0.001 * n), RunOptions(snapshots=0)) for n in range(3)]
run_batch(jobs, Path(sys.argv[1]), processes=1)
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_batch_that_is_killed_goes_on_where_it_was(tmp_path: Path, how: signal.Signals) -> None:
    command = [sys.executable, "-c", BATCH, str(tmp_path)]
    # a shell that starts the tests in the background has SIGINT ignored, and children inherit that
    unignore = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    batch = subprocess.Popen(command, stderr=subprocess.DEVNULL, env=clean_environment(), preexec_fn=unignore)
    limit = time.monotonic() + 60.0
    while len(list(tmp_path.glob("*/result.json"))) < 1:
        assert time.monotonic() < limit
        time.sleep(0.01)
    batch.send_signal(how)
    batch.wait(timeout=10)
    limit = time.monotonic() + 20.0
    while _orphans():
        assert time.monotonic() < limit, "the worker does not notice that its batch is gone"
        time.sleep(0.05)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/result.json")}
    assert 1 <= len(before) < 3
    assert subprocess.run(command, timeout=60, env=clean_environment(), check=False).returncode == 0
    after = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*/result.json")}
    assert len(after) == 3
    assert before.items() <= after.items()


def _orphans() -> list[int]:
    """Workers whose batch is gone."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes()
            parent = int((process / "stat").read_text().rsplit(")", 1)[1].split()[1])
        except OSError:
            continue
        if b"tmc_vem.study.batch_worker" in command and parent == 1:
            found.append(int(process.name))
    return found
