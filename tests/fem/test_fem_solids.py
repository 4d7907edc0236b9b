"""All solids by name side by side: both methods are one on rectangles, and derivatives are right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from helpers_fem import grid, make_system, rates, wavy
from helpers_system import interpolate
from helpers_system import make_system as make_vem

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Material
from tmc_vem.problems.base import RegionEnergy, solid_region
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.vem.blocks import RegionKernel
from tmc_vem.vem.kernel.cells import compile_cells
from tmc_vem.vem.spaces.element_settings import ElementSettings

MATERIALS = {
    "mooney": Material(model="mooney_rivlin", volumetric="simo_taylor", c10=0.5, c01=0.1, nu=0.3),
    "yeoh": Material(model="yeoh", volumetric="quadratic", mu=1.2, c2=-0.05, c3=0.01, nu=0.3),
    "gent": Material(model="gent", mu=1.2, J_m=3.0, nu=0.3),
    "arruda": Material(model="arruda_boyce", mu=1.2, lambda_m=1.5, nu=0.3),
    "venant": Material(model="saint_venant_kirchhoff", E=3.0, nu=0.3),
}
REGIONS: dict[str, RegionEnergy] = {name: solid_region(material) for name, material in MATERIALS.items()}
SUPPORTS = (Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 1, -0.2))
STEPS = [2.0**-n for n in range(3, 7)]


def columns(distort: float = 0.0) -> PolygonMesh:
    """A column of two cells for each solid, bonded to its neighbours."""
    n = len(REGIONS)
    mesh = grid(n, 2, length=float(n), distort=distort)
    ends = mesh.points_vx[mesh.edges.vertices_ev, 1]
    named = {name: mesh.edges.vertices_ev[(ends == y).all(axis=1)] for name, y in (("bottom", 0.0), ("top", 1.0))}
    points = {name: n_column + n + 1 for n_column, name in enumerate(REGIONS)}  # of the middle row, from the left
    return PolygonMesh(
        mesh.points_vx,
        mesh.cell_offsets,
        mesh.cell_vertices,
        np.arange(mesh.n_cells) % n,
        tuple(REGIONS),
        points,
        named,
    )


def kernels() -> dict[str, RegionKernel]:
    compiled = {name: compile_cells(region.integrand) for name, region in REGIONS.items()}
    return {name: RegionKernel(of, of.parameter_array(REGIONS[name].values)) for name, of in compiled.items()}


def pressed(system: Any) -> tuple[Any, Any]:
    """Displacements of the columns' points and the evaluation where the top is pressed down."""
    solver = NewtonSolver(system)
    u, start = system.create_vector(), system.create_vector()
    assert solver.predict(start, Control(1.0), u)
    result = solver.solve(u)
    assert result.converged
    return system.point_displacements(u, tuple(REGIONS)), result.evaluation


def test_virtual_and_finite_elements_agree_in_all_digits() -> None:
    fem, by_fem = pressed(make_system(columns(), REGIONS, SUPPORTS, quadrature=6))
    vem, by_vem = pressed(make_vem(columns(), kernels(), SUPPORTS))
    assert np.abs(fem).max() > 0.05
    np.testing.assert_allclose(vem, fem, rtol=0, atol=1e-10)
    energies = {name: (by_vem.regions[name].energy, by_fem.regions[name].energy) for name in REGIONS}
    for name, (found, expected) in energies.items():
        assert found > 1e-3, name
        assert found == pytest.approx(expected, rel=1e-9), name
    assert by_vem.energy == pytest.approx(sum(found for found, _ in energies.values()), rel=1e-12)


@pytest.mark.parametrize("order", [2, 3])
def test_taylor(order: int) -> None:
    """Remainders of the energy fall with order 2 and 3, in each of the solids."""
    system = make_vem(columns(distort=0.2), kernels(), (), ElementSettings(order=order))
    u, du = interpolate(system, wavy), system.create_vector()
    du.getArray()[:] = np.random.default_rng(3).uniform(-0.01, 0.01, du.getLocalSize())
    gradient, action = system.create_vector(), system.create_vector()
    matrix = system.create_matrix()
    start = system.residual(u, gradient)
    system.jacobian(u, matrix)
    matrix.mult(du, action)
    slope, curvature = gradient.dot(du), action.dot(du)
    first, second = remainders(system.energy, u, du, start.energy, slope, curvature)
    assert rates(STEPS, first)[-1] == pytest.approx(2.0, abs=0.1)
    assert rates(STEPS, second)[-1] > 2.8  # a wrong tangent leaves 2


def remainders(
    energy: Callable[[Any], Any], u: Any, du: Any, start: float, slope: float, curvature: float
) -> tuple[list[float], list[float]]:
    """Of expansions to first and second order, for each step."""
    trial, first, second = u.duplicate(), [], []
    for step in STEPS:
        trial.waxpy(step, du, u)
        change = energy(trial).energy - start
        first.append(abs(change - step * slope))
        second.append(abs(change - step * slope - 0.5 * step**2 * curvature))
    return first, second
