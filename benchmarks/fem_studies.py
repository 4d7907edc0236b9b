"""Studies of the finite element path on the box; prints the tables of docs/fem.md.

usage: python benchmarks/fem_studies.py STUDY...
STUDY is one of linear, coercivity, eta, regulariser, quadrature, table2, convergence
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from tmc_vem.fem.system import FemSystem
from tmc_vem.problems import Box, Medium
from tmc_vem.report.richardson import extrapolate
from tmc_vem.simulation import compile_region
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import TmcError
from tmc_vem.system.fem_settings import FemSettings

PAPER_FEM = {
    (10.0, 1e-4): "8.269e-3", (10.0, 1e-5): "2.033e-3", (10.0, 1e-6): "suspect",
    (1.0, 1e-4): "8.044e-3", (1.0, 1e-5): "2.005e-3", (1.0, 1e-6): "4.997e-4",
    (0.1, 1e-4): "7.973e-3", (0.1, 1e-5): "1.989e-3", (0.1, 1e-6): "no convergence",
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """State at full load, or where it stopped and why."""

    gap: float
    load: float
    n_dofs: int
    steps: int
    iterations: int
    seconds: float
    system: Any
    u: Any

    @property
    def shown(self) -> str:
        """Gap for a table."""
        return f"{self.gap:.4e}" if self.load == 1.0 else f"stops at {100 * self.load:.0f} % of the load"


def solve(problem: Box, system: Any) -> Outcome:
    """Load the box up to the end."""
    start = time.perf_counter()
    count = [0, 0]

    def on_step(step: Any, *_: Any) -> None:
        count[0] += 1
        count[1] += len(step.newton.iterations) + step.wasted_iterations

    u = system.create_vector()
    outcome = LoadStepper(NewtonSolver(system), SteppingOptions(smallest=1e-3), on_step).run(u)
    names = ("flange_top", "flange_bottom")
    top, bottom = system.point_coordinates(names) + system.point_displacements(u, names)
    gap = float(np.hypot(*(top - bottom)))
    return Outcome(gap, outcome.load, system.n_dofs, *count, time.perf_counter() - start, system, u)


def fem_system(problem: Box, **settings: Any) -> FemSystem:
    """Finite elements for the box."""
    regions, conditions = problem.regions(), problem.prescribed()
    return FemSystem(MPI.COMM_WORLD, problem.make_mesh, regions, conditions, FemSettings(**settings))


def fem(cells: tuple[int, int], medium: Medium, **settings: Any) -> Outcome:
    """Box with finite elements."""
    problem = Box(cells=cells, medium=medium)
    return solve(problem, fem_system(problem, **settings))


def vem(cells: tuple[int, int], medium: Medium) -> Outcome:
    """Box with virtual elements."""
    from tmc_vem.mesh.spread.distribute import distribute
    from tmc_vem.vem.system import RegionKernel, VemSystem

    problem = Box(cells=cells, medium=medium)
    kernels = {name: RegionKernel(*compile_region(region)) for name, region in problem.regions().items()}
    return solve(problem, VemSystem(distribute(MPI.COMM_WORLD, problem.make_mesh), kernels, problem.prescribed()))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a Markdown table, row by row as they come."""
    print("\n| " + " | ".join(head) + " |\n|" + "---|" * len(head), flush=True)
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)


def eta() -> None:
    """Gap against the penalty factor."""
    medium = Medium(gamma=1e-5, alpha_r=1.0)

    def row(factor: float) -> list[str]:
        runs = [
            fem((20, 10), medium, interior_penalty=mode, eta=factor, triangles=triangles).shown
            for mode in ("penalty", "full")
            for triangles in (False, True)
        ]
        return [f"{factor:g}", *runs]

    head = ["eta", "penalty, Q2", "penalty, P2", "full, Q2", "full, P2"]
    table(head, map(row, (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)))


def regulariser() -> None:
    """Energy of the regulariser under refinement, facet terms included, and the gap beside it."""
    uy, medium = -0.5, Medium(gamma=1e-5, alpha_r=1.0)
    doubled = Medium(gamma=1e-5, alpha_r=2.0)

    def row(mode: str, triangles: bool) -> list[str]:
        energies = []
        for n in (1, 2, 4):
            problem = Box(cells=(20 * n, 5 * n), medium=medium, uy=uy)
            run = solve(problem, fem_system(problem, interior_penalty=mode, triangles=triangles))
            more = Box(cells=problem.cells, medium=doubled, uy=uy)
            other = fem_system(more, interior_penalty=mode, triangles=triangles)
            difference = (
                other.energy(run.u).regions["medium"].energy - run.system.energy(run.u).regions["medium"].energy
            )
            energies.append(f"{difference:.3e}" if run.load == 1.0 else run.shown)
        return [mode, "P2" if triangles else "Q2", *energies]

    head = ["second gradient", "element", "20 x 5", "40 x 10", "80 x 20"]
    table(head, (row(mode, triangles) for mode in ("none", "penalty", "full") for triangles in (False, True)))


