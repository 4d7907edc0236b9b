"""Time and memory of the parts of a Newton iteration against mesh size and ranks, on the box.

    python benchmarks/scaling.py sizes          # one rank, 50k to 800k degrees of freedom
    python benchmarks/scaling.py strong         # 200k degrees of freedom on 1, 2 and 4 ranks
    python benchmarks/scaling.py weak           # 50k degrees of freedom a rank
    python benchmarks/scaling.py assembly       # 2 million degrees of freedom, no factorisation
    python benchmarks/scaling.py linear         # iterations of the iterative preset against gamma, mesh and ranks
    python benchmarks/scaling.py fit            # cost model from what the others measured

Each study starts its own mpirun, adds what it measured to build/scaling.json and prints the table of docs/scaling.md.
Times are the least of several repetitions, of the slowest rank.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from harness import MPI_SETTINGS, YIELD

RESULTS = Path("build/scaling.json")
SIZES = ((160, 40), (320, 80), (640, 160))
SETTINGS = {**MPI_SETTINGS, "OMPI_MCA_btl_vader_single_copy_mechanism": "none"}
Row = dict[str, Any]


def measure(nx: int, ny: int, solver: str, gamma: float, uy: float, repeat: int) -> None:
    """Runs on every rank under mpirun; rank 0 prints a row as JSON."""
    from mpi4py import MPI

    from tmc_vem.problems import Box, Medium
    from tmc_vem.simulation import RunOptions, discretise
    from tmc_vem.simulation.balance import balance
    from tmc_vem.solve.linear import LinearSolver
    from tmc_vem.solve.newton import NewtonSolver
    from tmc_vem.solve.stepping import LoadStepper
    from tmc_vem.system.control import Control

    comm = MPI.COMM_WORLD

    def least(action: Callable[[], Any]) -> float:
        times: list[float] = []
        while len(times) < repeat or sum(times) < 1.0:  # the slowest rank's, so all ranks leave together
            comm.barrier()
            started = time.perf_counter()
            action()
            times.append(comm.allreduce(time.perf_counter() - started, op=MPI.MAX))
        return min(times)

    def resident() -> float:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return float(comm.allreduce(pages * resource.getpagesize()))

    problem = Box(cells=(nx, ny), medium=Medium(gamma=gamma), uy=uy or -1.0)
    discretise(Box(cells=(20, 5)), RunOptions(), comm)  # imports and libraries do not count
    before = resident()
    started = time.perf_counter()
    system = discretise(problem, RunOptions(), comm)
    row: Row = {"cells": [nx, ny], "ranks": comm.size, "dofs": system.n_dofs, "gamma": gamma, "uy": uy}
    row["set-up"] = comm.allreduce(time.perf_counter() - started, op=MPI.MAX)
    u, du, residual = (system.create_vector() for _ in range(3))
    if uy:
        row["complete"] = LoadStepper(NewtonSolver(system)).run(u).complete
    matrix = system.create_matrix()
    system.jacobian(u, matrix)
    row["bytes per dof"] = (resident() - before) / system.n_dofs
    row["tangent"] = least(lambda: system.jacobian(u, matrix))
    row["residual"] = least(lambda: system.residual(u, residual))
    du.setRandom()
    du.scale(1e-6)
    row["step limit"] = least(lambda: system.max_step(u, du))
    row["imbalance"] = balance(comm, system.work())["imbalance"]
    if solver != "none":
        linear = LinearSolver(matrix, comm, solver)
        du.getArray()[:] = 0.0
        du.getArray()[system.constrained()] = system.prescribed(Control(0.01))
        system.tangent_action(du, residual)
        residual.getArray()[system.constrained()] = 0.0
        started = time.perf_counter()
        worked = linear.solve(residual, du)
        row["first solve"] = comm.allreduce(time.perf_counter() - started, op=MPI.MAX)
        iterations = linear.iterations

        def again() -> None:
            matrix.assemble()
            matrix.stateIncrease()  # the values are taken for new ones
            linear.solve(residual, du)

        row["linear solve"] = least(again)
        row["solver"], row["iterations"], row["solved"] = solver, iterations, worked
        row["newton iteration"] = sum(row[part] for part in ("tangent", "residual", "step limit", "linear solve"))
    row["peak"] = balance(comm, {})["peak_memory_mib"]
    if comm.rank == 0:
        print(json.dumps(row))


def start(
    ranks: int, cells: tuple[int, int], solver: str = "direct", gamma: float = 1e-5, uy: float = 0.0, repeat: int = 5
) -> Row:
    """Measure in a process (or several) of its own."""
    command = [sys.executable, __file__, "measure", "--cells", *map(str, cells), "--solver", solver]
    command += ["--gamma", str(gamma), "--uy", str(uy), "--repeat", str(repeat)]
    settings = SETTINGS | (YIELD if ranks > len(os.sched_getaffinity(0)) else {})
    done = subprocess.run(
        ["mpirun", "-n", str(ranks), *command], capture_output=True, text=True, env=os.environ | settings, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(command)} on {ranks} ranks failed: {done.stderr[-1000:]}")
    row: Row = json.loads(done.stdout.splitlines()[-1])
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else []
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps([*known, row], indent=1) + "\n")
    return row


def show(rows: list[Row], reference: Row | None = None) -> None:
    """Table of times; with a reference, how much faster than that."""
    parts = ["tangent", "residual", "step limit", "linear solve", "newton iteration"]
    parts = [part for part in parts if part in rows[0]]
    print(
        "| cells | dofs | ranks |",
        " | ".join(f"{part} [s]" for part in parts),
        "| set-up [s] | bytes/dof | peak [MiB] |",
    )
    print("|---" * (6 + len(parts)) + "|")
    for row in rows:
        shown = [
            f"{row[part]:.3f}" + (f" ({reference[part] / row[part]:.2f} x)" if reference else "") for part in parts
        ]
        cells = "{} x {}".format(*row["cells"])
        last = f"{row['set-up']:.1f} | {row['bytes per dof']:.0f} | {row['peak']['all']:.0f}"
        print("|", cells, "|", row["dofs"], "|", row["ranks"], "|", " | ".join(shown), "|", last, "|", flush=True)
    if len({row["dofs"] for row in rows}) > 1 and {row["ranks"] for row in rows} == {1}:
        for part in (*parts, "bytes per dof"):
            each = [row[part] / row["dofs"] if part != "bytes per dof" else row[part] for row in rows]
            name = part if part == "bytes per dof" else f"{part} per dof"
            print(f"{name}: largest over smallest {max(each) / min(each):.3f}")


def sizes() -> None:
    show([start(1, cells) for cells in SIZES])


def strong() -> None:
    rows = [start(ranks, (320, 80)) for ranks in (1, 2, 4)]
    show(rows, rows[0])


def weak() -> None:
    show([start(ranks, (160 * ranks, 40)) for ranks in (1, 2, 4)])


def assembly() -> None:
    show([start(ranks, (1000, 250), "none", repeat=3) for ranks in (1, 2)])


def linear() -> None:
    """Iterations of the iterative preset on the box without load and in contact, and the times of both presets."""
    print("| cells | dofs | gamma | u_y | ranks | iterations | iterative [s] | direct [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for gamma in (1e-4, 1e-6):
        for cells, ranks in (((40, 10), 1), ((80, 20), 1), ((160, 40), 1), ((160, 40), 2)):
            for uy in (0.0, -1.0):
                one, other = (start(ranks, cells, solver, gamma, uy, 2) for solver in ("iterative", "direct"))
                row = [f"{cells[0]} x {cells[1]}", one["dofs"], f"{gamma:g}", uy, ranks]
                row.append(one["iterations"] if one["solved"] else "fails")
                row += [f"{one['linear solve']:.2f}", f"{other['linear solve']:.2f}"]
                print("|", " | ".join(map(str, row)), "|", flush=True)


def fit() -> None:
    """Seconds on one rank: a N for the evaluation, b N^1.5 + c N log N for the linear solve; see docs/scaling.md."""
    import numpy as np

    rows = [row for row in json.loads(RESULTS.read_text()) if row["ranks"] == 1 and row.get("solver") == "direct"]
    rows = [row for row in rows if row["dofs"] > 50_000 and not row["uy"]]
    n = np.array([row["dofs"] for row in rows], dtype=float)
    evaluation = np.array([row["tangent"] + row["residual"] + row["step limit"] for row in rows])
    solves = np.array([row["linear solve"] for row in rows])
    a = float((evaluation / n).mean())
    terms = np.column_stack([n**1.5, n * np.log2(n)]) / solves[:, None]
    (b, c), *_ = np.linalg.lstsq(terms, np.ones(len(n)), rcond=None)
    print(f"evaluation: {a:.3e} s a dof; linear solve: {b:.3e} N^1.5 + {c:.3e} N log2 N s")
    for row, predicted in zip(rows, b * n**1.5 + c * n * np.log2(n), strict=True):
        print(f"{row['dofs']} dofs: linear solve {row['linear solve']:.3f} s, model {predicted:.3f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    studies = {study.__name__: study for study in (sizes, strong, weak, assembly, linear, fit)}
    parser.add_argument("study", choices=[*studies, "measure"])
    parser.add_argument("--cells", type=int, nargs=2, default=(160, 40))
    parser.add_argument("--solver", default="direct", help="preset, file of PETSc options, or none")
    parser.add_argument("--gamma", type=float, default=1e-5)
    parser.add_argument("--uy", type=float, default=0.0, help="displacement of the load at which to measure")
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    if arguments.study == "measure":
        measure(*arguments.cells, arguments.solver, arguments.gamma, arguments.uy, arguments.repeat)
    else:
        studies[arguments.study]()


if __name__ == "__main__":
    main()
