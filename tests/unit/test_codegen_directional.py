"""Rates along a direction against central differences, for every operation that a density may use."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from codegen.directional import Rated, RatedMath, RatedParameters, rated
from codegen.integrand import SECOND_GRADIENT

M = SimpleNamespace(
    exp=math.exp, log=math.log, sqrt=math.sqrt, sin=math.sin, cos=math.cos, atan=math.atan, atan2=math.atan2
)
FUNCTIONS = {
    "sum": lambda x, y, m: 2 + x - y + (3 - x) - (-y) + (+x),
    "product": lambda x, y, m: 3 * x * y * x,
    "quotient": lambda x, y, m: x / y - 1 / x + y / 4,
    "power": lambda x, y, m: x**3 + y**-2 + x**0.5,
    **{
        name: (lambda x, y, m, name=name: getattr(m, name)(x * y))
        for name in ("exp", "log", "sqrt", "sin", "cos", "atan")
    },
    "atan2": lambda x, y, m: m.atan2(x - 2, -y),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_rate_is_the_derivative_along_the_direction(name: str) -> None:
    x, y, along = 0.7, 1.3, (0.4, -0.9)
    found = FUNCTIONS[name](Rated(x, along[0]), Rated(y, along[1]), RatedMath(M))
    h = 1e-5
    ahead, behind = (FUNCTIONS[name](x + s * h * along[0], y + s * h * along[1], M) for s in (1, -1))
    assert found.value == pytest.approx(FUNCTIONS[name](x, y, M), rel=1e-15)
    assert found.rate == pytest.approx((ahead - behind) / (2 * h), rel=1e-8)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_does_not_change_has_the_number_0_for_its_rate(name: str) -> None:
    found = FUNCTIONS[name](Rated(0.7), Rated(1.3), RatedMath(M))
    assert isinstance(found.rate, int)
    assert found.rate == 0


def test_parameters_do_not_change() -> None:
    p = RatedParameters(SimpleNamespace(mu=3.0))
    product = p.mu * Rated(2.0, 5.0)
    assert (product.value, product.rate) == (6.0, 15.0)


def test_every_component_has_its_own_rate() -> None:
    G, B = ([[[s + 4 * i + 2 * j + k for k in (0, 1)] for j in (0, 1)] for i in (0, 1)] for s in (0.0, 100.0))
    of_pair = rated(SECOND_GRADIENT, G, B)
    pairs = [(of_pair[i][j][k].value, of_pair[i][j][k].rate) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    assert pairs == [(float(n), 100.0 + n) for n in range(8)]
    assert rated(SECOND_GRADIENT, G)[1][1][1].rate == 0
