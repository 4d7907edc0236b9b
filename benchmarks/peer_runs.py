"""tmc-vem, FElupe, NGSolve and dolfinx on the same problems, each in its own process on one core: ``make bench-peers``.

    python benchmarks/peer_runs.py [--repeat 5] [--limit 570] [--only TEXT]

The others are installed into runs/peers-env, in the versions of benchmarks/peers/requirements.txt; one that cannot be
is left out. All programs run in turn, again and again, those that take long in every second round; medians are printed,
and everything is written to runs/bench/peers.json. ``make bench-page`` puts it into docs/peers.md.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from harness import MPI_SETTINGS, RESULTS, report
from peer_environment import ENVIRONMENT, PYTHON, installed
from peer_tables import COLUMNS, EQUAL, FIRST, OWN, PROBLEMS, rows

HERE = Path(__file__).resolve().parent
ROOT, PEERS, CACHE = HERE.parent, HERE / "peers", HERE.parent / "runs" / "peers-cache"
ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NGS_NUM_THREADS")
SLOW, ROUNDS_OF_SLOW = 8.0, 2  # what takes more seconds runs in every second round


@dataclass
class Entry:
    """A program on a mesh.

    Attributes:
        problem: 'cbox' or 'box'.
        program: what it is called in tables.
        cells: in x and y.
        script: file in benchmarks/peers.
        arguments: of it, besides the cells.
        group: of the requirements that it needs; empty for tmc-vem.
        stepping: which load steps, in words; NGSolve has those of tmc-vem.
        samples: what its runs have said.
        wall: seconds that the last process took.
        failure: why it is left out.
    """

    problem: str
    program: str
    cells: tuple[int, int]
    script: str
    arguments: tuple[str, ...] = ()
    group: str = ""
    stepping: str = EQUAL
    samples: list[dict[str, Any]] = field(default_factory=list)
    wall: float = 0.0
    failure: str = ""

    @property
    def name(self) -> str:
        """For messages."""
        return f"{self.problem}, {self.program} ({self.stepping}), {self.cells[0]} x {self.cells[1]}"

    def run(self, more: Sequence[str] = ()) -> dict[str, Any] | None:
        """What a process says; None if it fails."""
        cells = map(str, self.cells)
        started = time.perf_counter()
        said = start(self.script, [*self.arguments, "--cells", *cells, *more], peer=bool(self.group))
        self.wall = time.perf_counter() - started
        if said.returncode:
            self.failure = next(iter(said.stderr.strip().splitlines()[-1:]), f"exit code {said.returncode}")
            return None
        found: dict[str, Any] = json.loads(said.stdout.splitlines()[-1])
        return found

    def as_dict(self) -> dict[str, Any]:
        """For the record."""
        kept = ("problem", "program", "cells", "stepping", "samples", "failure")
        return {name: getattr(self, name) for name in kept}


def entries() -> list[Entry]:
    """All programs on all meshes, tmc-vem first."""
    ours, found = "with_tmc_vem.py", []
    for cells in PROBLEMS["cbox"].meshes:
        found += [
            Entry("cbox", FIRST, cells, ours, ("cbox", "--steps", "20")),
            Entry("cbox", FIRST, cells, ours, ("cbox",), stepping=OWN),
            Entry("cbox", "tmc-vem, dolfinx", cells, ours, ("cbox", "--steps", "20", "--method", "fem")),
        ]
        for program, solver in (
            ("FElupe, SuperLU", "scipy"),
            ("FElupe, Pardiso", "pardiso"),
            ("FElupe, symmetric Pardiso", "pardiso-symmetric"),
        ):
            found.append(Entry("cbox", program, cells, "with_felupe.py", ("--solver", solver), "felupe"))
    for cells in PROBLEMS["box"].meshes:
        found += [
            Entry("box", FIRST, cells, ours, ("box",), stepping=OWN),
            Entry("box", "tmc-vem, dolfinx", cells, ours, ("box", "--method", "fem"), stepping=OWN),
            Entry("box", "NGSolve", cells, "with_ngsolve.py", (), "ngsolve", OWN),
            Entry("box", "NGSolve, compiled", cells, "with_ngsolve.py", ("--compiled",), "ngsolve", OWN),
        ]
    return found


def start(script: str, arguments: Sequence[str], *, peer: bool) -> subprocess.CompletedProcess[str]:
    """Run a script of benchmarks/peers with one thread; caches of kernels and forms are this benchmark's own."""
    settings = dict.fromkeys(ONE_THREAD, "1") | MPI_SETTINGS
    settings |= {"XDG_CACHE_HOME": str(CACHE), "TMC_VEM_CACHE": str(CACHE / "tmc-vem")}
    settings |= {"PATH": f"{ENVIRONMENT / 'bin'}:{os.environ['PATH']}"} if peer else {"PYTHONPATH": str(ROOT)}
    python = PYTHON if peer else sys.executable
    command = [str(python), str(PEERS / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **settings})


