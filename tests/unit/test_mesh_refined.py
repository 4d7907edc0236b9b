"""Refinement with a history: parents, curves, flat corners, cells of any shape, and that no order matters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import SHAPES, mesh_of, regular
from helpers_refined import (
    CENTER,
    CIRCLE,
    MESHES,
    RADIUS,
    area_of,
    assert_lies_within,
    disc,
    interface_vertices,
    letters,
    most_hanging,
    squares,
)

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.make.hub import star_parts
from tmc_vem.mesh.make.loops import Loops
from tmc_vem.mesh.make.outline import Arc, Line
from tmc_vem.mesh.make.polyline import Polyline
from tmc_vem.mesh.make.refine import refined, refined_further
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.parts import submesh
from tmc_vem.support.errors import InputError


def angles(mesh):
    """Inner angles of all cells in degrees."""
    loops = Loops.of(mesh)
    x = mesh.points_vx[loops.vertices]
    a, b = (x[loops.following] - x) @ [1, 1j], (x[loops.preceding] - x) @ [1, 1j]
    return np.degrees(np.angle(b / a)) % 360.0


def geometry(mesh, values):
    """The cells of a mesh and what belongs to each, whatever their numbers are."""
    return sorted(
        (sorted(np.round(mesh.points_vx[loop], 9).tolist()), value)
        for loop, value in zip(mesh.cells(), values, strict=True)
    )


# -- what holds for every mesh -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("flat", [0.0, 20.0])
@pytest.mark.parametrize("name", MESHES)
def test_children_lie_in_their_parents_and_areas_stay(name, flat):
    mesh = MESHES[name]()
    for seed in range(3):
        marked = np.random.default_rng(seed).random(mesh.n_cells) < 0.4
        change = refined(mesh, marked, flat=flat)
        assert_lies_within(change, mesh)
        assert (change.before_vx == change.mesh.points_vx).all()
        assert (change.mesh.points_vx[: mesh.n_vertices] == mesh.points_vx).all()
        assert set(change.parent_c.tolist()) == set(range(mesh.n_cells))
        assert (np.bincount(change.parent_c)[marked] > 1).all()
        for region in mesh.region_names:
            assert area_of(change.mesh, region) == pytest.approx(area_of(mesh, region), rel=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_nothing_marked_is_the_same_mesh(name):
    mesh = MESHES[name]()
    change = refined(mesh, [])
    assert change.mesh is mesh
    assert change.parent_c.tolist() == list(range(mesh.n_cells))
    assert not change.tree.born_v.any()


def test_all_squares_are_squares_again():
    change = refined(squares(), np.ones(16, dtype=bool))
    assert change.mesh.n_cells == 64
    assert change.mesh.n_vertices == 81
    assert angles(change.mesh) == pytest.approx(90.0)
    assert change.parent_c.tolist() == np.repeat(np.arange(16), 4).tolist()
    assert change.tree.level_c.tolist() == [1] * 64
    assert change.tree.born_v.sum() == 81 - 25


@pytest.mark.parametrize("n_sides", [3, 4, 5, 6, 9])
def test_children_of_a_regular_polygon_by_hand(n_sides):
    """Quadrilaterals between hub, corner and two middles, the first at the first corner."""
    polygon = regular(n_sides)
    mesh = refined(mesh_of(polygon), [0]).mesh
    middle = 0.5 * (polygon + np.roll(polygon, -1, axis=0))
    for corner, loop in enumerate(mesh.cells()):
        expected = [middle[corner - 1], polygon[corner], middle[corner], (0.0, 0.0)]
        assert mesh.points_vx[loop] == pytest.approx(np.array(expected), abs=1e-15)


@pytest.mark.parametrize(
    ("at", "split"),
    [([0.5], 0.5), ([0.3], 0.3), ([0.29], 0.645), ([0.4, 0.6], 0.4), ([0.2, 0.4, 0.6], 0.4), ([0.1, 0.9], 0.5),
     ([0.75], 0.375), ([0.45, 0.5], 0.5)],
)  # fmt: skip
def test_where_a_side_is_divided(at, split):
    """At the hanging node nearest to its middle, up to a fifth away from it, else in the middle of an edge."""
    points = [(0, 0), *((x, 0) for x in at), (1, 0), (1, 1), (0, 1)]
    mesh = refined(mesh_of(np.array(points, dtype=float)), [0], max_hanging=9).mesh
    assert mesh.n_cells == 4
    hub = np.flatnonzero(np.isclose(mesh.points_vx, 0.5).all(axis=1))[0]
    below = [mesh.points_vx[v] for pair in mesh.edges.vertices_ev.tolist() if hub in pair for v in pair if v != hub]
    assert [x for x, y in below if y == 0.0] == pytest.approx([split])


def test_named_edges_in_pieces_keep_order_and_direction():
    mesh = PolygonMesh.from_cells(
        [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1)], [[0, 1, 4, 5], [1, 2, 3, 4]],
        named_edges={"low": np.array([(2, 1), (1, 0)]), "inner": np.array([(4, 1)]), "none": np.empty((0, 2))},
    )  # fmt: skip
    new = refined(mesh, [0]).mesh
    x = new.points_vx
    assert x[new.named_edges["low"]].tolist() == [
        [[2, 0], [1, 0]], [[1, 0], [0.5, 0]], [[0.5, 0], [0, 0]]
    ]  # fmt: skip
    assert x[new.named_edges["inner"]].tolist() == [[[1, 1], [1, 0.5]], [[1, 0.5], [1, 0]]]
    assert len(new.named_edges["none"]) == 0


# -- no order matters --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MESHES)
def test_the_order_of_marks_and_of_cells_does_not_matter(name):
    mesh, rng = MESHES[name](), np.random.default_rng(5)
    marked = np.flatnonzero(rng.random(mesh.n_cells) < 0.4)
    plain = refined(mesh, marked, curves=CIRCLE, flat=20.0)
    again = refined(mesh, rng.permutation(marked).tolist(), curves=CIRCLE, flat=20.0)
    assert (plain.mesh.points_vx == again.mesh.points_vx).all()
    assert (plain.mesh.cell_vertices == again.mesh.cell_vertices).all()

    order = rng.permutation(mesh.n_cells)
    loops = Loops.of(mesh).chosen(order)
    turned = replace(
        mesh, cell_offsets=loops.offsets, cell_vertices=loops.vertices, region_c=mesh.region_c[order],
        cell_data={name: values[order] for name, values in mesh.cell_data.items()},
    )  # fmt: skip
    number = np.empty(mesh.n_cells, dtype=int)
    number[order] = np.arange(mesh.n_cells)
    other = refined(turned, number[marked], curves=CIRCLE, flat=20.0)
    assert geometry(plain.mesh, plain.parent_c) == geometry(other.mesh, order[other.parent_c])
    assert geometry(plain.mesh, plain.mesh.cell_data["modulus"]) == geometry(
        other.mesh, other.mesh.cell_data["modulus"]
    )


def test_neighbours_divide_a_common_side_in_the_same_place():
    """A cell whose side is shared by two smaller ones, all three cut at once: the plain vertex is everybody's."""
    tall = structured_quadrilaterals([0, 1], [0, 1], [Rectangle("a", 0, 1, 0, 1)])
    small = structured_quadrilaterals([1, 2], [0, 0.25, 1], [Rectangle("a", 1, 2, 0, 1)])
    mesh = weld([tall, small])
    for max_hanging in (1, 2):
        change = refined(mesh, [0, 1, 2], max_hanging=max_hanging)
        assert_lies_within(change, mesh)
        on_side = change.mesh.points_vx[change.mesh.points_vx[:, 0] == 1.0][:, 1]
        assert {0.125, 0.25, 0.625} <= set(on_side.tolist())
        assert most_hanging(change.mesh, 0.0, change.tree.born_v) <= max_hanging


