"""Recovered gradients: exact for polynomials, apart in every region, and nearer to the truth than the cells' own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import grid, hanging, voronoi
from helpers_system import CLAMPED, interpolate, make_system, rates, region
from mpi4py import MPI
from test_vem_convergence import SOLID, manufactured

from codegen.stress import stress_of
from tmc_vem import Box, Material, RunOptions
from tmc_vem.adapt.patches import Patches, PointValues, neighbours
from tmc_vem.adapt.recovery import dual_indicators, energy_indicators, gradient_errors
from tmc_vem.adapt.small_strain import small_strain_stiffness, strain_products
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.materials import Medium
from tmc_vem.sensitivity.equilibrium import Equilibrium
from tmc_vem.sensitivity.functionals_record import Derivative
from tmc_vem.simulation.simulation import prepare
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.control import Control
from tmc_vem.vem.spaces.element_settings import ElementSettings

MESHES = {"voronoi": lambda: voronoi(20), "squares": lambda: grid(4, 3), "hanging": lambda: hanging(3, distort=0.02)}


class Made:
    """What indicators read of a problem."""

    def __init__(self, **regions: RegionEnergy) -> None:
        self._regions = regions

    def regions(self) -> dict[str, RegionEnergy]:
        return self._regions


MADE = Made(domain=solid_region(Material(K=5.0 / 3.0, mu=5.0 / 14.0)))  # that of SOLID


def system_on(mesh, order=2, energies=SOLID, prescribed=()):
    return make_system(mesh, energies, prescribed, ElementSettings(order=order), MPI.COMM_SELF)


def at_points(system, function) -> list[PointValues]:
    """Values (n_cells, n_points, n_components) of a function at a system's quadrature points."""
    numbers = system.cell_numbers()
    return [
        PointValues(numbers[states.cells], states.w_cq, states.X_cqx, function(*np.moveaxis(states.X_cqx, -1, 0)))
        for states in system.point_states(system.create_vector())
    ]


def halved(mesh):
    """The mesh as two regions, left and right of x = 0.5."""
    right = np.array([mesh.points_vx[loop][:, 0].mean() > 0.5 for loop in mesh.cells()])
    return replace(mesh, region_c=right.astype(np.int64), region_names=("left", "right"))


# ---- patches


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("mesh", MESHES)
def test_polynomials_of_the_elements_order_are_recovered(mesh, order) -> None:
    def gradient(x, y):
        return np.stack([1.0 + x**order - x * y ** (order - 1), y**order + 2.0 * x**2, x * y - 0.5], axis=-1)

    mesh = MESHES[mesh]()
    values = at_points(system_on(mesh, order), gradient)
    for some, fitted in zip(values, Patches(mesh, order).fitted(values), strict=True):
        np.testing.assert_allclose(fitted, some.value_cqt, atol=1e-9)
    of_less = Patches(mesh, order - 1).fitted(values)
    assert max(np.abs(fit - some.value_cqt).max() for some, fit in zip(values, of_less, strict=True)) > 1e-3


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("mesh", MESHES)
def test_what_elements_represent_has_no_error(mesh, order) -> None:
    mesh = MESHES[mesh]()
    system = system_on(mesh, order)
    u = interpolate(system, lambda x: 0.1 * np.column_stack([x[:, 0] * x[:, 1], x[:, 1] ** order]))
    for _, dF in gradient_errors(system, mesh, u):
        np.testing.assert_allclose(dF, 0.0, atol=1e-10)
    u = interpolate(system, lambda x: 0.1 * np.column_stack([x[:, 0] * x[:, 1], x[:, 1] ** (order + 1)]))
    assert max(np.abs(dF).max() for _, dF in gradient_errors(system, mesh, u)) > 1e-4


