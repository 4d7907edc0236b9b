"""Solutions in closed form that the demos of friction are compared with, and how runs are compared with them."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tmc_vem.energy import densities

sys.path.insert(0, str(Path(__file__).parents[2] / "demos"))

import demo_belt as belt
import demo_cattaneo as cattaneo
import demo_shear_lag as shear_lag
import demo_sliding_block as sliding_block

TINY = 1e-30


def history(loads: Any, name: str, displacement: Any, reaction: Any, probes: Any = None) -> Any:
    """A result with a step for each load, in which one load is reported."""
    steps = [
        SimpleNamespace(load=t, displacement=u, reaction=f, forces={name: {"displacement": u, "reaction": f}}, probes=p)
        for t, u, f, p in zip(loads, displacement, reaction, probes or [{}] * len(loads), strict=True)
    ]
    return SimpleNamespace(history=steps)


# ---- Block -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stretch", "shear"), [(0.01, 0.4), (0.3, 2.0)])
def test_parasitic_friction_is_that_of_a_sheared_layer(stretch: float, shear: float) -> None:
    maths = SimpleNamespace(exp=np.exp, log=np.log)

    def stress(i: int, j: int) -> float:
        F = np.array([[1.0, shear], [0.0, stretch]], dtype=complex)
        F[i, j] += 1j * TINY
        return float(np.imag(densities.balanced(F, None, SimpleNamespace(mu=1.0), maths)) / TINY)

    assert sliding_block.parasitic(stretch, shear) == pytest.approx(-stress(0, 1) / stress(1, 1), rel=1e-10)


def test_a_block_is_compared_without_the_part_of_the_medium_and_over_its_last_cycle() -> None:
    place = np.array([0.0, 0.0, 0.02, 0.02, -0.02, -0.02, 0.02])
    ratio = np.array([0.0, 0.3, 0.3, -0.3, -0.3, 0.3, 0.3])
    part = sliding_block.parasitic(0.01, place / 0.05)
    result = history(
        [0.5, 1.0, 2.0, 2.5, 4.0, 5.0, 6.0], "slide", place, 0.1 * (ratio + part), [{"squeezed": 0.01}] * 7
    )
    found_place, plain, found = sliding_block.ratios(result)
    np.testing.assert_array_equal(found_place, place[1:])
    np.testing.assert_allclose(plain, (ratio + part)[1:], rtol=1e-14)
    np.testing.assert_allclose(found, ratio[1:], rtol=1e-12, atol=1e-15)
    assert sliding_block.cycle_work(found_place, found) == pytest.approx(4 * 0.3 * 0.02)


# ---- Bar -------------------------------------------------------------------------------------------------------------


def test_forces_of_a_bar_are_those_of_its_strains() -> None:
    """The force falls by t per length from the end on; after the turn it rises by t where it slides backwards."""
    x = np.linspace(0.0, shear_lag.LENGTH, 40001)
    t, stiffness = shear_lag.FRICTION * shear_lag.PRESSURE, shear_lag.YOUNG * shear_lag.HEIGHT

    def extension(force: np.ndarray) -> float:
        return float((0.5 * (force[1:] + force[:-1]) * np.diff(x)).sum()) / stiffness

    first = np.maximum(shear_lag.FORCE - t * x, 0.0)
    assert extension(first) == pytest.approx(shear_lag.FARTHEST, rel=1e-6)
    assert shear_lag.pulled(np.array([shear_lag.FARTHEST]))[0] == pytest.approx(shear_lag.FORCE)
    for force in (0.5 * shear_lag.FORCE, 0.0, -0.7 * shear_lag.FORCE):
        u = extension(np.minimum(first, force + t * x))
        assert shear_lag.let_back(np.array([u]))[0] == pytest.approx(force, abs=1e-6)
    ends = shear_lag.let_back(np.array([0.5, -1.0]) * shear_lag.FARTHEST)
    np.testing.assert_allclose(ends, [0.0, -shear_lag.FORCE], atol=1e-15)


def bar(error: float = 0.0) -> shear_lag.Found:
    """A cycle with the analytic forces, up to a part of F_m that is added on the way back."""
    rise = shear_lag.FARTHEST * np.linspace(0.0, 1.0, 400) ** 2
    back = shear_lag.FARTHEST * np.cos(np.linspace(0.0, math.pi, 400))[1:]
    down = shear_lag.let_back(back) + error * shear_lag.FORCE
    forces = np.concatenate([shear_lag.pulled(rise), down, -shear_lag.let_back(back)])
    times = np.concatenate([1.0 + np.linspace(0.0, 1.0, 400), np.linspace(2.0, 6.0, 799)[1:]])
    return shear_lag.Found.of(history([0.5, *times], "pull", [9.0, *rise, *back, *-back], [9.0, *forces]))


def test_a_bar_is_compared_branch_by_branch() -> None:
    exact, off = bar(), bar(0.03)
    assert max(exact.loading, abs(exact.at_turn), exact.unloading, off.loading) < 1e-12
    assert abs(exact.energy) < 1e-3
    assert off.unloading == pytest.approx(0.03)
    lost = 0.03 * shear_lag.FORCE * 2 * shear_lag.FARTHEST / shear_lag.cycle_energy()
    assert off.energy - exact.energy == pytest.approx(-lost, rel=0.01)


# ---- Line contact ----------------------------------------------------------------------------------------------------


def test_shear_of_a_line_contact_adds_up_to_the_force_that_pushes() -> None:
    contact = cattaneo.Contact(press=1.6, push=0.3)
    x = contact.half_width * np.sin(np.linspace(-0.5 * math.pi, 0.5 * math.pi, 20001))
    for values, force in ((contact.pressure(x), 1.6), (contact.shear(x), 0.3)):
        assert (0.5 * (values[1:] + values[:-1]) * np.diff(x)).sum() == pytest.approx(force, rel=1e-6)
    np.testing.assert_allclose(contact.pressure(np.array([0.0])), contact.peak)
    slides = abs(x) >= contact.stick
    np.testing.assert_allclose(contact.shear(x)[slides], 0.3 * contact.pressure(x)[slides], rtol=1e-12)
    assert (contact.shear(x)[~slides] < 0.3 * contact.pressure(x)[~slides]).all()
    assert contact.half_width == pytest.approx(0.0609, abs=1e-4)  # sqrt(4 * 1.6 * 1.82 / (pi * 1000))
    # the traction that sticks moves all of the stick zone alike: slip's slope by the shear is 0 within c
    assert contact.stick / contact.half_width == pytest.approx(math.sqrt(1 - 0.3 / 0.48))


def test_widths_are_those_of_the_pressures_that_fit() -> None:
    contact = cattaneo.Contact(press=1.6, push=0.3)
    x = np.linspace(-0.1, 0.1, 41)
    found = cattaneo.Found(x, contact.pressure(x), contact.shear(x), np.full(41, 0.005), contact)
    assert found.width == pytest.approx(contact.half_width, rel=1e-9)
    assert found.stick == pytest.approx(contact.stick, rel=1e-9)


# ---- Belt ------------------------------------------------------------------------------------------------------------


def test_a_belt_grows_tight_along_a_drum() -> None:
    """Moments about the axis: dT (R + H / 2) = mu_f p R^2 dtheta, with T = p R, from 1 at the tail."""
    assert belt.exponent(0.3) == pytest.approx(0.3 / 1.01)
    assert belt.ratio(0.3) == pytest.approx(math.exp(0.3 * math.pi))


def test_nodes_of_a_belt_meet_those_of_the_drum() -> None:
    n = 30
    mesh = belt.belt_mesh(n)
    assert mesh.region_names == ("layer", "belt")
    assert np.bincount(mesh.region_c).tolist() == [n, n + 2]  # straight ends of one cell each
    radius = np.hypot(*mesh.points_vx.T)
    drum = mesh.points_vx[: n + 1]
    inner = mesh.points_vx[(abs(radius - 1.01) < 1e-9) & (mesh.points_vx[:, 1] > -1e-9)]
    from_top = [np.arctan2(points[:, 0], points[:, 1]) for points in (drum, inner)]
    np.testing.assert_allclose(radius[: n + 1], 1.0)
    np.testing.assert_allclose(1.0 * from_top[0], 1.01 * from_top[1], atol=1e-12)  # as long an arc from the middle
    below = belt.belt_mesh(n, 0.0).points_vx[: n + 1]
    np.testing.assert_allclose(1.01 * below, inner, atol=1e-12)
    assert mesh.points_vx[:, 1].min() == pytest.approx(-belt.FREE)
    outline = mesh.points_vx[mesh.points_vx[:, 1] < -1e-3 * belt.FREE]
    np.testing.assert_allclose(np.sort(outline[abs(outline[:, 1] + belt.FREE) < 1e-9, 0]), [-1.03, -1.01, 1.01, 1.03])


def test_a_belt_is_compared_by_moments_and_by_its_pressures() -> None:
    """Forces on the belt's nodes of the pressure T / R and friction of 0.3 times that, tail's force 2."""
    n, tail = 2001, 2.0
    rate = belt.exponent(0.3)
    theta = np.linspace(0.0, math.pi, n)
    out = np.column_stack([np.cos(theta), np.sin(theta)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    pressure = tail * np.exp(rate * theta)
    weight = np.gradient(theta)
    weight[[0, -1]] *= 0.5
    force = (pressure * weight)[:, None] * (out - 0.3 * along)
    shuffled = np.random.default_rng(0).permutation(n)
    elsewhere = np.array([[1.03, 0.5], [1.01, -0.1]])  # the outer face and a straight end
    curves = SimpleNamespace(
        reference_nx=np.concatenate([1.01 * out[shuffled], elsewhere]),
        point_nx=np.concatenate([out[shuffled], elsewhere]),
        force_ni=np.concatenate([force[shuffled], [[9.0, 9.0]] * 2]),
        pressure_n=np.concatenate([pressure[shuffled], [9.0, 9.0]]),
    )
    forces = {"tail": {"reaction": -tail}, "head": {"reaction": -tail * belt.ratio(rate)}}
    result: Any = SimpleNamespace(history=[SimpleNamespace(forces=forces)], traction=lambda: curves)
    found = belt.Found.of(result)
    assert found.ratio == pytest.approx(belt.ratio(rate))
    assert found.growth == pytest.approx(rate, rel=1e-9)
    np.testing.assert_allclose(found.theta, theta, atol=1e-12)
    np.testing.assert_allclose(found.tension, np.exp(rate * theta), rtol=2e-3)
    np.testing.assert_allclose(found.pressure, np.exp(rate * theta), rtol=1e-9)