# -- curves ------------------------------------------------------------------------------------------------------------


def test_middles_on_a_circle_and_the_order_of_its_area():
    """The polygon inscribed in a circle lacks an area of order h^2; straight middles would keep all of it."""
    mesh, tree, errors = disc(0.15), None, []
    straight = area_of(mesh, "disc")
    for _ in range(4):
        errors.append(np.pi * RADIUS**2 - area_of(mesh, "disc"))
        change = refined(mesh, np.ones(mesh.n_cells, dtype=bool), tree=tree, flat=20.0, curves=CIRCLE)
        mesh, tree = change.mesh, change.tree
        assert not find_faults(mesh)
        off = np.hypot(*(mesh.points_vx[interface_vertices(mesh)] - CENTER).T) - RADIUS
        assert np.abs(off).max() < 1e-12
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates == pytest.approx([2.0] * 3, abs=0.02)
    assert area_of(mesh) == pytest.approx(1.0, rel=1e-12)  # what one region gets the other one loses
    unmoved = refined(disc(0.15), np.ones(disc(0.15).n_cells, dtype=bool)).mesh
    assert area_of(unmoved, "disc") == pytest.approx(straight, rel=1e-12)


def test_before_is_the_middle_of_the_chord_and_where_all_others_are():
    mesh = disc()
    change = refined(mesh, np.ones(mesh.n_cells, dtype=bool), flat=20.0, curves=CIRCLE)
    assert_lies_within(change, mesh)
    moved = np.flatnonzero((change.before_vx != change.mesh.points_vx).any(axis=1))
    assert set(moved.tolist()) == set(interface_vertices(change.mesh).tolist()) - set(range(mesh.n_vertices))
    chords = mesh.points_vx[mesh.edges.vertices_ev]
    on_circle = (np.abs(np.hypot(*np.moveaxis(chords - CENTER, -1, 0)) - RADIUS) < 1e-9).all(axis=1)
    middles = chords[on_circle].mean(axis=1)
    assert sorted(change.before_vx[moved].tolist()) == sorted(middles.tolist())


