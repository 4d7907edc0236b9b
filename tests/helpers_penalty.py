"""The interior penalty in tests: compiled media with energies of sides, and a linear problem of the second gradient."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from helpers_mesh import with_boundary
from helpers_system import CLAMPED, Float, dense, interpolate, make_system

from codegen.integrand import Integrand, second_gradient_energy
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.mesh import PolygonMesh
from tmc_vem.support.petsc import PETSc
from tmc_vem.vem.blocks import RegionKernel
from tmc_vem.vem.facets.compiled import compile_sides
from tmc_vem.vem.kernel.cells import compile_cells
from tmc_vem.vem.spaces.element_settings import ElementSettings

WEIGHT = 0.1  # b of the linear problem; a = 1


def _linear(F: Any, G: Any, p: Any, m: Any) -> Any:
    """a/2 |grad u|^2 + b/2 |grad grad u|^2 with a = gamma and b = gamma alpha_r."""
    H = [F[i][j] - (i == j) for i in (0, 1) for j in (0, 1)]
    second = [G[i][j][k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return p.gamma * (p.a * sum(h * h for h in H) + p.alpha_r * sum(g * g for g in second)) / 2


LINEAR = second_gradient_energy(_linear, "linear", ("a", "gamma", "alpha_r"))


def medium(name: str) -> Integrand:
    """Energy of the registry."""
    energy = DENSITIES[name]
    return second_gradient_energy(energy.density, energy.name, energy.parameters)


@cache
def _cells(integrand: Integrand) -> Any:
    return compile_cells(integrand)


def penalised(integrand: Integrand, values: Mapping[str, float], kind: str, eta: float = 10.0) -> RegionKernel:
    """Compiled energy of a medium, with that of its sides."""
    kernel = _cells(integrand)
    sides = None if kind == "none" else compile_sides("medium", integrand, values, kind, eta)
    return RegionKernel(kernel, kernel.parameter_array(values), sides)


def bricks(n: int) -> PolygonMesh:
    """Rows of squares, each second one shifted by half a square, so that sides have hanging nodes."""
    number: dict[tuple[float, float], int] = {}

    def vertex(x: float, y: float) -> int:
        return number.setdefault((round(x, 9), round(y, 9)), len(number))

    whole = [i / n for i in range(n + 1)]
    shifted = [0.0, *((i + 0.5) / n for i in range(n)), 1.0]
    lines = [whole if row % 2 == 0 else shifted for row in range(n)]
    cells = []
    for row, (low, high) in enumerate(pairwise(whole)):
        for a, b in pairwise(lines[row]):
            below = [x for x in (lines[row - 1] if row else []) if a + 1e-9 < x < b - 1e-9]
            above = [x for x in (lines[row + 1] if row < n - 1 else []) if a + 1e-9 < x < b - 1e-9]
            cells.append(
                [*(vertex(x, low) for x in (a, *below, b)), *(vertex(x, high) for x in (b, *reversed(above), a))]
            )
    return with_boundary(np.array(list(number)), cells)


def named(mesh: PolygonMesh) -> PolygonMesh:
    """The same mesh with its boundary named."""
    return with_boundary(mesh.points_vx, [list(cell) for cell in mesh.cells()])


def triangles(mesh: PolygonMesh) -> PolygonMesh:
    """Quadrilaterals cut in two."""
    halves = [[c[i] for i in half] for c in map(list, mesh.cells()) for half in ((0, 1, 2), (0, 2, 3))]
    return with_boundary(mesh.points_vx, halves)


def amplitude(mesh: PolygonMesh, kind: str, order: int = 2, eta: float | None = None) -> float:
    """Solution over the exact one, sin sin, of the linear problem on the unit square with u = 0 on its boundary.

    The exact solution fulfils the natural conditions of the second gradient, as its normal second derivatives vanish.
    """
    eta = 10.0 * (order - 1) if eta is None else eta
    values = {"a": 1.0, "gamma": 1.0, "alpha_r": WEIGHT}
    system = make_system(mesh, penalised(LINEAR, values, kind, eta), CLAMPED, ElementSettings(order))

    def exact(x: Float) -> Float:
        return np.column_stack([np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1]), 0.0 * x[:, 0]])

    system.set_body_force(lambda x: (2 * np.pi**2 + WEIGHT * 4 * np.pi**4) * exact(x))
    u, residual, matrix = system.create_vector(), system.create_vector(), system.create_matrix()
    system.residual(u, residual)
    residual.getArray()[system.constrained()] = 0.0
    system.jacobian(u, matrix)
    solver = PETSc.KSP().create(comm=system.comm)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    solver.setOperators(matrix)
    solver.solve(residual, u)
    reference = interpolate(system, exact)
    return -u.dot(reference) / reference.dot(reference)


def second_gradient_stiffness(mesh: PolygonMesh, order: int, eta: float) -> Float:
    """Dense tangent of 1/2 |grad grad u|^2 with the full interior penalty at u = 0."""
    values = {"a": 0.0, "gamma": 1.0, "alpha_r": 1.0}
    system = make_system(mesh, penalised(LINEAR, values, "full", eta), (), ElementSettings(order))
    matrix = system.create_matrix()
    system.jacobian(system.create_vector(), matrix)
    return dense(matrix)
