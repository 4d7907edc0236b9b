"""Friction in assembled virtual elements: a layer against the oracle, derivatives, grading, and what a step leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_friction import affine, bent, follow, layer, normal
from helpers_mesh import grid, hanging, voronoi
from helpers_system import CLAMPED, dense, interpolate, make_system
from numpy.typing import NDArray

from tmc_vem import Material, Medium
from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.system.friction_settings import Friction
from tmc_vem.vem.spaces.element_settings import ElementSettings
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]

MEDIUM = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser="huhu_lulu")
PLAIN = medium_region(MEDIUM, 1.5)
SLIPPERY = replace(PLAIN, friction=Friction(0.4, 0.3))
LEVEL = 0.3 * 1.5  # gamma mu
PATH = [layer(0.5, 0.0), layer(0.04, 0.0), layer(0.04, 0.004), layer(0.035, 0.3), layer(0.04, 0.29), layer(0.04, -0.2)]
MESHES = {
    "quadrilaterals": lambda: grid(3, 3),
    "voronoi": lambda: voronoi(17),
    "hanging nodes": lambda: hanging(2, 0.1),
}


def system_of(mesh: PolygonMesh, regions: dict[str, RegionEnergy], supports: Any = ()) -> VemSystem:
    settings = ElementSettings()
    kernels = {name: _kernels(name, region, settings) for name, region in regions.items()}
    return make_system(mesh, kernels, supports, settings)


@pytest.mark.parametrize("kind", MESHES)
def test_a_layer_has_the_tractions_of_the_oracle(kind: str) -> None:
    """Polygons, all nodes prescribed: stress from virtual work, energies, shear and slip of all points."""
    mesh = MESHES[kind]()
    rough, plain = (system_of(mesh, dict.fromkeys(mesh.region_names, region)) for region in (SLIPPERY, PLAIN))
    out, spent = rough.create_vector(), []
    virtual = [interpolate(rough, affine(np.eye(2) + E)) for E in np.eye(4).reshape(4, 2, 2)]
    across, begun = np.zeros(2), 0.0  # normal at the beginning of the step, none in the first
    for F, step in zip(PATH, follow(PATH, 0.4, 0.3, LEVEL), strict=True):
        u = interpolate(rough, affine(F))
        stored = plain.energy(u).energy
        energy = rough.residual(u, out).energy
        P = [out.dot(field) for field in virtual]
        np.testing.assert_allclose(P, step.P.ravel(), rtol=0, atol=1e-10 * np.abs(step.P).max())
        assert energy - stored == pytest.approx(step.potential, rel=1e-8, abs=1e-11)
        assert rough.energy(u).energy == pytest.approx(energy, rel=1e-12)
        assert rough.cell_energies(u).sum() == pytest.approx(stored, rel=1e-12)
        spent.append(0.0)
        for states in rough.friction_states(u):
            assert states.response.tau == pytest.approx(
                np.full(states.points.w_cq.shape, step.tau), rel=1e-7, abs=1e-11
            )
            spent[-1] += float((states.points.w_cq * states.response.dissipated).sum())
            assert np.abs(states.slip.n_i @ across) == pytest.approx(np.full(states.points.w_cq.shape, begun))
        assert spent[-1] == pytest.approx(step.dissipated, rel=1e-8, abs=1e-10)
        across, begun = normal(F), 1.0
        rough.advance(u)
        assert rough.energy(u).energy == pytest.approx(stored, rel=1e-12)  # the potential of a step begins with 0
    assert [value > 1e-6 for value in spent] == [False, False, False, True, False, True]


def test_turned_between_slips_the_tractions_are_the_same() -> None:
    """Few polygons: slip, a turn by a right angle in steps, slip on; forces are those of the straight path."""
    mesh = voronoi(5)
    straight = [layer(0.1, 0.0), layer(0.02, 0.0), layer(0.02, 0.3), layer(0.02, 0.6), layer(0.02, 0.9)]
    turns = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in np.pi / 6 * np.arange(1, 4)]
    paths = (straight, [*straight[:4], *(Q @ straight[3] for Q in turns), turns[-1] @ straight[4]])
    found = []
    for path in paths:
        system = system_of(mesh, dict.fromkeys(mesh.region_names, SLIPPERY))
        out = system.create_vector()
        for F in path:
            u = interpolate(system, affine(F))
            system.residual(u, out)
            system.advance(u)
        found.append(out.getArray().reshape(-1, 2).copy())
    np.testing.assert_allclose(found[1], found[0] @ turns[-1].T, rtol=0, atol=1e-10 * np.abs(found[0]).max())


def kinds(system: VemSystem, u: Any) -> Float:
    """-1, 0 or 1 of all points: sliding one way, sticking, the other way; 9 without friction."""
    return np.concatenate([
        np.where(s.slip.bound > 0.0, np.where(s.response.sticks, 0.0, np.sign(s.response.tau)), 9.0).ravel()
        for s in system.friction_states(u)
    ])  # fmt: skip


def sliding(system: VemSystem) -> Any:
    """A state in the third step: some points stick, others slide either way."""
    matrix = system.create_matrix()
    for slip in (0.0, 0.05):
        u = interpolate(system, bent(0.1, slip))
        system.jacobian(u, matrix)  # a matrix that knows the step before
        system.advance(u)
    u = interpolate(system, bent(0.09, 0.2))
    u.getArray()[:] += np.random.default_rng(1).uniform(-4e-4, 4e-4, u.getLocalSize())
    return u


@pytest.mark.parametrize("kind", MESHES)
def test_residual_and_tangent_are_derivatives(kind: str) -> None:
    """Assembled, with cells beside constraints, over a step in which no point passes the kink."""
    mesh = MESHES[kind]()
    system = system_of(mesh, dict.fromkeys(mesh.region_names, SLIPPERY), CLAMPED)
    u = sliding(system)
    here = kinds(system, u)
    assert all((here == kind).sum() > 3 for kind in (-1.0, 0.0, 1.0))
    held, t = system.constrained(), 1e-7
    direction, ahead, behind = system.create_vector(), u.duplicate(), u.duplicate()
    direction.getArray()[:] = np.random.default_rng(8).uniform(-1.0, 1.0, direction.getLocalSize())
    direction.getArray()[held] = 0.0
    ahead.waxpy(t, direction, u)
    behind.waxpy(-t, direction, u)
    np.testing.assert_array_equal(kinds(system, ahead), here)
    np.testing.assert_array_equal(kinds(system, behind), here)
    gradient, after, before, matrix = (*(system.create_vector() for _ in range(3)), system.create_matrix())
    slope = (system.residual(ahead, after).energy - system.residual(behind, before).energy) / (2 * t)
    system.residual(u, gradient)
    assert gradient.dot(direction) == pytest.approx(slope, rel=1e-6)
    system.jacobian(u, matrix)
    expected = (after.getArray() - before.getArray()) / (2 * t)
    action = dense(matrix) @ direction.getArray()
    free = np.setdiff1d(np.arange(len(expected)), held)
    assert np.abs(action - expected)[free].max() < 1e-6 * np.abs(expected).max()
    by_cells = system.create_vector()
    system.tangent_action(direction, by_cells)
    np.testing.assert_allclose(by_cells.getArray()[free], action[free], rtol=0, atol=1e-12 * np.abs(action).max())


def test_a_graded_medium_is_many_media() -> None:
    """Gamma jumps in the middle, the bound with it; packs of eight mix cells of both."""
    mesh = voronoi(23)
    centre = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    halves = replace(mesh, region_c=(centre[:, 0] > 0.5).astype(np.int64), region_names=("left", "right"))
    one = replace(mesh, region_c=np.zeros_like(mesh.region_c), region_names=("all",))
    graded = replace(
        medium_region(MEDIUM, 1.5, graded={"gamma": "gamma * where(x < 0.5, 1, 3)"}), friction=Friction(0.4)
    )
    split = {
        name: replace(medium_region(replace(MEDIUM, gamma=0.3 * f), 1.5), friction=Friction(0.4))
        for name, f in (("left", 1.0), ("right", 3.0))
    }
    found = []
    for system in (system_of(one, {"all": graded}, CLAMPED), system_of(halves, split, CLAMPED)):
        u, out, tangent = sliding(system), system.create_vector(), system.create_matrix()
        energy = system.residual(u, out).energy
        system.jacobian(u, tangent)
        found.append((energy, out.getArray().copy(), dense(tangent)))
    for made, wanted in zip(*found, strict=True):
        assert made == pytest.approx(wanted, rel=1e-11, abs=1e-11 * np.abs(wanted).max())


def test_media_have_their_own_coefficients() -> None:
    """Two media side by side with the same shear, and a solid below that has none."""
    mesh = grid(4, 2)
    region = np.where(np.arange(8) < 4, 0, 1 + (np.arange(8) % 4 > 1))
    mesh = replace(mesh, region_c=region.astype(np.int64), region_names=("solid", "rough", "smooth"))
    regions = {"solid": solid_region(Material(K=3.0, mu=1.5)), "rough": SLIPPERY}
    system = system_of(mesh, {**regions, "smooth": replace(PLAIN, friction=Friction(0.1, 0.6))})
    for slip in (0.0, 0.5):
        u = interpolate(system, affine(layer(0.05, slip)))
        found = {states.points.region: states for states in system.friction_states(u)}
        system.advance(u)
    assert found.keys() == {"rough", "smooth"}
    ratio = found["rough"].slip.bound[0, 0] / found["smooth"].slip.bound
    assert ratio == pytest.approx(np.full(ratio.shape, 4.0), rel=1e-12)
    ratio = found["rough"].slip.stiffness[0, 0] / found["smooth"].slip.stiffness
    assert ratio == pytest.approx(np.full(ratio.shape, 8.0), rel=1e-12)


def test_only_the_end_of_a_step_changes_its_friction() -> None:
    """States that are looked at, and tangents, leave nothing; displacements and shear say all there is to know."""
    mesh = voronoi(11)
    rough, again = (system_of(mesh, dict.fromkeys(mesh.region_names, SLIPPERY), CLAMPED) for _ in range(2))
    u = sliding(rough)
    out, expected, matrix = rough.create_vector(), rough.create_vector(), rough.create_matrix()
    rough.residual(u, expected)
    elsewhere = interpolate(rough, bent(0.3, -1.0))
    rough.residual(elsewhere, out)
    rough.jacobian(elsewhere, matrix)
    rough.max_step(elsewhere, u)
    list(rough.friction_states(elsewhere))
    rough.residual(u, out)
    np.testing.assert_array_equal(out.getArray(), expected.getArray())

    X, tau = rough.shear(u)
    known = {tuple(x): value for x, value in zip(X.tolist(), tau.tolist(), strict=True)}
    rough.advance(u)
    again.remember_shear(u, lambda points: np.array([known[tuple(x)] for x in points.tolist()]))
    for system, vector in ((rough, expected), (again, out)):
        system.residual(elsewhere, vector)
    np.testing.assert_array_equal(out.getArray(), expected.getArray())


def test_without_friction_nothing_is_there() -> None:
    mesh = grid(1, 1)
    system = system_of(mesh, dict.fromkeys(mesh.region_names, PLAIN))
    u = interpolate(system, affine(layer(0.1, 0.2)))
    system.advance(u)
    assert not list(system.friction_states(u))
    assert system.shear(u)[0].shape == (0, 2)
    assert all(block.batch.friction is None for block in system.blocks)