@pytest.mark.parametrize("seed", range(4))
def test_interfaces_remain_interfaces_when_marks_are_random(seed):
    """Edges of both sides are the same, nothing overlaps, and children of children lie in their parents too."""
    mesh, tree, rng = disc(0.15, seed), None, np.random.default_rng(seed)
    for _ in range(3):
        change = refined(mesh, rng.random(mesh.n_cells) < 0.3, tree=tree, flat=20.0, curves=CIRCLE)
        assert_lies_within(change, mesh)
        mesh, tree = change.mesh, change.tree
        left, right = mesh.cells_of_edges
        free = mesh.points_vx[mesh.edges.vertices_ev[(left < 0) | (right < 0)]]
        assert (np.isclose(free, 0.0) | np.isclose(free, 1.0)).any(axis=2).all()  # only around the square
        assert most_hanging(mesh, 20.0, tree.born_v) <= 1
        assert np.hypot(*(mesh.points_vx[interface_vertices(mesh)] - CENTER).T) == pytest.approx(RADIUS, abs=1e-12)


def sectors():
    """Six sectors of a disc, each with a chord of 60 degrees, in a square."""
    turn = np.radians(np.arange(0.0, 360.0, 60.0))
    points = [(0.0, 0.0), *zip(np.cos(turn), np.sin(turn), strict=True)]
    square = [(2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0)]
    inner = [[0, k, k % 6 + 1] for k in range(1, 7)]
    outer = [[1, 7, 8, 2], [2, 8, 9, 3], [3, 9, 4], [4, 9, 10, 5], [5, 10, 7, 6], [6, 7, 1]]
    return PolygonMesh.from_cells([*points, *square], [*inner, *outer], [0] * 6 + [1] * 6, ("disc", "around"))


def test_before_goes_through_all_passes():
    """Three refinements as one change: where vertices were, children fill their parents to the last bit of area."""
    mesh = sectors()
    circle = [Arc((0, 0), 1.0, 0, 180), Arc((0, 0), 1.0, 180, 360)]
    change = refined(mesh, np.ones(12, dtype=bool), flat=20.0, curves=circle)
    for _ in range(3):
        change = refined_further(change, np.ones(change.mesh.n_cells, dtype=bool), flat=20.0, curves=circle)
    assert_lies_within(change, mesh)
    radius = np.hypot(*change.mesh.points_vx[interface_vertices(change.mesh)].T)
    assert radius == pytest.approx(1.0, abs=1e-12)
    before = [areas(change.before_vx[loop][None])[0] for loop in change.mesh.cells()]
    assert min(before) > 0.0
    parts = np.bincount(change.parent_c, before)
    assert parts == pytest.approx([areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells()], rel=1e-12)
    assert area_of(change.mesh, "disc") > np.sum(parts[:6]) * 1.15


