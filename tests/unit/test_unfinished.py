"""Runs without a result: whether they go on is known, and what they have done so far can be looked at."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from helpers_process import clean_environment, tmc
from test_checkpoint import BOX, COMMAND, stopped_run

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.cli.progress import summary_rows
from tmc_vem.report.cautions import of_runs
from tmc_vem.report.run_page import run_page
from tmc_vem.report.tables import reached
from tmc_vem.report.write import to_markdown
from tmc_vem.results.lock import LOCK, DirectoryLock, is_held
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import BEGUN, process_facts
from tmc_vem.simulation.checkpoint import BEFORE, CHECKPOINT
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.solve.budget import OutOfBudget
from tmc_vem.support.errors import InputError

SHORT = Box(cells=(20, 5), uy=-0.1, medium=Medium(gamma=1e-4))


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "killed"
    stopped_run(out, signal.SIGKILL)
    return out


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Path]:
    """A run that is held still after its fifth step."""
    out = tmp_path / "running"
    process = subprocess.Popen([*COMMAND, *BOX, "--out", str(out)], stderr=subprocess.DEVNULL, env=clean_environment())
    deadline = time.monotonic() + 60
    while not (out / "history.csv").exists() or len((out / "history.csv").read_text().splitlines()) < 6:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.002)
    process.send_signal(signal.SIGSTOP)
    yield out
    process.kill()
    process.wait(timeout=60)


def shows(out: Path, state: str) -> None:
    """Every command shows a run whose state begins like this."""
    listed = tmc("list", str(out.parent))
    assert state in listed.stdout, listed.stderr
    (entry,) = json.loads(tmc("list", str(out.parent), "--json").stdout).values()
    assert entry["state"] == state.split()[0]
    plotted = tmc("plot", str(out))
    assert plotted.returncode == 0, plotted.stderr
    assert state in (out / "plots" / "run.html").read_text()
    shutil.rmtree(out / "plots")


def test_a_run_that_goes_on(running: Path) -> None:
    result = RunResult.read(running)
    shows(running, f"running at {result.load:.4g}")
    assert result.reason.startswith("process ")
    assert len(result.to_pandas()) == len(result.history) >= 5
    assert result.n_dofs == 902
    assert tmc("animate", str(running)).returncode == 0
    refused = tmc("resume", str(running))
    assert (refused.returncode, "goes on" in refused.stderr) == (2, True)


def test_a_run_that_was_killed(killed: Path) -> None:
    result = RunResult.read(killed)
    shows(killed, f"interrupted at {result.load:.4g}")
    assert "without a word" in result.reason
    assert f"'tmc-vem resume {killed}' goes on" in result.reason
    assert tmc("animate", str(killed)).returncode == 0
    assert len(result.to_pandas().loc[5]) > 10


@pytest.mark.parametrize(("number", "name"), [(signal.SIGINT, "SIGINT"), (signal.SIGTERM, "SIGTERM")])
def test_a_run_that_was_asked_to_stop_says_so(number: int, name: str, tmp_path: Path) -> None:
    out = tmp_path / "box"
    stopped_run(out, number)
    result = RunResult.read(out)
    assert reached(result) == f"interrupted at {result.load:.4g}"
    assert result.reason == f"stopped by {name}; 'tmc-vem resume {out}' goes on"
    assert tmc("resume", str(out), "--quiet").returncode == 0
    assert RunResult.read(out).state == "complete"
    assert not (out / BEGUN).exists()


def test_a_run_that_was_resumed_and_killed_has_no_result_of_before(tmp_path: Path) -> None:
    out = tmp_path / "box"
    assert tmc(*BOX, "--max-iterations", "20", "--out", str(out)).returncode == 3
    before = RunResult.read(out)
    assert before.state == "stopped"

    class Killed(Monitor):
        def stepped(self, record: StepRecord) -> None:
            raise SystemExit

    options = RunOptions(steps=16, snapshots=4)
    with pytest.raises(SystemExit):
        run(Box(cells=(20, 5), uy=-0.4), out, options, monitor=Killed(), resume=True)
    after = RunResult.read(out)
    assert after.state == "interrupted"
    assert after.steps == before.steps + 1


def test_before_the_first_step(tmp_path: Path) -> None:
    out = tmp_path / "runs" / "box"
    done = tmc(*BOX, "--max-iterations", "1", "--out", str(out))
    assert done.returncode == 3
    assert "stopped before its first step" in done.stderr
    assert "resume" not in done.stderr
    shows(out, "stopped before its first step")
    frame = RunResult.read(out).to_pandas()
    assert len(frame) == 0
    assert {"load", "reaction"} <= set(frame.columns)
    animated = tmc("animate", str(out))
    assert (animated.returncode, len(animated.stderr.splitlines())) == (2, 1)
    resumed = tmc("resume", str(out))
    assert (resumed.returncode, "no checkpoint" in resumed.stderr) == (2, True)


def test_resume_is_advised_where_it_helps(tmp_path: Path) -> None:
    out = tmp_path / "with one"
    cut = tmc(*BOX, "--max-iterations", "20", "--out", str(out))
    assert f"'tmc-vem resume '{out}'' goes on" in cut.stderr
    bare = tmc(*BOX, "--max-iterations", "20", "--checkpoint-every", "0", "--out", str(tmp_path / "bare"))
    assert bare.returncode == 3
    assert "tmc-vem resume" not in bare.stderr
    result = RunResult.read(out)
    assert "tmc-vem resume" in of_runs({"a": result})[0].text
    without = replace(result, cut_short=False, reason="no convergence")
    assert "tmc-vem resume" not in of_runs({"a": without})[0].text


def test_a_row_that_was_being_written_is_left_out(killed: Path, tmp_path: Path) -> None:
    out = tmp_path / "box"
    shutil.copytree(killed, out)
    steps = RunResult.read(out).steps
    text = (out / "history.csv").read_text()
    (out / "history.csv").write_text(text[:-1])  # the last number may be cut
    assert RunResult.read(out).steps == steps - 1
    (out / "history.csv").write_text(text[:-40])
    assert RunResult.read(out).steps == steps - 1


@pytest.mark.usefixtures("undrawn")
def test_directories_from_before_run_json(killed: Path, tmp_path: Path) -> None:
    out = tmp_path / "box"
    shutil.copytree(killed, out)
    (out / BEGUN).unlink()
    result = RunResult.read(out)
    assert (result.state, result.n_dofs) == ("interrupted", 0)
    assert result.inputs["medium"]["gamma"] == 1e-5
    assert "– degrees of freedom" in to_markdown(run_page(result))
    for name in (CHECKPOINT, BEFORE):
        (out / name).unlink(missing_ok=True)
    assert RunResult.read(out).inputs == {"problem": "box"}
    assert "resume" not in RunResult.read(out).reason


def test_where_there_are_no_locks_the_process_is_looked_for(killed: Path, tmp_path: Path) -> None:
    out = tmp_path / "box"
    shutil.copytree(killed, out)
    (out / LOCK).unlink()
    facts = json.loads((out / BEGUN).read_text())
    me = process_facts(locked=False)
    other = {**me, "host": "elsewhere"}
    for process, state in (
        (me, "running"), ({**me, "began": -1}, "interrupted"), ({**me, "id": 2**22 + 1}, "interrupted"),
        (other, "unknown"), ({"locked": False}, "unknown"),
    ):  # fmt: skip
        (out / BEGUN).write_text(json.dumps({**facts, "process": process}))
        assert RunResult.read(out).state == state, process
    assert reached(RunResult.read(out)).startswith("unfinished at")


def test_whether_a_lock_is_held(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert is_held(tmp_path) is False
    lock = DirectoryLock(tmp_path)
    assert is_held(tmp_path) is True
    lock.release()
    assert is_held(tmp_path) is False
    (tmp_path / LOCK).write_text("process 1 on elsewhere\n")  # left by a process that was killed
    assert is_held(tmp_path) is False

    def refuse(*_: object) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    assert is_held(tmp_path) is None


def test_who_looks_does_not_keep_a_run_from_starting(tmp_path: Path) -> None:
    (tmp_path / LOCK).touch()
    looking = os.open(tmp_path / LOCK, os.O_RDONLY)
    fcntl.flock(looking, fcntl.LOCK_SH)
    for_an_instant = threading.Timer(0.03, os.close, [looking])
    for_an_instant.start()
    DirectoryLock(tmp_path).release()
    for_an_instant.join()


def test_a_full_disk_is_said_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tmc_vem.results.output import SnapshotWriter

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    out = tmp_path / "box"
    monkeypatch.setattr(SnapshotWriter, "write", full)
    with pytest.raises(Exception, match="No space left on device"):
        run(SHORT, out, RunOptions(snapshots=1))
    result = RunResult.read(out)
    assert result.state == "interrupted"
    assert "No space left on device" in result.reason
    assert result.reason.count("goes on") == 1


@pytest.mark.usefixtures("undrawn")
def test_gamma_that_was_not_brought_back_is_said_everywhere(tmp_path: Path) -> None:
    class Enough(Monitor):
        def stepped(self, record: StepRecord) -> None:
            if record.load == 1.0 and record.parameters["gamma"] < 1e-2:
                raise OutOfBudget("enough")

    options = RunOptions(continuation={"gamma": 1e-2})
    result = run(SHORT, tmp_path / "box", options, monitor=Enough())
    assert result.load == 1.0
    assert not result.complete
    gamma = result.last.parameters["gamma"] if result.last else 0.0
    assert gamma > 1e-4
    assert reached(result) == f"stopped at 1, gamma {gamma:.3g}"
    assert dict(summary_rows(result))["load reached"] == reached(result)
    missing = f"with gamma = {gamma:.4g}, not yet brought back to 0.0001"
    assert missing in of_runs({"a": result})[0].text
    assert any(f"gamma = {gamma:.4g}, not 0.0001" in text for text in result.errors)
    assert missing in to_markdown(run_page(RunResult.read(tmp_path / "box"))).replace("\\", "")


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a run directory"):
        RunResult.read(tmp_path)