def quadrature() -> None:
    """Gap against the degree of the quadrature."""
    medium = Medium(gamma=1e-5, alpha_r=1.0)

    def row(degree: int) -> list[str]:
        def run(triangles: bool) -> str:
            try:
                outcome = fem((40, 10), medium, quadrature=degree, triangles=triangles)
            except TmcError as error:
                return str(error)
            return outcome.shown if outcome.load < 1.0 else f"{outcome.shown} ({outcome.iterations} iterations)"

        return [str(degree), run(False), run(True)]

    table(["degree", "Q2", "P2"], map(row, (2, 3, 4, 5, 6, 8)))


def table2() -> None:
    """The nine pairs of Table 2 on a fine mesh of Q2."""

    def row(pair: tuple[float, float]) -> list[str]:
        run = fem((80, 20), Medium(alpha_r=pair[0], gamma=pair[1]))
        paper = PAPER_FEM[pair]
        deviation = f"{100 * (run.gap / float(paper) - 1):+.2f} %" if paper[0].isdigit() else "-"
        effort = [str(run.steps), str(run.iterations), f"{run.seconds:.0f}"]
        return [f"{pair[0]:g}", f"{pair[1]:g}", run.shown, paper, deviation, *effort]

    head = ["alpha_r", "gamma", "gap", "paper's FEM", "difference", "steps", "Newton iterations", "seconds"]
    table(head, map(row, PAPER_FEM))


def convergence() -> None:
    """Mesh-converged gaps of both methods, with uncertainty."""
    meshes = (2, 4, 8)

    def row(pair: tuple[float, float], method: str) -> list[str]:
        run = functools.partial(fem if method == "FEM" else vem, medium=Medium(alpha_r=pair[0], gamma=pair[1]))
        gaps = [run((20 * n, 5 * n)).gap for n in meshes]
        limit = extrapolate([1.0 / n for n in meshes], gaps)
        return [f"{pair[0]:g}", f"{pair[1]:g}", method, *(f"{gap:.4e}" for gap in gaps), str(limit)]

    pairs = ((1.0, 1e-4), (1.0, 1e-5), (10.0, 1e-4))
    head = ["alpha_r", "gamma", "method", *(f"{20 * n} x {5 * n}" for n in meshes), "extrapolated"]
    table(head, (row(pair, method) for pair in pairs for method in ("FEM", "VEM")))


def linear() -> None:
    """Errors on the manufactured linear problem of the tests: natural norm and first gradient, with rates."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "fem"))
    from test_fem_penalty import solve_linear

    meshes = (4, 8, 16, 32)

    def row(mode: str, triangles: bool) -> list[str]:
        errors = np.array([solve_linear(n, mode, triangles) for n in meshes])
        rates = np.log2(errors[:-1] / errors[1:])[-1]
        shown = [f"{natural:.3g} / {gradient:.3g}" for natural, gradient in errors]
        return [mode, "P2" if triangles else "Q2", *shown, f"{rates[0]:.2f} / {rates[1]:.2f}"]

    head = ["second gradient", "element", *(f"{n} x {n}" for n in meshes), "last rate"]
    table(head, (row(mode, triangles) for mode in ("none", "penalty", "full") for triangles in (False, True)))


def coercivity() -> None:
    """Negative eigenvalues of the regulariser's form alone at F = I, with 'full', on 6 x 6 cells with u = 0 around."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "fem"))
    from helpers_fem import CLAMPED, grid, make_system

    from tmc_vem.energy import Energy
    from tmc_vem.energy import kinematics as kin
    from tmc_vem.problems.base import RegionEnergy

    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        return p.gamma * p.alpha_r * kin.squared_norm(kin.all_second_gradients(G)) / 2

    energy = Energy("second_gradient", density, ("gamma", "alpha_r"))
    region = RegionEnergy(energy, {"gamma": 1.0, "alpha_r": 1.0}, is_medium=True)

    def negative(factor: float, triangles: bool) -> str:
        settings = {"interior_penalty": "full", "triangles": triangles, "eta": factor}
        system = make_system(grid(6, 6), region, CLAMPED, **settings)
        matrix = system.create_matrix()
        system.jacobian(system.create_vector(), matrix)
        n = system.n_dofs
        free = np.setdiff1d(np.arange(n), system.constrained())
        values = np.linalg.eigvalsh(np.array(matrix.getValues(range(n), range(n)))[np.ix_(free, free)])
        return str(int((values < -1e-9 * values[-1]).sum()))

    rows = ([f"{factor:g}", negative(factor, False), negative(factor, True)] for factor in (0.5, 1.0, 1.5, 2.0, 10.0))
    table(["eta", "Q2", "P2"], rows)


STUDIES = {study.__name__: study for study in (linear, coercivity, eta, regulariser, quadrature, table2, convergence)}

if __name__ == "__main__":
    unknown = [name for name in sys.argv[1:] if name not in STUDIES]
    if unknown or not sys.argv[1:]:
        raise SystemExit(__doc__)
    for name in sys.argv[1:]:
        print(f"\n{name}: {STUDIES[name].__doc__}")
        STUDIES[name]()