@pytest.mark.parametrize("turned", [False, True])
def test_a_row_of_cells_tells_nothing_of_what_is_across_it(turned) -> None:
    """In a row of three cells x^2 and x y are recovered; of y^2 its mean is all that is left."""
    mesh = grid(1, 3, 1.0, 2.0) if turned else grid(3, 1, 2.0, 1.0)

    def known(x, y):
        along, across = (y, x) if turned else (x, y)
        return np.stack([along**2, x * y, 3.0 * across + along, (across - 0.5) ** 2], axis=-1)

    values = at_points(system_on(mesh), known)
    for some, fitted in zip(values, Patches(mesh, 2).fitted(values), strict=True):
        np.testing.assert_allclose(fitted[..., :3], some.value_cqt[..., :3], atol=1e-10)
        np.testing.assert_allclose(fitted[..., 3], 1.0 / 12.0, atol=1e-10)


@pytest.mark.parametrize("lift", [1e-4, 1e-2, 0.1])
def test_what_a_patch_hardly_tells_is_damped(lift) -> None:
    """One vertex of a row of cells is lifted a little: now projections of y^2 differ a little from all others.

    Values that are just this difference, in mean square 1, are answered by ``1 / sqrt(SEEN)`` at most in any patch;
    what fits them has 12 times to 9000 times their size.
    """
    mesh = grid(3, 1, 3.0, 1.0)
    points = mesh.points_vx.copy()
    points[1, 1] += lift
    mesh = replace(mesh, points_vx=points)
    (of,) = at_points(system_on(mesh), lambda x, y: np.stack([0.0 * x + 1.0, x, y, x * x, x * y, y * y], axis=-1))
    root = np.sqrt(of.w_cq)[..., None]
    bases, values = root * of.value_cqt[..., :3], root * of.value_cqt
    seen = np.concatenate([a @ np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(bases, values, strict=True)])
    rest = seen[:, 5] - seen[:, :5] @ np.linalg.lstsq(seen[:, :5], seen[:, 5], rcond=None)[0]
    alone = (rest / np.linalg.norm(rest)).reshape(root.shape) / root
    (fitted,) = Patches(mesh, 2).fitted([replace(of, value_cqt=alone)])
    assert 0.5 < np.linalg.norm(root * fitted) < 2.0


def test_a_cell_alone_keeps_its_own_polynomial() -> None:
    mesh = grid(1, 1)
    values = at_points(system_on(mesh), lambda x, y: np.stack([x - 2.0 * y, x * x], axis=-1))
    (some,), (fitted,) = values, Patches(mesh, 2).fitted(values)
    np.testing.assert_allclose(fitted[..., 0], some.value_cqt[..., 0], atol=1e-12)
    np.testing.assert_allclose(fitted[..., 1], some.X_cqx[..., 0] - 1.0 / 6.0, atol=1e-12)