def compile_times(chosen: Sequence[Entry]) -> dict[str, float]:
    """Wall seconds of the first start with empty caches, kernels and forms being compiled, by problem and program."""
    shutil.rmtree(CACHE, ignore_errors=True)
    CACHE.mkdir(parents=True)
    found = {}
    for entry in chosen:
        name = f"{entry.problem}, {entry.program}"
        if not entry.group and name not in found and (said := entry.run()):
            found[name] = said["seconds"]["start-up"]["wall"]
    return found


def same_problem() -> dict[str, Any]:
    """How far apart FElupe and our finite elements are on the coarsest C-box: in given states, and at full load.

    Raises:
        subprocess.CalledProcessError: a script fails.
    """
    with tempfile.TemporaryDirectory() as scratch:
        states, theirs, ours = (f"{scratch}/{name}.npz" for name in ("states", "felupe", "fem"))
        start("with_felupe.py", ["--states", states], peer=True).check_returncode()
        said = start("same_energy.py", [states], peer=False)
        said.check_returncode()
        start("with_felupe.py", ["--keep", theirs], peer=True).check_returncode()
        fem = ["cbox", "--steps", "20", "--method", "fem", "--keep", ours]
        start("with_tmc_vem.py", fem, peer=False).check_returncode()
        found: dict[str, Any] = json.loads(said.stdout.splitlines()[-1])
        one, other = (in_order(np.load(path)) for path in (theirs, ours))
        found["displacement"] = float(np.abs(one[0] - other[0]).max() / np.abs(other[0]).max())
        found["reaction"] = abs(one[1] / other[1] - 1.0)
    return found


def in_order(kept: Any) -> tuple[Any, float]:
    """Displacements in the order of coordinates, and the reaction, of a file that a run has kept."""
    rounded = np.round(kept["points"], 7)
    return kept["u"][np.lexsort((rounded[:, 1], rounded[:, 0]))], float(kept["reaction"])


def rounds(chosen: Sequence[Entry], repeat: int, until: float) -> None:
    """All entries in turn; those that are slow less often; nothing that would end after a time is begun."""
    loads: dict[tuple[int, int], list[str]] = {}
    for number in range(repeat):
        for entry in chosen:
            slow = entry.wall > SLOW and number % ROUNDS_OF_SLOW
            if entry.failure or slow or (number and time.perf_counter() + entry.wall > until):
                continue
            more = ["--loads", *loads[entry.cells]] if entry.cells in loads and entry.group == "ngsolve" else []
            said = entry.run(more)
            if said is None:
                print(f"left out: {entry.name}: {entry.failure}", flush=True)
                continue
            if entry.problem == "box" and not entry.group:
                loads.setdefault(entry.cells, [repr(load) for load in said["loads"]])
            entry.samples.append(said)
        print(f"round {number + 1} of {repeat} done", flush=True)


def main() -> None:
    """Compare, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=5, help="rounds; 5 by default")
    parser.add_argument("--limit", type=float, default=570.0, help="seconds after which no run is begun")
    parser.add_argument("--only", default="", help="entries whose name has this text")
    arguments = parser.parse_args()
    left_out = installed()
    until = time.perf_counter() + arguments.limit
    chosen = [entry for entry in entries() if entry.group not in left_out and arguments.only in entry.name]
    compiled = compile_times(chosen)
    same = same_problem() if "felupe" not in left_out else {}
    print("compiled", *(f"{name}: {seconds:.0f} s;" for name, seconds in compiled.items()), flush=True)
    rounds(chosen, arguments.repeat, until)
    data = {
        "runs": [entry.as_dict() for entry in chosen],
        "first_start": compiled,
        "same": same,
        "left_out": left_out,
    }
    printed = [row for problem in PROBLEMS for row in rows(data, problem)]
    report("peers", "One core; seconds are processor seconds", COLUMNS, printed, data, width=190)
    for group, reason in left_out.items():
        print(f"left out: {group}: {reason}")
    print(f"{RESULTS / 'peers.json'} written")


if __name__ == "__main__":
    main()
