"""Densities against formulas written by hand, in every namespace, and the properties of a strain energy."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from codegen.centre import J, symbols
from codegen.derive import parameter_symbol, to_sympy
from codegen.integrand import LAYOUT, second_gradient_energy
from codegen.oracle import components, energy_density, numpy_namespace
from codegen.sampling import REGIMES, from_vector, rotate, sample
from codegen.trace import trace
from tmc_vem.energy import (
    DENSITIES,
    MEDIA,
    REGULARISERS,
    Regulariser,
    densities,
    get_regulariser,
    hyperelastic_solid,
    third_medium,
)
from tmc_vem.support.errors import InputError

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 5.0}
NOT_OBJECTIVE = {name for name in DENSITIES if "tangent" in name}
TINY = 1e-30


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.concatenate([sample(regime, 20, rng, max_rotation=95.0) for regime in REGIMES])


# ---- By hand: tensors, determinants and angles from numpy, gradients along X by the complex step --------------------


def isochoric_by_hand(F: np.ndarray) -> float:
    F3 = np.eye(3)
    F3[:2, :2] = F
    C = F3.T @ F3
    return 0.5 * PARAMETERS["mu"] * (np.linalg.det(C) ** (-1 / 3) * np.trace(C) - 3.0)


def along_x(function, F: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Gradient of a function of F with respect to X, where F(X + dX) = F + G dX."""
    return np.array([np.imag(function(F + 1j * TINY * G[:, :, k])) / TINY for k in (0, 1)])


def tangent_of_angle(F: np.ndarray) -> complex:
    return (F[0, 1] - F[1, 0]) / (F[0, 0] + F[1, 1])


def regulariser_by_hand(name: str, F: np.ndarray, G: np.ndarray) -> float:
    laplacian = np.einsum("ijj->i", G)
    grad_j = along_x(np.linalg.det, F, G)
    if name == "huhu":
        return 0.5 * float(np.sum(G**2))
    if name == "huhu_lulu":
        return 0.5 * float(np.sum(G**2) - 0.5 * laplacian @ laplacian)
    if name.endswith("_log"):
        grad_j = along_x(lambda F: np.log(np.linalg.det(F)), F, G)
    if name == "huhu_log":
        return 0.5 * float(np.sum(G**2) + grad_j @ grad_j)
    angle = (lambda F: np.arctan(tangent_of_angle(F))) if name.startswith("angle") else tangent_of_angle
    grad = along_x(angle, F, G)
    return 0.5 * float(grad @ grad + grad_j @ grad_j)


def by_hand(name: str, F: np.ndarray, G: np.ndarray) -> float:
    if name == "solid":
        return 0.5 * PARAMETERS["K"] * np.log(np.linalg.det(F)) ** 2 + isochoric_by_hand(F)
    regulariser = name.removeprefix("medium_").removeprefix("balanced_").removesuffix("_damped")
    psi_r, psi_m = regulariser_by_hand(regulariser, F, G), isochoric_by_hand(F)
    if "balanced" in name:
        J, mu = np.linalg.det(F), PARAMETERS["mu"]
        psi_m = mu / 2 * (J ** (-2 / 3) * (np.sum(F**2) + 2) - 4) + mu / 3 * (J - 1)
    if name.endswith("_damped"):
        psi_r *= np.exp(-PARAMETERS["beta"] * np.linalg.det(F))
    return PARAMETERS["gamma"] * (psi_m + PARAMETERS["alpha_r"] * psi_r)


@pytest.mark.parametrize("name", DENSITIES)
def test_value_is_that_of_the_formula_written_by_hand(name, states):
    F, G = from_vector(states)
    expected = [by_hand(name, F[n], G[n]) for n in range(len(states))]
    np.testing.assert_allclose(energy_density(DENSITIES[name].density, states, PARAMETERS), expected, rtol=1e-9)


def test_angle_is_smooth_where_the_quotient_of_its_tangent_jumps():
    """grad phi against differences of the unwrapped atan2, for rotations from 80 to 170 degrees."""
    rng = np.random.default_rng(5)
    degrees = np.arange(80.0, 171.0, 10.0)
    x = rotate(sample(REGIMES[0], len(degrees), rng, max_rotation=15.0), degrees)
    F, G = from_vector(x)
    step = 1e-6
    psi = energy_density(densities.angle, x, {})
    for n in range(len(x)):
        phi = [
            [
                np.arctan2(Y[0, 1] - Y[1, 0], Y[0, 0] + Y[1, 1])
                for Y in (F[n] + s * step * G[n, :, :, k] for s in (-1, 1))
            ]
            for k in (0, 1)
        ]
        grad_phi = np.diff(np.unwrap(phi), axis=1)[:, 0] / (2 * step)
        grad_j = along_x(np.linalg.det, F[n], G[n])
        assert psi[n] == pytest.approx(0.5 * (grad_phi @ grad_phi + grad_j @ grad_j), rel=1e-8)


