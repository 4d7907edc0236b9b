"""Stresses of any energy at many points: against compiled kernels, and along F[2][2]."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from codegen.errors import CodegenError
from codegen.integrand import SECOND_GRADIENT, Integrand, second_gradient_energy
from codegen.kernel import GRADIENT, Kernel, compiled
from codegen.out_of_plane import out_of_plane_stress
from codegen.sampling import REGIMES, from_vector, sample
from codegen.stress import AT_ONCE, stress_of
from tmc_vem.energy import DENSITIES, third_medium
from tmc_vem.fem.maths import numpy_namespace
from tmc_vem.problems.materials import Medium

VALUES = {"K": 20.0, "mu": 3.0, "gamma": 0.5, "alpha_r": 0.3, "beta": 2.0, "a": 0.7}


def everything(F, G, p, m):
    """Each function and operator, in an order in which a wrong slope shows."""
    det = F[2][2] * (F[0][0] * F[1][1] - F[0][1] * F[1][0])
    turned = m.atan2(F[1][0] - F[0][1] + 0.2, F[0][0] + F[1][1]) ** 2
    bent = m.exp(-p.a * det) * G[0][0][1] ** 2 + m.cos(G[1][1][0] * F[0][1])
    return m.log(det) ** 2 / 3 + m.sqrt(F[0][0] + 3) - turned + bent + m.sin(F[1][1]) * m.atan(F[1][0]) + (-det) * 0.1


def in_plane(F, G, p, m):
    return p.mu * (F[0][0] * F[0][0] + F[0][1] * F[1][0] + F[1][1])


def integrand_of(energy):
    return second_gradient_energy(energy.density, energy.name, energy.parameters)


ENERGIES = {
    "everything": second_gradient_energy(everything, "everything", ("a",)),
    "in_plane": second_gradient_energy(in_plane, "in_plane", ("mu",)),
    "solid": integrand_of(DENSITIES["solid"]),
    "medium": integrand_of(third_medium(Medium().resolve()[0], damped=True, medium="isochoric", volumetric=False)),
}


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    rng = np.random.default_rng(8)
    return np.concatenate([sample(regime, 10, rng) for regime in REGIMES[:2]])


def density(energy, F, G, across=1.0):
    """The energy at single states, with F[2][2]."""
    p, m = SimpleNamespace(**VALUES), numpy_namespace()
    rows = [[*(F[:, i, j] for j in (0, 1)), 0.0] for i in (0, 1)]
    return energy.function([*rows, [0.0, 0.0, across]], np.moveaxis(G, 0, -1), p, m)


@pytest.mark.parametrize("name", ["everything", "medium", "in_plane"])
def test_stresses_are_the_slopes_of_the_energy(name, states) -> None:
    energy, (F, G), step = ENERGIES[name], from_vector(states), 1e-6
    stress = stress_of(energy)
    P, across = stress.at(F, G, VALUES)
    for i, j in np.ndindex(2, 2):
        change = np.zeros((2, 2))
        change[i, j] = step
        slope = (density(energy, F + change, G) - density(energy, F - change, G)) / (2.0 * step)
        np.testing.assert_allclose(P[:, i, j], slope, rtol=1e-6, atol=1e-6, err_msg=f"{i}{j}")
    if name == "in_plane":
        assert across is None
        assert stress.reason == out_of_plane_stress(energy).reason != ""
        return
    assert stress.reason == ""
    slope = (density(energy, F, G, 1.0 + step) - density(energy, F, G, 1.0 - step)) / (2.0 * step)
    np.testing.assert_allclose(across, slope, rtol=1e-6, atol=1e-6)


def test_stresses_are_those_of_the_compiled_kernel(states) -> None:
    energy, (F, _) = ENERGIES["solid"], from_vector(states)
    P, across = stress_of(energy).at(F, None, VALUES)
    assert across is not None
    kernel = Kernel(compiled(energy), energy)
    _, expected, _ = kernel.points(GRADIENT, states, kernel.parameter_array(VALUES))
    assert expected is not None
    flat = np.stack([P[:, 0, 0], P[:, 1, 0], P[:, 0, 1], P[:, 1, 1]], axis=1)
    np.testing.assert_allclose(flat, expected[:, :4], rtol=1e-9, atol=1e-10)


def test_parameters_may_vary_and_points_come_in_any_number(states) -> None:
    """More points than are taken at once, with a parameter of each row."""
    F = np.tile(from_vector(states)[0][:1], (AT_ONCE // 8 + 3, 16, 1, 1))
    mu = np.arange(1.0, len(F) + 1.0)[:, None]
    P, across = stress_of(ENERGIES["solid"]).at(F, None, {"K": 0.0, "mu": mu})
    assert across is not None
    np.testing.assert_allclose(P, mu[..., None, None] * P[:1], rtol=1e-12)
    np.testing.assert_allclose(across, mu * across[:1], rtol=1e-12)


def test_an_energy_says_what_it_needs() -> None:
    assert [stress_of(ENERGIES[name]).uses_second_gradient for name in ("everything", "solid")] == [True, False]
    with pytest.raises(ValueError, match="needs second gradients"):
        stress_of(ENERGIES["everything"]).at(np.eye(2)[None], None, VALUES)
    with pytest.raises(CodegenError, match="reads no deformation gradient"):
        stress_of(Integrand("bare", (SECOND_GRADIENT,), (), lambda G, p, m: G[0][0][0]))
