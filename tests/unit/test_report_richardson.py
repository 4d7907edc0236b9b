"""Extrapolation to vanishing mesh size."""

from __future__ import annotations

import pytest

from tmc_vem.report.richardson import extrapolate
from tmc_vem.support.errors import InputError


@pytest.mark.parametrize("order", [0.8, 1.0, 2.0, 3.5])
@pytest.mark.parametrize("sizes", [(1.0, 0.5, 0.25), (1 / 2, 1 / 3, 1 / 4), (1.0, 0.9, 0.3)])
def test_finds_the_limit_and_the_order(order: float, sizes: tuple[float, float, float]) -> None:
    result = extrapolate(sizes, [3.0 - 0.7 * h**order for h in sizes])
    assert result.value == pytest.approx(3.0, rel=1e-9)
    assert result.order == pytest.approx(order, rel=1e-6)
    assert result.uncertainty == pytest.approx(1.25 * 0.7 * sizes[2] ** order, rel=1e-6)


def test_too_fast_convergence_is_not_believed() -> None:
    sizes = (1.0, 0.5, 0.25)
    result = extrapolate(sizes, [3.0 + h**6 for h in sizes])
    assert result.order is None
    assert result.value == 3.0 + sizes[2] ** 6
    assert result.uncertainty == pytest.approx(3.0 * (0.5**6 - 0.25**6))


@pytest.mark.parametrize(
    ("values", "uncertainty"),
    [
        pytest.param((1.0, 1.2, 1.1), 0.2, id="oscillates and settles"),
        pytest.param((1.0, 1.1, 0.9), 0.6, id="oscillates and grows"),
        pytest.param((1.0, 1.1, 1.3), 0.6, id="diverges"),
        pytest.param((1.0, 1.1, 1.19), 0.3, id="hardly converges"),
        pytest.param((1.0, 1.1, 1.1), 0.3, id="stops"),
    ],
)
def test_no_order_no_model(values: tuple[float, float, float], uncertainty: float) -> None:
    result = extrapolate((1.0, 0.5, 0.25), values)
    assert result.order is None
    assert result.value == values[2]
    assert result.uncertainty == pytest.approx(uncertainty)


def test_a_line_for_people() -> None:
    assert str(extrapolate((1.0, 0.5, 0.25), (1.0, 1.5, 1.75))) == "2.0000e+00 ± 3e-01 (15.6%, order 1.0)"


def test_wrong_input() -> None:
    with pytest.raises(InputError, match="needs three"):
        extrapolate((1.0, 0.5), (1.0, 2.0))
    with pytest.raises(InputError, match="must decrease"):
        extrapolate((1.0, 0.5, 0.5), (1.0, 2.0, 3.0))
