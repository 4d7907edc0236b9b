"""A block that is pressed on a rigid base and pushed: what it gains to solve a step again with friction of its end.

    python benchmarks/friction_block.py

The second solution takes the slip systems of the state that the first one has found, and counts slip from the beginning
of the step as before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.solve.newton import NewtonOptions, NewtonSolver
from tmc_vem.support.distributed import Vec
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.histories import History
from tmc_vem.vem.friction import BlockFriction
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]

GAP, HEIGHT, PUSH = 0.05, 0.3, 0.04
PRESSED = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.97, 0.99, 1.0)
STEPS, SOLUTIONS = (20, 40, 80), (1, 2)


def block() -> PolygonMesh:
    """Eight columns of cells, two rows of medium below three of solid."""
    heights = np.concatenate([np.linspace(0.0, GAP, 3), np.linspace(GAP, HEIGHT, 4)[1:]])
    rectangles = [Rectangle("medium", 0.0, 1.0, 0.0, GAP), Rectangle("solid", 0.0, 1.0, GAP, HEIGHT)]
    mesh = structured_quadrilaterals(np.linspace(0.0, 1.0, 9), heights, rectangles)
    border = mesh.edges.vertices_ev[mesh.edges.n_cells_e == 1]
    y = mesh.points_vx[border][..., 1]
    edges = {name: border[(np.abs(y - at) < 1e-9).all(axis=1)] for name, at in (("base", 0.0), ("top", HEIGHT))}
    return replace(mesh, named_edges=edges)


def system() -> VemSystem:
    """The block, K = 20 and mu = 10, on a medium with friction 0.3."""
    medium = Medium(gamma=1e-5, alpha_r=0.1, beta=5.0, regulariser="huhu_lulu", friction=0.3)
    regions = {"solid": solid_region(Material(K=20.0, mu=10.0)), "medium": medium_region(medium, 10.0)}
    press, push = History(((0.0, 0.0), (1.0, 1.0), (3.0, 1.0))), History(((0.0, 0.0), (1.0, 0.0), (2.0, 1.0)))
    supports = (
        Prescribed("base", 0), Prescribed("base", 1), Prescribed("top", 0, PUSH, push),
        Prescribed("top", 1, -0.0502, press),
    )  # fmt: skip
    settings = ElementSettings()
    kernels = {name: _kernels(name, region, settings) for name, region in regions.items()}
    return VemSystem(distribute(MPI.COMM_WORLD, block), kernels, supports, settings)


def push(n_steps: int, solutions: int) -> dict[str, float]:
    """R_t / R_n at the end, and Newton iterations of all solutions.

    Raises:
        RuntimeError: a step has failed.
    """
    held = system()
    solver = NewtonSolver(held, NewtonOptions(max_iterations=60))
    start, u, end, iterations, ratio = held.create_vector(), held.create_vector(), held.create_vector(), 0, 0.0
    for load in (*PRESSED, *(1.0 + k / n_steps for k in range(1, n_steps + 1))):
        reached = [list(_shear(part, held.nodal_values(start))) for part in held._friction]
        if not solver.predict(start, Control(load), u):
            raise RuntimeError(f"no predictor at {load:g}")
        for number in range(solutions):
            if number:
                u.copy(end)
                for part, shear in zip(held._friction, reached, strict=True):
                    _freeze_at(part, held, start, end, shear)
            result = solver.solve(u)
            iterations += len(result.iterations)
            if not result.converged or result.residual is None:
                raise RuntimeError(f"no convergence at {load:g}: {result.reason}")
        forces = [held.reaction(result.residual, "top", i) for i in (0, 1)]
        ratio = forces[0] / -forces[1]
        held.advance(u)
        u.copy(start)
    return {"ratio": ratio, "iterations": iterations}


def _shear(part: BlockFriction, u_ni: Float) -> Iterator[Float]:
    return (states.response.tau for states in part.states(u_ni))


def _freeze_at(part: BlockFriction, held: VemSystem, start: Vec, end: Vec, reached: list[Float]) -> None:
    """Slip systems of ``end``, from whose deformation slip is not counted, with the shear reached at ``start``."""
    before, after = (list(part._points(held.nodal_values(u))) for u in (start, end))
    for (chosen, begun), (_, found), tau_cq in zip(before, after, reached, strict=True):
        slip = part.law.slip_system(found.F_cqij, found.parameters, tau_cq)
        AH = np.einsum("cqij,cqij->cq", slip.A_ij, begun.F_cqij - np.eye(2))
        part._freeze(chosen, replace(slip, AH=AH))


if __name__ == "__main__":
    for n_steps in STEPS:
        for solutions in SOLUTIONS:
            ratio, iterations = push(n_steps, solutions)
            print(
                f"{n_steps} steps, solved {solutions} times: R_t / R_n = {ratio:.5f}, {iterations} iterations",
                flush=True,
            )
