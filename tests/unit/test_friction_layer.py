"""Friction of a homogeneous layer, point by point: against sums written out one at a time, and against exact values."""

from __future__ import annotations

import itertools
from dataclasses import fields

import numpy as np
import pytest
from helpers_friction import (
    RIGHT_ANGLE,
    bound,
    follow,
    layer,
    medium_stress,
    normal,
    parasitic,
    sliding_ratio,
    slip_direction,
)
from numpy.typing import NDArray

from codegen.stress import stress_of
from tmc_vem import Medium
from tmc_vem.problems.base import medium_region
from tmc_vem.support.errors import InputError
from tmc_vem.system.friction import Friction, FrictionLaw, SlipResponse, SlipSystem, slip_system, smallest_stretch

Float = NDArray[np.float64]

FRICTION = Friction(0.3)
SQUEEZE = [layer(stretch, 0.0) for stretch in (0.7, 0.4, 0.1, 0.03, 0.01)]
SLIDE = (0.001, 0.003, 0.1, 0.4, 0.8)
BACK = (0.799, 0.797, 0.5, 0.0, -0.4, -0.5)
RELEASE = [layer(stretch, -0.5) for stretch in (0.05, 0.3, 0.6, 1.0)]
LOOP = [*SQUEEZE, *(layer(0.01, k) for k in (*SLIDE, *BACK)), *RELEASE]


def rotation(angle: float) -> Float:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def march(path: list[Float], friction: Friction, level: float = 1.0) -> list[tuple[Float, SlipSystem, SlipResponse]]:
    """Stress with friction, what was frozen, and the response at every step of a path, of one point or many."""
    before, found = np.zeros_like(path[0]) + np.eye(2), []
    tau = np.zeros(before.shape[:-2])
    for F in path:
        system = slip_system(before, medium_stress(before, level), friction, tau)
        response = system.response(F)
        found.append((medium_stress(F, level) + response.tau[..., None, None] * system.A_ij, system, response))
        before, tau = F, response.tau
    return found


@pytest.fixture(scope="module")
def loop() -> list[tuple[Float, SlipSystem, SlipResponse]]:
    """Load, slide, slide back beyond the start, let go."""
    return march(LOOP, FRICTION)


@pytest.mark.parametrize(("stretch", "coefficient", "elastic_slip"), [(0.01, 0.3, 0.2), (0.04, 0.7, 0.05)])
def test_a_loop_is_what_its_definitions_say(stretch: float, coefficient: float, elastic_slip: float) -> None:
    path = [
        layer(0.6, 0.0),
        layer(0.2, 0.0),
        layer(stretch, 0.0),
        *(layer(stretch, k) for k in (0.1, 0.5, 0.499, 0.3, -0.2)),
        np.eye(2),
    ]
    expected = follow(path, coefficient, elastic_slip, 2.5)
    assert [step.tau != 0.0 for step in expected] == 3 * [False] + 6 * [True]
    for step, (P, _, response) in zip(expected, march(path, Friction(coefficient, elastic_slip), 2.5), strict=True):
        np.testing.assert_allclose(P, step.P, rtol=1e-12, atol=1e-12 * np.abs(step.P).max())
        assert abs(response.tau) == pytest.approx(abs(step.tau), rel=1e-12)
        assert response.energy == pytest.approx(step.potential, rel=1e-11, abs=1e-14)
        assert response.dissipated == pytest.approx(step.dissipated, rel=1e-11, abs=1e-13)


def test_layers_slide_at_the_coefficient() -> None:
    """In the limit of small steps, squeezed to a hundredth."""
    limits = [sliding_ratio(0.01, k, 0.3) for k in (0.1, 0.5, 1.0, 2.0, 5.0)]
    assert limits == pytest.approx([0.3002, 0.3007, 0.3009, 0.3007, 0.3004], abs=5e-5)


def test_steps_lead_to_the_limits_with_order_one() -> None:
    """Layers slide in one direction, far enough for the full shear; halving the steps halves the error."""
    slips = np.array([0.1, 0.5, 1.0, 2.0, 5.0])
    limits, errors = np.array([sliding_ratio(0.01, k, 0.3) for k in slips]), []
    for n_steps in (100, 200, 400):
        starts = slips - 0.1
        slides = [np.array([layer(0.01, k + t) for k in starts]) for t in np.linspace(0.0, 0.1, n_steps + 1)]
        P = march([np.array(5 * [F]) for F in SQUEEZE[:-1]] + slides, FRICTION)[-1][0]
        errors.append(-P[:, 0, 1] / P[:, 1, 1] - parasitic(0.01, slips) - limits)
    assert np.abs(errors[-1]).max() < 1e-4
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(np.full(5, 2.0), rel=0.02)
    assert np.abs(2.0 * errors[-1] - errors[-2]).max() < 1e-6


