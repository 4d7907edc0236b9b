"""Lines of the surface of solids, and what their integrals are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from tmc_vem.mesh.bodies import body_names, named_bodies
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.results.contact.facing import facing
from tmc_vem.results.contact.surface import Surface
from tmc_vem.results.contact.traction import Traction
from tmc_vem.system.fields import Polygons

Float = NDArray[np.float64]
# 4 x 3 squares: a body below over the whole width, one above it that is in medium but for its top
REGIONS = [
    Rectangle("m", 0.0, 4.0, 0.0, 3.0),
    Rectangle("low", 0.0, 4.0, 0.0, 1.0),
    Rectangle("up", 1.0, 2.0, 2.0, 3.0),
]


def squares() -> PolygonMesh:
    return structured_quadrilaterals(np.arange(5.0), np.arange(4.0), REGIONS)


def polygons(mesh: PolygonMesh, order: int = 1) -> Polygons:
    """The mesh with so many nodes a side as polynomials of an order have, at Lobatto's places."""
    t = {1: [0.0], 2: [0.0, 0.5], 3: [0.0, 0.5 - math.sqrt(0.05), 0.5 + math.sqrt(0.05)]}[order]
    points: list[tuple[float, float]] = []
    number: dict[tuple[float, float], int] = {}
    loops = []
    for c in range(mesh.n_cells):
        corners = mesh.points_vx[mesh.cell_vertices[mesh.cell_offsets[c] : mesh.cell_offsets[c + 1]]]
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            for s in t:
                x, y = np.round(a + s * (b - a), 12).tolist()
                loops.append(number.setdefault((x, y), len(number)))
    points = list(number)
    offsets = np.asarray(mesh.cell_offsets) * order
    return Polygons(np.array(points), offsets, np.array(loops), mesh.region_c, mesh.region_names, ("m",))


def surface(order: int = 2, numbers: NDArray[np.int64] | None = None) -> Surface:
    found = polygons(squares(), order)
    return Surface.of(found, np.arange(found.n_cells) if numbers is None else numbers, order)


def test_names_of_bodies() -> None:
    """By region; further ones by the number of their first cell; bonded regions are one body, and so is a hinge."""
    offsets, nodes = np.arange(0, 15, 3), np.array([0, 1, 2, 3, 4, 5, 5, 6, 7, 8, 9, 10, 11, 12, 13])[:12]
    names = ("a", "b", "m")
    solid = np.array([True, True, True, True])
    body, found = named_bodies(offsets[:5], nodes, np.array([0, 0, 1, 0]), names, solid, np.array([7, 3, 4, 1]))
    assert (body.tolist(), found) == ([2, 1, 1, 0], ["a", "a+b", "a-2"])
    body, found = named_bodies(offsets[:5], nodes, np.array([0, 2, 2, 0]), names, solid & [1, 0, 0, 1], np.arange(4))
    assert (body.tolist(), found) == ([0, -1, -1, 1], ["a", "a-2"])
    clash = ("a-2", "a", "m")
    _, found = named_bodies(offsets[:5], nodes, np.array([0, 1, 2, 1]), clash, solid & [1, 1, 0, 1], np.arange(4))
    assert found == ["a-2", "a", "a-3"]
    mesh = squares()
    assert body_names(mesh, mesh.region_c > 0) == ["low", "up"]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_lines_have_the_solid_on_their_left(order: int) -> None:
    found = surface(order)
    assert (found.bodies, found.body_l.tolist(), found.closed_l.tolist()) == (("low", "up"), [0, 1], [False, False])
    lower, upper = (found.points_nx[found.line_n == line] for line in (0, 1))
    assert len(lower) == 4 * order + 1
    assert len(upper) == 3 * order + 1
    assert lower[[0, -1]].tolist() == [[4.0, 1.0], [0.0, 1.0]]
    assert upper[[0, order, 2 * order, -1]].tolist() == [[1.0, 3.0], [1.0, 2.0], [2.0, 2.0], [2.0, 3.0]]
    assert found.weight_n.sum() == pytest.approx(7.0, rel=1e-14)
    assert found.share_n == pytest.approx(np.ones(len(found)))
    assert found.arc_length(found.points_nx)[found.line_n == 1][[0, order, -1]] == pytest.approx([0.0, 1.0, 3.0])
    assert set(found.medium_s.tolist()).isdisjoint(found.solid_s.tolist())


def test_weights_are_those_of_simpson_and_lobatto() -> None:
    assert surface(2).weight_n[:5] == pytest.approx(np.array([1.0, 4.0, 2.0, 4.0, 2.0]) / 6.0)
    assert surface(3).weight_n[:4] == pytest.approx(np.array([1.0, 5.0, 5.0, 2.0]) / 12.0)


def test_bodies_come_in_the_order_of_the_numbers_of_cells() -> None:
    turned = surface(2, np.arange(12)[::-1])
    assert turned.bodies == ("up", "low")
    assert turned.points_nx[0].tolist() == [1.0, 3.0]


def test_a_body_that_is_all_in_medium_has_a_closed_line() -> None:
    mesh = structured_quadrilaterals(
        np.arange(4.0), np.arange(4.0), [Rectangle("m", 0.0, 3.0, 0.0, 3.0), Rectangle("s", 1.0, 2.0, 1.0, 2.0)]
    )
    found = Surface.of(polygons(mesh, 2), np.arange(9), 2)
    assert (len(found), found.closed_l.tolist()) == (8, [True])
    assert found.points_nx[[0, 2, 4, 6]].tolist() == [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]]
    assert found.weight_n.sum() == pytest.approx(4.0)
    assert found.arc_length(found.points_nx)[-1] == pytest.approx(3.5)
    assert found.stations_sa[-1].tolist() == [6, 7, 0]


