"""Whole runs on several ranks: the same results, checkpoints for any number of ranks, and an end when a rank dies."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from helpers_process import MPIRUN, clean_environment, process, tmc

# few load steps: every iteration waits for all ranks, of which there are more than cores
PROBLEMS = {
    "box": ["box", "--cells", "20", "5", "--gamma", "1e-4", "--steps", "4"],
    "hanging nodes": ["box", "--cells", "20", "5", "--refine-medium", "2", "--uy", "-0.4", "--steps", "3"],
    "cbox": ["cbox", "--cells", "20", "10", "--uy", "-0.3", "--steps", "2"],
    "bodies": ["bodies", "--discs", "1", "--uy", "0.1", "--steps", "2"],
    "punch": ["punch", "--size", "0.25", "--uy", "-0.7", "--steps", "4"],
}
RANKS = {"box": 4, "hanging nodes": 3, "cbox": 2, "bodies": 2, "punch": 4}
ONE_AFTER_ANOTHER = """
import json, sys
from tmc_vem.cli import main
sys.exit(max(main._run(["run", *arguments, "--json"]) for arguments in json.loads(sys.argv[1])))
"""
SLOW_BOX = ["run", "box", "--cells", "20", "5", "--uy", "-0.4", "--steps", "40", "--snapshots", "2", "--quiet"]


@cache
def runs(ranks: int) -> dict[str, dict[str, Any]]:
    """Results of all problems that this number of ranks solves, in one start."""
    names = [name for name, wanted in RANKS.items() if ranks in (0, wanted)]
    done = process(["-c", ONE_AFTER_ANOTHER, json.dumps([PROBLEMS[name] for name in names])], ranks=ranks)
    assert done.returncode == 0, done.stderr[-2000:]
    results = [json.loads(text) for text in re.split(r"(?<=^})\n", done.stdout, flags=re.MULTILINE) if text]
    return dict(zip(names, results, strict=True))


@pytest.mark.parametrize(("problem", "ranks"), RANKS.items())
def test_gap_and_reaction_do_not_depend_on_the_ranks(problem: str, ranks: int) -> None:
    """Every problem on 1 to 4 ranks, at full size: benchmarks/rank_independence.py --full."""
    expected, found = runs(0)[problem], runs(ranks)[problem]
    assert (expected["versions"]["ranks"], found["versions"]["ranks"]) == (1, ranks)
    assert found["complete"]
    assert found["gap"] == pytest.approx(expected["gap"], rel=1e-8)
    assert found["reaction"] == pytest.approx(expected["reaction"], rel=1e-8)
    assert found["n_dofs"] == expected["n_dofs"]


def test_reproducible_runs_agree_to_the_bit() -> None:
    once, again = (
        json.loads(tmc("run", *PROBLEMS["box"], "--solver", "reproducible", "--json", ranks=3).stdout) for _ in range(2)
    )
    for name in ("gap", "reaction", "energy", "min_j", "newton_iterations", "negative_pivots"):
        assert once[name] == again[name], name
    assert once["gap"] == pytest.approx(runs(0)["box"]["gap"], rel=1e-9)
    assert once["negative_pivots"] == 0


def started(out: Path, ranks: int, rows: int = 6) -> subprocess.Popen[bytes]:
    """A run under mpirun that has made some load steps."""
    command = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()", *SLOW_BOX, "--out", str(out)]
    running = subprocess.Popen(
        [MPIRUN, "-n", str(ranks), *command],
        env=clean_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + 90
    history = out / "history.csv"
    while not history.exists() or len(history.read_text().splitlines()) < rows:
        assert time.monotonic() < deadline, "the run made no progress"
        assert running.poll() is None, "the run ended too early"
        time.sleep(0.005)
    return running


def descendants(pid: int) -> Iterator[int]:
    """Processes below a process: MPICH's mpirun has a proxy between itself and the ranks."""
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        yield int(child)
        yield from descendants(int(child))


def kill_rank(running: subprocess.Popen[bytes], rank: int) -> None:
    """SIGKILL the process of one rank, of Open MPI or MPICH."""
    names = {f"{variable}={rank}".encode() for variable in ("OMPI_COMM_WORLD_RANK", "PMI_RANK")}
    for child in descendants(running.pid):
        if names & set(Path(f"/proc/{child}/environ").read_bytes().split(b"\0")):
            os.kill(child, signal.SIGKILL)
            return
    raise AssertionError(f"rank {rank} was not found")


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    out = tmp_path_factory.mktemp("whole") / "box"
    assert tmc(*SLOW_BOX, "--out", str(out)).returncode == 0
    result: dict[str, Any] = json.loads((out / "result.json").read_text())
    return result


@pytest.mark.parametrize("dying", [0, 2])
def test_a_rank_that_dies_ends_the_run_and_leaves_a_checkpoint(
    dying: int, tmp_path: Path, whole_run: dict[str, Any]
) -> None:
    """Three ranks, one of which is killed; two go on from the checkpoint to the result of one."""
    out = tmp_path / "box"
    running = started(out, ranks=3)
    kill_rank(running, dying)
    assert running.wait(timeout=60) != 0
    assert not (out / "result.json").exists()

    resumed = tmc("resume", str(out), "--quiet", ranks=2)
    assert resumed.returncode == 0, resumed.stderr[-2000:]
    result = json.loads((out / "result.json").read_text())
    assert result["complete"]
    assert result["steps"] == whole_run["steps"]
    for name in ("gap", "reaction"):
        assert result[name] == pytest.approx(whole_run[name], rel=1e-8)


def test_a_failing_kernel_on_one_rank_cuts_the_step_on_all() -> None:
    done = process([str(Path(__file__).with_name("failing_rank.py"))], ranks=3)
    assert done.returncode == 0, done.stderr[-2000:]
    report = json.loads(done.stdout)
    for failure, cut_backs in (("no memory", 2), ("no memory for a tangent", 1), ("not a number", 0)):
        assert report[failure] == 3 * [[True, cut_backs, "full load"]], failure
    assert report["for good"] == 3 * [[False, 0, "kernel 'solid' could not allocate its work space"]]


def test_an_error_that_one_rank_keeps_to_itself_ends_all() -> None:
    """Ours are raised on all ranks; one that is not must not leave the others waiting."""
    lonely = """
import sys
from mpi4py import MPI
from tmc_vem.support import parallel
from tmc_vem.cli import main
from tmc_vem.support.errors import InputError

parallel.PATIENCE = 1.0
def fail(*_, **__):
    if MPI.COMM_WORLD.rank == 1:
        raise InputError("only here")
    MPI.COMM_WORLD.barrier()
main.cli.main = fail
main.main([])
"""
    done = process(["-c", lonely], ranks=2, timeout=60)
    assert done.returncode == 2
