"""Patch tests: fields that the space contains are solutions, with exact energies and reactions, on any mesh."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import grid, hanging, non_convex, subdivide, voronoi, with_boundary
from helpers_oracle import INSIDE
from helpers_system import CLAMPED, errors, free_part, interpolate, make_system, region

from tmc_vem.energy.registry import DENSITIES, PAPER_DENSITIES
from tmc_vem.mesh.geometry import areas
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.tabulated import points_and_values

MESHES = {
    "Voronoi": voronoi(20),
    "hanging nodes": hanging(3),
    "hanging nodes on bent sides": hanging(3, 0.06),
    "non-convex": non_convex(),
    "rectangles": grid(3, 2),
}
K, MU = 5.0 / 3.0, 5.0 / 14.0
SOLID = {"K": K, "mu": MU}
MEDIUM = {"mu": MU, "gamma": 0.5, "alpha_r": 0.7, "beta": 3.0}
H_FULL = np.array([[0.3, 0.45], [-0.25, 0.2]])  # displacement gradient: finite strain and rotation
# Weights of the Gauss-Lobatto rules at the nodes of a side: forces that a constant traction exerts on them.
SIDE_WEIGHTS = {2: [1 / 6, 2 / 3, 1 / 6], 3: [1 / 12, 5 / 12, 5 / 12, 1 / 12]}


def linear(x):
    return x @ H_FULL.T + [0.1, -0.2]


def solid_energy_and_stress(F):
    """psi and P of the solid, equation (2), by hand."""
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    trace = (F**2).sum() + 1.0
    inverse_transposed = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
    psi = K / 2 * np.log(J) ** 2 + MU / 2 * (J ** (-2 / 3) * trace - 3)
    P = K * np.log(J) * inverse_transposed + MU * J ** (-2 / 3) * (F - trace / 3 * inverse_transposed)
    return psi, P


def disturbed(system, exact, amount, seed=3):
    """The field with noise at the free degrees of freedom."""
    u = exact.copy()
    noise = np.random.default_rng(seed).normal(size=u.getLocalSize()) * amount
    noise[system.constrained()] = 0.0
    u.getArray()[:] += noise
    return u


@pytest.mark.parametrize("k", [2, 3])
@pytest.mark.parametrize("name", MESHES)
def test_linear_displacement_under_finite_strain(name, k):
    system = make_system(MESHES[name], region("solid", **SOLID), CLAMPED, ElementSettings(order=k))
    H = (1.0 if k == 2 else 0.6) * H_FULL  # beyond, the soft modes of the non-convex cell buckle for k = 3

    def linear(x):
        return x @ H.T + [0.1, -0.2]

    exact = interpolate(system, linear)
    u = disturbed(system, exact, 2e-3 if k == 2 else 3e-5)  # functions of moments grow with k
    start = np.abs((u - exact).getArray()).max()
    solver = NewtonSolver(system)
    result = solver.solve(u)
    assert result.converged, result.reason
    assert start > 5e-5
    assert np.abs((u - exact).getArray()).max() < 1e-10

    psi, P = solid_energy_and_stress(np.eye(2) + H)
    mesh = MESHES[name]
    area = sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells())
    assert result.evaluation.energy == pytest.approx(psi * area, rel=1e-12)
    assert result.evaluation.min_j == pytest.approx(np.linalg.det(np.eye(2) + H), rel=1e-10)
    assert errors(system, u, linear, lambda x: np.tile(H, (len(x), 1, 1))) == pytest.approx((0, 0), abs=1e-10)

    # every single reaction: the constant traction P N on the boundary's sides
    forces = np.zeros((system.dofmap.n_nodes, 2))
    edges = system.distributed.edges
    for side, e in enumerate(edges.cell_edges.tolist()):
        if edges.n_cells_e[e] == 2:
            continue
        a, b = edges.vertices_ev[e] if edges.forward[side] else edges.vertices_ev[e][::-1]
        tangent = mesh.points_vx[b] - mesh.points_vx[a]
        traction = P @ np.array([tangent[1], -tangent[0]])
        nodes = [system.dofmap.vertex_nodes[a], *system.dofmap.edge_nodes[e], system.dofmap.vertex_nodes[b]]
        for node, weight in zip(nodes, SIDE_WEIGHTS[k], strict=True):
            forces[node] += weight * traction
    residual = result.residual.getArray().reshape(-1, 2)
    assert residual == pytest.approx(forces, abs=1e-9)
    total = [system.reaction(result.residual, "boundary", i) for i in (0, 1)]
    assert total == pytest.approx([0.0, 0.0], abs=1e-10)  # equilibrium
    x, _ = positions(system)
    deformed = x + u.getArray().reshape(-1, 2)
    torque = (deformed[:, 0] * residual[:, 1] - deformed[:, 1] * residual[:, 0])[np.abs(forces).sum(axis=1) > 0].sum()
    assert torque == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_a_stiff_body_that_moves_far_has_no_forces(name):
    """Summed as they are, displacements of 1e3 would leave forces of 1e-13 times the stiffness."""
    system = make_system(MESHES[name], region("solid", K=1e5, mu=1e5), CLAMPED)
    u, residual = system.create_vector(), system.create_vector()
    u.getArray()[0::2], u.getArray()[1::2] = 1e3, -1e4 / 3
    assert system.residual(u, residual).energy == 0.0
    assert residual.norm() == 0.0


def positions(system):
    """Coordinates (n_nodes, 2) of vertices and points of edges; zero for moments."""
    mesh, dofmap, edges = system.distributed.mesh, system.dofmap, system.distributed.edges
    x = np.zeros((dofmap.n_nodes, 2))
    x[dofmap.vertex_nodes] = mesh.points_vx
    a, b = mesh.points_vx[edges.vertices_ev[:, 0]], mesh.points_vx[edges.vertices_ev[:, 1]]
    for i, t in enumerate(INSIDE[dofmap.order]):
        x[dofmap.edge_nodes[:, i]] = (1 - t) * a + t * b
    return x, np.abs(x).sum(axis=1) > 0


@pytest.mark.parametrize("energy", ["medium_huhu", "medium_huhu_lulu_damped", "medium_angle"])
@pytest.mark.parametrize("name", MESHES)
def test_linear_displacement_of_the_third_medium(name, energy):
    """G vanishes, so the regulariser must neither store energy nor push."""
    system = make_system(MESHES[name], region(energy, **MEDIUM), CLAMPED)
    exact = interpolate(system, linear)
    u = disturbed(system, exact, 2e-3)
    result = NewtonSolver(system).solve(u)
    assert result.converged, result.reason
    assert np.abs((u - exact).getArray()).max() < 1e-9
    F = np.eye(2) + H_FULL
    psi = MU / 2 * (np.linalg.det(F) ** (-2 / 3) * ((F**2).sum() + 1) - 3)
    area = sum(areas(MESHES[name].points_vx[loop][None])[0] for loop in MESHES[name].cells())
    assert result.evaluation.energy == pytest.approx(MEDIUM["gamma"] * psi * area, rel=1e-9)


# u_i = c_i0 x^2 + c_i1 x y + c_i2 y^2
C = np.array([[0.02, 0.05, -0.03], [0.04, -0.02, 0.01]])


def quadratic(x):
    return np.stack([x[:, 0] ** 2, x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1) @ C.T


def quadratic_gradient(x):
    zero = np.zeros(len(x))
    powers = np.stack([[2 * x[:, 0], x[:, 1], zero], [zero, x[:, 0], 2 * x[:, 1]]])  # derivative j of monomial m
    return np.einsum("im,jmn->nij", C, powers)


G = np.array([[[2 * a, b], [b, 2 * c]] for a, b, c in C])


@pytest.mark.parametrize("k", [2, 3])
@pytest.mark.parametrize("name", MESHES)
def test_quadratic_field_has_its_exact_gradient_energy(name, k):
    """The part of the energy with alpha_r is linear in it, and for (6) and (9) constant over the domain."""
    mesh = MESHES[name]
    area = sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells())
    squared = (G**2).sum()
    laplacian = np.einsum("ijj->i", G)
    exact = {"medium_huhu": squared / 2, "medium_huhu_lulu": (squared - (laplacian**2).sum() / 2) / 2}
    for energy, psi_r in exact.items():
        stored = []
        for alpha_r in (1.0, 3.0):
            values = {**MEDIUM, "alpha_r": alpha_r}
            system = make_system(mesh, region(energy, **values), (), ElementSettings(order=k))
            u = interpolate(system, quadratic)
            stored.append(system.energy(u).energy)
            assert errors(system, u, quadratic, quadratic_gradient) == pytest.approx((0, 0), abs=1e-9)
        assert stored[1] - stored[0] == pytest.approx(2.0 * MEDIUM["gamma"] * psi_r * area, rel=1e-7)


@pytest.mark.parametrize("energy", sorted(name for name in PAPER_DENSITIES if name.startswith("medium")))
def test_quadratic_field_has_the_energy_of_every_regulariser(energy):
    """Against the density itself, in numpy, with the exact F and G at the quadrature points."""
    system = make_system(MESHES["Voronoi"], region(energy, **MEDIUM))
    u = interpolate(system, quadratic)

    class Parameters:
        mu, gamma, alpha_r, beta = MEDIUM["mu"], MEDIUM["gamma"], MEDIUM["alpha_r"], MEDIUM["beta"]

    expected = 0.0
    for block in system.blocks:
        polygons = block.polygons(system.distributed.mesh)
        points_cqx, _ = points_and_values(polygons, 2, block.scaled_points())
        for points, w_q in zip(points_cqx, block.weights(), strict=True):
            F = np.moveaxis(np.eye(2) + quadratic_gradient(points), 0, -1)
            expected += w_q @ DENSITIES[energy].density(F, G, Parameters, np)
    assert system.energy(u).energy == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("k", [2, 3])
def test_high_projection_degrees_keep_constant_stress_in_balance(k):
    """A cell whose l is far above 2 k: its quadrature must be exact for the projected gradient."""
    if k == 2:
        square = subdivide([(0, 0), (1, 0), (1, 1.2), (0, 1.2)], [4, 1, 1, 1])
    else:
        square = subdivide([(0, 0), (1, 0), (1, 1.2), (0, 1.2)], [2, 2, 2, 2])
    mesh = with_boundary(square, [range(len(square))])
    for quadrature in (None, 2):
        system = make_system(
            mesh, region("solid", **SOLID), CLAMPED, ElementSettings(order=k, quadrature=quadrature, projection="full")
        )
        assert system.blocks[0].degree >= 6
        out = system.create_vector()
        system.residual(interpolate(system, linear), out)
        assert np.abs(free_part(system, out)).max() < 1e-11
