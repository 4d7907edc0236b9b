"""Friction along the surface of solids: what is made of the cells beside it, and how far surfaces have slipped."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from test_contact_surface import surface

from tmc_vem.results.contact.facing import facing
from tmc_vem.results.contact.friction import SideFriction, Slip, SurfaceFriction, measure
from tmc_vem.results.contact.pairs import measure as measure_contact
from tmc_vem.results.contact.surface import Surface
from tmc_vem.results.contact.traction import Traction

Float = NDArray[np.float64]
# beside the lower side of the upper body, which runs from (1, 2) to (2, 2), and beside the ground under it
SHEAR, BOUND, STUCK = 0.25, 0.5, 0.125


def state(move: tuple[float, float] = (0.0, 0.0), force: tuple[float, float] = (0.0, 0.0)) -> Traction:
    """The upper body moved as a whole, with a force on every station of its lower side."""
    found = surface(2)
    on_up = found.line_n == 1
    low = on_up & (found.points_nx[:, 1] == 2.0)
    return Traction(found, found.points_nx + on_up[:, None] * move, low[:, None] * np.array(force))


def beside(found: Surface) -> SideFriction:
    """Shear and bound beside the side of each body that faces the other, none elsewhere."""
    x = found.points_nx[found.stations_sa]
    close = ((x[..., 1] == 2.0) | ((x[..., 1] == 1.0) & (x[..., 0] >= 1.0) & (x[..., 0] <= 2.0))).all(axis=1)
    stress = np.array([[7.0, SHEAR], [SHEAR, -3.0]])
    return SideFriction(close[:, None, None] * stress, close * BOUND, close * STUCK)


def test_shear_bound_and_sticking_of_stations() -> None:
    traction = state()
    found = SurfaceFriction.of(traction, beside(traction.surface))
    x, line = traction.surface.points_nx, traction.surface.line_n
    middle = (line == 1) & (x[:, 0] == 1.5) & (x[:, 1] == 2.0)
    corner = (line == 1) & (x[:, 1] == 2.0) & ~middle
    assert corner.sum() == 2
    # the upper body's side runs to the right, its normal downwards: t . sigma n = -SHEAR; both bodies see it alike
    assert found.shear_n[middle] == pytest.approx([-SHEAR])
    under = (line == 0) & (x[:, 0] == 1.5)
    assert found.shear_n[under] == pytest.approx([-SHEAR])
    assert (found.bound_n[middle], found.sticking_n[middle]) == (pytest.approx([BOUND]), pytest.approx([STUCK / BOUND]))
    # half of what a corner stands for is on the side that nothing presses, and its tangent is that of the other
    assert found.bound_n[corner] == pytest.approx([BOUND / 2] * 2)
    assert found.shear_n[corner] == pytest.approx([-SHEAR / 2] * 2)
    assert found.sticking_n[corner] == pytest.approx([STUCK / BOUND] * 2)
    assert found.tangent_ni[corner] == pytest.approx(np.array([[1.0, 0.0]] * 2))
    assert abs(traction.tangent_ni[corner, 1]) == pytest.approx([math.sqrt(0.5)] * 2)
    apart = (line == 1) & (x[:, 1] > 2.0)
    assert np.isnan(found.sticking_n[apart]).all()
    assert (found.bound_n[apart] == 0.0).all()
    assert found.tangent_ni[apart] == pytest.approx(traction.tangent_ni[apart])
    assert not found.touches_n[apart].any()


def test_stretched_sides_count_as_long_as_they_are() -> None:
    """True shear and bound are over the deformed length: a body twice as long has the same ones and twice the force."""
    plain = surface(2)
    wide = Traction(plain, plain.points_nx * [2.0, 1.0], np.zeros((len(plain), 2)))
    found, sides = SurfaceFriction.of(wide, beside(plain)), beside(plain)
    assert found.shear_n.min() == pytest.approx(-SHEAR)
    assert found.bound_n.max() == pytest.approx(BOUND)
    low = (plain.line_n == 1) & (plain.points_nx[:, 1] == 2.0)
    assert (found.bound_n * wide.weight_n)[low].sum() == pytest.approx(2.0 * BOUND)
    assert sides.bound_s.sum() == pytest.approx(2.0 * BOUND)


def slid(*moves: tuple[float, float]) -> tuple[Slip, Traction, SurfaceFriction]:
    """After steps to these places of the upper body."""
    before = state((0.0, -0.99))
    slip = Slip.none(len(before.surface))
    found = SurfaceFriction.of(before, beside(before.surface))
    for move in moves:
        now = state((move[0], -0.99 + move[1]))
        slip.add(before, now, facing(now), found.touches_n)
        before = now
    return slip, before, found


def test_slip_is_along_what_is_faced_and_has_a_direction() -> None:
    """0.03 to the right and 0.01 back: the upper body's side runs to the right, the ground's from right to left."""
    slip, now, found = slid((0.03, 0.002), (0.02, 0.0))
    middle = (now.surface.points_nx[:, 0] == 1.5) & found.touches_n
    on_up, on_low = (middle & (now.surface.line_n == line) for line in (1, 0))
    assert slip.slip_n[on_up] == pytest.approx([0.02])
    assert slip.slip_n[on_low] == pytest.approx([0.02])
    assert slip.path_n[on_up] == slip.path_n[on_low] == pytest.approx([0.04])
    assert (slip.slip_n[~found.touches_n] == 0.0).all()
    assert (slip.path_n[~found.touches_n] == 0.0).all()


def test_what_faces_nothing_is_on_ground_unless_its_line_faces_something() -> None:
    before, now = state(), state((0.25, 0.0))
    seen, n = facing(now), len(now.surface)
    touches = (now.surface.line_n == 1) & (now.surface.points_nx[:, 1] == 2.0)
    away = (now.surface.line_n == 1) & (now.surface.points_nx[:, 1] == 2.5)
    alone, both = Slip.none(n), Slip.none(n)
    nothing = type(seen)(np.full(n, -1), np.full(n, np.nan), np.full((n, 2), -1), np.zeros(n))
    alone.add(before, now, nothing, touches)
    assert alone.slip_n[touches] == pytest.approx([0.25 * c for c in now.tangent_ni[touches, 0]])
    turned, chord = (
        Slip.none(n),
        Traction(now.surface, now.points_nx @ np.array([[0.0, 1.0], [-1.0, 0.0]]), now.force_ni),
    )
    turned.add(before, chord, nothing, touches)
    middle = touches & (now.surface.points_nx[:, 0] == 1.5)  # goes from (1.5, 2) to (-2, 1.75), along x and then y
    assert turned.slip_n[middle] == pytest.approx([(-3.5 - 0.25) / math.sqrt(2.0)])
    both.add(before, now, seen, touches | away)
    assert (both.slip_n[away] == 0.0).all()
    assert (both.missed_n == away).all()
    assert not alone.missed_n.any()
    assert np.isnan(both.largest_of_n[away]).all()
    assert both.largest_of_n[touches].max() == np.abs(both.slip_n[touches]).max() == pytest.approx(0.25)


def test_bodies_that_turn_together_do_not_slip() -> None:
    plain = state((0.0, -0.99))
    angle = math.radians(30.0)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    turned = Traction(plain.surface, plain.points_nx @ turn.T, plain.force_ni)
    slip = Slip.none(len(plain.surface))
    slip.add(plain, turned, facing(turned), SurfaceFriction.of(plain, beside(plain.surface)).touches_n)
    middle = (plain.surface.line_n == 1) & (plain.surface.points_nx == [1.5, 2.0]).all(axis=1)
    assert slip.slip_n[middle] == pytest.approx([0.0], abs=1e-15)


def test_what_is_reported_of_stations() -> None:
    """Three stations with the force (-2, 5) each: the shear is -2 along the line, the pressure 5."""
    traction = state(force=(-2.0, 5.0))
    found, slip = SurfaceFriction.of(traction, beside(traction.surface)), Slip.none(len(traction.surface))
    slip.slip_n[:] = -0.5 * (traction.surface.points_nx[:, 0] == 1.0)
    on_up = traction.surface.line_n == 1
    values = measure(traction, found, slip, on_up)
    assert values == pytest.approx({
        "friction": 6.0, "friction_x": -6.0, "friction_y": 0.0, "apparent_coefficient": 0.4,
        "friction_coefficient": SHEAR / 15.0, "sticking": STUCK / BOUND, "slip_max": 0.5,
    })  # fmt: skip
    slip.slip_n[on_up & (traction.surface.points_nx[:, 0] != 1.0)] = 0.75
    slip.missed_n[:] = traction.surface.points_nx[:, 0] != 1.0  # of some it is not known
    assert measure(traction, found, slip, on_up)["slip_max"] == 0.5
    slip.missed_n[:] = 2.0
    assert "slip_max" not in measure(traction, found, slip, on_up)
    pulled = measure(state(force=(3.0, -5.0)), found, slip, on_up)
    assert pulled == {"friction": 9.0, "friction_x": 9.0, "friction_y": 0.0}, (
        "no pressure: nothing is known but the force"
    )
    nothing = measure(traction, found, slip, np.zeros(len(on_up), dtype=bool))
    assert nothing == {"friction": 0.0, "friction_x": 0.0, "friction_y": 0.0}


def test_bodies_and_the_first_of_a_pair_have_it() -> None:
    traction, asked = state((0.0, -0.97)), []

    def also(chosen: NDArray[np.bool_]) -> dict[str, float]:
        asked.append(chosen)
        return {"friction": float(chosen.sum())}

    found = measure_contact(traction, also)
    plain = measure_contact(traction)
    assert list(found) == ["low", "up", "low-up"]
    assert {name: values.pop("friction") for name, values in found.items()} == {
        name: float(chosen.sum()) for name, chosen in zip(found, asked, strict=True)
    }
    assert found == plain
    line = traction.surface.line_n
    assert [set(line[chosen].tolist()) for chosen in asked] == [{0}, {1}, {0}]
    assert 0 < asked[2].sum() < asked[0].sum()


def test_places_between_stations_that_are_faced() -> None:
    found = surface(2)
    seen = facing(Traction(found, found.points_nx + [[0.3, 0.0]] * (found.line_n == 1)[:, None], found.points_nx * 0.0))
    below = (found.line_n == 1) & (found.points_nx[:, 0] == 1.5) & (found.points_nx[:, 1] == 2.0)
    assert seen.at(found.points_nx)[below] == pytest.approx(np.array([[1.8, 1.0]]))
    assert (seen.at(found.points_nx)[seen.station_n < 0] == 0.0).all()
    assert (seen.ends_ne[seen.station_n < 0] == -1).all()
