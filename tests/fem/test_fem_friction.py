"""Friction in finite elements: a layer against the oracle, derivatives beside the kink, and virtual elements."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_fem import CLAMPED, SOLID, Float, grid, make_system, medium, random_vector
from helpers_friction import affine, bent, follow, layer, normal
from helpers_system import interpolate
from helpers_system import make_system as make_vem

from tmc_vem.fem.system import FemSystem
from tmc_vem.mesh import PolygonMesh
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.friction_settings import Friction
from tmc_vem.vem.spaces.element_settings import ElementSettings

SLIPPERY = replace(medium(), friction=Friction(0.4, 0.3))
LEVEL = 0.3 * 1.5  # gamma mu of the tests' medium
STEPS = [layer(0.5, 0.0), layer(0.04, 0.0), layer(0.04, 0.004), layer(0.035, 0.3), layer(0.04, 0.29), layer(0.04, -0.2)]


def sheared(stretch: float, slip: float) -> Any:
    """The same of order two, which both methods have exactly."""
    return lambda x: np.stack([slip * x[:, 1] * (x[:, 0] - 0.4), (stretch - 1.0) * x[:, 1]], axis=1)


def two_layers(nx: int = 3, ny: int = 3) -> PolygonMesh:
    """A row of solid below rows of medium."""
    mesh = grid(nx, ny)
    return replace(mesh, region_c=(np.arange(mesh.n_cells) >= nx).astype(np.int64), region_names=("solid", "medium"))


@pytest.mark.parametrize("triangles", [False, True])
def test_a_layer_has_the_tractions_of_the_oracle(triangles: bool) -> None:
    """Distorted cells, all nodes prescribed: stress from virtual work, energies, shear and slip of all points."""
    system = make_system(grid(3, 2, distort=0.2), SLIPPERY, triangles=triangles)
    virtual = [system.interpolate(affine(np.eye(2) + E)) for E in np.eye(4).reshape(4, 2, 2)]
    out, spent = system.create_vector(), []
    plain = make_system(grid(3, 2, distort=0.2), medium(), triangles=triangles)
    across, begun = np.zeros(2), 0.0  # normal at the beginning of the step, none in the first
    for F, step in zip(STEPS, follow(STEPS, 0.4, 0.3, LEVEL), strict=True):
        u = system.interpolate(affine(F))
        energy = system.residual(u, out).energy
        P = [out.dot(field) for field in virtual]
        np.testing.assert_allclose(P, step.P.ravel(), rtol=0, atol=1e-10 * np.abs(step.P).max())
        assert energy - plain.energy(u).energy == pytest.approx(step.potential, rel=1e-9, abs=1e-12)
        assert system.cell_energies(u).sum() == pytest.approx(plain.energy(u).energy, rel=1e-12)
        spent.append(0.0)
        for states in system.friction_states(u):
            assert states.response.tau == pytest.approx(np.full(states.points.w_cq.shape, step.tau), abs=1e-12)
            spent[-1] += float((states.points.w_cq * states.response.dissipated).sum())
            assert np.abs(states.slip.n_i @ across) == pytest.approx(np.full(states.points.w_cq.shape, begun))
        assert spent[-1] == pytest.approx(step.dissipated, rel=1e-9, abs=1e-12)
        across, begun = normal(F), 1.0
        system.advance(u)
        assert system.energy(u).energy == pytest.approx(plain.energy(u).energy, rel=1e-12)
    assert [value > 1e-6 for value in spent] == [False, False, False, True, False, True]


@pytest.fixture(scope="module")
def sliding() -> tuple[FemSystem, Any]:
    """A layer beside a solid in the middle of a step: some points stick, others slide either way."""
    system = make_system(two_layers(), {"solid": SOLID, "medium": SLIPPERY}, CLAMPED)
    for slip in (0.0, 0.05):
        system.advance(system.interpolate(bent(0.1, slip)))
    u = system.interpolate(bent(0.09, 0.2))
    u.axpy(1.0, random_vector(system, 3, 4e-4))
    return system, u


def moved(u: Any, step: float, direction: Any) -> Any:
    trial = u.duplicate()
    trial.waxpy(step, direction, u)
    return trial


def kinds(system: FemSystem, u: Any) -> Float:
    """-1, 0 or 1 of all points: sliding one way, sticking, the other way; those without friction are left out."""
    found = []
    for states in system.friction_states(u):
        slides = np.where(states.response.sticks, 0.0, np.sign(states.response.tau))
        found.append(slides[states.slip.bound > 0.0])
    return np.concatenate(found)


def test_residual_and_tangent_are_derivatives(sliding: tuple[FemSystem, Any]) -> None:
    """Differences over a step in which no point passes the kink; there are points on all sides of it."""
    system, u = sliding
    here = kinds(system, u)
    assert min((here == kind).sum() for kind in (-1.0, 0.0, 1.0)) > 3
    t, direction = 1e-7, random_vector(system, 8, 1.0)
    ahead, behind = moved(u, t, direction), moved(u, -t, direction)
    np.testing.assert_array_equal(kinds(system, ahead), here)
    np.testing.assert_array_equal(kinds(system, behind), here)
    gradient, action, matrix = system.create_vector(), system.create_vector(), system.create_matrix()
    after, before = system.create_vector(), system.create_vector()
    slope = (system.residual(ahead, after).energy - system.residual(behind, before).energy) / (2 * t)
    system.residual(u, gradient)
    assert gradient.dot(direction) == pytest.approx(slope, rel=1e-6)
    system.jacobian(u, matrix)
    system.tangent_action(direction, action)
    after.axpy(-1.0, before)
    after.scale(0.5 / t)
    after.axpy(-1.0, action)
    assert after.norm() < 1e-6 * action.norm()
    n = matrix.getSize()[0]
    dense = np.array(matrix.getValues(range(n), range(n)))
    assert np.abs(dense - dense.T).max() < 1e-12 * np.abs(dense).max()


def test_friction_acts_on_the_cells_of_its_medium(sliding: tuple[FemSystem, Any]) -> None:
    system, u = sliding
    medium_c = system.mesh.region_c[: system.mesh.n_owned] == 1
    of_medium, of_solid = (system.internal_forces(u, chosen) for chosen in (medium_c, ~medium_c))
    out = system.create_vector()
    system.residual(u, out)
    np.testing.assert_allclose((of_medium + of_solid).ravel(), out.getArray(), rtol=0, atol=1e-12)
    plain = make_system(two_layers(), {"solid": SOLID, "medium": medium()}, CLAMPED)
    np.testing.assert_array_equal(plain.internal_forces(u, ~medium_c), of_solid)
    assert np.abs(plain.internal_forces(u, medium_c) - of_medium).max() > 1e-3
    assert {states.points.region for states in system.friction_states(u)} == {"medium"}
    assert not list(plain.friction_states(u))


def test_what_is_remembered_goes_on_to_the_bit(sliding: tuple[FemSystem, Any]) -> None:
    """From displacements and shear alone, whatever was there before; a state that is only looked at leaves nothing."""
    system, u = sliding
    _, tau = system.shear(u)
    X, again = system.shear(moved(u, 1.0, random_vector(system, 5, 1e-3)))
    assert np.abs(again - tau).max() > 1e-3
    np.testing.assert_array_equal(system.shear(u)[1], tau)
    assert X.shape == (6 * 9, 2)
    first, second = (make_system(two_layers(), {"solid": SOLID, "medium": SLIPPERY}) for _ in range(2))
    for other in (first, second):
        for slip in (0.0, 0.05):
            other.advance(other.interpolate(bent(0.1, slip)))
    first.advance(u)
    known = {tuple(x): value for x, value in zip(X.tolist(), tau.tolist(), strict=True)}
    second.advance(second.interpolate(bent(0.3, 0.1)))
    second.remember_shear(u, lambda points: np.array([known[tuple(x)] for x in points.tolist()]))
    out, expected, v = first.create_vector(), first.create_vector(), first.interpolate(bent(0.088, 0.25))
    assert first.residual(v, expected).energy == second.residual(v, out).energy
    np.testing.assert_array_equal(out.getArray(), expected.getArray())
    for one, other in zip(first.friction_states(v), second.friction_states(v), strict=True):
        np.testing.assert_array_equal(one.slip.n_i, other.slip.n_i)


def test_a_medium_without_friction_has_the_forms_of_before() -> None:
    plain, rough = (make_system(grid(1, 1), energy) for energy in (medium(), SLIPPERY))
    n_plain, n_rough = (len(system.forms.residual.coefficients()) for system in (plain, rough))
    assert n_rough == n_plain + 1
    assert not plain.damp_slip(0.5)
    assert plain.shear(plain.create_vector())[0].shape == (0, 2)


def _stiffness(system: Discretisation, u: Any, direction: Any, damping: float) -> float:
    """The second derivative in a direction, with damped slip."""
    assert system.damp_slip(damping)
    action, matrix = system.create_vector(), system.create_matrix()
    system.jacobian(u, matrix)
    system.tangent_action(direction, action)
    return float(action.dot(direction))


def test_both_methods_have_the_same_friction() -> None:
    """On rectangles virtual elements are Q2 with 4 x 4 points: the same points, shear, energies and forces."""
    mesh, element = two_layers(), ElementSettings(rule="auto")
    regions = {"solid": SOLID, "medium": SLIPPERY}
    fem = make_system(mesh, regions, CLAMPED, quadrature=6)
    vem = make_vem(mesh, {name: _kernels(name, region, element) for name, region in regions.items()}, CLAMPED, element)
    by_fem, by_vem = fem.create_vector(), vem.create_vector()
    virtual = lambda x: np.stack([x[:, 0] * x[:, 1], x[:, 1] ** 2 - x[:, 0]], axis=1)  # noqa: E731
    for stretch, slip in ((0.1, 0.0), (0.1, 0.05), (0.09, 0.2), (0.1, 0.1)):
        field = sheared(stretch, slip)
        u, v = fem.interpolate(field), interpolate(vem, field)
        one, other = fem.residual(u, by_fem), vem.residual(v, by_vem)
        for name in regions:
            assert one.regions[name].energy == pytest.approx(other.regions[name].energy, rel=1e-10)
        directions = fem.interpolate(virtual), interpolate(vem, virtual)
        for damping in (0.0, 0.25):
            of_fem, of_vem = _stiffness(fem, u, directions[0], damping), _stiffness(vem, v, directions[1], damping)
            assert of_fem == pytest.approx(of_vem, rel=1e-9)
        assert by_fem.dot(directions[0]) == pytest.approx(by_vem.dot(directions[1]), rel=1e-9)
        (X, tau), (Y, shear) = fem.shear(u), vem.shear(v)
        order, other_order = (np.lexsort(np.round(points, 9).T) for points in (X, Y))
        np.testing.assert_allclose(X[order], Y[other_order], rtol=0, atol=1e-12)
        np.testing.assert_allclose(tau[order], shear[other_order], rtol=1e-9, atol=1e-12)
        fem.advance(u)
        vem.advance(v)
    assert tau.max() > 0.01
    assert tau.min() < -0.01
