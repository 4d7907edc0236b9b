"""Gradients, J and the step limit at quadrature points."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_fem import SOLID, Float, grid, make_system, medium, random_vector, wavy

from tmc_vem.fem.points import jacobian, largest_step
from tmc_vem.system.places import Places


def quadratic(x: Float) -> Float:
    a, b = x[:, 0], x[:, 1]
    return np.stack([a * a - 3.0 * a * b + b, 2.0 * b * b + 0.5 * a * b - a], axis=1)


@pytest.mark.parametrize("triangles", [False, True])
def test_gradients_of_a_quadratic_on_skewed_cells(triangles: bool) -> None:
    system = make_system(grid(3, 3, distort=0.25), SOLID, triangles=triangles)
    nodes = system.interpolate(quadratic).getArray().reshape(-1, 2)
    first, second = system.points.gradients(nodes[system.nodes.cell_nodes_ca])
    a, b = np.moveaxis(system.points.X_cqx, -1, 0)
    expected = np.stack([np.stack([2 * a - 3 * b, 1 - 3 * a], -1), np.stack([0.5 * b - 1, 4 * b + 0.5 * a], -1)], -2)
    G = np.array([[[2.0, -3.0], [-3.0, 0.0]], [[0.0, 0.5], [0.5, 4.0]]])
    assert first == pytest.approx(expected, abs=1e-12)
    assert second == pytest.approx(np.broadcast_to(G, second.shape), abs=1e-10)
    assert system.points.w_cq.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("away", [-1e-7, 0.0, 1e-9, 1e-7])
def test_points_near_sides_do_not_snap_to_them(triangles: bool, away: float) -> None:
    mesh = grid(3, 3, distort=0.25)
    system = make_system(mesh, SOLID, triangles=triangles)
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    along = ends[:, 1] - ends[:, 0]
    points = ends.mean(axis=1) + away * np.column_stack([along[:, 1], -along[:, 0]])
    found = Places(system, points).displacements(system.interpolate(quadratic))
    assert found == pytest.approx(quadratic(points), abs=1e-12)


def brute_force_step(gradient: Float, direction: Float) -> float:
    """Smallest positive root of the quadratics, from numpy's polynomial roots."""
    smallest = np.inf
    for h, d in zip(gradient.reshape(-1, 2, 2), direction.reshape(-1, 2, 2), strict=True):
        at = [np.linalg.det(np.eye(2) + h + s * d) for s in (-1.0, 0.0, 1.0)]
        roots = np.roots(np.polyfit([-1.0, 0.0, 1.0], at, 2))
        real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
        smallest = min([smallest, *real.tolist()])
    return smallest


@pytest.mark.parametrize("seed", range(20))
def test_step_limit_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    gradient, direction = rng.uniform(-0.3, 0.3, (1, 2, 2)), rng.uniform(-1.0, 1.0, (1, 2, 2))
    expected = brute_force_step(gradient, direction)
    assert largest_step(gradient, direction) == pytest.approx(expected, rel=1e-7)
    if np.isfinite(expected):
        assert jacobian(gradient + 0.999 * expected * direction)[0] > 0.0
        assert jacobian(gradient + 1.001 * expected * direction)[0] < 0.0


def test_step_limit_without_and_beyond_a_limit() -> None:
    still, growth = np.zeros((3, 2, 2)), np.broadcast_to(np.eye(2), (3, 2, 2))
    assert largest_step(still, growth) == np.inf
    assert largest_step(still, still) == np.inf
    assert largest_step(still, -0.5 * growth) == pytest.approx(2.0)
    assert largest_step(-2.0 * growth * [[1.0, 0.0], [0.0, 0.0]], growth) == 0.0
    assert largest_step(np.full((1, 2, 2), np.nan), growth[:1]) == 0.0


def test_step_limit_of_a_system() -> None:
    system = make_system(grid(3, 3), SOLID)
    u, du = system.interpolate(lambda x: 0.3 * wavy(x)), random_vector(system, 2, 0.1)
    limit = system.max_step(u, du)
    trial = u.duplicate()
    for factor, admissible in ((0.999, True), (1.001, False)):
        trial.waxpy(factor * limit, du, u)
        assert system.energy(trial).admissible is admissible


def test_inadmissible_states_name_the_cell() -> None:
    system = make_system(grid(3, 3), medium())
    u = system.interpolate(lambda x: np.where(x[:, :1] > 0.7, -2.0 * (x - 0.7) * [1.0, 0.0], 0.0 * x))
    evaluation = system.energy(u)
    assert not evaluation.admissible
    assert evaluation.min_j < 0.0
    assert evaluation.worst.startswith("J = -")
    assert "of region 'all'" in evaluation.worst
    worst = int(evaluation.worst.split(" in cell ")[1].split()[0])
    assert worst in {2, 5, 8}  # the right column


@pytest.mark.parametrize(("order", "triangles"), [(2, False), (3, False), (2, True), (3, True)])
def test_polynomials_are_exact_at_any_point(order: int, triangles: bool) -> None:
    """Distorted quadrilaterals, whose maps are not affine, and triangles; vertices, sides, and points inside."""
    from tmc_vem.system.places import Places

    mesh = grid(5, 4, distort=0.2)
    system = make_system(mesh, SOLID, order=order, triangles=triangles)

    def field(x: Float) -> Float:
        return np.column_stack([1 + x[:, 0] - 2 * x[:, 0] * x[:, 1], x[:, 1] ** 2 - 3 * x[:, 0]])

    points = np.concatenate([np.random.default_rng(3).uniform(0.0, 1.0, (100, 2)), mesh.points_vx])
    found = Places(system, points).displacements(system.interpolate(field))
    assert found == pytest.approx(field(points), abs=1e-10)


@pytest.mark.parametrize("triangles", [False, True])
def test_the_smallest_j_of_cells_is_looked_for_in_their_vertices_too(triangles: bool) -> None:
    """u = (0.3 x^2, 0): J = 1 + 0.6 x, smallest at the left-most vertex."""
    mesh = grid(3, 3, distort=0.25)
    system = make_system(mesh, SOLID, triangles=triangles)
    u = system.interpolate(lambda x: np.stack([0.3 * x[:, 0] ** 2, 0.0 * x[:, 0]], axis=1))
    expected = 1.0 + 0.6 * system.mesh.points_cvx[..., 0].min(axis=1)
    assert system.dense_jacobians(u) == pytest.approx(expected, abs=1e-12)
    assert (system.dense_jacobians(u) < system.cell_jacobians(u)[1]).all()
