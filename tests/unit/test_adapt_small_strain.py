"""Stiffness at rest: that of the moduli where there are some, positive and of strains for any energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tmc_vem import Material, Medium
from tmc_vem.adapt.small_strain import small_strain_stiffness, strain_products
from tmc_vem.energy import REGULARISERS, Energy
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.support.errors import InputError

ROTATION = np.array([0.0, 1.0, -1.0, 0.0])


def isotropic(K: float, mu: float) -> np.ndarray:
    """D of plane strain, from what it does to every unit tensor."""
    columns = []
    for unit in np.eye(4).reshape(4, 2, 2):
        strain = 0.5 * (unit + unit.T)
        columns.append((K - 2.0 / 3.0 * mu) * np.trace(strain) * np.eye(2) + 2.0 * mu * strain)
    return np.array(columns).reshape(4, 4).T


def own(density, **values: float) -> RegionEnergy:
    return RegionEnergy(Energy("own", density, tuple(values)), values)


@pytest.mark.parametrize(
    "material",
    [
        Material(K=5.0, mu=2.0),
        Material(K=5.0, mu=2.0, volumetric="simo_taylor"),
        Material(model="saint_venant_kirchhoff", E=3.0, nu=0.3),
        Material(model="mooney_rivlin", E=5.0, nu=0.45, c01=0.2),
        Material(model="gent", K=5.0, mu=2.0, J_m=9.0),
    ],
)
def test_solids_have_their_moduli(material) -> None:
    found = small_strain_stiffness(solid_region(material))
    np.testing.assert_allclose(found, isotropic(material.moduli.K, material.moduli.mu), atol=1e-12)


@pytest.mark.parametrize("regulariser", REGULARISERS)
@pytest.mark.parametrize("beta", [0.0, 5.0])
def test_media_have_gamma_mu_and_no_bulk_modulus_but_their_own(regulariser, beta) -> None:
    medium = Medium(gamma=1e-4, beta=beta, regulariser=regulariser)
    found = small_strain_stiffness(medium_region(medium, 3.0))
    np.testing.assert_allclose(found, isotropic(0.0, 3e-4), atol=1e-15)
    found = small_strain_stiffness(medium_region(replace(medium, log_j=0.5), 3.0))
    np.testing.assert_allclose(found, isotropic(1.5e-4, 3e-4), atol=1e-15)


def test_the_balanced_medium_has_a_bulk_modulus_of_five_ninths_of_mu() -> None:
    """Its energy to second order in H = F - I: ``mu/2 (|H|^2 - 2 det H + 8/9 (tr H)^2)``."""
    found = small_strain_stiffness(medium_region(Medium(gamma=1.0, energy="balanced"), 9.0))
    np.testing.assert_allclose(found, isotropic(5.0, 9.0), atol=1e-12)


def test_values_of_the_system_go_before_those_of_the_region_and_may_vary() -> None:
    region = medium_region(Medium(gamma=1e-4), 3.0)
    plain = small_strain_stiffness(region)
    found = small_strain_stiffness(region, {**region.values, "gamma": 1e-2})
    np.testing.assert_allclose(found, 100.0 * plain, atol=1e-12)
    factor = np.array([[1.0], [2.0], [50.0]])
    found = small_strain_stiffness(region, {**region.values, "mu": 3.0 * factor})
    assert found.shape == (3, 4, 4)
    np.testing.assert_allclose(found, factor[..., None] * plain, atol=1e-12)


def test_eigenvalues_below_0_are_0_and_rotations_have_none() -> None:
    """An energy under tension at rest, and one that is unstable where the volume changes."""
    pulled = own(lambda F, G, p, m: p.a * (F[0][0] + F[0][1] ** 2 + F[1][0] ** 2 + F[1][1]), a=3.0)
    found = small_strain_stiffness(pulled)
    np.testing.assert_allclose(found @ ROTATION, 0.0, atol=1e-14)
    np.testing.assert_allclose(found, 3.0 * np.outer([0, 1, 1, 0], [0, 1, 1, 0]), atol=1e-14)

    def unstable(F, G, p, m):
        a, b, c = F[0][0] - 1, F[1][1] - 1, (F[0][1] + F[1][0]) / 2
        return p.mu * (a * a + b * b + 2 * c * c) - p.lam * (a + b) ** 2 / 2

    found = small_strain_stiffness(own(unstable, mu=1.0, lam=5.0))
    values = np.sort(np.linalg.eigvalsh(found))
    np.testing.assert_allclose(values, [0.0, 0.0, 2.0, 2.0], atol=1e-14)  # one of 2 mu - 2 lam is gone
    np.testing.assert_allclose(found @ [1.0, 0.0, 0.0, 1.0], 0.0, atol=1e-14)
    np.testing.assert_allclose(found @ [1.0, 0.0, 0.0, -1.0], [2.0, 0.0, 0.0, -2.0], atol=1e-14)


def test_energies_of_users_need_a_second_derivative_at_rest() -> None:
    def kinked(F, G, p, m):
        return p.a * m.sqrt((F[0][0] - 1) ** 2 + F[0][1] ** 2)

    with pytest.raises(InputError, match=r"'own' has no second derivative at F = I and G = 0.*smooth there"):
        small_strain_stiffness(own(kinked, a=1.0))
    # a kink in G is none in F
    fine = own(lambda F, G, p, m: p.a * (F[0][0] - 1) ** 2 * (1 + m.sqrt(G[0][0][0] ** 2)), a=2.0)
    assert small_strain_stiffness(fine)[0, 0] == pytest.approx(4.0)


def test_products_are_sums_over_points() -> None:
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(2, 3, 5, 2, 2))
    w, D = rng.random((3, 5)), rng.normal(size=(3, 4, 4))
    by_hand = [
        sum(w[c, q] * A[c, q].ravel() @ D[c] @ B[c, q].ravel() for q in range(5)) for c in range(3)
    ]  # fmt: skip
    np.testing.assert_allclose(strain_products(D, A, B, w), by_hand, rtol=1e-12)
    np.testing.assert_allclose(strain_products(D[1], A, B, w)[1], by_hand[1], rtol=1e-12)
