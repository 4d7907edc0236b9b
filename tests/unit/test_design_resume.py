"""Searches for a design that are stopped go on with the same bits."""

from __future__ import annotations

import dataclasses
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_design import CANTILEVER, cantilever, cantilever_file, design_rows
from helpers_process import clean_environment, tmc

from tmc_vem import optimise
from tmc_vem.results.design_run import DesignRun
from tmc_vem.support.errors import InputError, TmcError

COMMAND = ["-c", "from tmc_vem.cli.main import main; main()"]
QUICK: dict[str, Any] = {"animation": False, "final": False}
LONG = CANTILEVER.replace(
    "iterations = 6", "iterations = 14\nprojection = { first = 1, largest = 2, every = 6 }\nnoise = 0.1"
)
ARGUMENTS = ("optimise", "cantilever.toml", "--no-final", "--no-animation", "--every", "3")


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    there = tmp_path_factory.mktemp("whole")
    cantilever_file(there, LONG)
    assert tmc(*ARGUMENTS, "--out", "found", cwd=there).returncode == 0
    return there / "found"


def stopped_after(there: Path, designs: int, number: int) -> subprocess.CompletedProcess[str]:
    """A search that gets a signal once it has written so many evaluations."""
    cantilever_file(there, LONG)
    arguments = [sys.executable, *COMMAND, *ARGUMENTS, "--out", "found"]
    with subprocess.Popen(
        arguments, cwd=there, env=clean_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as search:
        wanted = there / "found" / "evaluations" / f"{designs:05d}.npz"
        deadline = time.monotonic() + 100.0
        while not wanted.exists() and search.poll() is None and time.monotonic() < deadline:
            time.sleep(0.002)
        search.send_signal(number)
        out, err = search.communicate()
        return subprocess.CompletedProcess(arguments, search.returncode, out, err)


def assert_same(one: Path, other: Path) -> None:
    assert design_rows(one) == design_rows(other)
    for n in range(1, 15):
        first, second = (np.load(there / "evaluations" / f"{n:05d}.npz") for there in (one, other))
        for name in ("z", "objective", "gradient", "constraints", "jacobian"):
            assert first[name].tobytes() == second[name].tobytes(), (n, name)
    with np.load(one / "stiffness.npz") as first, np.load(other / "stiffness.npz") as second:
        assert first["stiffness_c"].tobytes() == second["stiffness_c"].tobytes()
    assert (one / "design.pvd").read_text() == (other / "design.pvd").read_text()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_a_search_goes_on_with_the_same_bits(uninterrupted: Path, number: int, code: int, tmp_path: Path) -> None:
    done = stopped_after(tmp_path, 8, number)
    assert done.returncode == code
    if code > 0:
        assert "'tmc-vem resume found' goes on" in done.stderr
    with pytest.raises(InputError, match=r"has no result yet \(interrupted\)"):
        DesignRun.read(tmp_path / "found")
    (tmp_path / "cantilever.toml").unlink()  # the copy in the directory is as good
    again = tmc("resume", "found", "--quiet", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert_same(tmp_path / "found", uninterrupted)


def test_torn_files_cost_an_evaluation(uninterrupted: Path, tmp_path: Path) -> None:
    stopped_after(tmp_path, 9, signal.SIGKILL)
    there = tmp_path / "found"
    checkpoint = there / "checkpoint.npz"
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    (there / ".unfinished-evaluation").write_bytes(b"")
    with (there / "history.csv").open("a") as file:
        file.write("10,0,torn")
    again = tmc(*ARGUMENTS, "--out", "found", "--resume", "--quiet", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert_same(there, uninterrupted)


def test_a_search_that_is_done_goes_on_with_more_evaluations(tmp_path: Path) -> None:
    (few, options), (more, _) = (cantilever(tmp_path, {"design.iterations": n}) for n in (4, 7))
    optimise(few, tmp_path / "few", options, **QUICK)
    optimise(more, tmp_path / "few", options, resume=True, **QUICK)
    optimise(more, tmp_path / "many", options, **QUICK)
    assert design_rows(tmp_path / "few") == design_rows(tmp_path / "many")
    assert len(design_rows(tmp_path / "few")) == 7


def test_a_limit_of_time_ends_a_search(tmp_path: Path) -> None:
    problem, options = cantilever(tmp_path)
    with pytest.raises(TmcError, match=r"the limit of 0.001 seconds is used up$"):  # nothing to go on from
        optimise(problem, tmp_path / "found", dataclasses.replace(options, max_seconds=1e-3), **QUICK)
    assert not (tmp_path / "found" / "result.json").exists()
    optimise(problem, tmp_path / "found", dataclasses.replace(options, overwrite=True), **QUICK)


def test_what_cannot_go_on(tmp_path: Path) -> None:
    problem, options = cantilever(tmp_path, {"design.iterations": 2})
    with pytest.raises(InputError, match="there is nothing to resume without a directory"):
        optimise(problem, None, options, resume=True)
    with pytest.raises(InputError, match=r"has no checkpoint to go on from"):
        optimise(problem, tmp_path / "nothing", options, resume=True)
    optimise(problem, tmp_path / "found", options, **QUICK)
    other, _ = cantilever(tmp_path, {"design.volume": 0.4})
    with pytest.raises(InputError, match=r"the checkpoint was made with design\.volume = 0\.5, not 0\.4: start anew"):
        optimise(other, tmp_path / "found", options, resume=True, **QUICK)
    (tmp_path / "found" / "evaluations" / "00001.npz").write_bytes(b"torn")
    with pytest.raises(InputError, match=r"has 0 good evaluations, but the last states are those of number 2"):
        optimise(problem, tmp_path / "found", options, resume=True, **QUICK)