def test_a_boundary_follows_a_curve_and_a_curve_that_is_not_followed_is_left_alone():
    """A quarter of a disc; a polyline whose corner is between the ends of an edge; a chord of more than 60 degrees."""
    turns = np.radians([0.0, 45.0, 90.0])
    points = [(0.0, 0.0), *zip(np.cos(turns), np.sin(turns), strict=True)]
    quarter = PolygonMesh.from_cells(points, [[0, 1, 2], [0, 2, 3]])
    arc = Arc((0, 0), 1.0, -10.0, 100.0)
    radius = np.hypot(*refined(quarter, [0, 1], curves=[arc]).mesh.points_vx.T)
    assert np.isclose(radius, 1.0, atol=1e-14).sum() == 5
    whole = PolygonMesh.from_cells([points[0], points[1], points[3]], [[0, 1, 2]])
    wide = refined(whole, [0], curves=[arc])
    assert (wide.before_vx == wide.mesh.points_vx).all()
    kinked = Polyline(((1.0, 0.0), (0.97, 0.35), (np.cos(turns[1]), np.sin(turns[1]))))
    mesh = refined(quarter, [0], curves=[kinked]).mesh
    t, distance = kinked.parameter_of(tuple(0.5 * (np.array(points[1]) + points[2])))
    assert distance > 0.03
    assert kinked.at(np.array([t]))[0].tolist() in mesh.points_vx.tolist()
    corner = Polyline(((1.0, 0.0), (1.0, 0.5), (np.cos(turns[1]), np.sin(turns[1]))))  # longer than its chord by 9 %
    assert (refined(quarter, [0], curves=[corner]).before_vx == refined(quarter, [0]).mesh.points_vx).all()
    line = Line((0.0, 0.0), (1.0, 0.0))
    assert (refined(quarter, [0], curves=[line]).mesh.points_vx == refined(quarter, [0]).mesh.points_vx).all()


def test_across_the_seam_of_a_closed_curve():
    turns = np.linspace(0.0, 2.0 * np.pi, 721)[:-1]
    ring = [(float(np.cos(t)), float(np.sin(t))) for t in [*turns, turns[0]]]
    corner = np.radians(np.arange(-15.0, 345.0, 30.0))
    mesh = mesh_of(np.column_stack([np.cos(corner), np.sin(corner)]))
    for _ in range(2):
        mesh = refined(mesh, np.ones(mesh.n_cells, dtype=bool), curves=[Polyline(tuple(ring))]).mesh
    outer = np.unique(mesh.edges.vertices_ev[mesh.edges.n_cells_e == 1])
    assert len(outer) == 48
    assert np.hypot(*mesh.points_vx[outer].T) == pytest.approx(1.0, abs=2e-5)


def test_a_middle_stays_where_a_cell_would_turn_inside_out():
    """A thin layer inside of an arc: the curve is beyond its other side."""
    ends = np.radians([60.0, 120.0])
    outer = [(np.cos(t), np.sin(t)) for t in ends]
    thin = [(x, 0.95 * y) for x, y in outer]
    above = [(x, 1.5 * y) for x, y in outer]
    arc = Arc((0.0, 0.0), 1.0, 0.0, 180.0)
    below_too = PolygonMesh.from_cells([*outer, *above, *thin], [[0, 2, 3, 1], [4, 0, 1, 5]], [0, 1], ("a", "b"))
    moved = refined(below_too, [0], curves=[arc])
    assert (moved.before_vx != moved.mesh.points_vx).any()
    thin_above = [(x, y + 0.05) for x, y in outer]
    mesh = PolygonMesh.from_cells([*outer, *thin_above, *thin], [[0, 2, 3, 1], [4, 0, 1, 5]], [0, 1], ("a", "b"))
    for marked in ([0], [1], [0, 1]):  # cut or not, the thin cell is in the way
        change = refined(mesh, marked, curves=[arc])
        assert not find_faults(change.mesh)
        assert (change.before_vx == change.mesh.points_vx).all()


