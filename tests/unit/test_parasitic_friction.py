"""The friction of a medium that has none: a homogeneous layer that is sheared, whose tractions are known."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from helpers_mesh import grid
from helpers_system import CLAMPED, interpolate, make_system, region

from tmc_vem.results.plausibility import PARASITIC
from tmc_vem.vem.system import VemSystem

MU, GAMMA = 10.0, 1e-3
SLIPS = (0.1, 0.5, 1.0, 2.0, 5.0)


@pytest.fixture(scope="module", params=["medium", "medium_balanced"])
def layer(request: pytest.FixtureRequest) -> tuple[str, VemSystem]:
    """A unit square of medium, all of whose nodes are prescribed; what acts on its sides cancels at the corners."""
    mesh = grid(3, 2)
    outer = mesh.named_edges["boundary"]
    top = outer[(mesh.points_vx[outer][..., 1] > 1.0 - 1e-9).all(axis=1)]
    mesh = dataclasses.replace(mesh, named_edges={"boundary": outer, "top": top})
    values = region(f"{request.param}_huhu_lulu_damped", mu=MU, gamma=GAMMA, alpha_r=1.0, beta=5.0)
    return request.param, make_system(mesh, values, CLAMPED)


def tractions(system: VemSystem, k: float, stretch: float) -> tuple[float, float]:
    """Shear and pressure of the upper face at F = [[1, k], [0, l]]."""
    u, residual = interpolate(system, lambda x: x[:, 1:] * [k, stretch - 1.0]), system.create_vector()
    system.residual(u, residual)
    return system.reaction(residual, "top", 0), -system.reaction(residual, "top", 1)


def known(medium: str, k: float, stretch: float) -> float:
    """Shear over pressure, from the energies by hand: theory_beyond of ours has the first."""
    if medium == "medium":
        return 3 * stretch * k / (2 + k**2 - 2 * stretch**2)
    return 3 * stretch * k / (3 + k**2 - 2 * stretch**2 - stretch ** (5 / 3))


@pytest.mark.parametrize("stretch", [0.3, 0.01])
def test_the_frictionless_medium_has_a_parasitic_friction(layer: tuple[str, VemSystem], stretch: float) -> None:
    medium, system = layer
    for k in (*SLIPS, -1.0):
        shear, pressure = tractions(system, k, stretch)
        assert shear / pressure == pytest.approx(known(medium, k, stretch), rel=1e-9)
        assert abs(shear) <= PARASITIC * stretch / math.sqrt(1.0 - stretch**2) * pressure
    shear, pressure = tractions(system, 0.0, stretch)
    assert shear == pytest.approx(0.0, abs=1e-12 * pressure)


def test_the_bound_is_that_of_the_worst_slip(layer: tuple[str, VemSystem]) -> None:
    """At k^2 = 2 (1 - l^2) the paper's medium has 1.06 l; the balanced one stays below, at sqrt(3) / 2 l."""
    medium, system = layer
    stretch = 1e-3
    worst, most = {"medium": (math.sqrt(2.0), PARASITIC), "medium_balanced": (math.sqrt(3.0), 0.8660)}[medium]
    shear, pressure = tractions(system, worst, stretch)
    assert shear / pressure / stretch == pytest.approx(most, rel=1e-3)
    assert pressure > 2.0 * GAMMA * MU / 3.0 * stretch ** (-5 / 3)
    assert all(np.divide(*tractions(system, f * worst, stretch)) < shear / pressure for f in (0.7, 1.4))
