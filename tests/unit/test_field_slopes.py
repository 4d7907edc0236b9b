"""Derivatives of fields of stress and strain by their tensors: Taylor remainders, and states where they are special."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.sensitivity.field_slopes import SLOPES
from tmc_vem.system.tensors import COMPONENTS, DEFORMATION, SCALARS, values_of

STEPS = np.array([2e-3, 1e-3, 5e-4])


def tensors(name: str, n: int = 40) -> np.ndarray:
    """Tensors whose principal values are apart by more than the steps."""
    rng = np.random.default_rng(4)
    of = SCALARS[name].of
    if of == DEFORMATION:
        F = np.array([1.3, 0.2, -0.1, 0.8]) + rng.uniform(-0.2, 0.2, size=(n, 4))
        return np.concatenate([F, F * np.array([1.0, 1.0, -1.0, -1.0])]) if name.startswith("principal") else F
    spread = np.array([[3.0, 0.0, -2.0, 0.4], [-2.0, 3.0, 0.0, -0.3], [0.0, -2.0, 3.0, 0.2]])
    base = spread[:, : len(COMPONENTS[of])] if of == "cauchy_stress" else np.zeros((1, len(COMPONENTS[of])))
    return (base[:, None] + rng.uniform(-0.3, 0.3, size=(len(base), n, len(COMPONENTS[of])))).reshape(-1, base.shape[1])


def test_all_fields_have_slopes() -> None:
    assert SLOPES.keys() == SCALARS.keys()


@pytest.mark.parametrize("name", SCALARS)
def test_slopes_are_those_of_the_values(name: str) -> None:
    tensor = tensors(name)
    change = np.random.default_rng(6).normal(size=tensor.shape)
    slope = (SLOPES[name](tensor) * change).sum(axis=-1)

    def value(step: float) -> np.ndarray:
        return values_of(name, {SCALARS[name].of: tensor + step * change})

    away = np.array([np.abs((value(e) - value(-e)) / (2.0 * e) - slope).max() for e in STEPS])
    if away.max() < 1e-11:  # linear or quadratic
        assert not name.startswith(("von_mises", "principal", "in_plane", "log_strain"))
        return
    assert np.diff(np.log(away)) / np.diff(np.log(STEPS)) == pytest.approx([2.0, 2.0], abs=0.1)


def test_logarithmic_strains_near_equal_stretches() -> None:
    """On both sides of where a series is taken, and at the very place, where ln(b) / 2 has the slope of E."""
    change = np.array([0.3, -0.2, 0.5, 0.7])
    for away in (0.0, 1e-9, 1e-3, 0.0157, 0.0159, 0.1):
        F = np.array([[1.1 * (1.0 + away), 0.0, 0.0, 1.1 / (1.0 + away)]])
        for name in ("log_strain_xx", "log_strain_yy", "log_strain_xy"):
            slope = (SLOPES[name](F) * change).sum()
            e = 1e-5
            values = [values_of(name, {DEFORMATION: F + step * change})[0] for step in (e, -e)]
            assert slope == pytest.approx((values[0] - values[1]) / (2.0 * e), rel=1e-7, abs=1e-9), (name, away)


def test_where_a_field_has_no_slope_a_mean_is_taken() -> None:
    nothing = np.zeros((1, 4))
    assert not SLOPES["von_mises"](nothing).any()
    same = np.array([[2.0, 2.0, -1.0, 0.0]])
    for name in ("in_plane_stress_1", "in_plane_stress_2"):
        np.testing.assert_array_equal(SLOPES[name](same), [[0.5, 0.5, 0.0, 0.0]])
    for name in ("principal_stretch_1", "principal_stretch_2"):
        np.testing.assert_array_equal(SLOPES[name](np.array([[1.2, 0.0, 0.0, 1.2]])), [[0.5, 0.0, 0.0, 0.5]])
