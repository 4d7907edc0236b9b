"""Generated kernels against derivatives that no symbolic algebra has touched, and the matrix layout of Appendix C."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from codegen import oracle
from codegen.errors import CodegenError
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel, compile_energy
from codegen.sampling import REGIMES, directions, from_vector, sample
from codegen.tensors import stress_and_moduli
from tmc_vem.energy import DENSITIES, PAPER_DENSITIES

PARAMETERS = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 5.0}
OURS = ("medium_balanced_angle_log_damped", "medium_huhu_log")
STEP = 1e-5

# Rows and columns of (C.1), (C.2) and (C.3) as they are printed.
F_ORDER = ["11", "21", "12", "22"]
G_ORDER = ["111", "211", "121", "221", "112", "212", "122", "222"]


def kernel_of(name: str) -> Kernel:
    energy = DENSITIES[name]
    return compile_energy(energy.density, energy.name, energy.parameters, energy.description)


def states_of(name: str, n: int = 25) -> np.ndarray:
    rng = np.random.default_rng(11)
    max_rotation = 90.0 if "tangent" in name else 180.0
    return np.concatenate([sample(regime, n, rng, max_rotation) for regime in REGIMES])


def hessian_by_differences(density, x: np.ndarray) -> np.ndarray:
    """Complex step for the first derivative, central differences of it, with a step relative to J, for the second."""
    F, _ = from_vector(x)
    relative = np.minimum(1.0, np.linalg.det(F) / np.abs(F).max(axis=(1, 2)))
    h = np.empty((len(x), 12, 12))
    for b in range(12):
        step = np.zeros_like(x)
        step[:, b] = STEP * (relative if b < 4 else 1.0)
        ahead, behind = x + step, x - step
        change = oracle.gradient(density, ahead, PARAMETERS) - oracle.gradient(density, behind, PARAMETERS)
        h[:, :, b] = change / (ahead - behind)[:, b, None]
    return h


@pytest.mark.parametrize("name", [*PAPER_DENSITIES, *OURS])
def test_values_and_derivatives_agree_with_complex_step(name):
    kernel, x = kernel_of(name), states_of(name)
    density = DENSITIES[name].density
    psi, g, h = kernel.points(TANGENT, x, kernel.parameter_array(PARAMETERS))
    np.testing.assert_allclose(psi, oracle.energy_density(density, x, PARAMETERS), rtol=1e-10)
    g_error = np.abs(g - oracle.gradient(density, x, PARAMETERS)).max(axis=1) / np.abs(g).max(axis=1)
    assert g_error.max() < 1e-9
    h_error = np.abs(h - hessian_by_differences(density, x)).max(axis=(1, 2)) / np.abs(h).max(axis=(1, 2))
    assert h_error.max() < 1e-6


@pytest.mark.parametrize("name", [*PAPER_DENSITIES, *OURS])
@pytest.mark.parametrize("regime", REGIMES, ids=lambda regime: regime.name)
def test_taylor_rates_are_two_and_three(name, regime):
    kernel, rng = kernel_of(name), np.random.default_rng(17)
    array = kernel.parameter_array(PARAMETERS)
    x = sample(regime, 30, rng, 90.0 if "tangent" in name else 180.0)
    d = directions(x, rng)
    psi, g, h = kernel.points(TANGENT, x, array)
    slope, curvature = np.einsum("nx,nx->n", g, d), np.einsum("nx,nxy,ny->n", d, h, d)
    steps = np.array([4e-3, 2e-3, 1e-3])
    first, second = [], []
    for step in steps:
        remainder = kernel.points(ENERGY, x + step * d, array)[0] - psi - step * slope
        first.append(np.sqrt(np.mean((remainder / psi) ** 2)))
        second.append(np.sqrt(np.mean(((remainder - step**2 / 2 * curvature) / psi) ** 2)))
    assert np.diff(np.log2(first)) == pytest.approx(-2.0, abs=0.05)
    assert np.diff(np.log2(second)) == pytest.approx(-3.0, abs=0.1)


@pytest.mark.parametrize("name", [*PAPER_DENSITIES, *OURS])
def test_lower_levels_give_the_same_and_nothing_more(name):
    kernel, x = kernel_of(name), states_of(name, 3)
    array = kernel.parameter_array(PARAMETERS)
    psi, g, _ = kernel.points(TANGENT, x, array)
    psi_1, g_1, none_1 = kernel.points(GRADIENT, x, array)
    psi_0, none_g, none_h = kernel.points(ENERGY, x, array)
    np.testing.assert_allclose(psi_1, psi, rtol=1e-14)
    np.testing.assert_allclose(psi_0, psi, rtol=1e-14)
    np.testing.assert_allclose(g_1, g, rtol=0, atol=1e-14 * np.abs(g).max())
    assert none_1 is None
    assert none_g is None
    assert none_h is None


# ---- Layout ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def quadratic():
    """An energy with a different second derivative for every pair of components, and its tensors."""
    rng = np.random.default_rng(23)
    D, A, B = rng.normal(size=(2,) * 4), rng.normal(size=(2,) * 5), rng.normal(size=(2,) * 6)
    D, B = D + D.transpose(2, 3, 0, 1), B + B.transpose(3, 4, 5, 0, 1, 2)

    def density(F, G, p, m):
        psi = 0.0
        for i, j, k, o in np.ndindex(D.shape):
            psi = psi + D[i, j, k, o] / 2 * F[i][j] * F[k][o]
        for i, j, k, q, r in np.ndindex(A.shape):
            psi = psi + A[i, j, k, q, r] * G[i][j][k] * F[q][r]
        for i, j, k, q, r, s in np.ndindex(B.shape):
            psi = psi + B[i, j, k, q, r, s] / 2 * G[i][j][k] * G[q][r][s]
        return psi

    return compile_energy(density, "layout", ()), D, A, B


def at(tensor: np.ndarray, digits: str) -> float:
    return float(tensor[tuple(int(digit) - 1 for digit in digits)])


def test_rows_and_columns_are_those_printed_in_the_paper(quadratic):
    kernel, D, A, B = quadratic
    rng = np.random.default_rng(29)
    F, G = rng.normal(size=(3, 2, 2)), rng.normal(size=(3, 2, 2, 2))
    found = stress_and_moduli(kernel, F, G)
    assert [found.D_n44.shape, found.A_n84.shape, found.B_n88.shape] == [(3, 4, 4), (3, 8, 4), (3, 8, 8)]

    P = np.einsum("ijkl,nkl->nij", D, F) + np.einsum("ijkqr,nijk->nqr", A, G)
    T = np.einsum("ijkqr,nqr->nijk", A, F) + np.einsum("ijkqrs,nqrs->nijk", B, G)
    for n in range(3):
        close = {"rel": 1e-12, "abs": 1e-13}
        assert found.P_n4[n] == pytest.approx([at(P[n], row) for row in F_ORDER], **close)  # (53)
        assert found.T_n8[n] == pytest.approx([at(T[n], row) for row in G_ORDER], **close)  # (54)
        expected_d = [[at(D, row + column) for column in F_ORDER] for row in F_ORDER]  # (C.1)
        np.testing.assert_allclose(found.D_n44[n], expected_d, rtol=1e-12)
        expected_a = [[at(A, row + column) for column in F_ORDER] for row in G_ORDER]  # (C.2)
        np.testing.assert_allclose(found.A_n84[n], expected_a, rtol=1e-12)
        expected_b = [[at(B, row + column) for column in G_ORDER] for row in G_ORDER]  # (C.3)
        np.testing.assert_allclose(found.B_n88[n], expected_b, rtol=1e-12)


def test_moduli_of_one_state_and_without_second_gradient():
    kernel = kernel_of("medium_angle_damped")
    F = np.array([[1.1, 0.2], [-0.1, 0.9]])
    one = stress_and_moduli(kernel, F, parameters=PARAMETERS)
    many = stress_and_moduli(kernel, F[None], np.zeros((1, 2, 2, 2)), PARAMETERS)
    for field in fields(one):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(many, field.name))
    assert np.all(one.T_n8 == 0)  # quadratic in G
    assert np.all(one.A_n84 == 0)


def test_wrong_shapes_and_missing_parameters_are_named(quadratic):
    kernel = quadratic[0]
    with pytest.raises(ValueError, match=r"F_nij has shape \(3, 3\), expected \(n, 2, 2\) or \(2, 2\)"):
        stress_and_moduli(kernel, np.eye(3))
    with pytest.raises(ValueError, match=r"G_nijk has shape \(2, 2, 2\), expected \(2, 2, 2, 2\)"):
        stress_and_moduli(kernel, np.stack([np.eye(2)] * 2), np.zeros((2, 2, 2)))
    with pytest.raises(CodegenError, match="energy 'solid' needs a value for mu"):
        stress_and_moduli(kernel_of("solid"), np.eye(2), parameters={"K": 1.0})


def test_entries_that_vanish_identically_are_exactly_zero():
    """T and A of an energy of F alone, and of the quadratic regularisers without damping."""
    x = states_of("solid", 5)
    F, G = from_vector(x)
    solid = stress_and_moduli(kernel_of("solid"), F, G, PARAMETERS)
    assert not solid.T_n8.any()
    assert not solid.A_n84.any()
    assert not solid.B_n88.any()
    assert not stress_and_moduli(kernel_of("medium_huhu"), F, G, PARAMETERS).A_n84.any()
    assert not kernel_of("solid").uses_second_gradient
    assert kernel_of("medium_huhu").uses_second_gradient
