"""Kill a run at random times, resume it each time, and compare the result with that of a run that was left alone.

    python benchmarks/kill_and_resume.py --kills 20

After every kill all files of the run directory are read. Exit code 1 if one is unreadable or the gaps differ by more
than 1e-10 of their value.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import meshio

from tmc_vem.results.records import COLLECTION, COMMAND, HISTORY, StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.checkpoint import BEFORE, CHECKPOINT, Checkpoint
from tmc_vem.support.files import TEMPORARY

TMC = [sys.executable, "-c", "from tmc_vem.cli.main import main; main()"]
RUN = ["run", "box", "--cells", "20", "5", "--gamma", "1e-6", "--alpha-r", "0.1", "--snapshots", "20", "--quiet"]
TOLERANCE = 1e-10


def read_all(directory: Path) -> int:
    """Read every file of a run directory; how many steps its history has.

    Raises:
        Exception: one is unreadable.
    """
    if (directory / COMMAND).exists():
        json.loads((directory / COMMAND).read_text())
    if (directory / CHECKPOINT).exists() or (directory / BEFORE).exists():
        Checkpoint.read(directory)
    for path in directory.rglob("*.vtu"):
        if not path.name.startswith(TEMPORARY):
            meshio.read(path)
    if (directory / COLLECTION).exists():
        files = [part.split('"')[0] for part in (directory / COLLECTION).read_text().split('file="')[1:]]
        for name in files:
            meshio.read(directory / name)
    if not (directory / HISTORY).exists():
        return 0
    with (directory / HISTORY).open(newline="") as file:
        return len([StepRecord.from_row(row) for row in csv.DictReader(file)])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    folder = Path(tempfile.mkdtemp(prefix="kill-"))
    alone = folder / "alone"
    begin = time.monotonic()
    subprocess.run([*TMC, *RUN, "--out", str(alone)], check=True)
    longest = time.monotonic() - begin
    gap = RunResult.read(alone).gap
    assert gap is not None
    print(f"left alone: gap {gap!r} in {longest:.1f} s", flush=True)

    kills, number, worst = 0, 0, 0.0
    while kills < arguments.kills:
        number += 1
        out = folder / f"killed-{number}"
        here, command = 0, [*TMC, *RUN, "--out", str(out)]
        while True:
            process = subprocess.Popen(command)
            try:
                # half of the kills early, so that no run gets through without any
                wait = longest * chance.uniform(0.2, 0.6 if chance.random() < 0.5 else 1.0)
                code = process.wait(wait if kills < arguments.kills else None)
                if code:
                    sys.exit(f"exit code {code} of {' '.join(command[3:])}")
                break
            except subprocess.TimeoutExpired:
                process.send_signal(signal.SIGKILL)
                process.wait()
                kills, here = kills + 1, here + 1
                steps = read_all(out) if out.exists() else 0
                print(f"kill {kills}: after {wait:.2f} s, {steps} steps on disk, all readable", flush=True)
                if (out / CHECKPOINT).exists() or (out / BEFORE).exists():
                    command = [*TMC, "resume", str(out), "--quiet"]
                else:  # killed before the first step: start anew
                    command = [*TMC, *RUN, "--out", str(out), "--overwrite"]
        read_all(out)
        found = RunResult.read(out).gap
        assert found is not None
        worst = max(worst, abs(found - gap) / gap)
        print(f"run {number}: killed {here} times, gap {found!r}", flush=True)
    shutil.rmtree(folder)
    print(f"{kills} kills in {number} runs; largest relative difference of the gap {worst:.1e}")
    sys.exit(worst > TOLERANCE)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