def test_a_cell_alone_may_have_few_points() -> None:
    """Three points tell a linear function, and make the Gram matrix of polynomials of degree 2 singular."""
    mesh = PolygonMesh.from_cells([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
    X = np.array([[[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]]) / 6.0
    some = PointValues(np.array([0]), np.full((1, 3), 1.0 / 6.0), X, (X[..., :1] - 3.0 * X[..., 1:]) + 2.0)
    (fitted,) = Patches(mesh, 2).fitted([some])
    np.testing.assert_allclose(fitted, some.value_cqt, atol=1e-9)


def test_not_all_patches_need_be_in_memory_together(monkeypatch) -> None:
    mesh = voronoi(20)
    values = at_points(system_on(mesh), lambda x, y: np.stack([np.sin(3.0 * x), np.cos(x + 2.0 * y)], axis=-1))
    together = Patches(mesh, 2).fitted(values)
    monkeypatch.setattr("tmc_vem.adapt.patches.AT_ONCE", 7)
    for fitted, expected in zip(Patches(mesh, 2).fitted(values), together, strict=True):
        np.testing.assert_allclose(fitted, expected, rtol=1e-12)


def test_large_cells_beside_small_ones_and_places_far_away_do_no_harm() -> None:
    """Cells in many sizes, and a mesh a thousand times its size away from the origin, with polynomials of degree 4."""
    mesh = hanging(4)
    mesh = replace(mesh, points_vx=np.array([1e3, -2e3]) + mesh.points_vx**1.5)
    values = at_points(system_on(mesh, 4), lambda x, y: np.stack([(x - 1e3) ** 4, (x - 1e3) * (y + 2e3) ** 3], axis=-1))
    for some, fitted in zip(values, Patches(mesh, 4).fitted(values), strict=True):
        np.testing.assert_allclose(fitted, some.value_cqt, atol=1e-7)


def test_neighbours_share_a_vertex_and_a_region() -> None:
    mesh = halved(grid(4, 3))
    cell_p, other_p = neighbours(mesh)
    found = set(zip(cell_p.tolist(), other_p.tolist(), strict=True))
    by_hand = {
        (a, b)
        for a in range(12)
        for b in range(12)
        if mesh.region_c[a] == mesh.region_c[b] and set(mesh.cell(a)) & set(mesh.cell(b))
    }
    assert found == by_hand
    assert len(cell_p) == len(found) == 2 * (6 * 6 - 2 * 4)  # of six cells in a region, two do not meet two others
    assert (np.diff(cell_p) >= 0).all()


# ---- errors


def test_jumps_between_regions_are_no_errors() -> None:
    mesh = halved(grid(6, 4))
    one = replace(mesh, region_c=np.zeros_like(mesh.region_c), region_names=("all",))

    def kinked(x):
        return np.column_stack([0.1 * np.abs(x[:, 0] - 0.5) + 0.02 * x[:, 1], 0.2 * np.maximum(x[:, 0] - 0.5, 0.0)])

    for each, jumps in ((mesh, False), (one, True)):
        system = system_on(each)
        largest = max(np.abs(dF).max() for _, dF in gradient_errors(system, each, interpolate(system, kinked)))
        assert (largest > 0.02) if jumps else (largest < 1e-12)


def smooth(mesh, order=2):
    """Solution of a smooth problem of the nonlinear solid; energy norms of its true and its estimated error, and of
    what the estimated one is away from the true one."""
    displacement, gradient, force = manufactured()
    system = system_on(mesh, order, prescribed=CLAMPED)
    system.set_body_force(force)
    u = interpolate(system, displacement)
    assert NewtonSolver(system).solve(u).converged
    D = small_strain_stiffness(MADE.regions()["domain"])
    true = away = 0.0
    for states, dF in gradient_errors(system, mesh, u):
        error = np.eye(2) + gradient(states.X_cqx.reshape(-1, 2)).reshape(dF.shape) - states.F_cqij
        true += 0.5 * strain_products(D, error, error, states.w_cq).sum()
        away += 0.5 * strain_products(D, error - dF, error - dF, states.w_cq).sum()
    estimated = np.linalg.norm(energy_indicators(MADE, system, mesh, u))
    return np.sqrt(true), estimated, np.sqrt(away)


@pytest.mark.parametrize(
    ("make", "sizes", "order", "effectivity"),
    [
        (lambda n: grid(n, n), (8, 16, 32), 2, 1.03),
        (lambda n: voronoi(n * n), (8, 16), 2, 1.05),
        (hanging, (8, 16), 2, 1.12),
        (lambda n: voronoi(n * n), (8, 16), 3, 1.21),
    ],
    ids=["squares", "voronoi", "hanging", "voronoi of order 3"],
)
def test_estimates_tend_to_the_error_of_a_smooth_solution(make, sizes, order, effectivity) -> None:
    """The estimate falls as fast as the error does, and what it is away from it faster by almost an order."""
    meshes = [make(n) for n in sizes]
    found = np.array([smooth(mesh, order) for mesh in meshes])
    widths = [mesh.n_cells**-0.5 for mesh in meshes]
    index = found[:, 1] / found[:, 0]
    assert (np.diff(np.abs(index - 1.0)) < 0.0).all()
    assert index[-1] == pytest.approx(effectivity, abs=0.01)
    assert rates(widths, found[:, 1])[-1] > order - 0.05
    assert rates(widths, found[:, 2])[-1] > order + 0.7


# ---- indicators


def mixed_system(mesh):
    """A solid and a medium with second gradients, side by side, at a state that is no equilibrium."""
    solid, medium = solid_region(Material(K=20.0, mu=10.0)), medium_region(Medium(gamma=0.1, alpha_r=0.2), 10.0)
    problem = Made(left=solid, right=medium)
    energies = {name: region(each.energy.name, **each.values) for name, each in problem.regions().items()}
    system = system_on(mesh, energies=energies)
    u = interpolate(system, lambda x: 0.1 * np.column_stack([np.sin(3.0 * x[:, 0] + x[:, 1]), np.cos(2.0 * x[:, 1])]))
    z = interpolate(system, lambda x: np.column_stack([np.cos(2.0 * x[:, 0]), np.sin(4.0 * x[:, 0] * x[:, 1])]))
    return problem, system, u, z


@pytest.mark.parametrize("mesh", MESHES)
def test_indicators_are_energies_and_products_of_cells(mesh) -> None:
    mesh = halved(MESHES[mesh]())
    problem, system, u, z = mixed_system(mesh)
    numbers, regions = system.cell_numbers(), problem.regions()
    of_u, of_z = (gradient_errors(system, mesh, vector) for vector in (u, z))
    eta, (_, indicators) = energy_indicators(problem, system, mesh, u), dual_indicators(problem, system, mesh, u, z)
    for (states, dF), (_, dZ) in zip(of_u, of_z, strict=True):
        D = small_strain_stiffness(regions[states.region])
        cells = numbers[states.cells]
        assert (mesh.region_c[cells] == mesh.region_names.index(states.region)).all()
        squares = [strain_products(D, error, error, states.w_cq) for error in (dF, dZ)]
        np.testing.assert_allclose(2.0 * eta[cells] ** 2, squares[0], rtol=1e-12)
        np.testing.assert_allclose(indicators[cells] ** 2, squares[0] * squares[1], rtol=1e-12)
    assert (indicators > 0.0).all()


def test_cells_are_counted_as_in_the_mesh() -> None:
    """A system may have its cells in another order than the mesh."""
    mesh = halved(voronoi(20))
    problem, system, u, z = mixed_system(mesh)
    order = np.random.default_rng(3).permutation(mesh.n_cells)
    loops = list(mesh.cells())
    other = PolygonMesh.from_cells(mesh.points_vx, [loops[c] for c in order], mesh.region_c[order], mesh.region_names)

    class Reordered:
        point_states, order = system.point_states, system.order

        def cell_numbers(self):
            return np.argsort(order)

    for found, expected in (
        (energy_indicators(problem, Reordered(), other, u), energy_indicators(problem, system, mesh, u)),
        (dual_indicators(problem, Reordered(), other, u, z)[1], dual_indicators(problem, system, mesh, u, z)[1]),
    ):
        np.testing.assert_allclose(found, expected[order], rtol=1e-9)


def test_indicators_have_the_parameters_of_the_system() -> None:
    mesh = halved(grid(6, 4))
    problem, system, u, _ = mixed_system(mesh)
    before = energy_indicators(problem, system, mesh, u)
    system.set_parameters({"right.gamma": 0.4})
    ratio = np.where(mesh.region_c == 1, 2.0, 1.0)
    np.testing.assert_allclose(energy_indicators(problem, system, mesh, u), ratio * before, rtol=1e-12)


def test_stiffness_may_vary_from_cell_to_cell() -> None:
    """Four times the modulus in the right half, in one region: twice the indicator, at the same displacements."""
    text = {name: f"{name} * where(x < 1, 1, 4)" for name in ("K", "mu")}
    material = Material(K=20.0, mu=10.0)

    class Graded(Box):
        def regions(self):
            return {**super().regions(), "solid": solid_region(material, graded=text)}

    found = []
    for problem in (Box(cells=(20, 5)), Graded(cells=(20, 5))):
        system = prepare(problem, None, RunOptions(), comm=MPI.COMM_SELF).system
        mesh = problem.make_mesh()
        u = interpolate(system, lambda x: 0.01 * np.column_stack([np.sin(3.0 * x[:, 0]), np.cos(5.0 * x[:, 1])]))
        found.append(energy_indicators(problem, system, mesh, u))
    centre = np.array([mesh.points_vx[loop].mean(axis=0) for loop in mesh.cells()])
    stiff = (centre[:, 0] > 1.0) & (mesh.region_c == mesh.region_names.index("solid"))
    np.testing.assert_allclose(found[1], np.where(stiff, 2.0, 1.0) * found[0], rtol=1e-12)


@pytest.mark.parametrize("mesh", MESHES)
def test_the_dual_estimate_has_the_tangent_at_the_state(mesh) -> None:
    """It is the rate of ``int dF : P`` along dZ, by differences of the stress itself, second gradients held."""
    mesh = halved(MESHES[mesh]())
    problem, system, u, z = mixed_system(mesh)
    step, slope = 1e-5, 0.0
    for (states, dF), (_, dZ) in zip(*(gradient_errors(system, mesh, vector) for vector in (u, z)), strict=True):
        stress = stress_of(problem.regions()[states.region].integrand)
        ahead, behind = (
            stress.at(states.F_cqij + sign * step * dZ, states.G_cqijk, states.parameters)[0] for sign in (1, -1)
        )
        slope += np.einsum("cq,cqij,cqij->", states.w_cq, dF, ahead - behind) / (2.0 * step)
    estimate, _ = dual_indicators(problem, system, mesh, u, z)
    assert estimate == pytest.approx(slope, rel=1e-7)
    assert dual_indicators(problem, system, mesh, u, -3.0 * z)[0] == pytest.approx(-3.0 * estimate, rel=1e-12)


def test_a_small_state_is_its_own_adjoint_field() -> None:
    """Where tangents are those at rest, ``int dF : A : dF`` is twice the energy of the error, cell by cell."""
    mesh = halved(voronoi(20))
    problem, system, u, _ = mixed_system(mesh)
    u = 1e-6 * u
    estimate, indicators = dual_indicators(problem, system, mesh, u, u)
    energies = energy_indicators(problem, system, mesh, u) ** 2
    np.testing.assert_allclose(indicators, 2.0 * energies, rtol=1e-12)
    assert estimate == pytest.approx(2.0 * energies.sum(), rel=1e-4)


def test_the_dual_estimate_is_the_error_of_a_result() -> None:
    """The integral of u_x of a smooth solution on squares: found less exact is what is estimated, with its sign."""
    displacement, _, force = manufactured()
    t, w = np.polynomial.legendre.leggauss(12)
    points = np.stack(np.meshgrid((t + 1.0) / 2.0, (t + 1.0) / 2.0), axis=-1).reshape(-1, 2)
    exact = np.outer(w, w).ravel() @ displacement(points)[:, 0] / 4.0
    index = []
    for n in (16, 32):
        mesh = grid(n, n)
        system = system_on(mesh, prescribed=CLAMPED)
        system.set_body_force(force)
        u = interpolate(system, displacement)
        solver = NewtonSolver(system)
        assert solver.solve(u).converged
        by_u = system.create_vector()
        by_u.getArray()[::2] = system.area_weights(("domain",))
        z = Equilibrium(solver, system, u, Control(1.0)).adjoint(Derivative(by_u.dot(u), by_u)).field
        estimate, indicators = dual_indicators(MADE, system, mesh, u, z)
        index.append(estimate / (by_u.dot(u) - exact))
        assert abs(by_u.dot(u) - exact) < indicators.sum()
    assert index == pytest.approx([0.57, 0.86], abs=0.03)


def test_one_rank_needs_all_cells() -> None:
    mesh = grid(4, 3)
    system = system_on(mesh)
    with pytest.raises(ValueError, match="this rank has 12 of 20 cells"):
        gradient_errors(system, grid(5, 4), system.create_vector())
