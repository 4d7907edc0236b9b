"""Finite and virtual elements on the same triangles solve the same problem and approach each other."""

from __future__ import annotations

import numpy as np
from helpers_fem import SOLID, Float, grid, make_system, rates

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control

SUPPORTS = (Prescribed("left", 0), Prescribed("left", 1), Prescribed("tip", 1, -0.4))
POINTS = {"a": (1.0, 0.5), "b": (2.0, 1.0), "c": (1.0, 1.0)}


def cantilever(n: int) -> PolygonMesh:
    """Triangles on [0, 2] x [0, 1], fixed at the left and pushed down at the whole right side."""
    mesh, _ = split_quadrilaterals(grid(2 * n, n, length=2.0))
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    left = mesh.edges.vertices_ev[(ends[..., 0] == 0.0).all(axis=1)]
    right = mesh.edges.vertices_ev[(ends[..., 0] == 2.0).all(axis=1)]
    return PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c,
        named_edges={"left": left, "tip": right},
        named_points={name: mesh.find_vertex(*x) for name, x in POINTS.items()},
        region_names=mesh.region_names,
    )  # fmt: skip


def displacements(n: int, method: str) -> tuple[Float, float]:
    """Displacements of three points and the energy at equilibrium."""
    mesh = cantilever(n)
    if method == "fem":
        system = make_system(mesh, SOLID, SUPPORTS)
    else:
        from helpers_system import make_system as make_vem
        from helpers_system import region

        system = make_vem(mesh, region("solid", **SOLID.values), SUPPORTS)
    solver = NewtonSolver(system)
    u, start = system.create_vector(), system.create_vector()
    for load in (0.5, 1.0):
        assert solver.predict(start, Control(load), u)
        result = solver.solve(u)
        assert result.converged
        u.copy(start)
    return system.point_displacements(u, ("a", "b", "c")), result.evaluation.energy


def test_both_approach_each_other() -> None:
    cells = (2, 4, 8)
    differences, energy_differences = [], []
    for n in cells:
        (fem, fem_energy), (vem, vem_energy) = (displacements(n, method) for method in ("fem", "vem"))
        assert np.abs(fem).max() > 0.2
        differences.append(float(np.abs(fem - vem).max()))
        energy_differences.append(abs(fem_energy - vem_energy) / fem_energy)
    sizes = [1.0 / n for n in cells]
    assert differences[-1] < 1e-3
    assert energy_differences[-1] < 2e-3
    assert rates(sizes, differences).mean() > 1.2
    assert rates(sizes, energy_differences).mean() > 1.0
