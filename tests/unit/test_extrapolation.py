"""The limit of values for gamma to 0: exponents, intervals, and when there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tmc_vem.results.extrapolation import EXPONENT, estimate, local_exponents, ratio_of

GAMMA = 10.0 ** -np.arange(4.0, 6.1, 0.5)
# Reaction of the box of 20 x 10 cells at gamma = 1e-4 to 1e-6, and that of a conventional contact computation
BOX = {
    0.30: ([0.0107315, 0.0094480, 0.0087700, 0.0084480, 0.0083170], 0.0082482),
    0.40: ([0.014089177, 0.012599223, 0.011816400, 0.011434057, 0.011264513], 0.0111474),
    0.50: ([0.018150, 0.016728, 0.016078, 0.015797, 0.015678], 0.015581),
    0.70: ([0.028560, 0.026984, 0.026242, 0.025884, 0.025708], 0.025536),
    1.00: ([0.057981, 0.055094, 0.053658, 0.052941, 0.052585], 0.052254),
}


def rest(exponent: float) -> float:
    return 1.0 / (10.0 ** (exponent / 2.0) - 1.0)


def power(exponent: float, size: float = 2.0, limit: float = 1.0) -> list[float]:
    return [limit + size * value for value in (GAMMA / GAMMA[0]) ** exponent]


def test_an_established_contact() -> None:
    values = power(EXPONENT)
    last = values[-2] - values[-1]
    made = estimate(values)
    low, high = (values[-1] - last * rest(q) for q in (0.54, 0.66))
    assert made.value == pytest.approx(1.0, rel=1e-12)
    assert made.uncertainty == pytest.approx(1.0 - low, rel=1e-9)
    assert made.uncertainty > high - 1.0
    assert made.ratio == pytest.approx(10.0**0.6, rel=1e-12)
    assert made.reason is None


def test_only_the_last_values_count() -> None:
    assert estimate([7.0, 6.0, *power(EXPONENT)]) == estimate(power(EXPONENT))


@pytest.mark.parametrize(
    ("exponents", "low", "high"),
    [
        ((0.6, 0.7), 0.64, 0.96),  # it rises, and may go on to
        ((0.7, 0.6), 0.34, 0.66),
        ((0.5, 0.5), 0.44, 0.5 + 0.06 + 2.5 * 0.07),  # contact begins
        ((1.0, 1.0), 0.94, 1.06),  # no contact
        ((1.1, 1.22), 1.16, 1.25),
        ((1.3, 1.3), 1.19, 1.25),
        ((0.5, 0.35), 0.3, 0.35 + 0.06 + 2.5 * 0.22),
        ((0.25, 0.25), 0.3, 0.25 + 0.06 + 2.5 * 0.32),
    ],
)
def test_the_interval_is_that_of_the_exponents(exponents: tuple[float, float], low: float, high: float) -> None:
    changes = [1.0]
    for exponent in (*exponents[::-1], 0.6):
        changes.insert(0, changes[0] * 10.0 ** (exponent / 2.0))
    values = 50.0 - np.cumsum([0.0, *changes])
    made = estimate(values.tolist())
    first, middle, last = (values[-1] - rest(q) for q in (low, 0.5 * (low + high), high))
    assert made.value == pytest.approx(middle, rel=1e-12)
    assert made.uncertainty == pytest.approx(middle - first, rel=1e-9)  # the longer half
    assert middle - first > last - middle


@pytest.mark.parametrize("load", BOX)
def test_the_box_comes_to_conventional_contact(load: float) -> None:
    values, conventional = BOX[load]
    for sign in (1.0, -1.0):
        made = estimate([sign * value for value in values])
        assert made.value is not None
        assert made.uncertainty is not None
        assert abs(made.value - sign * conventional) <= made.uncertainty
        assert made.value == pytest.approx(sign * conventional, rel=2e-3)
        assert 0.0 < made.uncertainty < 0.005 * conventional


def test_values_that_do_not_change() -> None:
    assert estimate([-0.5] * 5) == estimate([-0.5] * 6)
    made = estimate([-0.5, -0.5, -0.5 + 4e-9, -0.5, -0.5])
    assert (made.value, made.uncertainty, made.ratio) == (-0.5, pytest.approx(0.5e-8), None)
    assert estimate([0.0] * 5).value == 0.0
    assert estimate([0.0] * 5).uncertainty == 0.0
    assert estimate([-0.5, -0.5, -0.5 + 6e-9, -0.5, -0.5]).uncertainty != pytest.approx(0.5e-8)


def test_values_that_turn() -> None:
    small = [2.0, 1.9993, 1.9990, 1.9992, 1.9991]
    made = estimate(small)
    assert made.value == pytest.approx(1.9991 + 1e-4 * -1.0)
    assert made.uncertainty == pytest.approx(3.0 * 2e-4)
    large = estimate([2.0, 1.5, 1.2, 1.205, 1.2])
    assert (large.value, large.uncertainty, large.reason) == (None, None, "it follows no power of gamma")
    assert large.ratio is None  # its last change over a decade is none
    assert estimate([2.0, 1.5, 1.2, 1.205, 1.21]).ratio == pytest.approx(0.8 / -0.01)


def test_exponents_of_no_power_law() -> None:
    assert local_exponents(np.array([4.0, 2.0, 1.0])) == pytest.approx([2.0 * math.log10(2.0)] * 2)
    assert local_exponents(np.array([4.0, 0.0, 1.0])) is None
    assert local_exponents(np.array([4.0, -2.0, 1.0])) is None
    assert local_exponents(np.array([9.0, 5.1, 1.0])) is None  # 1.415
    assert local_exponents(np.array([5.1, 1.0, 0.5])) is None
    assert local_exponents(np.array([9.0, 5.0, 1.0])) is not None  # 1.398
    assert local_exponents(np.array([9.0, 1.25, 1.0])) is None  # 0.194
    assert local_exponents(np.array([9.0, 1.27, 1.0])) is None  # the one before it
    assert local_exponents(np.array([2.0, 1.27, 1.0])) is not None


def test_what_is_too_vague_is_withheld() -> None:
    values = power(0.21)  # hardly anything of the whole change has come
    made = estimate(values)
    assert made.value is None
    assert made.reason == "contact begins at this load: how its value goes on with gamma is too uncertain"
    assert made.ratio == pytest.approx(10.0**0.21)


def test_what_is_no_sequence_of_values() -> None:
    assert estimate([1.0] * 4).reason == "4 values of gamma, 5 are needed"
    assert estimate([1.0, 1.0, math.nan, 1.0, 1.0]).reason == "it is not a number at every gamma"
    assert estimate([1.0, math.inf, 1.0, 1.0, 1.0]).ratio is None


def test_the_ratio_is_that_of_decades() -> None:
    assert ratio_of([9.0, 7.0, 6.5, 3.0, 2.0, 1.5]) == pytest.approx((7.0 - 3.0) / (3.0 - 1.5))
    assert ratio_of([7.0, 6.5, 3.0, 2.0, 3.0]) is None
