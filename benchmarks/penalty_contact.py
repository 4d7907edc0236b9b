"""The box with and without the interior penalty: the measurements behind docs/interior-penalty.md.

    python benchmarks/penalty_contact.py       # seconds of a Newton iteration, with and without; some minutes

All else is measured, kept and written into the page by ``scripts/refresh-numbers docs/interior-penalty.md``.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from mpi4py import MPI
from projection_contact import TiledBox, Tiles

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.problems import Box
from tmc_vem.problems.materials import Medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.simulation.discretised import discretise
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.support.errors import ConvergenceError
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.interior_penalty import INTERIOR_PENALTIES
from tmc_vem.vem.spaces.element_settings import ElementSettings

REPEATS = 5


class TriangleBox(Box):
    """The box on squares cut in two."""

    def make_mesh(self) -> PolygonMesh:
        """See :meth:`tmc_vem.problems.Box.make_mesh`."""
        return split_quadrilaterals(super().make_mesh())[0]


# By the kind of cells; n = 1 are squares of 0.1 or what has about as many unknowns, n = 2 of 0.05, and so on.
BOXES: dict[str, Callable[[int, Medium], Box]] = {
    "squares": lambda n, medium: Box(cells=(20 * n, 5 * n), medium=medium),
    "triangles": lambda n, medium: TriangleBox(cells=(20 * n, 5 * n), medium=medium),
    "Voronoi": lambda n, medium: Box(cells=(20 * n, 5 * n), medium=medium, cell_kind="voronoi"),
    "bricks": lambda n, medium: TiledBox(tiles=Tiles.bricks(n), medium=medium),
    "hanging nodes": lambda n, medium: Box(cells=(20 * n, 5 * n), medium=medium, medium_refinement=2),
}  # fmt: skip


def _options(kind: str, method: str = "vem", **more: Any) -> RunOptions:
    element, fem = ElementSettings(interior_penalty=kind), FemSettings(interior_penalty=kind)
    return RunOptions(method, element=element, fem=fem, **more)


def box(
    mesh: str, n: int, kind: str, alpha_r: float, gamma: float, method: str = "vem", most: int | None = None
) -> dict[str, Any]:
    """The box at full load, or at the load that was reached.

    Args:
        mesh: of :data:`BOXES`.
        n: how fine it is, see there.
        kind: of the interior penalty.
        alpha_r, gamma: of the medium.
        method: 'vem' or 'fem'.
        most: Newton iterations; a run that takes more counts as one that stops.

    Returns:
        Whether the full load was reached, load, gap, energy of the regulariser in cells and all of it, reaction,
        steps, iterations, jumps, sizes.
    """
    problem = BOXES[mesh](n, Medium(gamma=gamma, alpha_r=alpha_r))
    try:
        result = run(problem, options=_options(kind, method, max_iterations=most))
    except ConvergenceError as error:
        return {"complete": False, "load": 0.0, "reason": str(error)}
    cells = result.checks["regulariser_energy"]
    return {
        "complete": result.complete, "load": result.load, "gap": result.gap, "in_cells": cells,
        "regulariser": cells + result.checks.get("penalty_energy", 0.0), "reaction": result.reaction,
        "steps": result.steps, "iterations": result.newton_iterations,
        "jumps": sum(record.jumped for record in result.history), "n_cells": result.n_cells, "n_dofs": result.n_dofs,
    }  # fmt: skip


def _undeformed(mesh: str, n: int, kind: str) -> tuple[Discretisation, Mat, list[Vec]]:
    """The box before any load, with a matrix and three vectors of its unknowns, all of them 0."""
    system = discretise(BOXES[mesh](n, Medium(gamma=1e-5)), _options(kind), MPI.COMM_SELF)
    return system, system.create_matrix(), [system.create_vector() for _ in range(3)]


def factor(mesh: str, n: int, kind: str) -> dict[str, float]:
    """Unknowns, entries of the tangent and of its factor, and operations of the factorisation, before any load."""
    system, matrix, (u, residual, step) = _undeformed(mesh, n, kind)
    system.residual(u, residual)
    system.jacobian(u, matrix)
    solver = LinearSolver(matrix, MPI.COMM_SELF)
    solver.solve(residual, step)
    made = solver.ksp.getPC().getFactorMatrix()
    entries = int(made.getMumpsInfog(29))  # negative: in millions
    return {
        "n_dofs": float(system.n_dofs), "entries": float(matrix.getInfo()["nz_used"]),
        "factor": float(entries if entries >= 0 else -1e6 * entries), "operations": float(made.getMumpsRinfog(3)),
    }  # fmt: skip


def iteration_seconds(mesh: str, n: int, kind: str) -> dict[str, float]:
    """Unknowns, and median seconds of residual, tangent, and factorisation with solve, before any load."""
    system, matrix, (u, residual, step) = _undeformed(mesh, n, kind)
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
    print(f"{'cells':13} {'dofs':>7} {'':8} {'residual':>9} {'tangent':>9} {'solve':>9} {'iteration':>9}  to none")
    for mesh, n in (*((mesh, 4) for mesh in BOXES), ("squares", 11)):
        whole = {}
        for kind in INTERIOR_PENALTIES:
            found = iteration_seconds(mesh, n, kind)
            parts = [found[name] for name in ("residual", "tangent", "solve")]
            whole[kind] = sum(parts)
            times = " ".join(f"{1e3 * part:6.1f} ms" for part in (*parts, whole[kind]))
            ratio = whole[kind] / whole["none"]
            print(f"{mesh:13} {found['dofs']:7.0f} {kind:8} {times}  {ratio:.2f}", flush=True)


if __name__ == "__main__":
    cost()