def cell_with_walls(thickness):
    """A square below an edge that is the chord of an arc, and a U above it."""
    x, y, t = 0.5, np.sqrt(0.75), thickness
    points = [(-x, 0), (x, 0), (x, y), (-x, y), (x, 2), (x - 0.1, 2), (x - 0.1, y + t), (0.1 - x, y + t), (0.1 - x, 2),
              (-x, 2)]  # fmt: skip
    return PolygonMesh.from_cells(points, [[0, 1, 2, 3], [3, 2, 4, 5, 6, 7, 8, 9]], [0, 1], ("a", "b"))


@pytest.mark.parametrize("marked", [[0], [0, 1]], ids=["beside", "cut into parts"])
def test_cells_that_no_point_sees_keep_clear_of_the_curve(marked):
    arc = Arc((0.0, 0.0), 1.0, 0.0, 180.0)
    for thickness, moves in ((0.1, False), (0.3, True)):  # the arc's height is 0.134
        change = refined(cell_with_walls(thickness), marked, curves=[arc])
        assert not find_faults(change.mesh)
        assert (change.before_vx != change.mesh.points_vx).any() == moves


def test_straight_lines_move_nothing():
    """Not even by rounding."""
    polygon = regular(7)
    lines = [Line(tuple(a), tuple(b)) for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)]
    plain, along = (refined(mesh_of(polygon), [0], curves=curves).mesh for curves in ((), lines))
    assert (plain.points_vx == along.points_vx).all()


def test_of_two_curves_the_nearer_one_is_followed():
    """Both within the tolerance; whatever their order."""
    turns = np.radians([0.0, 45.0])
    mesh = PolygonMesh.from_cells([(0.0, 0.0), *zip(np.cos(turns), np.sin(turns), strict=True)], [[0, 1, 2]])
    near, far = Arc((0, 0), 1.0, -10, 90), Arc((0, 0), 1.0 + 5e-7, -10, 90)
    for curves in ([near, far], [far, near]):
        moved = refined(mesh, [0], curves=curves)
        at = (moved.before_vx != moved.mesh.points_vx).any(axis=1)
        assert np.hypot(*moved.mesh.points_vx[at][0]) == pytest.approx(1.0, abs=1e-12)
    away = refined(mesh, [0], curves=[Arc((0, 0), 1.0 + 1e-5, -10, 90)])
    assert (away.before_vx == away.mesh.points_vx).all()


# -- corners -----------------------------------------------------------------------------------------------------------


def bent_square(off=0.05):
    """Middles of the sides moved out by as much."""
    return np.array(
        [(0, 0), (0.5, -off), (1, 0), (1 + off, 0.5), (1, 1), (0.5, 1 + off), (0, 1), (-off, 0.5)], dtype=float
    )


def test_flat_vertices_are_no_corners():
    mesh = mesh_of(bent_square())
    assert refined(mesh, [0]).mesh.n_cells == 8
    assert refined(mesh, [0], flat=10.0).mesh.n_cells == 8  # they turn by 11.4 degrees
    change = refined(mesh, [0], flat=12.0)
    assert change.mesh.n_cells == 4
    assert change.mesh.n_vertices == 9  # the bent middles divide the sides
    assert area_of(change.mesh) == pytest.approx(1.1)
    assert angles(change.mesh).min() > 80.0


def test_a_cell_with_no_corners_left_goes_by_straight_angles():
    round_cell = mesh_of(regular(24))
    assert refined(round_cell, [0], flat=20.0).mesh.n_cells == 24
    lens = np.array([*bent_square()[:3], (0.5, 0.08)])
    assert refined(mesh_of(lens), [0], flat=20.0).mesh.n_cells == 4


def test_cells_along_a_circle_do_not_degenerate():
    """Four levels deep all cells are quadrilaterals and triangles' children with sensible angles, whatever comes."""
    mesh, tree = disc(0.15), None
    first = angles(mesh).min()
    for _ in range(3):
        change = refined(mesh, np.ones(mesh.n_cells, dtype=bool), tree=tree, flat=20.0, curves=CIRCLE)
        mesh, tree = change.mesh, change.tree
    assert mesh.n_sides_c.max() <= 5
    assert angles(mesh).min() > 0.4 * first
    assert np.sort(angles(mesh))[-1] < 200.0


