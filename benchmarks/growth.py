"""Time and memory per degree of freedom from small to large, and the exponents of their growth.

    python benchmarks/growth.py [--sizes 5000 ...] [--factor 70000]

Set-up is everything from a mesh in memory to an allocated matrix, in processor time. Every size is a process of its
own, so that peak memory is its own; memory of the interpreter with its libraries is taken off. All Voronoi cells have
shapes of their own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from typing import Any

import numpy as np
from harness import interleaved, report

KINDS = ("quadrilaterals", "voronoi")
SIZES = [5e3, 16e3, 50e3, 160e3, 500e3]
FACTOR = 70e3  # largest size that is factorised


def peak() -> int:
    """Largest resident memory of this process so far, in bytes."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def resident() -> int:
    """Resident memory of this process now, in bytes."""
    import os
    from pathlib import Path

    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def measure(kind: str, n_dofs: float, factor: bool) -> dict[str, float]:
    """One size, in this process."""
    from meshes import bend, region, square
    from mpi4py import MPI

    from tmc_vem.mesh.spread.distribute import distribute
    from tmc_vem.solve.linear import LinearSolver
    from tmc_vem.support.memory import reuse_freed
    from tmc_vem.vem.system import VemSystem

    reuse_freed()  # as every run does
    small = VemSystem(distribute(MPI.COMM_WORLD, lambda: square(kind, 500)), {"body": region("huhu_lulu")})
    small._insertion_into(small.create_matrix())
    mesh = square(kind, n_dofs)
    before = resident()
    started, cpu = time.perf_counter(), time.process_time()
    system = VemSystem(distribute(MPI.COMM_WORLD, lambda: mesh), {"body": region("huhu_lulu")})
    matrix = system.create_matrix()
    system._insertion_into(matrix)  # where tangents go in it, else looked up for the first one
    setup, setup_cpu = time.perf_counter() - started, time.process_time() - cpu
    u, out, x = (system.create_vector() for _ in range(3))
    u.getArray()[:] = bend(system.node_labels()[:, :2]).ravel()
    work = {"tangent": lambda: system.jacobian(u, matrix), "residual": lambda: system.residual(u, out)}
    seconds = {name: sample.best for name, sample in interleaved(work, 3).items()}
    result = {
        "n_dofs": system.n_dofs, "n_cells": system.n_cells_global, "setup": setup, "setup_cpu": setup_cpu, **seconds,
        "memory": resident() - before, "peak": peak() - before,
    }  # fmt: skip
    if factor:
        # the body floats: the diagonal is shifted so that there is something to factorise
        matrix.shift(1.0)
        solver = LinearSolver(matrix, MPI.COMM_WORLD)
        for name in ("first_solve", "next_solve"):
            matrix.scale(2.0)  # new values, as far as PETSc can tell
            started = time.perf_counter()
            solver.solve(out, x)
            result[name] = time.perf_counter() - started
        result["with_factor"] = peak() - before
    return result


def exponent(n: list[float], values: list[float]) -> float:
    """Slope in double logarithmic axes."""
    return float(np.polyfit(np.log(n), np.log(values), 1)[0])


COLUMNS = (
    "cells, dofs", "set-up, us/dof", "us/cell", "tangent, us/dof", "residual, us/dof", "KiB/dof", "solve, us/dof",
    "KiB/dof with factor",
)  # fmt: skip


def table_rows(results: dict[str, Any]) -> list[tuple[str, ...]]:
    """Rows under ``COLUMNS``, for the terminal and for the page."""
    rows = []
    for kind in KINDS:
        for f in results[kind]["sizes"]:
            per = 1.0 / f["n_dofs"]
            rows.append((
                f"{kind}, {f['n_dofs']}", f"{1e6 * f['setup_cpu'] * per:.1f}",
                f"{1e6 * f['setup_cpu'] / f['n_cells']:.0f}", f"{1e6 * f['tangent'] * per:.2f}",
                f"{1e6 * f['residual'] * per:.3f}", f"{f['memory'] * per / 1024:.2f}",
                f"{1e6 * f['next_solve'] * per:.1f}" if "next_solve" in f else "",
                f"{f['with_factor'] * per / 1024:.1f}" if "with_factor" in f else "",
            ))  # fmt: skip
        powers = results[kind]["exponents"]
        if powers:
            cells = [f"n^{powers[k]:.2f}" for k in ("setup_cpu", "tangent", "residual", "memory")]
            rows.append((f"{kind}: exponents", cells[0], "", *cells[1:], "", ""))
    return rows


def main() -> None:
    """Print growth and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES)
    parser.add_argument("--factor", type=float, default=FACTOR)
    parser.add_argument("--one", nargs=2)
    arguments = parser.parse_args()
    if arguments.one:
        kind, n = arguments.one
        print(json.dumps(measure(kind, float(n), float(n) <= arguments.factor)))
        return
    results = {}
    for kind in KINDS:
        found: list[dict[str, Any]] = []
        for n in arguments.sizes:
            command = [sys.executable, __file__, "--factor", str(arguments.factor), "--one", kind, str(n)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            found.append(json.loads(done.stdout.splitlines()[-1]))
        sizes = [float(f["n_dofs"]) for f in found]
        keys = ("setup_cpu", "tangent", "residual", "memory")
        growth = {k: exponent(sizes, [f[k] for f in found]) for k in keys} if len(sizes) > 1 else {}
        results[kind] = {"sizes": found, "exponents": growth}
    report("growth", "Growth with the size, damped huhu_lulu", COLUMNS, table_rows(results), results)


if __name__ == "__main__":
    main()