def test_lines_that_meet_share_the_forces_of_their_node() -> None:
    """Two squares that touch in a corner: one body with two lines there, by length."""
    mesh = structured_quadrilaterals(
        np.array([0.0, 2.0, 3.0, 4.0]), np.array([0.0, 1.0, 2.0, 3.0]),
        [Rectangle("m", 0.0, 4.0, 0.0, 3.0), Rectangle("s", 0.0, 2.0, 0.0, 1.0), Rectangle("s", 2.0, 3.0, 1.0, 2.0)],
    )  # fmt: skip
    found = Surface.of(polygons(mesh, 2), np.arange(9), 2)
    assert found.bodies == ("s",)
    at = np.flatnonzero((found.points_nx == (2.0, 1.0)).all(axis=1))
    assert len(at) == 2
    assert found.place_n[at[0]] == found.place_n[at[1]]
    assert found.share_n[at].sum() == pytest.approx(1.0)
    assert found.share_n[at] == pytest.approx(found.weight_n[at] / found.weight_n[at].sum())


def test_true_tractions_of_a_stretched_and_turned_surface() -> None:
    """x = Q diag(2, 3) X and forces of a pressure and a shear over the deformed length, whatever the axes."""
    found = surface(2)
    c, s = math.cos(0.5), math.sin(0.5)
    turn = np.array([[c, -s], [s, c]])
    x = found.points_nx @ (turn @ np.diag([2.0, 3.0])).T
    plain = Traction(found, x, np.zeros((len(found), 2)))
    flat = found.line_n == 0
    assert plain.stretch_n[flat] == pytest.approx(2.0)
    assert plain.normal_ni[flat] == pytest.approx(np.tile(turn @ (0.0, 1.0), (flat.sum(), 1)))
    assert plain.tangent_ni[flat] == pytest.approx(np.tile(turn @ (-1.0, 0.0), (flat.sum(), 1)))
    pushed = plain.weight_n[:, None] * (-0.7 * plain.normal_ni + 0.2 * plain.tangent_ni)
    loaded = Traction(found, x, pushed)
    assert loaded.pressure_n == pytest.approx(np.full(len(found), 0.7))
    assert loaded.shear_n == pytest.approx(np.full(len(found), 0.2))
    assert loaded.nominal_ni[flat] == pytest.approx(2.0 * loaded.true_ni[flat])
    assert loaded.arc_length_n(deformed=True)[flat][-1] == pytest.approx(8.0)
    assert loaded.arc_length_n()[flat][-1] == pytest.approx(4.0)
    of_line = loaded.resultant(flat)
    fx, fy = pushed[flat].sum(axis=0)
    assert (of_line["force_x"], of_line["force_y"]) == pytest.approx((fx, fy))
    assert of_line["force"] == pytest.approx(math.hypot(fx, fy))
    assert of_line["moment"] == pytest.approx(float(np.cross(x[flat], pushed[flat]).sum()))


def test_lengths_of_a_curved_side_are_those_of_its_arc() -> None:
    """A parabola through three nodes: the length of y = x^2 from 0 to 1."""
    mesh = structured_quadrilaterals(
        np.array([0.0, 1.0]), np.arange(3.0), [Rectangle("m", 0.0, 1.0, 0.0, 2.0), Rectangle("s", 0.0, 1.0, 0.0, 1.0)]
    )
    found = Surface.of(polygons(mesh, 2), np.arange(2), 2)
    x = found.points_nx.copy()
    x[:, 1] += x[:, 0] ** 2
    exact = math.sqrt(5.0) / 2.0 + math.asinh(2.0) / 4.0
    assert found.arc_length(x)[-1] == pytest.approx(exact, rel=1e-5)
    slopes = found.tangents(x)[0]
    assert slopes[:, 1] / slopes[:, 0] == pytest.approx([2.0, 1.0, 0.0])


def test_stations_face_the_nearest_side_ahead_that_looks_back() -> None:
    found = surface(2)
    seen = facing(Traction(found, found.points_nx, np.zeros((len(found), 2))))
    x = found.points_nx
    below = (found.line_n == 1) & (x[:, 1] == 2.0) & (x[:, 0] > 1.0) & (x[:, 0] < 2.0)
    assert below.sum() == 1
    assert seen.gap_n[below] == pytest.approx([1.0])
    assert x[seen.station_n[below]].tolist() == [[1.5, 1.0]]
    under = (found.line_n == 0) & (x[:, 0] == 1.5)
    assert x[seen.station_n[under]].tolist() == [[1.5, 2.0]]
    assert seen.gap_n[under] == pytest.approx([1.0])
    # straight up from there, and sideways, is nothing
    away = ((found.line_n == 0) & (x[:, 0] == 4.0)) | ((found.line_n == 1) & (x[:, 1] > 2.0))
    assert (seen.station_n[away] == -1).all()
    assert np.isnan(seen.gap_n[away]).all()
    # a gap that is small against the sides is seen from everywhere, also slightly from the side
    closed = x.copy()
    closed[found.line_n == 1, 1] -= 0.97
    closed[found.line_n == 1, 0] += 0.4
    near = facing(Traction(found, closed, np.zeros((len(found), 2))))
    inside = (found.line_n == 0) & (x[:, 0] >= 1.5) & (x[:, 0] <= 2.0)
    assert near.gap_n[inside] == pytest.approx(0.03)
