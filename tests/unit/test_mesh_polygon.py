"""Polygon meshes: validation messages, immutability, edges, geometry."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import SHAPES, grid, hanging, mesh_of, non_convex, voronoi

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.geometry import areas, centroids, diameters, star_shaped_about
from tmc_vem.support.errors import InputError

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
TWO = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]
LEFT, RIGHT = [0, 1, 4, 3], [1, 2, 5, 4]


def test_two_good_cells_are_a_mesh():
    mesh = PolygonMesh.from_cells(TWO, [LEFT, RIGHT], [0, 1], ("a", "b"), {"corner": 0}, {"top": [(4, 3), (4, 5)]})
    assert (mesh.n_cells, mesh.n_vertices) == (2, 6)
    assert mesh.cell(1).tolist() == RIGHT
    assert mesh.n_sides_c.tolist() == [4, 4]
    assert mesh.named_vertex("corner") == 0


@pytest.mark.parametrize(
    ("points", "cells", "message"),
    [
        (SQUARE, [[0, 3, 2, 1]], r"cell 0 is clockwise .*counter-clockwise"),
        (TWO, [LEFT, [1, 4, 5, 2]], r"cell 1 is clockwise"),
        (SQUARE, [[0, 1, 3, 2]], r"cell 0 intersects itself: its sides \d and \d cross or touch"),
        ([*SQUARE[:2], (0.0, 2.0), (1.0, 1.5)], [[0, 1, 2, 3]], r"cell 0 intersects itself"),
        ([*SQUARE, (0.5, 0.0)], [[0, 1, 2, 4, 3]], r"cell 0 intersects itself"),  # touches its own side
        ([*SQUARE[:3], (0.5, 1.0), (0.5, 2.0)], [[0, 1, 2, 3, 4, 3]], r"cell 0 repeats vertex 3"),
        ([(0, 0), (1, 0), (1, 1), (0.2, 1), (0.2, 2), (0.2, 0.5)], [[0, 1, 2, 3, 4, 5]], r"cell 0 intersects itself"),
        (SQUARE, [[0, 1, 2, 1]], r"cell 0 repeats vertex 1"),
        ([*SQUARE, (0.0, 1.0)], [[0, 1, 2, 3, 4]], r"cell 0 has an edge of length zero between vertices 3 and 4"),
        ([*SQUARE, (1e-13, 1.0)], [[0, 1, 2, 4, 3]], r"cell 0 has an edge of length zero"),
        ([(0, 0), (1, 0), (2, 0)], [[0, 1, 2]], r"cell 0 has no area: its vertices lie on a line"),
        ([(0, 0), (1, 1), (3, 3), (2, 2)], [[0, 1, 2, 3]], r"cell 0 has no area: its vertices lie on a line"),
        (SQUARE, [[0, 1]], r"cell 0 has 2 vertices; a polygon needs at least 3"),
        (SQUARE, [], r"the mesh has no cells"),
        (SQUARE, [[0, 1, 2, 7]], r"cell 0 refers to vertex 7; there are 4 vertices"),
        (TWO, [LEFT, [1, 2, 5, -1]], r"cell 1 refers to vertex -1; there are 6 vertices"),
        ([*SQUARE, (3.0, 3.0)], [[0, 1, 2, 3]], r"vertex 4 belongs to no cell \(1 such vertices\)"),
        ([*SQUARE[:3], (np.nan, 1.0)], [[0, 1, 2, 3]], r"vertex 3 has a coordinate that is not a finite number"),
        ([*SQUARE[:3], (0.0, np.inf)], [[0, 1, 2, 3]], r"vertex 3 has a coordinate that is not a finite number"),
        (TWO, [LEFT, [0, 1, 4, 3]], r"cells 0 and 1 overlap"),
        ([*SQUARE, (0.5, 0.5)], [[0, 1, 2, 3], [0, 1, 4]], r"cells 0 and 1 overlap.* same side of the edge"),
        ([*SQUARE, (0.5, -1), (0.5, -2)], [[0, 1, 2, 3], [0, 4, 1], [0, 5, 1]], r"3 cells share the edge .* 0 and 1"),
    ],
)
def test_bad_polygons_are_refused_by_name(points, cells, message):
    with pytest.raises(InputError, match=message):
        PolygonMesh.from_cells(points, cells)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"region_c": [0, 2], "region_names": ("a", "b")}, r"cell 1 is in region 2, .* 0 to 1 \(a, b\)"),
        ({"region_c": [-1, 0]}, r"cell 0 is in region -1"),
        ({"region_c": [0]}, r"1 region numbers for 2 cells"),
        ({"named_points": {"load": 6}}, r"named point 'load' has no node: vertex 6 of 6"),
        ({"named_points": {"load": -1}}, r"named point 'load' has no node"),
        ({"named_edges": {"top": [(3, 5)]}}, r"named edges 'top': vertices 3 and 5 are not joined by an edge"),
        ({"named_edges": {"top": [(3, 9)]}}, r"named edges 'top'"),
    ],
)
def test_bad_regions_and_names_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        PolygonMesh.from_cells(TWO, [LEFT, RIGHT], **arguments)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"points_vx": np.zeros((4, 3))}, r"points need shape \(n, 2\), got \(4, 3\)"),
        ({"cell_offsets": [0, 3]}, r"cell_offsets"),
        ({"cell_offsets": [1, 4]}, r"cell_offsets"),
        ({"cell_offsets": [0, 5]}, r"cell_offsets"),
        ({"cell_offsets": []}, r"no cells"),
    ],
)
def test_bad_arrays_are_refused(arrays, message):
    good = {"points_vx": SQUARE, "cell_offsets": [0, 4], "cell_vertices": [0, 1, 2, 3], "region_c": [0]}
    with pytest.raises(InputError, match=message):
        PolygonMesh(**{**good, **arrays})


def test_arrays_cannot_be_changed():
    points = np.array(SQUARE)
    pairs, names = np.array([[0, 1]]), {"corner": 0}
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3]], named_points=names, named_edges={"low": pairs})
    points[0], pairs[0], names["corner"] = 9.0, 3, 2  # the caller's own data stay the caller's
    assert mesh.points_vx[0].tolist() == [0.0, 0.0]
    assert mesh.named_edges["low"].tolist() == [[0, 1]]
    assert mesh.named_vertex("corner") == 0
    for array in (mesh.points_vx, mesh.cell_vertices, mesh.cell_offsets, mesh.region_c, mesh.named_edges["low"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(TypeError):
        mesh.named_points["corner"] = 1
    with pytest.raises(AttributeError):
        mesh.region_names = ("other",)


def test_edges_are_unique_and_know_how_cells_run_along_them():
    for mesh in (voronoi(16), hanging(3), non_convex()):
        edges = mesh.edges
        pairs: dict[tuple[int, int], list[bool]] = {}
        side = 0
        for loop in mesh.cells():
            for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True):
                low, high = edges.vertices_ev[edges.cell_edges[side]].tolist()
                assert (a, b) == ((low, high) if edges.forward[side] else (high, low))
                pairs.setdefault((low, high), []).append(bool(edges.forward[side]))
                side += 1
        assert len(pairs) == len(edges) == len(edges.n_cells_e)
        for (low, high), count in zip(edges.vertices_ev.tolist(), edges.n_cells_e.tolist(), strict=True):
            assert low < high
            assert len(pairs[low, high]) == count
            assert count == 1 or sorted(pairs[low, high]) == [False, True]
        assert mesh.n_vertices - len(edges) + mesh.n_cells == 1  # Euler's formula for a disc


def test_names_that_are_missing_are_listed():
    mesh = PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]], named_points={"b": 1, "a": 0})
    with pytest.raises(InputError, match=r"no named point 'load' \(it has: a, b\)"):
        mesh.named_vertex("load")


def test_find_vertex_names_the_nearest():
    mesh = PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]])
    assert mesh.find_vertex(1.0, 1.0 + 1e-12) == 2
    with pytest.raises(InputError, match=r"no node at \(0\.9, 1\): the nearest is vertex 2 at \(1, 1\)"):
        mesh.find_vertex(0.9, 1.0)


@pytest.mark.parametrize("offset", [0.0, 1e4])
@pytest.mark.parametrize("name", SHAPES)
def test_geometry_of_polygons(name, offset):
    polygon = SHAPES[name] + offset
    # Oracle: signed triangles from a fixed point, one after the other.
    area, moment = 0.0, np.zeros(2)
    origin = polygon.mean(axis=0)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        piece = 0.5 * ((a - origin)[0] * (b - origin)[1] - (a - origin)[1] * (b - origin)[0])
        area += piece
        moment += piece * ((a - origin) + (b - origin)) / 3.0
    longest = max(np.hypot(*(a - b)) for a in polygon for b in polygon)
    accuracy = 1e-14 + 1e-15 * offset
    assert areas(polygon[None])[0] == pytest.approx(area, rel=100 * accuracy)
    assert centroids(polygon[None])[0] - origin == pytest.approx(moment / area, abs=100 * accuracy)
    assert diameters(polygon[None])[0] == pytest.approx(longest, rel=1e-14)


def test_star_shaped_about():
    def is_star(name, center):
        return bool(star_shaped_about(SHAPES[name][None], np.array([center]))[0])

    assert is_star("square", (0.5, 0.5))
    assert not is_star("square", (0.5, 0.0))  # on a side: that triangle has no area
    assert is_star("L", (0.5, 0.5))
    assert not is_star("L", (1.5, 0.5))  # the other arm is out of sight
    assert not is_star("U", tuple(centroids(SHAPES["U"][None])[0]))
    assert is_star("square, three hanging nodes on one edge", (0.5, 0.5))


@pytest.mark.parametrize("mesh", [voronoi(16), hanging(4), hanging(4, 0.05), grid(3, 2)], ids=lambda m: str(m.n_cells))
def test_meshes_of_the_tests_fill_the_unit_square(mesh):
    total = sum(areas(mesh.points_vx[loop][None])[0] for loop in mesh.cells())
    assert total == pytest.approx(1.0, abs=1e-13)


def test_cells_by_size_covers_every_cell_once():
    mesh = hanging(3)
    seen = []
    for n_sides, cells, vertices in mesh.cells_by_size():
        assert vertices.shape == (len(cells), n_sides)
        for c, loop in zip(cells.tolist(), vertices, strict=True):
            assert loop.tolist() == mesh.cell(c).tolist()
        seen += cells.tolist()
    assert sorted(seen) == list(range(mesh.n_cells))


def test_many_vertices_far_from_the_origin_are_no_self_intersection():
    ring = np.array([(np.cos(t), np.sin(t)) for t in np.linspace(0, 2 * np.pi, 60, endpoint=False)])
    assert mesh_of(ring + 1e3).n_cells == 1
