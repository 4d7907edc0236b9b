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
from tmc_vem.simulation.problem_file import read_problem

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).parents[2] / "demos"))

import demo_belt as belt
import demo_cattaneo as cattaneo
import demo_shear_lag as shear_lag
import demo_sliding_block as sliding_block
import demo_snap_fit as snap_fit
from pages import friction, sources

ROOT = Path(__file__).parents[2]
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


def test_a_block_is_compared_where_it_turns() -> None:
    place = np.array([0.0, 0.01, 0.0, -0.01, 0.0, 0.01])
    ratio = np.array([0.0, 0.303, 0.1, -0.306, -0.2, 0.291])
    part = sliding_block.parasitic(0.01, place / 0.05)
    result = history([1, 2, 3, 4, 5, 6], "slide", place, 0.1 * (ratio + part), [{"squeezed": 0.01}] * 6)
    turns = sliding_block.at_turns(result)
    assert [turn.place for turn in turns] == [0.01, -0.01, 0.01]
    assert [turn.error(0.3) for turn in turns] == pytest.approx([0.01, 0.02, -0.03])
    assert [turn.plain - turn.ratio for turn in turns] == pytest.approx(part[[1, 3, 5]])


# ---- Bar -------------------------------------------------------------------------------------------------------------


BAR = shear_lag.Bar()


@pytest.mark.parametrize("bar", shear_lag.BARS.values(), ids=str)
def test_forces_of_a_bar_are_those_of_its_strains(bar: shear_lag.Bar) -> None:
    """The force falls by t per length from the end on; after the turn it rises by t where it slides backwards."""
    x = np.linspace(0.0, bar.length, 40001)
    t, stiffness = shear_lag.FRICTION * shear_lag.PRESSURE, bar.young * bar.height

    def extension(force: np.ndarray) -> float:
        return float((0.5 * (force[1:] + force[:-1]) * np.diff(x)).sum()) / stiffness

    first = np.maximum(bar.force - t * x, 0.0)
    assert first[-1] == 0.0  # its other end stands still
    assert extension(first) == pytest.approx(bar.farthest, rel=1e-6)
    assert bar.pulled(np.array([bar.farthest]))[0] == pytest.approx(bar.force)
    for force in (0.5 * bar.force, 0.0, -0.7 * bar.force):
        u = extension(np.minimum(first, force + t * x))
        assert bar.let_back(np.array([u]))[0] == pytest.approx(force, abs=1e-6)
    ends = bar.let_back(np.array([0.5, -1.0]) * bar.farthest)
    np.testing.assert_allclose(ends, [0.0, -bar.force], atol=1e-15)


def test_the_problem_file_is_that_of_the_first_bar() -> None:
    same, _ = read_problem(shear_lag.PROBLEM, BAR.changes(0.05, "quadrilaterals"))
    assert same.table == read_problem(shear_lag.PROBLEM)[0].table


def test_the_layer_has_two_rows_of_voronoi_cells_below_a_shorter_bar() -> None:
    bar = shear_lag.BARS[1e-6]
    changes = bar.changes(0.05, "voronoi")
    problem, _ = read_problem(shear_lag.PROBLEM, changes)
    mesh = problem.make_mesh()
    points = mesh.points_vx
    np.testing.assert_allclose(points.max(axis=0), [bar.length, shear_lag.GAP + bar.height])
    assert changes["mesh.size"] == 2 * changes["mesh.refine"][0]["size"] == 0.05
    assert changes["regions.medium.medium.elastic_slip"] == 0.1
    assert changes["load.pull.ux"] == bar.farthest


def cycle(error: float = 0.0) -> shear_lag.Found:
    """A cycle with the analytic forces, up to a part of F_m that is added on the way back."""
    rise = BAR.farthest * np.linspace(0.0, 1.0, 400) ** 2
    back = BAR.farthest * np.cos(np.linspace(0.0, math.pi, 400))[1:]
    down = BAR.let_back(back) + error * BAR.force * np.where(back > 0.5 * BAR.farthest, 2.0, 1.0)
    forces = np.concatenate([BAR.pulled(rise), down, -BAR.let_back(back)])
    times = np.concatenate([1.0 + np.linspace(0.0, 1.0, 400), np.linspace(2.0, 6.0, 799)[1:]])
    return shear_lag.Found.of(BAR, history([0.5, *times], "pull", [9.0, *rise, *back, *-back], [9.0, *forces]))


def test_a_bar_is_compared_branch_by_branch() -> None:
    exact, off = cycle(), cycle(0.03)
    assert max(exact.loading, abs(exact.at_turn), exact.unloading, exact.all_the_way_back, off.loading) < 1e-12
    assert abs(exact.energy) < 1e-3
    assert off.unloading == pytest.approx(0.03)
    assert off.all_the_way_back == pytest.approx(0.06)
    lost = 0.03 * BAR.force * (2.0 + 0.5) * BAR.farthest / BAR.cycle_energy
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


# ---- Their numbers in the documentation ------------------------------------------------------------------------------


