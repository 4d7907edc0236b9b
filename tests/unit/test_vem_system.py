"""The assembled system: derivatives by Taylor rates, boundary conditions, admissible steps, objectivity, reactions."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import grid, hanging, non_convex, voronoi, with_boundary
from helpers_penalty import medium, penalised
from helpers_system import CLAMPED, dense, interpolate, make_system, problem_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Box, Medium
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.vem import insertion
from tmc_vem.vem.pattern import serial_matrix
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.spaces.tabulated import points_and_values

MEDIUM = {"mu": 10.0, "gamma": 0.1, "alpha_r": 0.3, "beta": 2.0}
ENERGIES = ["solid", "medium_huhu_lulu_damped", "medium_angle_damped", "medium_huhu"]


def values(name):
    return {"K": 20.0, "mu": 10.0} if name == "solid" else MEDIUM


def wavy(x):
    return 0.08 * np.stack([np.sin(2 * x[:, 0] + x[:, 1]), x[:, 0] * x[:, 1] + np.cos(3 * x[:, 1])], axis=1)


def random_vector(system, seed, scale=1.0):
    vector = system.create_vector()
    vector.getArray()[:] = scale * np.random.default_rng(seed).normal(size=vector.getLocalSize())
    return vector


def two_regions():
    """A 3 x 2 grid: solid on the left, third medium on the right; k = 2 and 3 work on it."""
    mesh = grid(3, 2)
    right = [int(mesh.points_vx[loop, 0].mean() > 0.5) for loop in mesh.cells()]
    return PolygonMesh.from_cells(
        mesh.points_vx, list(mesh.cells()), right, ("solid", "medium"), {"corner": 0}, dict(mesh.named_edges)
    )


KERNELS = {"solid": ("solid", {"K": 20.0, "mu": 10.0}), "medium": ("medium_huhu_lulu_damped", MEDIUM)}


def mixed_system(prescribed=(), k=2):
    kernels = {name: region(energy, **values) for name, (energy, values) in KERNELS.items()}
    return make_system(two_regions(), kernels, prescribed, ElementSettings(order=k))


SYSTEMS = {
    "box": lambda: problem_system(Box(cells=(20, 5), medium=Medium(gamma=0.1, alpha_r=0.01))),
    "solid and medium, order 2": mixed_system,
    "solid and medium, order 3": lambda: mixed_system(k=3),
    **{
        f"Voronoi, {name}": lambda name=name: make_system(voronoi(9), region(name, **values(name))) for name in ENERGIES
    },
    "hanging nodes": lambda: make_system(hanging(2, 0.04), region("medium_huhu", **MEDIUM)),
    "non-convex": lambda: make_system(non_convex(), region("solid", K=20.0, mu=10.0)),
    "sides": lambda: make_system(
        hanging(2, 0.04), penalised(medium("medium_angle_damped"), MEDIUM, "full"), [Prescribed("boundary", 0)]
    ),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_taylor_rates(name):
    """E, R and K are each other's derivatives: remainders fall like h^2 and h^3, of the residual like h^2."""
    system = SYSTEMS[name]()
    u = interpolate(system, wavy)
    direction = interpolate(system, lambda x: np.stack([np.cos(3 * x[:, 0] * x[:, 1]), np.sin(4 * x[:, 0])], axis=1))
    residual, action, moved = (system.create_vector() for _ in range(3))
    energy = system.residual(u, residual).energy
    assert system.energy(u).energy == pytest.approx(energy, rel=1e-13)
    system.jacobian(u, system.create_matrix())
    system.tangent_action(direction, action)
    slope, curvature = residual.dot(direction), action.dot(direction)
    steps = [0.02 * 0.5**n for n in range(5)]
    first, second, of_residual = [], [], []
    for h in steps:
        state = u + h * direction
        shifted = system.residual(state, moved)
        assert shifted.admissible
        first.append(abs(shifted.energy - energy - h * slope))
        second.append(abs(shifted.energy - energy - h * slope - h * h / 2 * curvature))
        of_residual.append((moved - residual - h * action).norm())
    observed = [np.log2(np.array(r[:-1]) / r[1:]) for r in (first, second, of_residual)]
    assert observed[0][-1] == pytest.approx(2.0, abs=0.1)
    assert observed[1][-1] == pytest.approx(3.0, abs=0.25)
    assert observed[2][-1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("name", SYSTEMS)
def test_tangent_is_symmetric_and_assembles_its_action(name):
    system = SYSTEMS[name]()
    matrix = system.create_matrix()
    system.jacobian(interpolate(system, wavy), matrix)
    K = dense(matrix)
    assert np.abs(K - K.T).max() < 1e-12 * np.abs(K).max()
    du, action = random_vector(system, 1), system.create_vector()
    fixed = system.constrained()  # the matrix has no constrained columns, the action has
    du.getArray()[fixed] = 0.0
    system.tangent_action(du, action)
    product, expected = K @ du.getArray(), action.getArray().copy()
    product[fixed] = expected[fixed] = 0.0
    assert product == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(
    "name", ["box", "Voronoi, medium_angle_damped", "solid and medium, order 3", "hanging nodes", "sides"]
)
def test_direct_insertion_is_that_of_petsc(name, monkeypatch):
    """Most terms write to the matrix' values; with every one through MatSetValues the matrix is the same."""
    tangents = []
    for direct in (True, False):
        if not direct:
            monkeypatch.setattr(insertion, "_structure", lambda matrix: None)
        system = SYSTEMS[name]()
        matrix, u = system.create_matrix(), interpolate(system, wavy)
        for _ in range(2):  # the second time over the values of the first
            system.jacobian(u, matrix)
        assert bool(system._insertion._direct) == direct
        tangents.append(dense(matrix))
    np.testing.assert_allclose(tangents[0], tangents[1], rtol=0, atol=1e-13 * np.abs(tangents[1]).max())


def test_tangents_go_into_every_matrix_of_the_pattern():
    """Where they go is looked up in the matrix that comes first, whoever has made it."""
    system = SYSTEMS["box"]()
    u = interpolate(system, wavy)
    made_by_the_dm, made_by_us = system.dofmap.dm.createMat(), system.create_matrix()
    for matrix in (made_by_the_dm, made_by_us):
        system.jacobian(u, matrix)
    np.testing.assert_array_equal(dense(made_by_the_dm), dense(made_by_us))


@pytest.mark.parametrize("name", ["box", "solid and medium, order 3", "hanging nodes", "non-convex"])
def test_the_matrix_of_one_rank_is_that_of_the_dm(name):
    system = SYSTEMS[name]()
    ours, expected = serial_matrix(system.blocks, system.dofmap.dm, system.dofmap.n_nodes), system.dofmap.dm.createMat()
    for found, wanted in zip(ours.getValuesCSR(), expected.getValuesCSR(), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert ours.getBlockSizes() == (2, 2)  # the components of a node


def test_constrained_rows_and_columns_are_the_identity():
    system = mixed_system((Prescribed("boundary", 1, 0.3), Prescribed("corner", 0)))
    free = mixed_system()
    matrix, full = system.create_matrix(), free.create_matrix()
    u = interpolate(system, wavy)
    system.jacobian(u, matrix)
    free.jacobian(u, full)
    K, expected = dense(matrix), dense(full)
    fixed = system.constrained()
    # 10 sides with 10 vertices and 10 midpoints in y, and the corner in x
    assert len(fixed) == len(set(fixed.tolist())) == 21
    expected[fixed, :] = expected[:, fixed] = 0.0
    expected[fixed, fixed] = 1.0
    assert pytest.approx(expected, abs=1e-12 * np.abs(expected).max()) == K
    assert sorted(set(system.prescribed(Control(0.5)).tolist())) == [0.0, 0.15]
    system.jacobian(u, matrix)  # values are set anew, not added
    assert pytest.approx(K, abs=1e-12 * np.abs(K).max()) == dense(matrix)


def test_assembly_allocates_nothing():
    system = SYSTEMS["box"]()
    matrix = system.create_matrix()
    n_entries = len(matrix.getRowIJ()[1])
    system.jacobian(interpolate(system, wavy), matrix)
    info = matrix.getInfo()
    assert info["mallocs"] == 0
    assert info["nz_used"] == len(matrix.getRowIJ()[1]) == n_entries


def test_conditions_on_names_that_do_not_exist_are_refused():
    with pytest.raises(InputError, match=r"the mesh has neither a point nor edges named 'laod'"):
        mixed_system((Prescribed("laod", 0),))
    system = mixed_system()
    with pytest.raises(InputError, match=r"named 'laod'"):
        system.reaction(system.create_vector(), "laod", 0)
    with pytest.raises(InputError, match=r"no named point 'laod'"):
        system.point_displacements(system.create_vector(), ["corner", "laod"])


def test_a_region_without_energy_is_refused():
    with pytest.raises(InputError, match=r"region 'medium' has no energy \(given: solid\)"):
        make_system(two_regions(), {"solid": region("solid", K=1.0, mu=1.0)})


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("name", ["box", "Voronoi, solid", "solid and medium, order 3", "non-convex"])
def test_max_step_is_exact(name, seed):
    """J is positive all the way to the returned step and zero there; found by trying, not by solving."""
    system = SYSTEMS[name]()
    u, du = interpolate(system, wavy), random_vector(system, seed, 1e-3)
    limit = system.max_step(u, du)
    assert 0.0 < limit < np.inf
    for s in np.linspace(0.0, 1.0 - 1e-9, 60).tolist():
        assert system.energy(u + s * limit * du).min_j > 0.0
    assert system.energy(u + limit * du).min_j == pytest.approx(0.0, abs=1e-9)
    beyond = system.energy(u + (1 + 1e-6) * limit * du)
    assert not beyond.admissible
    assert beyond.min_j < 0.0


def test_max_step_is_infinite_where_j_never_vanishes():
    system = SYSTEMS["Voronoi, solid"]()
    u = interpolate(system, lambda x: 0.0 * x)
    assert system.max_step(u, interpolate(system, lambda x: 0.5 * x)) == np.inf
    assert system.max_step(u, interpolate(system, lambda x: np.ones_like(x))) > 1e10  # J constant up to rounding
    assert system.max_step(u, interpolate(system, lambda x: -0.5 * x)) == pytest.approx(2.0, rel=1e-6)  # a double root
    assert system.max_step(u, interpolate(system, lambda x: x * [-0.25, 0.0])) == pytest.approx(4.0, rel=1e-9)


def test_inadmissible_states_are_reported_with_the_cell():
    system = mixed_system()
    u = interpolate(system, lambda x: np.where(x[:, :1] > 0.9, [-0.8, 0.0], [0.0, 0.0]))
    for evaluation in (system.energy(u), system.residual(u, system.create_vector())):
        assert not evaluation.admissible
        assert evaluation.min_j < 0.0
        assert evaluation.regions["solid"].min_j > 0.0 > evaluation.regions["medium"].min_j
        assert evaluation.worst.startswith("J = -")
        cell = int(evaluation.worst.split("cell ")[1].split()[0])
        assert cell in (2, 5)
        assert evaluation.worst.endswith("of region 'medium'")
    u.getArray()[0] = np.nan
    assert not system.energy(u).admissible


@pytest.mark.parametrize("angle", [0.4, 1.5, 3.0])
@pytest.mark.parametrize("name", ENERGIES)
@pytest.mark.parametrize("k", [2, 3])
def test_rotating_the_deformed_body_rotates_the_forces(name, angle, k):
    """Residual of R (x + u) - x is R times that of u, energy and J are the same: objectivity of the whole system."""
    system = make_system(voronoi(9), region(name, **values(name)), (), ElementSettings(order=k))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    rest = interpolate(system, lambda x: x).getArray().reshape(-1, 2)
    u = interpolate(system, wavy)
    turned = u.duplicate()
    turned.getArray()[:] = ((rest + u.getArray().reshape(-1, 2)) @ turn.T - rest).ravel()
    forces, turned_forces = system.create_vector(), system.create_vector()
    before, after = system.residual(u, forces), system.residual(turned, turned_forces)
    assert after.energy == pytest.approx(before.energy, rel=1e-10)
    assert after.min_j == pytest.approx(before.min_j, rel=1e-10)
    expected = forces.getArray().reshape(-1, 2) @ turn.T
    assert turned_forces.getArray().reshape(-1, 2) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", SYSTEMS)
def test_internal_forces_are_in_equilibrium(name):
    """No net force on the unconstrained body, and nothing at all at rest."""
    system = SYSTEMS[name]()
    residual = system.create_vector()
    system.residual(interpolate(system, wavy), residual)
    ones = [interpolate(system, lambda x, i=i: np.eye(2)[i] * np.ones_like(x)) for i in (0, 1)]
    scale = np.abs(residual.getArray()).max()
    assert scale > 1e-3
    assert [residual.dot(translation) for translation in ones] == pytest.approx([0.0, 0.0], abs=1e-10 * scale)
    assert system.residual(system.create_vector(), residual).energy == pytest.approx(0.0, abs=1e-13)
    assert np.abs(residual.getArray()).max() < 1e-12


def test_body_force_does_the_work_of_a_constant_force():
    system = make_system(voronoi(9), region("solid", K=20.0, mu=10.0))
    u, without, with_force = interpolate(system, wavy), system.create_vector(), system.create_vector()
    stored = system.residual(u, without).energy
    system.set_body_force(lambda x: np.tile([3.0, -2.0], (len(x), 1)))
    potential = system.residual(u, with_force).energy
    force = (without - with_force).getArray().reshape(-1, 2)
    # the integral of u is in the moments of degree 0, times the cells' areas
    integral = np.zeros(2)
    nodes = system.nodal_values(u)
    for block in system.blocks:
        area = block.weights().sum(axis=1)
        integral += area @ nodes[system.dofmap.cell_moments[block.cells, 0]]
    assert stored - potential == pytest.approx(integral @ [3.0, -2.0], rel=1e-12)
    translations = [interpolate(system, lambda x, i=i: np.eye(2)[i] * np.ones_like(x)) for i in (0, 1)]
    assert [(force * t.getArray().reshape(-1, 2)).sum() for t in translations] == pytest.approx([3.0, -2.0], rel=1e-12)


def test_cell_values_add_up():
    system = SYSTEMS["solid and medium, order 2"]()
    u = interpolate(system, wavy)
    evaluation = system.energy(u)
    assert system.cell_energies(u).sum() == pytest.approx(evaluation.energy, rel=1e-12)
    mean, smallest = system.cell_jacobians(u)
    assert smallest.min() == pytest.approx(evaluation.min_j, rel=1e-12)
    assert (smallest <= mean).all()
    H = np.array([[0.1, 0.3], [-0.2, 0.4]])
    mean, smallest = system.cell_jacobians(interpolate(system, lambda x: x @ H.T))
    assert mean == pytest.approx(np.full(6, np.linalg.det(np.eye(2) + H)), rel=1e-10)


@pytest.mark.parametrize("name", SYSTEMS)
def test_displacement_gradients_are_rows_of_the_basis_times_displacements(name):
    system = SYSTEMS[name]()
    u_nodes = system.nodal_values(interpolate(system, wavy))
    for block in system.blocks:
        expected = np.einsum("cqxa,cai->cqxi", block.rows(2), u_nodes[block.batch.nodes_ca])
        for chosen in (slice(None), slice(0, 1)):
            found = block.displacement_gradients(u_nodes, chosen)
            np.testing.assert_allclose(found, expected[chosen], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("k", [2, 3, 4])
def test_shared_edges_are_read_in_the_same_direction_by_both_cells(k):
    """Interpolate on two cells that share an edge, from every starting vertex: the gradient of P_k is exact in both."""
    points = np.array([(0, 0), (1, 0), (2, 0.2), (2.1, 1.1), (1.2, 1), (-0.1, 0.9)])
    for shift in range(4):
        cells = [[0, 1, 4, 5], np.roll([1, 2, 3, 4], shift).tolist()]
        mesh = with_boundary(points, cells)
        system = make_system(mesh, region("solid", K=1.0, mu=1.0), CLAMPED, ElementSettings(order=k))

        def field(x):
            return np.stack([x[:, 0] ** k, x[:, 0] * x[:, 1] ** (k - 1)], axis=1)

        nodes = system.nodal_values(interpolate(system, field))
        for block in system.blocks:
            points_cqx, _ = points_and_values(block.polygons(mesh), k, block.scaled_points())
            for at_qx, B_qra, local in zip(points_cqx, block.rows(2), nodes[block.batch.nodes_ca], strict=True):
                x, y = at_qx.T
                rows = B_qra @ local  # q, derivative, component
                assert rows[:, 0, 0] == pytest.approx(k * x ** (k - 1), abs=1e-9)
                assert rows[:, 1, 0] == pytest.approx(0.0 * x, abs=1e-9)
                assert rows[:, 0, 1] == pytest.approx(y ** (k - 1), abs=1e-9)
                assert rows[:, 1, 1] == pytest.approx((k - 1) * x * y ** (k - 2), abs=1e-9)


def test_matrices_without_compressed_rows_are_left_to_petsc() -> None:
    dense = PETSc.Mat().createDense((4, 4), comm=PETSc.COMM_SELF)
    dense.assemble()
    assert insertion._structure(dense) is None