# -- limits on hanging nodes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("max_hanging", [1, 2, 3])
@pytest.mark.parametrize("name", ["squares", "triangles", "voronoi", "letters"])
def test_limit_of_hanging_nodes(name, max_hanging):
    mesh, tree, rng = MESHES[name](), None, np.random.default_rng(max_hanging)
    reached = 0
    for _ in range(5):
        near = np.hypot(*(np.array([p.mean(axis=0) for p in map(mesh.points_vx.__getitem__, mesh.cells())]) - 0.4).T)
        marked = np.argsort(near)[: 1 + rng.integers(3)]
        change = refined(mesh, marked, tree=tree, max_hanging=max_hanging)
        mesh, tree = change.mesh, change.tree
        assert not find_faults(mesh)
        reached = max(reached, most_hanging(mesh, 0.0, tree.born_v))
    assert reached == max_hanging


def test_nodes_that_hung_before_do_not_count_alone():
    """Welded meshes have as many as they like; a side that gets another one is too much."""
    coarse = structured_quadrilaterals([0, 1, 2], [0, 1], [Rectangle("a", 0, 2, 0, 1)])
    fine = structured_quadrilaterals([2, 3], np.linspace(0, 1, 5), [Rectangle("b", 2, 3, 0, 1)])
    mesh = weld([coarse, fine])
    assert most_hanging(mesh, 0.0, np.zeros(mesh.n_vertices, dtype=bool)) == 3
    assert np.bincount(refined(mesh, [0]).parent_c).tolist() == [4, 1, 1, 1, 1, 1]
    assert np.bincount(refined(mesh, [2]).parent_c)[[0, 2]].tolist() == [1, 4]
    assert np.bincount(refined(mesh, [2]).parent_c)[1] >= 4


def test_vertices_of_the_first_mesh_that_turn_by_little_do_not_hang():
    """They lie on a side where a cell is cut, but other cells are not cut because of them."""
    points = [(0, 0), (1, -0.1), (2, -0.1), (3, 0), (3, 3), (0, 3), (1, -1), (2, -1)]
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4, 5], [6, 7, 2, 1]])
    assert np.bincount(refined(mesh, [1], flat=20.0).parent_c).tolist() == [1, 4]
    assert np.bincount(refined(mesh, [0], flat=20.0).parent_c).tolist() == [4, 1]


