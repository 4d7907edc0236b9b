"""Residual and tangent are the derivatives of the energy, for every treatment of the second gradient."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_fem import SOLID, layered, make_system, medium, random_vector, rates, wavy

STEPS = [2.0**-n for n in range(3, 7)]


def check(mode: str, regulariser: str, triangles: bool) -> None:
    """Remainders of the energy fall with order 2 and 3, that of the residual with order 2."""
    regions = {"solid": SOLID, "medium": medium(regulariser)}
    system = make_system(layered(3, 3), regions, interior_penalty=mode, triangles=triangles)
    u, du = system.interpolate(wavy), random_vector(system, 1, 0.02)
    gradient, moved, action = system.create_vector(), system.create_vector(), system.create_vector()
    matrix = system.create_matrix()
    energy = system.residual(u, gradient).energy
    system.jacobian(u, matrix)
    system.tangent_action(du, action)
    slope, curvature = gradient.dot(du), action.dot(du)
    first, second, residual = [], [], []
    trial = u.duplicate()
    for step in STEPS:
        trial.waxpy(step, du, u)
        change = system.residual(trial, moved).energy - energy
        first.append(abs(change - step * slope))
        second.append(abs(change - step * slope - 0.5 * step**2 * curvature))
        moved.axpy(-1.0, gradient)
        moved.axpy(-step, action)
        residual.append(moved.norm())
    assert rates(STEPS, first)[-1] == pytest.approx(2.0, abs=0.1)
    assert rates(STEPS, second)[-1] == pytest.approx(3.0, abs=0.2)
    assert rates(STEPS, residual)[-1] == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("mode", ["none", "penalty", "full"])
def test_taylor(mode: str, triangles: bool) -> None:
    check(mode, "huhu_lulu", triangles)


@pytest.mark.slow
@pytest.mark.parametrize("regulariser", ["huhu", "angle", "tangent"])
@pytest.mark.parametrize("mode", ["none", "penalty", "full"])
def test_taylor_of_other_regularisers(mode: str, regulariser: str) -> None:
    check(mode, regulariser, triangles=True)


@pytest.mark.parametrize("mode", ["none", "penalty"])
def test_tangent_is_symmetric(mode: str) -> None:
    system = make_system(layered(3, 3), {"solid": SOLID, "medium": medium()}, interior_penalty=mode)
    u = system.interpolate(wavy)
    matrix = system.create_matrix()
    system.jacobian(u, matrix)
    n = matrix.getSize()[0]
    dense = np.array(matrix.getValues(range(n), range(n)))
    assert np.abs(dense - dense.T).max() < 1e-12 * np.abs(dense).max()
