"""Laws of densities: interpolation, projection and its continuation."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.design.interpolation import Ramp, Simp, interpolation
from tmc_vem.design.projection import Continuation, Projection
from tmc_vem.support.errors import InputError

X = np.linspace(0.05, 0.95, 19)


def rate_of(value, slope, x=X):
    """Rate at which value(x + h d) - value(x) - h slope d goes to zero."""
    direction = np.sin(7.0 * x)
    error = [np.linalg.norm(value(x + h * direction) - value(x) - h * slope(x) * direction) for h in (1e-2, 1e-3)]
    return np.log10(error[0] / error[1])


@pytest.mark.parametrize("law", [Simp(), Simp(1.7), Ramp(), Ramp(0.5)])
def test_slopes_of_interpolation(law):
    assert rate_of(law.factor, law.slope) == pytest.approx(2.0, abs=0.1)
    assert law.factor(np.array([0.0, 1.0])).tolist() == [0.0, 1.0]
    assert (np.diff(law.factor(X)) > 0.0).all()


def test_closed_forms():
    assert Simp(3.0).factor(np.array([0.5])) == pytest.approx(0.125)
    assert Ramp(8.0).factor(np.array([0.5])) == pytest.approx(0.1)
    assert Ramp(8.0).slope(np.array([0.0, 1.0])) == pytest.approx([1.0 / 9.0, 9.0])
    assert Simp(1.0).factor(X) == pytest.approx(X)
    assert Ramp(0.0).factor(X) == pytest.approx(X)


def test_laws_by_name():
    assert interpolation("simp") == Simp(3.0)
    assert interpolation("ramp", q=4) == Ramp(4.0)
    with pytest.raises(InputError, match=r"unknown interpolation 'smip'.*simp"):
        interpolation("smip")
    with pytest.raises(InputError, match=r"'ramp' has no 'p'"):
        interpolation("ramp", p=3.0)
    with pytest.raises(InputError, match=r"p = '3' .* no number"):
        interpolation("simp", p="3")
    with pytest.raises(InputError, match=r"exponent p of SIMP = 0.5"):
        Simp(0.5)
    with pytest.raises(InputError, match=r"q of RAMP = -1"):
        Ramp(-1.0)


@pytest.mark.parametrize("eta", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("beta", [0.1, 1.0, 8.0])
def test_slope_of_projection(beta, eta):
    projection = Projection(beta, eta)
    assert rate_of(projection.value, projection.slope) == pytest.approx(2.0, abs=0.15)
    assert projection.value(np.array([0.0, 1.0])) == pytest.approx([0.0, 1.0], abs=1e-15)


def test_limits_of_projection():
    assert Projection(1e-6).value(X) == pytest.approx(X, abs=1e-9)
    assert Projection(1e4, 0.52).value(X) == pytest.approx((X > 0.52).astype(float))
    assert np.isfinite(Projection(1e4).slope(X)).all()
    steep = Projection(16.0, 0.4)
    assert steep.value(np.array([0.4])) == pytest.approx(np.tanh(6.4) / (np.tanh(6.4) + np.tanh(9.6)))
    assert steep.slope(np.array([0.4])) == pytest.approx(16.0 / (np.tanh(6.4) + np.tanh(9.6)))
    for wrong in ({"beta": 0.0}, {"beta": 1e5}, {"eta": 1.1}, {"beta": np.nan}):
        with pytest.raises(InputError, match="of the projection"):
            Projection(**wrong)


def test_continuation():
    betas = [level.beta for level in Continuation(1.0, 20.0, 2.0).levels()]
    assert betas == [1.0, 2.0, 4.0, 8.0, 16.0, 20.0]
    assert [level.beta for level in Continuation(4.0, 4.0).levels()] == [4.0]
    assert {level.eta for level in Continuation(eta=0.4).levels()} == {0.4}
    schedule = Continuation(every=10, change=0.02)
    assert [schedule.ended(9, 0.1), schedule.ended(10, 0.1), schedule.ended(3, 0.01)] == [False, True, True]
    for wrong in ({"first": 8.0, "largest": 4.0}, {"factor": 1.0}, {"every": 0}, {"change": -1.0}, {"every": True}):
        with pytest.raises(InputError):
            Continuation(**wrong)