def test_hanging_nodes_are_counted_wherever_a_list_begins():
    """Three on one side of a square, two of them made by refinement, beside a plain square."""
    points = np.array([(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (4, 4), (0, 4), (8, 0), (8, 4)], dtype=float)
    born = np.arange(9) % 2 == 1
    for k in range(7):
        loops = Loops.of_sizes(np.array([4, 7]), np.array([4, 7, 8, 5, *np.roll(np.arange(7), k)]))
        for flat in (0.0, 20.0):
            assert loops.overloaded(points, born, flat, 2).tolist() == [False, True]
            assert loops.overloaded(points, born, flat, 3).tolist() == [False, False]
            assert loops.overloaded(points, points[:, 0] > 3, flat, 2).tolist() == [False, False]


# -- cells of any shape ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_any_polygon_is_cut(name):
    mesh, tree = mesh_of(SHAPES[name]), None
    for _ in range(3):
        change = refined(mesh, np.ones(mesh.n_cells, dtype=bool), tree=tree, max_hanging=9)
        assert_lies_within(change, mesh)
        assert (np.bincount(change.parent_c) > 1).all()
        assert area_of(change.mesh) == pytest.approx(area_of(mesh), rel=1e-12)
        assert angles(change.mesh).min() > 5.0
        mesh, tree = change.mesh, change.tree


def test_a_cell_that_does_not_see_its_centroid_is_cut_from_another_point():
    """An L with a long thin leg: its centroid is outside, all of it is seen from the inner corner's square."""
    ell = np.array([(0, 0), (4, 0), (4, 0.5), (0.5, 0.5), (0.5, 4), (0, 4)], dtype=float)
    mesh = refined(mesh_of(ell), [0]).mesh
    assert mesh.n_cells == 5  # none at the inner corner, which divides a side
    hub = mesh.points_vx[mesh.cell(0)[-1]]
    assert hub == pytest.approx(0.25, abs=1e-12)


def test_a_cell_that_no_point_sees_is_cut_into_parts():
    """A U: one diagonal from an inner corner leaves two parts, each of which a point sees."""
    change = refined(mesh_of(SHAPES["U"]), [0])
    assert change.mesh.n_vertices == 8  # no new ones
    assert [sorted(map(tuple, change.mesh.points_vx[loop].tolist())) for loop in change.mesh.cells()] == [
        [(0, 0), (1, 1), (2, 1), (2, 2), (3, 0), (3, 2)],
        [(0, 0), (0, 2), (1, 1), (1, 2)],
    ]  # fmt: skip
    assert not change.tree.born_v.any()


def hub_edges(mesh, hub):
    """The other ends of all edges at a vertex."""
    return {
        tuple(mesh.points_vx[v]) for pair in mesh.edges.vertices_ev.tolist() if hub in pair for v in pair if v != hub
    }


@pytest.mark.parametrize(
    ("chain", "ends_at"),
    [
        ([(1, 1)], (1, 1)),  # far from the middle of its side
        ([(1.2, 1.0), (1, 1.1)], (1, 1.1)),  # the sharper of two, which turns by 63 degrees
        ([(2.2, 0.99)], (2.2, 0.99)),
    ],
)
def test_a_corner_to_the_right_divides_its_side(chain, ends_at):
    """An L with unequal legs: no child has it for a corner."""
    polygon = np.array([(0, 0), (4, 0), (4, 1), *chain, (1, 1.5), (0, 1.5)], dtype=float)
    mesh = refined(mesh_of(polygon), [0]).mesh
    assert mesh.n_cells == 5
    assert ends_at in hub_edges(mesh, mesh.n_vertices - 1)
    assert mesh.n_vertices == len(polygon) + 5  # four new middles and the hub
    assert angles(mesh).max() < 210.0


def test_a_centroid_close_to_a_side_is_no_hub():
    """A dart whose centroid just sees all of it: it is cut from the middle of what does."""
    dart = np.array([(0, 0), (1, 0.95), (2, 0), (1, 2)])
    mesh = refined(mesh_of(dart), [0]).mesh
    assert centroids(dart[None])[0] == pytest.approx([1.0, 2.95 / 3])
    assert mesh.n_cells == 3
    x, y = mesh.points_vx[-1]
    assert x == pytest.approx(1.0)
    assert 1.2 < y < 1.5
    assert angles(mesh).min() > 15.0


def comb(teeth, lean=0.0):
    """A bar with teeth, all ends on two lines."""
    outline = [(0, 0), (2 * teeth - 1, 0)]
    for k in range(2 * teeth - 2, -1, -2):
        outline += [(k + 1 + lean, 3), (k + lean, 3)]
        outline += [(k, 1), (k - 1, 1)] if k else []
    return np.array(outline, dtype=float)


# A table with a notch in its top: the line between two vertices of its sides passes through the notch's end.
TABLE = np.array(
    [(0, -3), (1, -3), (1, 0), (3, 0), (3, -3), (4, -3), (4, 2), (4, 3), (3, 3), (2, 2), (1, 3), (0, 3), (0, 2)],
    dtype=float,
)
COMBS = [comb(2), comb(4), comb(5, 1.5), comb(3, -0.5) @ [[0.6, 0.8], [-0.8, 0.6]], TABLE]


@pytest.mark.parametrize("polygon", COMBS)
def test_parts_of_combs(polygon):
    """Diagonals neither leave the polygon nor pass through its vertices."""
    import shapely

    parts = [shapely.Polygon(polygon[part]) for part in star_parts(polygon)]
    whole = shapely.Polygon(polygon)
    assert len(parts) >= 2
    assert all(part.is_valid and part.within(whole.buffer(1e-9)) for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(whole.area)
    mesh = refined(mesh_of(polygon), [0]).mesh
    assert not find_faults(mesh)
    assert not find_faults(refined(mesh, np.ones(mesh.n_cells, dtype=bool)).mesh)


def test_of_equal_diagonals_the_shorter_is_cut():
    """A U with a narrow and a wide leg on a floor of two thicknesses: both diagonals make 45 degrees."""
    polygon = np.array([(0, 0), (6, 0), (6, 9), (4, 9), (4, 2), (1, 1), (1, 9), (0, 9)], dtype=float)
    first = star_parts(polygon)
    assert sorted(map(sorted, first))[0] == [0, 1, 2, 3, 4, 5]
    mirrored = star_parts((polygon * [-1.0, 1.0])[::-1])
    assert sorted(map(sorted, mirrored))[-1] == [2, 3, 4, 5, 6, 7]


def spiral(turns=12):
    """A corridor of width 1 that winds inwards."""
    inner, outer = [], []
    for n in range(turns):
        r = 2.0 + 0.5 * n
        direction = np.array([np.cos(n * np.pi / 4), np.sin(n * np.pi / 4)])
        inner.append(r * direction)
        outer.append((r + 1.0) * direction)
    return np.array([*outer, *inner[::-1]])


def test_a_spiral():
    polygon = spiral()
    parts = star_parts(polygon)
    assert len(parts) >= 4
    assert sum(areas(polygon[part][None])[0] for part in parts) == pytest.approx(areas(polygon[None])[0])
    mesh = refined(mesh_of(polygon), [0]).mesh
    mesh = refined(mesh, np.ones(mesh.n_cells, dtype=bool)).mesh
    assert not find_faults(mesh)


def test_parts_do_not_depend_on_where_the_list_begins():
    polygon = SHAPES["U"]
    for k in range(1, 8):
        turned = np.roll(polygon, -k, axis=0)
        assert {frozenset(map(tuple, turned[part])) for part in star_parts(turned)} == {
            frozenset(map(tuple, polygon[part])) for part in star_parts(polygon)
        }


def test_parts_get_the_middles_that_their_neighbours_make():
    mesh = letters()
    assert refined(mesh, [1]).mesh.n_sides_c.max() > mesh.n_sides_c.max()
    change = refined(mesh, [0, 1])
    assert_lies_within(change, mesh)
    assert np.bincount(change.parent_c)[:2].tolist() == [2, 4]


def test_a_cell_that_cannot_be_cut_is_named():
    """A U squeezed until its diagonals make no angle with its sides."""
    mesh = mesh_of(SHAPES["U"] * [1.0, 1e-7])
    with pytest.raises(InputError, match="cell 0 cannot be refined: no point sees all of it"):
        refined(mesh, [0])
    assert refined(mesh_of(SHAPES["U"] * [1.0, 1e-5]), [0]).mesh.n_cells >= 2
    flat = SHAPES["U"] * [1.0, 1e-7]
    points = [(1.5, 0.0), *flat, (0.0, -1.0), (1.5, -1.0), (3.0, -1.0)]
    mesh = PolygonMesh.from_cells(points, [[9, 10, 0, 1], [10, 11, 2, 0], [1, 0, 2, 3, 4, 5, 6, 7, 8]])
    with pytest.raises(InputError, match="cell 2 cannot be refined"):  # as its neighbours are
        refined(mesh, [0, 1])


# -- input -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("marked", "more", "message"),
    [
        ([16], {}, r"cells 16 to 16 are marked, but cells run from 0 to 15"),
        (np.ones(3, dtype=bool), {}, r"the mask has 3 entries for 16 cells"),
        ([0], {"max_hanging": 0}, r"max_hanging = 0"),
        ([0], {"flat": -1.0}, r"flat = -1: use an angle from 0 to 60 degrees"),
        ([0], {"flat": 61.0}, r"flat = 61"),
        ([0], {"tree": CellTree.of(squares(2))}, r"the tree is of a mesh with 4 cells, this one has 16"),
    ],
)
def test_bad_input(marked, more, message):
    with pytest.raises(InputError, match=message):
        refined(squares(), marked, **more)


def test_hub_of_a_part_of_a_mesh_and_of_a_copy_far_away():
    """Cells are cut the same wherever they are."""
    mesh = disc()
    part = submesh(mesh, np.arange(5))
    far = replace(part, points_vx=part.points_vx + 1024.0)
    here, there = refined(part, [2]).mesh, refined(far, [2]).mesh
    assert there.points_vx - 1024.0 == pytest.approx(here.points_vx, abs=1e-12)
    assert (here.cell_vertices == there.cell_vertices).all()
    assert centroids(part.points_vx[part.cell(2)][None])[0] == pytest.approx(here.points_vx[-1], abs=1e-15)