def test_blocks_of_the_page_are_measured_and_rounded() -> None:
    asked = []

    def measure(function: Any, *arguments: Any, **named: Any) -> Any:
        asked.append((function.__name__, *arguments))
        found = {"at_turn": 0.0031, "loading": 0.021, "unloading": 0.032, "all_the_way_back": 0.08, "energy": -0.041}
        line = {"contact": -0.004, "stick": -0.0132, "ratio": 0.6124}
        return {"block": [-0.002, 0.0, 0.004], "bar": found, "cattaneo": line}[function.__name__]

    assert friction.sliding(measure).splitlines()[-1] == "| 0.6 | -0.2 % | +0.0 % | +0.4 % |"
    row = "| +0.3 % | 2.1 % | 3.2 % | 8.0 % | -4.1 % |"
    assert friction.bar(measure).splitlines()[2:] == [
        f"| 1e-05 | quadrilaterals {row}", f"| 1e-05 | Voronoi cells {row}"
    ]  # fmt: skip
    assert friction.thin_bar(measure).splitlines()[2] == f"| 1e-06 | quadrilaterals {row}"
    assert friction.partial_slip(measure).splitlines()[-1] == "| 1e-06 | -0.4 % | 0.612 | -1.3 % |"
    assert ("bar", 1e-6, "voronoi") in asked
    assert ("block", 0.3) in asked


def test_numbers_of_a_demo_are_out_of_date_when_its_problem_file_changes() -> None:
    assert shear_lag.PROBLEM in sources.dependencies(ROOT / "benchmarks" / "friction_demos.py")


# ---- Snap-fit --------------------------------------------------------------------------------------------------------


def beam() -> tuple[float, float, float, float]:
    """Length, bending, shear and axial stiffness of an arm."""
    modulus, thickness = snap_fit.YOUNG / 0.91, snap_fit.THICKNESS
    return snap_fit.LENGTH, modulus * thickness**3 / 12.0, snap_fit.YOUNG / 3.12 * thickness, modulus * thickness


def test_an_arm_is_a_cantilever_that_buckles() -> None:
    length, bending, shear, axial = beam()
    gives = np.array([[length**3 / 3.0 / bending + length / shear, length**2 / 2.0 / bending], [0.0, length / bending]])
    gives[1, 0] = gives[0, 1]
    np.testing.assert_allclose(np.linalg.inv(snap_fit.arm(0.0)[1:, 1:]), gives, rtol=1e-10)
    assert snap_fit.arm(0.0)[0] == pytest.approx([axial / length, 0.0, 0.0])
    euler = math.pi**2 * bending / (4.0 * length**2)
    assert np.linalg.det(snap_fit.arm(0.98 * euler)[1:, 1:]) > 0.0 > np.linalg.det(snap_fit.arm(1.02 * euler)[1:, 1:])


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_two_arms_on_each_other_push_a_nose_up_a_wedge(mu: float, monkeypatch: pytest.MonkeyPatch) -> None:
    reach, depth = 0.15, 0.2
    monkeypatch.setattr(snap_fit, "HEIGHTS", (0.5, 0.5))
    monkeypatch.setattr(snap_fit, "FACE", (snap_fit.ENDS + reach, 0.5 - depth))
    length, bending, shear, axial = beam()
    push, ramp = 1e-6, math.tan(math.pi / 6.0)
    tilt = math.tan(math.pi / 6.0 + math.atan(mu))
    moment = push * (reach - depth * tilt)
    turn = (push * length**2 / 2.0 + moment * length) / (2.0 * bending)
    rise = (push * length**3 / 3.0 + moment * length**2 / 2.0) / (2.0 * bending) + push * length / (2.0 * shear)
    way = (rise + reach * turn) / ramp - depth * turn + push * tilt * length / (2.0 * axial)
    u, force = snap_fit.insertion(push, mu)
    assert u - 0.1 == pytest.approx(way, rel=1e-4)
    assert force == pytest.approx(push * tilt, rel=1e-12)


def test_a_frame_gets_softer_under_its_force_and_hardly_turns() -> None:
    near, far = (snap_fit.insertion(push, 0.3)[0] - snap_fit.TOUCHES for push in (0.01, 0.04))
    assert 4.02 * near < far < 4.2 * near
    length, bending, _, _ = beam()
    guided = 24.0 * bending / length**3 * math.tan(math.pi / 6.0)
    for coefficient, tilt in ((0.0, math.pi / 6.0), (0.3, math.pi / 6.0 + math.atan(0.3))):
        u, force = snap_fit.known(coefficient, 0.14)
        assert (u[0], u[-1], force[0]) == pytest.approx((0.1, 0.14, 0.0))
        assert 0.9 < snap_fit.slope(u, force) / (guided * math.tan(tilt)) < 0.97


def test_slopes_and_coefficients_are_those_of_the_end() -> None:
    u = np.linspace(0.0, 1.0, 101)
    assert snap_fit.slope(u, np.maximum(0.0, 3.0 * (u - 0.75))) == pytest.approx(3.0)
    tilt = math.tan(math.radians(30.0) + math.atan(0.2))
    steps = [SimpleNamespace(contact={"hook": {"force_x": -tilt * push, "force_y": push}}) for push in (1.0, 2.0)]
    assert snap_fit.coefficient(SimpleNamespace(history=steps)) == pytest.approx(0.2)  # type: ignore[arg-type]


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
