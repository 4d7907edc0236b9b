"""Where the time of a run goes, and what an assembly and a solve consist of.

    python benchmarks/phases.py

Box of 16k degrees of freedom with its run directory, alpha_r = 1, gamma = 1e-5. A run is the best of five, each in a
process of its own, which has to load what it needs; what a program loads before it starts a run is in startup.py.
"""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from harness import interleaved, report
from meshes import bend
from mpi4py import MPI

from tmc_vem.problems import Box, Medium
from tmc_vem.simulation import RunOptions, discretise, run
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.support.petsc import PETSc
from tmc_vem.vem.kernel.batch import Tangents

EVENTS = {"symbolic": "MatCholFctrSym", "numeric": "MatCholFctrNum", "solve": "MatSolve"}
KINDS = {"quadrilaterals": (80, 25), "voronoi": (80, 25)}
SOLUTION, PICTURE = ("assembly", "linear solve"), "picture"
COLUMNS = ("phase", "time", "of the run")


def problem(kind: str) -> Box:
    """Box of about 16k degrees of freedom."""
    return Box(cells=KINDS[kind], cell_kind=kind, medium=Medium(gamma=1e-5, alpha_r=1.0))


def of_run(kind: str) -> dict[str, Any]:
    """Seconds by phase of a complete run that writes everything."""
    with tempfile.TemporaryDirectory() as scratch:
        result = run(problem(kind), Path(scratch) / "run", RunOptions())
    numbers = {"n_dofs": result.n_dofs, "iterations": result.newton_iterations, "steps": result.steps}
    return {**numbers, "seconds": dict(result.seconds)}


def best_run(kind: str, repetitions: int = 5) -> dict[str, Any]:
    """The fastest of several runs, each in a new process."""
    found = []
    for _ in range(repetitions):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            found.append(pool.apply(of_run, (kind,)))
    return min(found, key=lambda run: float(run["seconds"]["total"]))


def of_iteration(kind: str) -> dict[str, float]:
    """Seconds of the parts of one Newton iteration."""
    system = discretise(problem(kind), RunOptions(), MPI.COMM_WORLD)
    matrix, u, out = system.create_matrix(), system.create_vector(), system.create_vector()
    u.getArray()[:] = bend(system.node_labels()[:, :2]).ravel()
    nodes = system.nodal_values(u)
    dense = [np.empty((len(b.cells), 2 * b.batch.n_basis, 2 * b.batch.n_basis)) for b in system.blocks]

    def kernels() -> None:
        for block, target in zip(system.blocks, dense, strict=True):
            block.kernel.cells(block.batch, nodes, block.parameters, None, Tangents(target))

    work = {
        "tangent and insertion": lambda: system.jacobian(u, matrix),
        "element tangents, dense": kernels,
        "residual and energy": lambda: system.residual(u, out),
        "largest step": lambda: system.max_step(u, out),
    }
    seconds = {name: sample.best for name, sample in interleaved(work, 9).items()}
    PETSc.Log.begin()
    solver, x = LinearSolver(matrix, MPI.COMM_WORLD), out.duplicate()
    for _ in range(5):
        solver.solve(out, x)
    for label, event in EVENTS.items():
        info = PETSc.Log.Event(event).getPerfInfo()
        seconds[f"factorisation, {label}" if label != "solve" else "forward and backward substitution"] = info[
            "time"
        ] / max(info["count"], 1)
        seconds[f"count of {event}"] = float(info["count"])
    return seconds


def table_rows(results: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Rows of the table: phases and sums of the runs, and parts of an iteration."""
    rows = []
    for kind in KINDS:
        whole, seconds = results[kind]["run"], results[kind]["run"]["seconds"]
        total = seconds["total"]
        outside = total - sum(seconds[phase] for phase in SOLUTION)
        for phase, spent in seconds.items():
            rows.append((f"{kind}, {whole['n_dofs']} dofs: {phase}", f"{spent:.3f} s", f"{100 * spent / total:.1f} %"))
        rows.append((f"{kind}: outside assembly and solves", f"{outside:.3f} s", f"{100 * outside / total:.1f} %"))
        outside, total = outside - seconds[PICTURE], total - seconds[PICTURE]
        rows.append((f"{kind}: the same without the picture", f"{outside:.3f} s", f"{100 * outside / total:.1f} %"))
        for phase, spent in results[kind]["iteration"].items():
            if not phase.startswith("count"):
                rows.append((f"{kind}, one iteration: {phase}", f"{1e3 * spent:.1f} ms", ""))
    return rows


def main() -> None:
    """Print phases and write them."""
    results = {kind: {"run": best_run(kind), "iteration": of_iteration(kind)} for kind in KINDS}
    report("phases", "Phases of a run, and of one Newton iteration", COLUMNS, table_rows(results), results)


if __name__ == "__main__":
    main()
