"""Recovered stresses: exact for polynomials, apart in every region, of second order and more in solutions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import grid, hanging, voronoi
from helpers_system import CLAMPED, interpolate, make_system, rates, region
from test_vem_convergence import SOLID, manufactured

from codegen.integrand import second_gradient_energy
from codegen.stress import stress_of
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.recovery import Patches, mean_value_coordinates, monomials
from tmc_vem.system.stress import Stresses
from tmc_vem.system.tensors import CAUCHY, DEFORMATION, tensors_of
from tmc_vem.vem.spaces.element_settings import ElementSettings

ENERGY = DENSITIES["solid"]
INTEGRAND = second_gradient_energy(ENERGY.density, ENERGY.name, ENERGY.parameters)


def patches_of(system, order):
    return Patches(Stresses(system, dict.fromkeys(system.regions, INTEGRAND)), system.output_polygons(), order)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("mesh", [voronoi(20), hanging(3)], ids=["voronoi", "hanging"])
def test_gradients_of_polynomials_are_exact_at_nodes_and_inside(mesh, order) -> None:
    system = make_system(mesh, SOLID, (), ElementSettings(order=order))
    u = interpolate(system, lambda x: 0.1 * np.column_stack([x[:, 0] * x[:, 1], x[:, 1] ** order]))
    patches = patches_of(system, order)
    recovered = patches.recovered(u, (DEFORMATION,))

    def F(x):
        return np.column_stack(
            [1 + 0.1 * x[:, 1], 0.1 * x[:, 0], 0.0 * x[:, 0], 1 + 0.1 * order * x[:, 1] ** (order - 1)]
        )

    nodes = system.output_polygons().points_nx[patches.point_k]
    np.testing.assert_allclose(recovered.at_nodes()[DEFORMATION], F(nodes), atol=1e-10)
    np.testing.assert_allclose(recovered.at_vertices()[DEFORMATION], F(patches.centre_px), atol=1e-10)
    inside = np.array([mesh.points_vx[loop].mean(axis=0) for loop in mesh.cells()])
    found = recovered.at(np.arange(len(inside)), inside)[DEFORMATION]
    np.testing.assert_allclose(found, F(inside), atol=1e-10)


def test_nothing_is_recovered_across_an_interface() -> None:
    """Two materials under one gradient: the stress is constant in each, and jumps."""
    mesh = grid(4, 2)
    left = np.array([mesh.points_vx[loop][:, 0].mean() < 0.5 for loop in mesh.cells()])
    mesh = replace(mesh, region_c=np.where(left, 0, 1), region_names=("soft", "stiff"))
    values = {"soft": {"K": 1.0, "mu": 2.0}, "stiff": {"K": 30.0, "mu": 4.0}}
    system = make_system(mesh, {name: region("solid", **value) for name, value in values.items()})
    slope = np.array([[0.1, 0.05], [-0.02, -0.1]])
    patches = patches_of(system, 2)
    found = patches.recovered(interpolate(system, lambda x: x @ slope.T), (CAUCHY,)).at_vertices()[CAUCHY]
    for number, value in enumerate(values.values()):
        P, across = stress_of(INTEGRAND).at((np.eye(2) + slope)[None], None, value)
        expected = tensors_of((np.eye(2) + slope)[None], P, across)[CAUCHY]
        here = patches.region_p == number
        assert here.sum() == 9
        np.testing.assert_allclose(found[here], np.broadcast_to(expected, (9, 4)), atol=1e-10)


@pytest.mark.parametrize("make", [lambda n: voronoi(n * n), hanging], ids=["voronoi", "hanging"])
def test_stress_of_a_solution_converges_with_second_order(make) -> None:
    """The project's bar is 1.8, in the mean square over all nodes, corners included, and at the worst node."""
    displacement, gradient, force = manufactured()
    values = {"K": 5.0 / 3.0, "mu": 5.0 / 14.0}
    found, sizes = [], []
    for n in (4, 8):
        mesh = make(n)
        system = make_system(mesh, SOLID, CLAMPED)
        system.set_body_force(force)
        u = interpolate(system, displacement)
        assert NewtonSolver(system).solve(u).converged
        patches = patches_of(system, 2)
        points = system.output_polygons().points_nx[patches.point_k]
        F = np.eye(2) + gradient(points).reshape(-1, 2, 2)
        expected = tensors_of(F, *stress_of(INTEGRAND).at(F, None, values))[CAUCHY]
        error = patches.recovered(u, (CAUCHY,)).at_nodes()[CAUCHY] - expected
        found.append([np.sqrt((error**2).mean()), np.abs(error).max()])
        sizes.append(mesh.n_cells**-0.5)
    found = np.array(found)
    assert rates(sizes, found[:, 0]).min() > 2.0
    assert rates(sizes, found[:, 1]).min() > 1.6
    assert found[-1, 0] < 2e-3


def test_mean_value_coordinates_are_linear_on_sides_and_reproduce_points() -> None:
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [0.5, 2.0]])
    for point in ([1.0, 0.5], [0.5, 0.1], [1.2, 0.9]):
        weights = mean_value_coordinates(corners, np.array(point))
        assert weights.sum() == pytest.approx(1.0)
        assert weights @ corners == pytest.approx(point)
    assert mean_value_coordinates(corners, np.array([0.5, 0.0])) == pytest.approx([0.75, 0.25, 0, 0, 0])
    assert mean_value_coordinates(corners, corners[3]) == pytest.approx([0, 0, 0, 1, 0])
    # on the line of a side, but not on the side
    beyond = mean_value_coordinates(corners, np.array([0.6, 1.0]))
    assert beyond @ corners == pytest.approx([0.6, 1.0])


def test_monomials() -> None:
    assert monomials(2, np.array([2.0, 3.0])) == pytest.approx([1, 2, 3, 4, 6, 9])