def test_a_turn_between_slips_changes_nothing() -> None:
    """The same tractions, turned; the turn itself does no work."""
    straight = march([*SQUEEZE, *(layer(0.01, k) for k in (0.3, 0.6, 0.9, 1.2))], FRICTION)
    turn = [rotation(np.pi / 2 * t) @ layer(0.01, 0.6) for t in (0.25, 0.5, 0.75, 1.0)]
    path = [*SQUEEZE, layer(0.01, 0.3), layer(0.01, 0.6), *turn, *(RIGHT_ANGLE @ layer(0.01, k) for k in (0.9, 1.2))]
    turned = march(path, FRICTION)
    scale = abs(straight[-1][0][1, 1])
    for one, other in ((-1, -1), (-2, -2)):
        np.testing.assert_allclose(turned[other][0], RIGHT_ANGLE @ straight[one][0], rtol=0, atol=1e-10 * scale)
    for P, _, response in turned[7:10]:
        assert np.isfinite(P).all()
        assert float(response.tau) == pytest.approx(float(turned[6][2].tau), rel=1e-10)
        assert float(response.dissipated) == pytest.approx(0.0, abs=1e-10 * scale)


@pytest.mark.parametrize("angle", [0.3, -1.2, 2.8])
def test_a_rigid_rotation_of_any_size_does_no_work(angle: float) -> None:
    F = layer(0.02, 0.7)
    system = slip_system(F, medium_stress(F), FRICTION, np.array(0.1))
    assert float(system.response(rotation(angle) @ F).dg) == pytest.approx(0.0, abs=1e-12)
    stress = system.A_ij @ F.T
    np.testing.assert_allclose(stress, stress.T, rtol=0, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.1, 2.0, -0.7])
def test_axes_of_the_plane_do_not_matter(angle: float) -> None:
    """Turned before and after: stresses turn with both, numbers stay. n may come out as -n, which must not be seen."""
    Q, R = rotation(angle), rotation(1.9 * angle + 0.2)
    for straight, turned in zip(march(LOOP, FRICTION), march([Q @ F @ R for F in LOOP], FRICTION), strict=True):
        # the first step begins at F = I in both
        np.testing.assert_allclose(turned[0], Q @ straight[0] @ R, rtol=0, atol=1e-9 * np.abs(straight[0]).max())
        assert float(turned[2].energy) == pytest.approx(float(straight[2].energy), rel=1e-9, abs=1e-10)


def test_the_normal_has_no_sign() -> None:
    """Whatever the signs of n, stresses and energies are those of the oracle with all signs 1."""
    signs = np.random.default_rng(2).choice([-1, 1], len(LOOP)).tolist()
    plain, mixed = follow(LOOP, 0.3, 0.2), follow(LOOP, 0.3, 0.2, signs=signs)
    for one, other in zip(plain, mixed, strict=True):
        np.testing.assert_array_equal(one.P, other.P)
        assert one.potential == other.potential


def test_slip_dissipates(loop: list[tuple[Float, SlipSystem, SlipResponse]]) -> None:
    """Never less than nothing, something where it slides, and the step's potential is that and what became elastic."""
    dissipated = np.array([float(response.dissipated) for *_, response in loop])
    assert (dissipated >= 0.0).all()
    assert (dissipated > 1e-3).sum() > 7
    for _, system, response in loop:
        if system.bound > 0.0:
            before = 0.5 * system.tau**2 / system.stiffness
            assert float(response.energy) == pytest.approx(
                float(response.dissipated + response.stored - before), rel=1e-9
            )
            assert bool(response.sticks) == (float(response.dissipated) == pytest.approx(0.0, abs=1e-12))
    assert any(bool(response.sticks) for *_, response in loop[6:-4])


def test_random_paths_never_gain_energy() -> None:
    rng = np.random.default_rng(7)
    F = layer(0.02, 0.0) + rng.normal(scale=0.004, size=(200, 2, 2))
    tau, total = np.zeros(200), np.zeros(200)
    for _ in range(30):
        stress = medium_stress(F)
        system = slip_system(F, stress, Friction(0.5), tau)
        F = F + np.array([[0.002, 0.3], [0.0001, 0.002]]) * rng.normal(size=F.shape)
        keep = smallest_stretch(F) > 0.001
        F = np.where(keep[:, None, None], F, layer(0.02, 0.0))
        response = system.response(F)
        assert (response.dissipated >= -1e-14 * system.bound).all()
        assert (np.abs(response.tau) <= system.bound).all()
        tau, total = response.tau, total + response.dissipated
    assert (total > 0.0).all()


def test_the_shear_is_the_slope_of_the_potential() -> None:
    """On both sides of where slip begins, with a shear at the beginning, and in directions of all components."""
    F, rng, t = layer(0.02, 0.4), np.random.default_rng(4), 1e-6
    system = slip_system(F, medium_stress(F), FRICTION, np.array(0.0))
    kinds = set()
    for size in (0.002, 0.3, 3.0):
        for step in size * np.array([[0.02, 1.0], [0.005, 0.02]]) * rng.normal(size=(12, 2, 2)):
            at = F + step
            response = system.response(at)
            kinds.add((bool(response.sticks), bool(response.tau > 0.0)))
            for i, j in np.ndindex(2, 2):
                E = np.zeros((2, 2))
                E[i, j] = t
                slope = (system.response(at + E).energy - system.response(at - E).energy) / (2 * t)
                expected = float(response.tau * system.A_ij[i, j])
                assert float(slope) == pytest.approx(expected, rel=1e-5, abs=1e-5 * abs(system.A_ij).max())
    assert kinds == {(True, True), (True, False), (False, True), (False, False)}


