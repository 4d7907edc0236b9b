"""Energies as users write them keep their relative accuracy near F = I, whatever functions they are made of."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy as sp
from test_codegen_accuracy import LIMIT, MP, near_identity, reference, relative_error

from codegen import oracle
from codegen.centre import Centred
from codegen.derive import to_sympy
from codegen.integrand import second_gradient_energy
from codegen.kernel import TANGENT, compile_energy
from codegen.trace import trace

MP.sin, MP.cos, MP.atan = mpmath.sin, mpmath.cos, mpmath.atan


def det(F):
    return F[0][0] * F[1][1] - F[0][1] * F[1][0]


def trace_c(F):
    return 1 + sum(F[i][j] * F[i][j] for i in (0, 1) for j in (0, 1))


def ciarlet(F, G, p, m):
    return p.mu / 2 * (trace_c(F) - 3 - 2 * m.log(det(F))) + p.K / 4 * (det(F) ** 2 - 1 - 2 * m.log(det(F)))


def fung(F, G, p, m):
    return p.K * (m.exp(p.mu * (trace_c(F) - 3 - 2 * m.log(det(F)))) - 1)


def inverse_powers(F, G, p, m):
    return p.mu * (det(F) ** 2 + 1 / det(F) ** 2 - 2) + (1 / det(F) - 1) ** 2


def two_dimensional(F, G, p, m):
    return p.mu * ((trace_c(F) - 1) / det(F) - 2)


def roots(F, G, p, m):
    return p.mu * (m.sqrt(det(F)) + 1 / m.sqrt(det(F)) - 2) + (m.sqrt(trace_c(F) / 3) - m.exp(m.log(det(F)) / 3)) / 4


def logarithms(F, G, p, m):
    return p.mu * (3 * m.log(trace_c(F) / 3) - 2 * m.log(det(F))) + p.K * m.log(trace_c(F) / 3) ** 2


def fractional_powers(F, G, p, m):
    return p.mu * (8 * (trace_c(F) / 12) ** 1.5 * det(F) ** -1.0 - 1)


def with_gradient(F, G, p, m):
    return ciarlet(F, G, p, m) + p.mu * m.exp(-p.K * det(F)) * (F[1][1] * G[0][0][0] - F[0][1] * G[1][0][0]) ** 2


def stressed(F, G, p, m):
    """Vanishes at F = I but its stress does not."""
    return p.mu * m.log(det(F))


STRESS_FREE = [ciarlet, fung, inverse_powers, two_dimensional, roots, logarithms, fractional_powers, with_gradient]
PARAMETERS = ("mu", "K")
VALUES = {"mu": 10.0, "K": 20.0}


@pytest.mark.parametrize("size", [1e-8, 1e-5, 1e-2, 0.3])
@pytest.mark.parametrize("density", [*STRESS_FREE, stressed], ids=lambda density: density.__name__)
def test_relative_accuracy_near_the_identity(density, size):
    kernel = compile_energy(density, density.__name__, PARAMETERS)
    x_nx = near_identity(size, 3)
    x_nx[:, 4:] *= 0.1
    psi, g, h = kernel.points(TANGENT, x_nx, kernel.parameter_array(VALUES))
    with mpmath.workdps(94):
        for n, x in enumerate(x_nx):
            exact_psi, exact_g, exact_h = reference(density, x)
            assert relative_error([psi[n]], [exact_psi]) < LIMIT
            assert relative_error(g[n], exact_g) < LIMIT
            assert relative_error(h[n].ravel(), exact_h) < LIMIT


@pytest.mark.parametrize("density", STRESS_FREE, ids=lambda density: density.__name__)
def test_rest_is_exact_for_every_parameter(density):
    """Constant and linear part vanish as expressions, not just for some values."""
    value = to_sympy(trace(second_gradient_energy(density, density.__name__, PARAMETERS)))
    assert isinstance(value, Centred)
    assert value.constant == 0
    assert value.linear == {}


def split(density) -> Centred:
    value = to_sympy(trace(second_gradient_energy(density, "mine", ("a",))))
    assert isinstance(value, Centred)
    return value


def test_constant_and_linear_part_are_those_of_the_energy():
    a = sp.Symbol("p_a", real=True)
    value = split(lambda F, G, p, m: p.a * m.exp(F[0][1]) + F[0][0] * F[1][1] * m.log(F[1][1]) + p.a * G[0][1][0])
    assert value.constant == a
    assert {str(x): c for x, c in value.linear.items()} == {"F12": a, "H22": 1, "G121": a}


@pytest.mark.parametrize(
    "density",
    [
        lambda F, G, p, m: m.atan2(F[0][1] - F[1][0], F[0][0] + F[1][1]) ** 2 + (det(F) - 1) ** 2,
        lambda F, G, p, m: m.atan(F[0][1] - F[1][0]) ** 2 + m.sin(F[0][0]) + m.cos(G[0][0][0]),
        lambda F, G, p, m: m.sqrt((F[0][0] - 1) ** 2 + G[0][0][0] ** 2 + 0.25) + m.log(det(F) + 0.5),
        lambda F, G, p, m: m.sin(p.mu) * F[0][0] ** 3 / (1 + F[0][1] ** 2) + F[0][0] ** 0 + (-F[1][1]) ** 9,
        lambda F, G, p, m: (F[0][0] - 1) ** 1.5 + 1 / (F[0][1] - F[1][0]) + F[1][1] ** -2.5,
        lambda F, G, p, m: (1 - det(F)) / (det(F) - 4) + (F[0][0] + F[1][1]) ** -3 * det(F) ** 2.5,
    ],
)
def test_functions_without_a_centred_form_are_evaluated_as_written(density):
    kernel = compile_energy(density, "mixed", PARAMETERS)
    x_nx = np.random.default_rng(1).uniform(0.05, 0.3, (20, 12))
    x_nx[:, 2] += 0.4
    psi, g, _ = kernel.points(TANGENT, x_nx, kernel.parameter_array(VALUES))
    np.testing.assert_allclose(psi, oracle.energy_density(density, x_nx, VALUES), rtol=1e-13)
    expected = oracle.gradient(density, x_nx, VALUES)
    np.testing.assert_allclose(g, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
