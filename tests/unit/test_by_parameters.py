"""Derivatives with respect to parameters: of energies at points, of cells, and what cells do with given stresses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_mesh import grid, voronoi
from helpers_penalty import bricks
from helpers_system import CLAMPED, interpolate, make_system, rates

from codegen.by_parameters import compile_by_parameters
from codegen.integrand import second_gradient_energy
from codegen.kernel import GRADIENT, Kernel, compiled
from codegen.sampling import REGIMES, sample
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.support.errors import InputError
from tmc_vem.system.point_states import PointStates
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.system import VemSystem

STEPS = (1e-2, 5e-3, 2.5e-3)
MEDIUM = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser="angle")
MESHES = {"squares": lambda: grid(4, 3), "voronoi": lambda: voronoi(23), "hanging": lambda: bricks(3)}


def remainders(value: Callable[[float], Any], slope: Any) -> list[float]:
    """How far central differences with each step are from a slope: a remainder of order 2."""
    return [float(np.linalg.norm((value(h) - value(-h)) / (2 * h) - slope)) for h in STEPS]


def falls_squared(found: list[float], size: float) -> bool:
    """Whether remainders fall with the square of the step, or are rounding: of what is linear."""
    return max(found) < 1e-11 * size or bool((rates(STEPS, found) > 1.9).all())


@pytest.mark.parametrize("name", sorted(DENSITIES))
def test_point_derivatives_are_those_of_the_kernel(name: str) -> None:
    energy = DENSITIES[name]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    values = {parameter: 0.5 + 0.3 * n for n, parameter in enumerate(integrand.parameter_names)}
    kernel, derivatives = Kernel(compiled(integrand), integrand), compile_by_parameters(integrand)
    rng = np.random.default_rng(3)
    x_nx = sample(REGIMES[0], 19, rng, 60.0)
    y_nx, array = rng.normal(size=x_nx.shape), kernel.parameter_array(values)
    e_nk, r_nk = derivatives.by_parameters(x_nx, y_nx, array)
    for k, value in enumerate(array):

        def at(h: float, k: int = k, value: float = value) -> tuple[Any, Any]:
            changed = array.copy()
            changed[k] += h * value
            psi, g, _ = kernel.points(GRADIENT, x_nx, changed)
            assert g is not None
            return psi / value, (g * y_nx).sum(axis=1) / value

        for part, exact in ((0, e_nk[:, k]), (1, r_nk[:, k])):
            size = float(np.linalg.norm(at(0.0)[part])) + 1.0
            assert falls_squared(remainders(lambda h, part=part: at(h)[part], exact), size)


def test_point_derivatives_are_exact_near_the_undeformed_state() -> None:
    """Centred forms: of a solid at strains of 1e-9 the mixed derivative keeps all digits."""
    integrand = solid_region(Material(E=2.0, nu=0.3)).integrand
    derivatives = compile_by_parameters(integrand)
    x_nx = np.zeros((1, 12))
    x_nx[0, :4] = (1e-9, 2e-9, -1e-9, 3e-9)
    y_nx = np.zeros((1, 12))
    y_nx[0, 0] = 1.0
    names = integrand.parameter_names
    _, r_nk = derivatives.by_parameters(x_nx, y_nx, np.ones(len(names)))
    trace, e11 = 4e-9, 1e-9
    assert r_nk[0, names.index("K")] == pytest.approx(trace, rel=1e-8)
    assert r_nk[0, names.index("mu")] == pytest.approx(2 * (e11 - trace / 3), rel=1e-8)


def regions(graded: bool) -> dict[str, RegionEnergy]:
    """A solid, and a medium whose gamma may vary from cell to cell."""
    by = {"gamma": "gamma * (1 + x)"} if graded else None
    return {"left": solid_region(Material(E=2.0, nu=0.3)), "right": medium_region(MEDIUM, 1.3, None, by)}


def system_of(mesh: PolygonMesh, of: Mapping[str, RegionEnergy]) -> VemSystem:
    centre = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    two = replace(mesh, region_c=(centre[:, 0] > 0.5).astype(np.int64), region_names=("left", "right"))
    settings = ElementSettings()
    return make_system(two, {name: _kernels(name, region, settings) for name, region in of.items()}, CLAMPED, settings)


def wavy(x: Any) -> Any:
    return 0.1 * np.stack([np.sin(2.0 * x[:, 0] + x[:, 1]), np.cos(x[:, 0] - 2.5 * x[:, 1])], axis=1)


def other(x: Any) -> Any:
    return np.stack([x[:, 0] ** 2 - x[:, 1], np.sin(3.0 * x[:, 0]) + x[:, 0] * x[:, 1]], axis=1)


@pytest.mark.parametrize("graded", [False, True], ids=["uniform", "graded"])
@pytest.mark.parametrize("mesh", sorted(MESHES))
def test_cell_derivatives_are_those_of_energy_and_residual(mesh: str, graded: bool) -> None:
    system = system_of(MESHES[mesh](), regions(graded))
    u, adjoint, out = interpolate(system, wavy), interpolate(system, other), system.create_vector()
    found: dict[str, Any] = {"left": 0.0, "right": 0.0}
    names = {}
    for part in system.parameter_derivatives(u, adjoint):
        assert part.energy_ck.shape == part.residual_ck.shape == (len(part.cells), len(part.names))
        names[part.region] = part.names
        found[part.region] = found[part.region] + np.stack([part.energy_ck.sum(0), part.residual_ck.sum(0)])
    for region, of in regions(graded).items():
        for name, value in of.values.items():
            if graded and name == "gamma":
                continue  # by cells, below

            def at(h: float, region: str = region, name: str = name, value: float = value) -> Any:
                system.set_parameters({f"{region}.{name}": value * (1 + h)})
                energy = system.residual(u, out).energy
                return np.array([energy, out.dot(adjoint)]) / value

            size = float(np.linalg.norm(at(0.0)))
            assert falls_squared(remainders(at, found[region][:, names[region].index(name)]), size), (region, name)
            at(0.0)


def test_factors_of_cells_change_residual_and_tangent_as_derivatives_say() -> None:
    system = system_of(voronoi(23), regions(graded=True))
    u, adjoint, out = interpolate(system, wavy), interpolate(system, other), system.create_vector()
    matrix = system.create_matrix()
    system.jacobian(u, matrix)
    n_cells = system.distributed.mesh.n_cells
    start = np.linspace(1.0, 2.0, n_cells)[:, None]
    system.set_factors("right", start)
    direction = np.random.default_rng(1).normal(size=(n_cells, 1))
    gamma = MEDIUM.gamma
    slope = np.zeros(2)
    for part in system.parameter_derivatives(u, adjoint):
        if part.region == "right":
            k = part.names.index("gamma")
            along = gamma * direction[part.cells, 0]
            slope += (along @ part.energy_ck[:, k], along @ part.residual_ck[:, k])

    def at(h: float) -> Any:
        system.set_factors("right", start + h * direction)
        energy = system.residual(u, out).energy
        return np.array([energy, out.dot(adjoint)])

    assert falls_squared(remainders(at, slope), float(np.linalg.norm(at(0.0))))
    # what went into the matrix before follows
    system.jacobian(u, matrix)
    matrix.assemble()
    fresh = system.create_matrix()
    system._insertion = None
    system.jacobian(u, fresh)
    fresh.assemble()
    fresh.axpy(-1.0, matrix)
    assert fresh.norm() == 0.0
    with pytest.raises(InputError, match="region 'left' has no parameter that varies"):
        system.set_factors("left", start)


@pytest.mark.parametrize("mesh", sorted(MESHES))
def test_stresses_at_points_give_the_residual(mesh: str) -> None:
    system = system_of(MESHES[mesh](), regions(graded=True))
    u, residual, out = interpolate(system, wavy), system.create_vector(), system.create_vector()
    system.residual(u, residual)
    kernels = {name: Kernel(compiled(of.integrand), of.integrand) for name, of in regions(graded=True).items()}

    def forces(points: PointStates) -> tuple[Any, Any]:
        kernel = kernels[points.region]
        n_c, n_q = points.w_cq.shape
        P, T = np.empty((n_c, n_q, 2, 2)), np.empty((n_c, n_q, 2, 2, 2))
        for c in range(n_c):
            values = {name: float(np.ravel(v)[c if np.ndim(v) else 0]) for name, v in points.parameters.items()}
            G = np.zeros((n_q, 2, 2, 2)) if points.G_cqijk is None else points.G_cqijk[c]
            x = np.concatenate(
                [
                    np.swapaxes(points.F_cqij[c] - np.eye(2), 1, 2).reshape(n_q, 4),
                    G.transpose(0, 3, 2, 1).reshape(n_q, 8),
                ],
                axis=1,
            )
            g = kernel.points(GRADIENT, x, kernel.parameter_array(values))[1]
            assert g is not None
            P[c] = np.swapaxes(g[:, :4].reshape(n_q, 2, 2), 1, 2)
            T[c] = g[:, 4:].reshape(n_q, 2, 2, 2).transpose(0, 3, 2, 1)
        return P, (T if points.G_cqijk is not None else None)

    system.add_point_forces(u, forces, out)
    out.axpy(-1.0, residual)
    assert out.norm() < 1e-12 * residual.norm()


def test_tangent_of_some_cells_is_the_rate_of_their_forces() -> None:
    system = system_of(voronoi(23), regions(graded=False))
    u, du, out = interpolate(system, wavy), interpolate(system, other), system.create_vector()
    chosen = np.arange(system.distributed.mesh.n_cells) % 3 == 0
    system.cell_tangent_action(u, du, chosen, out)
    moved = u.duplicate()

    def at(h: float) -> Any:
        moved.waxpy(0.1 * h, du, u)
        return 10.0 * system.internal_forces(moved, chosen).ravel()

    exact = out.getArray().copy()
    assert falls_squared(remainders(at, exact), 1.0)


def test_an_interior_penalty_is_refused() -> None:
    settings = ElementSettings(interior_penalty="full")
    kernels = {name: _kernels(name, of, settings) for name, of in regions(graded=True).items()}
    mesh = grid(4, 3)
    two = replace(mesh, region_c=(np.arange(mesh.n_cells) % 2), region_names=("left", "right"))
    system = make_system(two, kernels, CLAMPED, settings)
    with pytest.raises(InputError, match="interior penalty"):
        system.parameter_derivatives(system.create_vector())
    with pytest.raises(InputError, match="interior penalty"):
        system.set_factors("right", np.ones((mesh.n_cells, 1)))
