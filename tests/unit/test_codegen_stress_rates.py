"""Derivatives of stresses by F, G and parameters: Taylor remainders of the stress itself fall with the third power."""

from __future__ import annotations

import numpy as np
import pytest
from test_codegen_stress import ENERGIES, VALUES

from codegen.errors import CodegenError
from codegen.integrand import SECOND_GRADIENT, Integrand, second_gradient_energy
from codegen.sampling import REGIMES, from_vector, sample
from codegen.stress import AT_ONCE, stress_of
from codegen.stress_rates import stress_rates_of

STEPS = np.array([4e-3, 2e-3, 1e-3])


@pytest.mark.parametrize("name", ["everything", "medium", "solid", "in_plane"])
@pytest.mark.parametrize("by", ["F", "G", "parameters"])
def test_rates_are_those_of_the_stress(name, by) -> None:
    energy, rng = ENERGIES[name], np.random.default_rng(5)
    F, G = from_vector(sample(REGIMES[0], 6, rng))
    A, a = rng.normal(size=F.shape), rng.normal(size=len(F))
    dF, dG = (rng.normal(size=X.shape) * (by == which) for X, which in ((F, "F"), (G, "G")))
    dp = {key: rng.normal(size=len(F)) * (by == "parameters") for key in energy.parameter_names}
    stress, rates = stress_of(energy), stress_rates_of(energy)

    def number(e: float) -> np.ndarray:
        p = {key: VALUES[key] + e * dp[key] for key in energy.parameter_names}
        P, across = stress.at(F + e * dF, G + e * dG, p)
        return (P * A).sum(axis=(1, 2)) + (0.0 if across is None else across * a)

    found = rates.at(F, G, VALUES, A, a)
    slope = (found.by_F * dF).sum(axis=(1, 2)) + (found.by_parameter * np.stack(list(dp.values()), axis=1)).sum(axis=1)
    if found.by_G is not None:
        slope = slope + (found.by_G * dG).sum(axis=(1, 2, 3))
    away = np.array([np.abs(number(e) - number(-e) - 2.0 * e * slope).max() for e in STEPS])
    scale = np.abs(number(STEPS[0]) - number(-STEPS[0])).max()
    if away.max() <= 1e-12 * max(scale, 1.0):  # linear: there is no remainder
        assert name != "everything" or by == "parameters"
        return
    assert np.diff(np.log(away)) / np.diff(np.log(STEPS)) == pytest.approx([3.0, 3.0], abs=0.1)


def test_parameters_may_vary_and_points_come_in_any_number() -> None:
    """More points than are taken at once, with a parameter of each row; P is linear in mu."""
    F = np.tile(from_vector(sample(REGIMES[0], 1, np.random.default_rng(1)))[0], (AT_ONCE // 8 + 3, 16, 1, 1))
    mu = np.arange(1.0, len(F) + 1.0)[:, None]
    A = np.ones_like(F)
    found = stress_rates_of(ENERGIES["solid"]).at(F, None, {"K": 0.0, "mu": mu}, A)
    P, _ = stress_of(ENERGIES["solid"]).at(F, None, {"K": 0.0, "mu": mu})
    np.testing.assert_allclose(found.by_parameter[..., 1], P.sum(axis=(2, 3)) / mu, rtol=1e-12)
    np.testing.assert_allclose(found.by_F, mu[..., None, None] * found.by_F[:1], rtol=1e-12)


def test_what_has_no_stress_or_none_that_depends_on_anything() -> None:
    only_G = second_gradient_energy(lambda F, G, p, m: p.a * G[0][0][0] ** 2, "only_G", ("a",))
    found = stress_rates_of(only_G).at(np.eye(2)[None], None, {"a": 2.0}, np.ones((1, 2, 2)))
    assert not found.by_F.any()
    assert not found.by_parameter.any()
    assert found.by_G is None
    assert [stress_rates_of(ENERGIES[name]).uses_second_gradient for name in ("everything", "solid")] == [True, False]
    with pytest.raises(ValueError, match="needs second gradients"):
        stress_rates_of(ENERGIES["everything"]).at(np.eye(2)[None], None, VALUES, np.ones((1, 2, 2)))
    with pytest.raises(CodegenError, match="reads no deformation gradient"):
        stress_rates_of(Integrand("bare", (SECOND_GRADIENT,), (), lambda G, p, m: G[0][0][0]))
