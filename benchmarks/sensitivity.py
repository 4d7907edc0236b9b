"""What derivatives by the stiffness of every cell of a design cost, against one solve with the factors at hand and one
residual.

    python benchmarks/sensitivity.py [cells]

A cantilever of a solid in third medium, squares on a grid and Voronoi cells, bent by a prescribed displacement. Both
sides begin with the tangent assembled and factorised: a gradient is the adjoint field of a result, and derivatives by
the stiffnesses of all cells. Processor seconds on one core.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from functools import partial

import numpy as np
from harness import interleaved, report
from numpy.typing import NDArray

from tmc_vem import RunOptions
from tmc_vem.problems.description import ProblemTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.sensitivity.equilibrium import Equilibrium
from tmc_vem.sensitivity.functionals import Functionals
from tmc_vem.sensitivity.gradient import Gradients
from tmc_vem.simulation.simulation import Simulation, prepare
from tmc_vem.support.distributed import Vec
from tmc_vem.support.validation import build
from tmc_vem.system.control import Control

Float = NDArray[np.float64]

CELLS = 10_000
RESULTS = ("reaction", "energy", "p_norm.von_mises.design")
WANTED = 1.3
COLUMNS = ("cells", "number", "result", "solve", "residual", "all cells alone", "gradient", "ratio")
TEXT = """
name = "cantilever"
shapes.frame = {{ rectangle = [0, 0, 2, 1] }}
mesh = {{ cells = "{cells}", size = {size} }}
points.tip = [2, 0.5]
edges.left = {{ line = [[0, 0], [0, 1]] }}
support = [{{ at = "left", ux = 0, uy = 0 }}]
load = {{ at = "tip", uy = -0.02 }}
[regions.design]
shape = "frame"
stiffness = 0.5
solid = {{ E = 100, nu = 0.3 }}
medium = {{ gamma = 1e-4, alpha_r = 1e-2, regulariser = "huhu_lulu", beta = 5 }}
"""
KINDS = {"grid": 1.0, "voronoi": 0.985}  # size of cells by that of squares, for about equally many


def prepared(kind: str, n_cells: int) -> tuple[Simulation, Vec]:
    """The cantilever, and a state of it that was solved for."""
    size = 0.5 * KINDS[kind] / round(float(np.sqrt(0.125 * n_cells)))  # squares with a corner at the tip
    table = build(ProblemTable, tomllib.loads(TEXT.format(cells=kind, size=size)), "cantilever")
    simulation = prepare(OwnProblem(table), None, RunOptions(steps=1, snapshots=0))
    result = simulation.go()
    assert result.complete, result.reason
    return simulation, result.end.give(simulation.system)


def main(n_cells: int) -> None:
    """Print a table and write it."""
    rows = []
    for kind in KINDS:
        simulation, u = prepared(kind, n_cells)
        system, solver, problem = simulation.system, simulation.solver, simulation.problem
        equilibrium = Equilibrium(solver, system, u, Control(1.0))
        functionals = {name: Functionals(problem, system).of(name) for name in RESULTS}
        rhs, out = system.create_vector(), system.create_vector()
        rhs.setRandom()

        def gradient(name: str) -> Float:
            made = Gradients(problem, equilibrium, dict(functionals))  # noqa: B023
            return made.by_stiffness(made.sensitivity(name), ("design",))

        def kernel() -> None:
            for _ in system.parameter_derivatives(u, rhs):  # noqa: B023
                pass

        work: dict[str, Callable[[], object]] = {name: partial(gradient, name) for name in RESULTS}
        work |= {"solve": partial(solver.correction, rhs, out), "kernel": kernel}
        work["residual"] = partial(system.residual, u, system.create_vector())
        best = {name: samples.best for name, samples in interleaved(work).items()}
        whole = best["solve"] + best["residual"]
        for name in RESULTS:
            times = [f"{1e3 * best[part]:.1f} ms" for part in ("solve", "residual", "kernel", name)]
            rows.append((kind, str(system.n_cells_global), name, *times, f"{best[name] / whole:.2f}"))
    title = f"Derivatives by all stiffnesses; wanted at most {WANTED} of a solve and a residual"
    report("sensitivity", title, COLUMNS, rows, {"columns": COLUMNS, "rows": rows})


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else CELLS)
