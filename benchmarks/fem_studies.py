"""Measurements of the finite element path: what stands behind the tables of docs/fem.md, which this prints.

    python benchmarks/fem_studies.py STUDY...

STUDY is one of linear, coercivity, eta, regulariser, quadrature, table2, convergence. ``scripts/refresh-numbers
fem-eta`` measures the same, keeps it, and writes it into the page.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from tmc_vem.fem.system import FemSystem
from tmc_vem.problems import Box, Medium
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.errors import TmcError
from tmc_vem.system.fem_settings import FemSettings

TESTS = Path(__file__).resolve().parents[1] / "tests"
Cells = tuple[int, int]


@dataclass(frozen=True)
class State:
    """A system and its last state."""

    system: Any
    u: Any
    outcome: Mapping[str, Any]


def solve(system: Any) -> State:
    """Load the box up to the end, or to where it stops."""
    count = [0, 0]

    def on_step(step: Any, *_: Any) -> None:
        count[0] += 1
        count[1] += len(step.newton.iterations) + step.wasted_iterations

    u = system.create_vector()
    outcome = LoadStepper(NewtonSolver(system), SteppingOptions(smallest=1e-3), on_step).run(u)
    names = ("flange_top", "flange_bottom")
    top, bottom = system.point_coordinates(names) + system.point_displacements(u, names)
    gap = float(np.hypot(*(top - bottom)))
    whole = sum(values.energy for values in system.energy(u).regions.values())
    bending = whole - float(system.cell_energies(u, without="alpha_r").sum())  # in cells and between them
    found = {"gap": gap, "load": outcome.load, "n_dofs": system.n_dofs, "steps": count[0], "iterations": count[1],
             "regulariser": bending}  # fmt: skip
    return State(system, u, found)


def fem_system(problem: Box, **settings: Any) -> FemSystem:
    """Finite elements for the box."""
    regions, conditions = problem.regions(), problem.prescribed()
    return FemSystem(MPI.COMM_WORLD, problem.make_mesh, regions, conditions, FemSettings(**settings))


def fem(cells: Cells, alpha_r: float, gamma: float, **settings: Any) -> Mapping[str, Any]:
    """Box with finite elements: gap, load, energy of the regulariser, steps, iterations."""
    problem = Box(cells=(cells[0], cells[1]), medium=Medium(gamma=gamma, alpha_r=alpha_r))
    try:
        return solve(fem_system(problem, **settings)).outcome
    except TmcError as error:
        return {"error": str(error)}


def regulariser_energy(cells: Cells, mode: str, triangles: bool) -> float:
    """What of the medium's energy at u_y = -0.5 is proportional to alpha_r, facet terms included."""
    energies = []
    u = None
    for alpha_r in (1.0, 2.0):
        problem = Box(cells=(cells[0], cells[1]), medium=Medium(gamma=1e-5, alpha_r=alpha_r), uy=-0.5)
        system = fem_system(problem, interior_penalty=mode, triangles=triangles)
        if u is None:
            state = solve(system)
            assert state.outcome["load"] == 1.0
            u = state.u
        energies.append(system.energy(u).regions["medium"].energy)
    return float(energies[1] - energies[0])


def linear_errors(n: int, mode: str, triangles: bool) -> tuple[float, float]:
    """Errors on the manufactured linear problem of the tests: natural norm and first gradient."""
    _with_tests()
    from test_fem_penalty import solve_linear

    natural, gradient = solve_linear(n, mode, triangles)
    return float(natural), float(gradient)


def negative_eigenvalues(eta: float, triangles: bool) -> int:
    """Negative eigenvalues of the regulariser's form alone at F = I, with 'full', on 6 x 6 cells with u = 0 around."""
    _with_tests()
    from helpers_fem import CLAMPED, grid, make_system

    from tmc_vem.energy import Energy
    from tmc_vem.energy import kinematics as kin
    from tmc_vem.problems.base import RegionEnergy

    def density(F: Any, G: Any, p: Any, m: Any) -> Any:
        return p.gamma * p.alpha_r * kin.squared_norm(kin.all_second_gradients(G)) / 2

    energy = Energy("second_gradient", density, ("gamma", "alpha_r"))
    region = RegionEnergy(energy, {"gamma": 1.0, "alpha_r": 1.0}, is_medium=True)
    system = make_system(grid(6, 6), region, CLAMPED, interior_penalty="full", triangles=triangles, eta=eta)
    matrix = system.create_matrix()
    system.jacobian(system.create_vector(), matrix)
    n = system.n_dofs
    free = np.setdiff1d(np.arange(n), system.constrained())
    values = np.linalg.eigvalsh(np.array(matrix.getValues(range(n), range(n)))[np.ix_(free, free)])
    return int((values < -1e-9 * values[-1]).sum())


def _with_tests() -> None:
    for path in (TESTS, TESTS / "fem"):
        if str(path) not in sys.path:
            sys.path.insert(0, str(path))


if __name__ == "__main__":
    from pages.fem import BLOCKS
    from pages.study import main

    main(__doc__, BLOCKS, "fem-")
