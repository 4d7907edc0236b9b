"""Widths from pressures, and pressures of the medium's own stress."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from codegen.integrand import second_gradient_energy
from tmc_vem.energy.registry import DENSITIES
from tmc_vem.results.contact.bump import Bump, vanishes
from tmc_vem.simulation.medium_pressure import MediumPressure, normal_pressure
from tmc_vem.system.point_states import PointStates

X = np.linspace(-0.8, 0.9, 12) + 3.0
HERTZ = 5.0 * np.sqrt(1.0 - ((X - 3.1) / 1.2) ** 2)
W = np.linspace(1.0, 2.0, 12)


def test_the_pressure_of_hertz_is_found_exactly() -> None:
    found = Bump.fit(X, HERTZ, W, 0.0, 9.0)
    assert found is not None
    assert (found.centre, found.half_width, found.pressure) == pytest.approx((3.1, 1.2, 5.0), rel=1e-10)


def test_weights_count() -> None:
    wrong = HERTZ.copy()
    wrong[4] *= 1.1
    one, other = (Bump.fit(X, wrong, np.where(np.arange(12) == 4, w, 1.0), 0.0, 9.0) for w in (1e-9, 1.0))
    assert one is not None
    assert other is not None
    assert one.half_width == pytest.approx(1.2, rel=1e-6)
    assert abs(other.half_width - 1.2) > 1e-3


def test_what_is_no_round_contact_has_no_half_width() -> None:
    assert Bump.fit(X[:3], HERTZ[:3], W[:3], 0.0, 9.0) is None, "too few"
    assert Bump.fit(np.ones(5), HERTZ[:5], W[:5], 0.0, 9.0) is None, "one place"
    assert Bump.fit(X, np.full(12, 2.0) + 0.01 * (X - 3.0) ** 2, W, 0.0, 9.0) is None, "more pressure at the ends"
    assert Bump.fit(X, HERTZ, W, 2.0, 9.0) is None, "contact ends at 2, the parabola at 1.9"
    assert Bump.fit(X, HERTZ, W, 0.0, 4.2) is None, "contact ends at 4.2, the parabola at 4.3"
    middle = slice(5, 9)
    assert Bump.fit(X[middle], HERTZ[middle], W[middle], 0.0, 9.0) is None, "seen too little of"


def test_where_the_pressure_vanishes() -> None:
    right = X >= 3.1
    assert vanishes(X[right], HERTZ[right], W[right], 9.0) == pytest.approx(4.3)
    assert vanishes(X[right], HERTZ[right], W[right], 4.1) == 4.1, "not beyond the end"
    assert vanishes(X[:2], HERTZ[:2], W[:2], 7.0) == 7.0, "too few"
    level = np.full(12, 2.0)
    assert vanishes(X, level, W, 4.0) == 4.0


def test_the_pressure_is_that_across_the_most_squeezed_direction() -> None:
    """F = Q diag(1, 1/4) Q^T, sigma with 3 across and 7 along: -3, however it is turned."""
    for angle in (0.0, 0.4, 2.0):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        F = turn @ np.diag([1.0, 0.25]) @ turn.T
        P = 0.25 * (turn @ np.diag([7.0, 3.0]) @ turn.T) @ np.linalg.inv(F).T  # J sigma F^-T
        assert normal_pressure(F[None, None], P[None, None]) == pytest.approx(np.array([[-3.0]]))


def test_the_pressure_of_cells_of_the_medium_is_that_without_its_regulariser() -> None:
    energy = DENSITIES["medium_huhu_lulu_damped"]
    integrand = second_gradient_energy(energy.density, energy.name, energy.parameters)
    values = {"mu": 10.0, "gamma": 1e-2, "alpha_r": 0.5, "beta": 5.0}
    F = np.array([[[[1.0, 0.2], [0.0, 0.1]], [[1.0, 0.0], [0.0, 0.2]]]])
    w = np.array([[0.3, 0.7]])

    def pressure(G: Any) -> Any:
        states = [PointStates("s", np.array([0]), w, None, F, None, {}),  # type: ignore[arg-type]
                  PointStates("m", np.array([1]), w, None, F, G, values)]  # type: ignore[arg-type]  # fmt: skip
        system: Any = SimpleNamespace(cell_numbers=lambda: np.arange(2), point_states=lambda u: iter(states))
        return MediumPressure(system, {"m": integrand}).of_cells(None)  # type: ignore[arg-type]

    level, bent = pressure(np.zeros((1, 2, 2, 2, 2))), pressure(np.ones((1, 2, 2, 2, 2)))
    assert np.isnan(level[0])
    assert bent[1] == level[1] > 0.0
    ends = [2.0 / 3.0 * 0.1 * (s ** (-5.0 / 3.0) - s ** (1.0 / 3.0)) for s in (0.1, 0.2)]
    assert min(ends) < level[1] < 1.1 * max(ends)