# ---- Namespaces -----------------------------------------------------------------------------------------------------


def floats(x: np.ndarray) -> tuple[list, list]:
    F, G = components(x[None, :])
    F = [[float(F[i][j][0]) for j in (0, 1)] for i in (0, 1)]
    G = [[[float(G[i][j][k][0]) for k in (0, 1)] for j in (0, 1)] for i in (0, 1)]
    return F, G


@pytest.mark.parametrize("name", DENSITIES)
def test_sympy_through_the_trace_agrees_with_numpy(name, states):
    energy = DENSITIES[name]
    value = to_sympy(trace(second_gradient_energy(energy.density, name, energy.parameters)))
    for x in states[::12]:
        F, _ = from_vector(x[None, :])
        numbers = {parameter_symbol(p): PARAMETERS[p] for p in energy.parameters}
        inputs = dict(zip(symbols(LAYOUT), [*F[0].T.ravel(), *x[4:]], strict=True))
        inputs[J] = F[0, 0, 0] * F[0, 1, 1] - F[0, 0, 1] * F[0, 1, 0]
        found = value.plain.xreplace(numbers).evalf(30, subs=inputs)
        expected = energy.density(*floats(x), SimpleNamespace(**PARAMETERS), numpy_namespace())
        assert float(found) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("name", DENSITIES)
def test_ufl_agrees_with_numpy(name, states):
    ufl = pytest.importorskip("ufl")
    from tmc_vem.fem.maths import ufl_namespace

    density = DENSITIES[name].density
    for x in states[::12]:
        F, G = floats(x)
        symbolic = density(ufl.as_matrix(F), ufl.as_tensor(G), SimpleNamespace(**PARAMETERS), ufl_namespace())
        expected = density(F, G, SimpleNamespace(**PARAMETERS), numpy_namespace())
        assert float(symbolic) == pytest.approx(expected, rel=1e-12)