def test_the_definitions_at_a_point() -> None:
    """Bound, stiffness, direction and normal of points of all kinds at once: squeezed, not enough, pulled, turned."""
    F = np.array([
        layer(0.02, 0.4), layer(0.499, 0.0), layer(0.501, 0.0), layer(3.0, 0.1), rotation(2.2) @ layer(0.1, -0.3),
        layer(0.4, 0.0) * 0.9,
    ])  # fmt: skip
    P = medium_stress(F, 2.0)
    P[5] = -P[5]  # a medium that is pulled across the squeeze: no friction
    tau = np.full(6, 1e6)
    system = slip_system(F, P, Friction(0.4, 0.5), tau)
    expected = np.array([bound(one, 0.4, 2.0) for one in F])
    expected[5] = 0.0
    assert (expected > 0.0).tolist() == [True, True, False, False, True, False]
    np.testing.assert_allclose(system.bound, expected, rtol=1e-12)
    np.testing.assert_allclose(system.stiffness, expected / 0.5, rtol=1e-12)
    np.testing.assert_array_equal(system.tau, system.bound)
    np.testing.assert_array_equal(slip_system(F, P, Friction(0.4, 0.5), -tau).tau, -system.bound)
    for one, A, AH, n in zip(F[[0, 1, 4]], *(a[[0, 1, 4]] for a in (system.A_ij, system.AH, system.n_i)), strict=True):
        np.testing.assert_allclose(A, slip_direction(one, normal(one)), rtol=1e-10, atol=1e-10)
        assert pytest.approx(np.sum(A * (one - np.eye(2))), rel=1e-12, abs=1e-14) == AH
        assert abs(n @ normal(one)) == pytest.approx(1.0, abs=1e-14)
    for k in (2, 3, 5):
        assert not system.A_ij[k].any()
        assert system.response(F[k] + 1.0).tau[k] == 0.0
    np.testing.assert_allclose(smallest_stretch(F), np.linalg.svd(F, compute_uv=False)[:, 1], rtol=1e-12)


@pytest.mark.parametrize(("stretch", "k", "rubs"), [(1.0, 3.0, False), (0.51, 2.0, False), (0.49, 0.0, True)])
def test_an_open_gap_that_is_sheared_has_no_friction(stretch: float, k: float, rubs: bool) -> None:
    """Its smallest stretch is small as well, and the medium is pressed along it; but nothing is squeezed away."""
    F = layer(stretch, k)
    assert smallest_stretch(F) < 0.5 or not k
    system = slip_system(F, medium_stress(F[None], 2.0)[0], Friction(0.3), np.array(0.0))
    assert (system.bound > 0.0) == rubs


def test_small_stretches_keep_their_digits() -> None:
    """Squeezed to a millionth and slipped far, an eigenvalue of b alone has lost all digits."""
    F = layer(1e-6, 3.0)
    assert float(smallest_stretch(F)) == pytest.approx(1e-6 / np.sqrt(10.0), rel=1e-10)


@pytest.mark.parametrize("value", [0.0, -0.1, np.nan, np.inf])
def test_numbers_of_friction_are_positive(value: float) -> None:
    assert Friction(0.3).elastic_slip == 0.2
    with pytest.raises(InputError, match=rf"^friction = {value:g} must be a positive coefficient"):
        Friction(value)
    with pytest.raises(InputError, match=rf"^elastic_slip = {value:g} must be positive"):
        Friction(0.3, value)


def test_a_law_knows_the_stress_of_its_medium() -> None:
    """Cells of points that are squeezed or not, whose gamma varies, with a regulariser that has no part in it."""
    region = medium_region(Medium(gamma=0.5, alpha_r=0.7, beta=2.0, regulariser="angle"), mu=1.5)
    law = FrictionLaw(FRICTION, stress_of(region.integrand))
    F = np.array([[layer(0.02, 0.4), layer(0.7, 0.2)], [layer(0.6, 0.0), layer(0.9, 0.3)], [layer(0.3, 0.1)] * 2])
    gamma, tau = np.array([[0.5], [2.0], [1.0]]), np.full((3, 2), 1e3)
    found = law.slip_system(F, {**region.values, "gamma": gamma}, tau)
    wanted = slip_system(F, gamma[..., None, None] * medium_stress(F, 1.5), FRICTION, tau)
    assert (found.bound > 0.0).tolist() == [[True, False], [False, False], [True, True]]
    for entry in fields(SlipSystem):
        values, expected = getattr(found, entry.name), getattr(wanted, entry.name)
        np.testing.assert_allclose(values, expected, rtol=1e-11, atol=1e-12, err_msg=entry.name)
