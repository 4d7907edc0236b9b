"""What the second gradient between cells is worth: the measurements behind docs/interior-penalty.md.

    python benchmarks/interior_penalty.py cost       # seconds of a Newton iteration, with and without; two minutes

The tables of the page are made by ``scripts/refresh-numbers interior-penalty``, from the functions of this file: a
linear problem of the second gradient with a known solution, and the box.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import helpers_penalty
import numpy as np
from helpers_mesh import grid, hanging, voronoi
from helpers_penalty import bricks, named, triangles
from mpi4py import MPI

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Box
from tmc_vem.problems.materials import Medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.simulation.discretised import discretise
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.support.errors import ConvergenceError
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.interior_penalty import INTERIOR_PENALTIES
from tmc_vem.vem.spaces.element_settings import ElementSettings

MESHES: dict[str, Callable[[int], PolygonMesh]] = {
    "squares": lambda n: grid(n, n),
    "triangles": lambda n: triangles(grid(n, n)),
    "Voronoi": lambda n: named(voronoi(n * n)),
    "bricks": bricks,
    "hanging nodes": lambda n: named(hanging(n)),
}
# The box: kind of cells, cells, refinement of the medium.
BOXES: dict[str, tuple[str, tuple[int, int], int]] = {
    "squares, 40 x 10": ("quadrilaterals", (40, 10), 1),
    "squares, 80 x 20": ("quadrilaterals", (80, 20), 1),
    "Voronoi, 40 x 10": ("voronoi", (40, 10), 1),
    "Voronoi, 80 x 20": ("voronoi", (80, 20), 1),
    "hanging nodes, 40 x 10": ("quadrilaterals", (40, 10), 2),
}
REPEATS = 5
ROUNDING = 1e-10  # eigenvalues of this part of the largest one count as 0


def amplitude(mesh: str, n: int, kind: str, order: int = 2) -> float:
    """See :func:`helpers_penalty.amplitude`."""
    return helpers_penalty.amplitude(MESHES[mesh](n), kind, order)


def box(mesh: str, kind: str, alpha_r: float, gamma: float, method: str = "vem") -> dict[str, Any]:
    """Gap, energy of the regulariser, steps and iterations of the box at full load, or at the load that was reached."""
    cells, size, refine = BOXES[mesh]
    problem = Box(cells=size, cell_kind=cells, medium_refinement=refine, medium=Medium(gamma=gamma, alpha_r=alpha_r))
    options = RunOptions(
        method, element=ElementSettings(interior_penalty=kind), fem=FemSettings(interior_penalty=kind)
    )  # fmt: skip
    try:
        result = run(problem, options=options)
    except ConvergenceError as error:
        return {"reached": 0.0, "reason": str(error)}
    return {
        "reached": result.load,
        "gap": result.gap,
        "regulariser": result.checks["regulariser_energy"],
        "reaction": result.reaction,
        "iterations": result.newton_iterations,
        "cells": result.n_cells,
        "dofs": result.n_dofs,
    }


def smallest_eta(mesh: str, n: int, order: int) -> float:
    """Smallest factor with which the regulariser alone, with its consistency term, has no negative eigenvalue.

    The stiffness is K + eta P: the factor is the largest eigenvalue of -K relative to P, where P is not 0. It is found
    by halving an interval, as P is singular.
    """
    without, one = (helpers_penalty.second_gradient_stiffness(MESHES[mesh](n), order, eta) for eta in (1.0, 2.0))
    penalty = one - without
    start = without - penalty
    low, high = 0.0, 64.0
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        values = np.linalg.eigvalsh(start + middle * penalty)
        low, high = (low, middle) if values[0] > -ROUNDING * values[-1] else (middle, high)
    return high


def iteration_seconds(cells: tuple[int, int], kind: str) -> dict[str, float]:
    """Median seconds of residual, tangent, and factorisation with solve, of the box just before contact."""
    problem = Box(cells=cells, medium=Medium(gamma=1e-5))
    system = discretise(problem, RunOptions(element=ElementSettings(interior_penalty=kind)), MPI.COMM_SELF)
    u, residual, step = (system.create_vector() for _ in range(3))
    matrix = system.create_matrix()
    solver = LinearSolver(matrix, MPI.COMM_SELF)
    system.jacobian(u, matrix)
    seconds: dict[str, list[float]] = {"residual": [], "tangent": [], "solve": []}
    for repeat in range(REPEATS + 1):
        marks = [time.perf_counter()]
        system.residual(u, residual)
        marks.append(time.perf_counter())
        system.jacobian(u, matrix)
        marks.append(time.perf_counter())
        solver.solve(residual, step)
        marks.append(time.perf_counter())
        if repeat:
            for name, start, end in zip(seconds, marks, marks[1:], strict=False):
                seconds[name].append(end - start)
    return {"dofs": float(system.n_dofs), **{name: statistics.median(values) for name, values in seconds.items()}}


def cost() -> None:
    """Print the table of costs."""
    print(f"{'dofs':>8} {'':8} {'residual':>9} {'tangent':>9} {'solve':>9} {'iteration':>9}  relative to none")
    for cells in ((80, 20), (220, 55)):
        whole = {}
        for kind in INTERIOR_PENALTIES:
            found = iteration_seconds(cells, kind)
            parts = [found[name] for name in ("residual", "tangent", "solve")]
            whole[kind] = sum(parts)
            times = " ".join(f"{1e3 * part:6.1f} ms" for part in (*parts, whole[kind]))
            print(f"{found['dofs']:8.0f} {kind:8} {times}  {whole[kind] / whole['none']:.2f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", choices=["cost"])
    parser.parse_args()
    cost()
