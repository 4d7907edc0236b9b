"""The batch script for SLURM, with a stand-in for srun that starts mpirun: it runs, stops in time, and goes on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers_process import MPIRUN, clean_environment

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "slurm-job.sh"
BOX = ["box", "--cells", "20", "5", "--uy", "-0.3", "--steps", "80", "--snapshots", "0"]


@pytest.fixture
def cluster(tmp_path: Path) -> dict[str, str]:
    """Environment of a job whose srun, scontrol and tmc-vem are small scripts."""
    programs = {
        # like srun, a signal to it goes to the tasks
        "srun": f'while [[ "$1" == --* ]]; do shift; done\nexec {MPIRUN} -n "$SLURM_NTASKS" "$@"\n',
        "scontrol": 'echo "$@" >> "$REQUESTS"\n',
        "tmc-vem": f'exec {sys.executable} -c "from tmc_vem.cli.main import main; main()" "$@"\n',
    }
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, text in programs.items():
        (folder / name).write_text("#!/usr/bin/env bash\n" + text)
        (folder / name).chmod(0o755)
    environment = clean_environment()
    environment |= {"PATH": f"{folder}:{environment['PATH']}", "REQUESTS": str(tmp_path / "requests")}
    return environment | {"SLURM_NTASKS": "2", "SLURM_JOB_ID": "4711"}


def test_syntax_and_usage() -> None:
    subprocess.run(["bash", "-n", str(SCRIPT)], check=True)
    done = subprocess.run(["bash", str(SCRIPT), "runs/box"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("usage: sbatch slurm-job.sh RUN_DIRECTORY PROBLEM")


def test_a_job_whose_time_is_up_is_queued_again_and_resumes(tmp_path: Path, cluster: dict[str, str]) -> None:
    out = tmp_path / "box"
    job = ["bash", str(SCRIPT), str(out), *BOX]
    first = subprocess.Popen(job, env=cluster)
    history, deadline = out / "history.csv", time.monotonic() + 90
    while not history.exists() or len(history.read_text().splitlines()) < 5:
        assert time.monotonic() < deadline, "the run made no progress"
        assert first.poll() is None, "the run ended before its time was up"
        time.sleep(0.005)
    os.kill(first.pid, signal.SIGTERM)
    assert first.wait(timeout=60) == 0
    assert (tmp_path / "requests").read_text() == "requeue 4711\n"
    assert not (out / "result.json").exists()

    assert subprocess.run(job, env=cluster | {"SLURM_NTASKS": "3"}, check=False, timeout=120).returncode == 0
    result = json.loads((out / "result.json").read_text())
    assert result["complete"]
    assert result["steps"] == 80
    again = subprocess.run(job, env=cluster, capture_output=True, text=True, check=True)
    assert again.stdout == f"{out} is complete\n"


def test_a_failed_run_fails_the_job(tmp_path: Path, cluster: dict[str, str]) -> None:
    job = ["bash", str(SCRIPT), str(tmp_path / "box"), "box", "--cells", "7", "5"]
    assert subprocess.run(job, env=cluster, capture_output=True, check=False).returncode == 2