# ---- Properties -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DENSITIES)
def test_reference_state_has_no_energy(name):
    assert energy_density(DENSITIES[name].density, np.zeros((1, 12)), PARAMETERS)[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("name", DENSITIES)
def test_energy_grows_away_from_the_reference_state(name):
    x = 1e-3 * np.random.default_rng(1).normal(size=(50, 12))
    assert np.all(energy_density(DENSITIES[name].density, x, PARAMETERS) > 0.0)


@pytest.mark.parametrize("name", [name for name in DENSITIES if name not in NOT_OBJECTIVE])
def test_superposed_rotation_changes_nothing(name, states):
    degrees = np.random.default_rng(2).uniform(-170.0, 170.0, len(states))
    density = DENSITIES[name].density
    psi = energy_density(density, states, PARAMETERS)
    np.testing.assert_allclose(energy_density(density, rotate(states, degrees), PARAMETERS), psi, rtol=1e-10)


@pytest.mark.parametrize("name", sorted(NOT_OBJECTIVE))
def test_tangent_is_not_objective_and_says_so(name):
    """t = tan(phi): grad t = grad phi / cos(phi)^2, and a superposed rotation changes phi but not grad phi."""
    x = sample(REGIMES[0], 8, np.random.default_rng(4))
    degrees = np.full(len(x), 30.0)
    F, _ = from_vector(x)
    phi = -np.arctan2(F[:, 0, 1] - F[:, 1, 0], F[:, 0, 0] + F[:, 1, 1])
    before, after = np.cos(phi), np.cos(phi + np.radians(30.0))
    no_grad_j = lambda F, G, p, m: densities.tangent(F, G, p, m) - grad_j_part(F, G, p, m)  # noqa: E731
    ratio = energy_density(no_grad_j, rotate(x, degrees), {}) / energy_density(no_grad_j, x, {})
    np.testing.assert_allclose(ratio, (before / after) ** 4, rtol=1e-9)
    assert DENSITIES[name].density.declared == {"objective": False, "max_rotation": 90.0}


def grad_j_part(F, G, p, m):
    grad = [F[1][1] * G[0][0][k] - F[1][0] * G[0][1][k] - F[0][1] * G[1][0][k] + F[0][0] * G[1][1][k] for k in (0, 1)]
    return (grad[0] ** 2 + grad[1] ** 2) / 2


def test_trace_is_three_dimensional():
    """Without F33 = 1 the reference state would be pre-stressed."""
    x = np.zeros((1, 12), dtype=complex)
    for a in range(4):
        shifted = x.copy()
        shifted[0, a] = 1j * TINY
        assert np.imag(energy_density(densities.medium, shifted, PARAMETERS)[0]) / TINY == pytest.approx(0, abs=1e-14)


@pytest.mark.parametrize("squeeze", [0.5, 0.1, 0.01])
def test_the_balanced_medium_does_not_pull_its_sides_in(squeeze):
    """Stress across a uniaxial squeeze, by complex step: mu/3 (s - s^(4/3)), and -mu/3 (1 - s^2) s^(-2/3) for (5)."""
    x = np.zeros((1, 12), dtype=complex)
    x[0, 0] = squeeze - 1.0
    x[0, 3] = 1j * TINY
    across = {name: np.imag(energy_density(density, x, PARAMETERS)[0]) / TINY for name, density in MEDIA.items()}
    mu = PARAMETERS["mu"]
    assert across["balanced"] == pytest.approx(mu / 3 * (squeeze - squeeze ** (4 / 3)), rel=1e-9)
    assert across["isochoric"] == pytest.approx(mu / 3 * (1 - squeeze**2) * squeeze ** (-2 / 3), rel=1e-9)


def test_log_regularisers_do_not_fade_where_the_medium_is_squeezed():
    """The same gradient of the stretch relative to the stretch costs the same at any stretch; with grad J it fades."""
    energies = {}
    for name in ("angle", "angle_log"):
        of = getattr(densities, name)
        for squeeze in (1.0, 0.01):
            x = np.zeros((1, 12))
            x[0, 0] = squeeze - 1.0
            x[0, 4] = 0.3 * squeeze  # G111
            energies[name, squeeze] = energy_density(of, x, {})[0]
    assert energies["angle_log", 0.01] == pytest.approx(0.045, rel=0.1)
    assert energies["angle", 0.01] < 1e-3 * energies["angle", 1.0]


# ---- Registry -------------------------------------------------------------------------------------------------------


def test_all_of_table_1_with_and_without_damping_and_the_solid():
    assert set(DENSITIES) >= {
        "solid",
        *(f"medium_{r}{d}" for r in ("huhu", "huhu_lulu", "angle", "tangent") for d in ("", "_damped")),
    }
    assert {r.name: r.equation for r in REGULARISERS.values() if r.equation} == {
        "huhu": "(6)", "huhu_lulu": "(9)", "angle": "(15)", "tangent": "(16)",
    }  # fmt: skip
    assert hyperelastic_solid().parameters == ("K", "mu")


def test_a_regulariser_brings_its_own_parameters():
    def bending(F, G, p, m):
        return p.kappa * G[0][0][0] ** 2

    energy = third_medium(Regulariser("bending", bending, parameters=("kappa",)), damped=True)
    assert energy.name == "medium_bending_damped"
    assert energy.parameters == ("mu", "gamma", "alpha_r", "beta", "kappa")
    x = np.zeros((1, 12))
    x[0, 4] = 2.0
    found = energy_density(energy.density, x, {**PARAMETERS, "kappa": 3.0})[0]
    assert found == pytest.approx(1e-3 * 0.7 * np.exp(-5.0) * 3.0 * 4.0)


def test_a_medium_may_have_the_volumetric_part_of_the_solid(states):
    """gamma log_j mu/2 (ln J)^2 on top of the paper's medium, free of stress at F = I."""
    with_log = third_medium(get_regulariser("huhu"), damped=True, volumetric=True)
    assert with_log.name == "medium_huhu_damped_log_j"
    assert with_log.parameters == ("mu", "gamma", "alpha_r", "beta", "log_j")
    assert with_log.description.endswith("with regulariser huhu (6) with exp(-beta J) and (ln J)^2")
    values = {**PARAMETERS, "log_j": 0.3}
    more = energy_density(with_log.density, states, values)
    plain = energy_density(DENSITIES["medium_huhu_damped"].density, states, PARAMETERS)
    J = np.linalg.det(from_vector(states)[0])
    np.testing.assert_allclose(more - plain, 1e-3 * 0.3 * 10.0 / 2 * np.log(J) ** 2, rtol=1e-7, atol=1e-12)
    clash = Regulariser("mine", densities.huhu, parameters=("log_j",))
    assert third_medium(clash, damped=False).parameters[-1] == "log_j"
    with pytest.raises(InputError, match="the medium has a parameter 'log_j' too"):
        third_medium(clash, damped=False, volumetric=True)


def test_names_that_do_not_exist_or_clash_are_refused():
    with pytest.raises(
        InputError, match=r"unknown regulariser 'hu'.*: choose one of huhu, huhu_lulu, angle, tangent.*; FILE"
    ):
        get_regulariser("hu")
    clash = Regulariser("mine", densities.huhu, parameters=("beta",))
    assert third_medium(clash, damped=False).parameters == ("mu", "gamma", "alpha_r", "beta")
    with pytest.raises(InputError, match="regulariser 'mine': the medium has a parameter 'beta' too; rename it"):
        third_medium(clash, damped=True)
