"""Adaptive runs on several ranks: the same mesh bit for bit, and the same results."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import MPIRUN, clean_environment, tmc

BOX = ["box", "--cells", "20", "5", "--uy", "-0.2", "--steps", "3", "--adapt", "gap", "--adapt-tolerance", "0.5%"]


def entries(out: Path) -> dict[str, Any]:
    with np.load(out / "adapt" / "mesh.npz") as file:
        return dict(file)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("alone") / "box"
    done = tmc("run", *BOX, "--quiet", "--out", str(out))
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_meshes_and_results_do_not_depend_on_the_ranks(ranks: int, tmp_path: Path, alone: Path) -> None:
    done = tmc("run", *BOX, "--json", "--out", str(tmp_path / "box"), ranks=ranks)
    assert done.returncode == 0, done.stderr[-2000:]
    found, expected = json.loads(done.stdout), json.loads((alone / "result.json").read_text())
    assert (expected["versions"]["ranks"], found["versions"]["ranks"]) == (1, ranks)
    mine, theirs = entries(tmp_path / "box"), entries(alone)
    assert set(mine) == set(theirs)
    assert len(theirs["region_c"]) > 100
    for name in theirs:
        assert np.array_equal(mine[name], theirs[name]), name
    for name in ("gap", "reaction"):
        assert found[name] == pytest.approx(expected[name], rel=1e-9)
    assert found["energy"] == pytest.approx(expected["energy"], rel=1e-9)
    rounds = [[{**each, "seconds": 0.0} for each in data["adaptivity"]["rounds"]] for data in (found, expected)]
    assert rounds[0] == rounds[1]


def test_another_number_of_ranks_goes_on(tmp_path: Path, alone: Path) -> None:
    """A run on two ranks that is stopped during its rounds goes on alone; all ranks end with the code of the signal."""
    out = tmp_path / "box"
    command = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()", "run", *BOX, "--out", str(out)]
    running = subprocess.Popen(
        [MPIRUN, "-n", "2", *command], env=clean_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 90
    while not (out / "adapt" / "rounds.json").exists():
        assert time.monotonic() < deadline, "the run made no progress"
        assert running.poll() is None, "the run ended too early"
        time.sleep(0.005)
    running.send_signal(signal.SIGTERM)
    _, errors = running.communicate(timeout=90)
    assert running.returncode != 0
    assert "Traceback" not in errors, errors
    assert not (out / "result.json").exists()
    done = tmc("resume", str(out), "--quiet")
    assert done.returncode == 0, done.stderr
    mine, theirs = entries(out), entries(alone)
    for name in theirs:
        assert np.array_equal(mine[name], theirs[name]), name
    first, second = (json.loads((path / "result.json").read_text()) for path in (out, alone))
    assert first["gap"] == second["gap"]


@pytest.mark.parametrize("arguments", [["--adapt", "gip"], ["--adapt", "gap", "--gamma", "-1"]])
def test_all_ranks_are_refused_together(arguments: list[str]) -> None:
    done = tmc("run", "box", "--cells", "20", "5", *arguments, ranks=2)
    assert "Traceback" not in done.stderr
    assert done.stderr.count("tmc-vem: ") == 1
    assert done.returncode != 0
