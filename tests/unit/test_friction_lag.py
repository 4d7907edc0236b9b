"""How far friction is behind at the end of a step: of first order, about the error of the shear, and 0 where nothing
changes that it goes by."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers_slip import Layer, sheared

SQUEEZED = 0.01
LIMIT = 0.30037  # of shear by pressure for k = 5 without the parasitic part, small steps


def pressed(weight: float = 1.0) -> Layer:
    layer = Layer(weight)
    for stretch in np.geomspace(1.0, SQUEEZED, 9)[1:]:
        layer.step(sheared(0.0, float(stretch)))
    return layer


def slid(n: int, to: float = 5.0) -> tuple[float, float]:
    """Error of the shear by pressure at the end of a slip in n steps, and how far friction is said to be behind."""
    layer = pressed()
    for k in np.linspace(0.0, to, n + 1)[1:]:
        P, behind = layer.step(sheared(float(k), SQUEEZED))
    parasitic = 3.0 * SQUEEZED * to / (2.0 + to**2 - 2.0 * SQUEEZED**2)
    return abs(-P[0, 1] / P[1, 1] - parasitic - LIMIT) / LIMIT, behind.behind / behind.carried


def test_it_is_of_first_order_and_not_smaller_than_the_error() -> None:
    errors, behind = np.transpose([slid(n) for n in (50, 100, 200)])
    np.testing.assert_allclose(behind[:-1] / behind[1:], 2.0, rtol=0.05)
    np.testing.assert_allclose(errors[:-1] / errors[1:], 2.0, rtol=0.05)
    np.testing.assert_allclose(errors / behind, 0.65, atol=0.03)


def test_nothing_is_behind_where_nothing_changes() -> None:
    layer = pressed()
    assert layer.lag(layer.F).behind == pytest.approx(0.0, abs=1e-9 * layer.lag(layer.F).carried)
    unsqueezed = Layer()
    _, behind = unsqueezed.step(sheared(0.3, 0.6))
    assert (behind.behind, behind.carried) == (0.0, 0.0)


@pytest.mark.parametrize("angle", [0.01, -0.03])
def test_turning_in_a_step_is_an_error_of_the_angle(angle: float) -> None:
    """While it slides, in units of what slides."""
    layer = pressed()
    layer.step(sheared(0.02, SQUEEZED))
    assert abs(layer.slip.tau[0, 0]) == pytest.approx(layer.slip.bound[0, 0], rel=1e-3)
    c, s = math.cos(angle), math.sin(angle)
    found = layer.lag(np.array([[c, -s], [s, c]]) @ layer.F)
    assert found.behind / found.carried == pytest.approx(2.0 * math.sin(abs(angle) / 2.0), rel=1e-3)


@pytest.mark.parametrize(("further", "slides"), [(0.06, True), (0.05, False)])
def test_a_layer_that_is_pressed_further_lags_by_what_its_traction_gains(further: float, *, slides: bool) -> None:
    """Per undeformed area: what the bound gains if it slides, what the same shear gains by the smaller gap if not."""
    layer, stretch = pressed(), 0.9 * SQUEEZED
    layer.step(sheared(0.05, SQUEEZED))
    before = layer.slip.bound[0, 0] / SQUEEZED
    found = layer.lag(sheared(further, stretch))
    layer.step(sheared(further, stretch))
    after = layer.slip.bound[0, 0] / stretch
    assert found.carried == pytest.approx(after, rel=3e-3)
    assert found.behind == pytest.approx(after - before if slides else before / 0.9 - before, rel=0.02)


def test_contact_that_begins_in_a_step_is_behind_by_all_of_its_friction() -> None:
    layer = Layer()
    layer.step(sheared(0.0, 0.6))
    found = layer.lag(sheared(1.0, 0.02))
    assert found.behind == pytest.approx(found.carried, rel=1e-9)


def test_integrals_are_weighted_with_the_area() -> None:
    one, three = (pressed(weight).lag(sheared(0.05, 0.9 * SQUEEZED)) for weight in (1.0, 3.0))
    assert (three.behind, three.carried) == pytest.approx((3.0 * one.behind, 3.0 * one.carried))
