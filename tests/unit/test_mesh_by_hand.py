"""Small meshes whose numbers are known by hand: polygons, parts, sides, welding, cutting and estimates."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.between import Outline, near_vertices, overlaps, parts_of, shapes_of, slits, t_junctions
from tmc_vem.mesh.geometry import areas, centroids, diameters, star_shaped_about, triangle_lattice
from tmc_vem.mesh.interface import body_numbers, free_chains, interface, solid_angles
from tmc_vem.mesh.locate import find_cells
from tmc_vem.mesh.make.estimate import check_size, estimate
from tmc_vem.mesh.make.far import meshed_near_origin, moved, origin_for, relative
from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.quality import measure
from tmc_vem.mesh.validate import check_polygons
from tmc_vem.support.errors import InputError

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]


def grid(nx: int, ny: int = 1, **names: Any) -> PolygonMesh:
    return structured_quadrilaterals(
        np.arange(nx + 1.0), np.arange(ny + 1.0), [Rectangle("a", 0, nx, 0, ny), Rectangle("b", 1, nx, 0, ny)], **names
    )


def unchecked(points: Any, cells: list[list[int]]) -> PolygonMesh:
    return PolygonMesh(
        np.array(points, dtype=float), np.cumsum([0, *map(len, cells)]), np.concatenate(cells),
        np.zeros(len(cells), dtype=np.int64), validate=False,
    )  # fmt: skip


def loops(mesh: PolygonMesh) -> list[list[int]]:
    return [loop.tolist() for loop in mesh.cells()]


def edges(mesh: PolygonMesh) -> dict[str, Any]:
    return {name: pairs.tolist() for name, pairs in mesh.named_edges.items()}


# -- polygons ----------------------------------------------------------------------------------------------------------


def test_geometry_of_polygons() -> None:
    """An L of five unit squares' worth with its shifted and turned copy; a triangle."""
    ell = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    both = np.stack([ell + np.array([7, -2]), ell @ [[0.0, 1.0], [-1.0, 0.0]]])
    center = np.array([(3 * 1.5 + 2 * 0.5) / 5, (3 * 0.5 + 2 * 2.0) / 5])
    assert areas(both) == pytest.approx([5.0, 5.0], rel=1e-14)
    assert areas(both[:, ::-1]) == pytest.approx([-5.0, -5.0], rel=1e-14)
    assert centroids(both) == pytest.approx(np.stack([center + np.array([7, -2]), [-center[1], center[0]]]), rel=1e-14)
    assert diameters(both) == pytest.approx([math.sqrt(18.0)] * 2, rel=1e-14)
    assert diameters(np.array([[[0, 0], [2, 0], [0, 1]]], dtype=float)) == pytest.approx([math.sqrt(5.0)])
    for point, inside in (((0.5, 0.5), True), ((2.0, 0.5), False), ((1.0, 1.0), False), ((0.999, 0.999), True)):
        assert star_shaped_about(ell[None], np.array([point]))[0] == inside
    margin = star_shaped_about(ell[None], np.array([[0.5, 1e-5]]), tolerance=1e-5)
    assert not margin[0]
    assert star_shaped_about(ell[None], np.array([[0.5, 1e-4]]), tolerance=1e-5)[0]
    assert triangle_lattice(3).tolist() == [
        [0, 0, 1], [0, 0.5, 0.5], [0, 1, 0], [0.5, 0, 0.5], [0.5, 0.5, 0], [1, 0, 0],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("points", "cell", "message"),
    [
        (SQUARE, [0, 1, 2, 3], None),
        (SQUARE, [1, 2, 1, 3], "cell 1 repeats vertex 1: list each vertex once"),
        ([[0, 0], [1, 0], [1, 0], [0, 1]], [3, 0, 1, 2],
         "cell 1 has an edge of length zero between vertices 1 and 2: merge them"),
        ([[0, 0], [1, 0], [1, 1], [0, 1e-10]], [0, 1, 2, 3],
         "cell 1 has an edge of length zero between vertices 3 and 0: merge them"),
        ([[0, 0], [1, 0], [1, 1], [0, 1.5e-10]], [0, 1, 2, 3], None),
        ([[0, 0], [1, 0], [3, 0], [2, 0]], [0, 1, 2, 3], "cell 1 has no area: its vertices lie on a line"),
        ([[0, 0], [1, 0], [3, 0], [2, 3.1e-10]], [0, 1, 2, 3],
         "cell 1 intersects itself: its sides 1 and 2 cross or touch"),
        ([[0, 0], [1, 0], [3, 0], [2, 2.9e-10]], [0, 1, 2, 3], "cell 1 has no area: its vertices lie on a line"),
        (SQUARE, [0, 2, 1, 3], "cell 1 intersects itself: its sides 0 and 2 cross or touch"),
        (SQUARE, [0, 1, 3, 2], "cell 1 intersects itself: its sides 1 and 3 cross or touch"),
        ([[0, 0], [4, 0], [4, 2], [2, 0], [0, 2]], [0, 1, 2, 3, 4],
         "cell 1 intersects itself: its sides 0 and 2 cross or touch"),
        ([[0, 0], [4, 0], [4, 2], [2, 0.001], [0, 2]], [0, 1, 2, 3, 4], None),
        ([[0, 0], [4, 0], [4, 2], [2, -1], [0, 2]], [0, 1, 2, 3, 4],
         "cell 1 intersects itself: its sides 0 and 2 cross or touch"),
        ([[0, 0], [2, 0], [2, 1], [1, 1], [3, 1], [0, 3]], [0, 1, 2, 3, 4, 5],
         "cell 1 intersects itself: its sides 1 and 3 cross or touch"),
        ([[0, 0], [2, 0], [1, 0], [1, 2]], [0, 1, 2, 3], "cell 1 intersects itself: its sides 0 and 1 cross or touch"),
        ([[1, 0], [1, 2], [0, 0], [2, 0]], [0, 1, 2, 3], "cell 1 intersects itself: its sides 0 and 2 cross or touch"),
        (SQUARE, [3, 2, 1, 0], "cell 1 is clockwise (area -1): list its vertices counter-clockwise"),
        ([[0, 0], [2, 0], [2, 2], [1, 2], [1, 1], [0, 1]], [0, 1, 2, 3, 4, 5], None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_polygons_that_are_none(points: Any, cell: list[int], message: str | None, scale: float) -> None:
    """Behind a good cell, at any scale: limits are fractions of the diameter."""
    n = len(points)
    angle = 2.0 * np.pi * np.arange(len(cell)) / len(cell)
    where = scale * np.array([*points, *np.column_stack([5 + np.cos(angle), 5 + np.sin(angle)])], dtype=float)
    flat = np.array([*range(n, n + len(cell)), *cell])
    offsets = np.array([0, len(cell), 2 * len(cell)])
    if message is None:
        check_polygons(where, offsets, flat)
        return
    with pytest.raises(InputError) as refused:
        check_polygons(where, offsets, flat)
    assert str(refused.value).replace("e+12", "") == message


def test_quality_by_hand() -> None:
    """A rectangle of 2 x 1, a triangle, and a dart that is not convex."""
    points = [[0, 0], [2, 0], [2, 1], [0, 1], [4, 0], [4, 1], [3, 0.75]]
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3], [1, 4, 6], [1, 6, 4, 5, 2]])
    quality = measure(mesh)
    assert quality.area_c == pytest.approx([2.0, 0.75, 1.25])
    assert quality.diameter_c == pytest.approx([math.sqrt(5), 2.0, math.sqrt(5)])
    assert quality.shortest_edge_c == pytest.approx([1.0, 1.25, 1.0])
    assert quality.aspect_c[0] == pytest.approx(2.0)
    assert quality.convex_c.tolist() == [True, True, False]
    assert quality.star_shaped_c.tolist() == [True, True, False]


def test_cells_of_points() -> None:
    """The smallest number where points lie on several cells; outside of all, the nearest."""
    squares = [np.array(SQUARE) + np.array([x, 0]) for x in (0, 1, 3)]
    points = np.array([[0.5, 0.5], [1.0, 0.5], [2.4, 0.5], [2.6, 0.25], [5.0, 2.0], [2.0000005, 0.5]])
    for numbers, on in (([5, 7, 9], 0), ([7, 5, 9], 1)):
        found = find_cells(squares, np.array(numbers), points, 1e-6)
        assert found.cell_n.tolist() == [0, on, 1, 2, 2, 1]
        assert found.distance_n == pytest.approx([0, 0, 0.4, 0.4, math.sqrt(2), 0])
        assert found.nearest_nx[2:5] == pytest.approx(np.array([[2, 0.5], [3, 0.25], [4, 1]]))
    assert np.isinf(find_cells([], np.array([], int), points, 1e-6).distance_n).all()
    assert find_cells(squares, np.arange(3), np.zeros((0, 2)), 1e-6).cell_n.shape == (0,)


# -- parts and names ---------------------------------------------------------------------------------------------------


def test_parts_keep_what_is_theirs() -> None:
    mesh = grid(3, named_points={"p": (0, 0), "q": (3, 1)})
    named = PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, mesh.named_points,
        {"low": np.array([[0, 1], [1, 2], [2, 3]]), "left": np.array([[4, 0]]), "inner": np.array([[6, 2]])},
    )  # fmt: skip
    part = submesh(named, [2, 1])
    assert part.points_vx.tolist() == mesh.points_vx[[1, 2, 3, 5, 6, 7]].tolist()
    assert loops(part) == [[1, 2, 5, 4], [0, 1, 4, 3]]
    assert (part.region_names, part.region_c.tolist()) == (("b",), [0, 0])
    assert dict(part.named_points) == {"q": 5}
    assert edges(part) == {"low": [[0, 1], [1, 2]], "inner": [[4, 1]]}
    other = submesh(named, np.array([True, False, True]))
    assert (loops(other), other.region_names, other.region_c.tolist()) == (
        [[0, 1, 5, 4], [2, 3, 7, 6]], ("a", "b"), [0, 1]
    )  # fmt: skip
    assert edges(other) == {"low": [[0, 1], [2, 3]], "left": [[4, 0]], "inner": [[6, 2]]}
    assert dict(submesh(named, [0]).named_points) == {"p": 0}
    for none in ([], np.zeros(3, dtype=bool)):
        with pytest.raises(InputError, match=r"^a part of a mesh needs at least one cell, none was chosen$"):
            submesh(named, none)


def test_edges_along_lines() -> None:
    """Within 1e-9 of the mesh's extent of the line and its ends, in either direction."""
    mesh = grid(4, 2)
    for start, end, n in (
        ((1, 1), (3, 1), 2), ((3, 1), (1, 1), 2), ((1, 1 + 3e-9), (3, 1), 2), ((1, 1 + 1e-8), (3, 1), 0),
        ((1 + 3e-9, 1), (3 - 3e-9, 1), 2), ((1 + 1e-8, 1), (3, 1), 1), ((1, 1), (3 - 1e-8, 1), 1), ((0, 0), (4, 2), 0),
        ((2, 0), (2, 2), 2), ((2.5, 0), (2.5, 2), 0), ((1, 1), (1 + 3e-9, 1), -1),
    ):  # fmt: skip
        if n > 0:
            assert len(with_names(mesh, lines={"e": (start, end)}).named_edges["e"]) == n
            continue
        said = (
            "no edge of the mesh lies on the line from {} to {}" if n == 0 else "the line from {} to {} has no length"
        )
        with pytest.raises(InputError) as refused:
            with_names(mesh, lines={"e": (start, end)})
        assert str(refused.value) == f"named edges 'e': {said.format(start, end)}"
    named = with_names(mesh, {"p": (4.0, 2.0)}, {"e": ((0, 0), (1, 0))})
    assert (dict(named.named_points), edges(named)) == ({"p": 14}, {"e": [[0, 1]]})
    assert named.region_names == ("a", "b")
    with pytest.raises(InputError, match=r"^named point 'p': "):
        with_names(mesh, {"p": (9.0, 2.0)})


# -- cutting and structured grids --------------------------------------------------------------------------------------


def test_quadrilaterals_are_cut_along_their_shorter_diagonals() -> None:
    points = [[0, 0], [1, 0], [1.2, 1], [0, 1], [2, 0], [2, 1.5], [3, 0]]
    mesh = PolygonMesh.from_cells(points, [[0, 1, 2, 3], [4, 6, 5], [1, 4, 5, 2]], [1, 0, 0], ("x", "y"), {"p": 3},
                                  {"e": np.array([[0, 1]])})  # fmt: skip
    cut, parents = split_quadrilaterals(mesh)
    assert loops(cut) == [[1, 2, 3], [1, 3, 0], [4, 6, 5], [4, 5, 2], [4, 2, 1]]
    assert parents.tolist() == [0, 0, 1, 2, 2]
    assert (cut.region_c.tolist(), cut.region_names) == ([1, 1, 0, 0, 0], ("x", "y"))
    assert (dict(cut.named_points), edges(cut)) == ({"p": 3}, {"e": [[0, 1]]})
    assert loops(split_quadrilaterals(grid(2, 2))[0]) == [
        [0, 1, 4], [0, 4, 3], [2, 5, 4], [2, 4, 1], [4, 7, 6], [4, 6, 3], [4, 5, 8], [4, 8, 7],
    ]  # fmt: skip
    five = PolygonMesh.from_cells([*SQUARE, [0.5, -1]], [[0, 4, 1, 2, 3]])
    with pytest.raises(InputError, match=r"^cell 0 has 5 vertices: quadrilaterals can be cut in two$"):
        split_quadrilaterals(five)


def test_structured_grids() -> None:
    mesh = structured_quadrilaterals(
        [0, 1, 3], [0, 2, 3], [Rectangle("a", 0, 3, 0, 3), Rectangle("b", 1, 3, 2, 3), Rectangle("a", 0, 3, 0, 2)],
        {"p": (1, 2)},
    )  # fmt: skip
    assert mesh.points_vx.tolist() == [[x, y] for y in (0, 2, 3) for x in (0, 1, 3)]
    assert loops(mesh) == [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    assert (mesh.region_c.tolist(), mesh.region_names, dict(mesh.named_points)) == ([0, 0, 0, 1], ("a", "b"), {"p": 4})


@pytest.mark.parametrize(
    ("x", "y", "rectangle", "message"),
    [
        ([0], [0, 1], (0, 1, 0, 1), "x mesh lines must be at least two increasing numbers, got [0.0]"),
        ([0, 1], [0, 2, 2], (0, 1, 0, 1), "y mesh lines must be at least two increasing numbers, got [0.0, 2.0, 2.0]"),
        ([0, np.inf], [0, 1], (0, 1, 0, 1), "x mesh lines must be at least two increasing numbers, got [0.0, inf]"),
        ([[0, 1]], [0, 1], (0, 1, 0, 1), "x mesh lines must be at least two increasing numbers, got [[0.0, 1.0]]"),
        ([0, 1], [0, 1], (1, 1, 0, 1), "region 'r' is an empty rectangle: x0 = 1, x1 = 1, y0 = 0, y1 = 1"),
        ([0, 1], [0, 1], (0, 1, 1, 1), "region 'r' is an empty rectangle: x0 = 0, x1 = 1, y0 = 1, y1 = 1"),
        ([0, 1, 2], [0, 1, 2], (0, 2, 0, 1), "the cell with lower left corner (0, 1) is in no region"),
        ([0, 1, 2], [0, 1, 2], (0, 1, 0, 2), "the cell with lower left corner (1, 0) is in no region"),
        ([0, 1, 2], [0, 1], (0.25, 2, 0, 1), "region 'r' ends at x = 0.25, which is not a mesh line (nearest 0): "
         "change the number of cells so that the spacing divides it"),
        ([0, 1, 2], [0, 1], (0, 2, 0, 1 + 1e-8), "region 'r' ends at y = 1, which is not a mesh line (nearest 1): "
         "change the number of cells so that the spacing divides it"),
    ],
)  # fmt: skip
def test_structured_grids_that_are_refused(x: Any, y: Any, rectangle: Any, message: str) -> None:
    with pytest.raises(InputError) as refused:
        structured_quadrilaterals(x, y, [Rectangle("r", *rectangle)])
    assert str(refused.value) == message
    assert structured_quadrilaterals([0, 1], [0, 1], [Rectangle("r", 0, 1 + 9e-10, 0, 1)]).n_cells == 1


# -- welding -----------------------------------------------------------------------------------------------------------


def test_welding_inserts_hanging_nodes_in_order() -> None:
    """One square beside three small ones: named edges are cut into pieces."""
    left = PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]], [0], ("a",), {"p": 1}, {"side": np.array([[2, 1]])})
    y = [0.0, 0.25, 0.5, 1.0]
    right = structured_quadrilaterals([1, 2], y, [Rectangle("b", 1, 2, 0, 1)], {"p": (1, 0), "q": (2, 1)})
    right = with_names(right, lines={"side": ((1, 0), (1, 1)), "out": ((2, 0), (2, 0.5))})
    mesh = weld([left, right])
    assert mesh.points_vx.tolist() == [*SQUARE, [2, 0], [1, 0.25], [2, 0.25], [1, 0.5], [2, 0.5], [2, 1]]
    assert loops(mesh) == [[0, 1, 5, 7, 2, 3], [1, 4, 6, 5], [5, 6, 8, 7], [7, 8, 9, 2]]
    assert (mesh.region_c.tolist(), mesh.region_names) == ([0, 1, 1, 1], ("a", "b"))
    assert dict(mesh.named_points) == {"p": 1, "q": 9}
    assert edges(mesh) == {"side": [[1, 5], [2, 7], [5, 7]], "out": [[4, 6], [6, 8]]}
    assert weld([right, left]).n_sides_c.tolist() == [4, 4, 4, 6]
    alone = weld([right])
    assert (loops(alone), edges(alone)) == (loops(right), {"side": [[0, 2], [2, 4], [4, 6]], "out": [[1, 3], [3, 5]]})


def test_what_is_welded_along_sides_that_are_not_the_same() -> None:
    left = PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]])
    for off, sides in ((0.01, 5), (1e-10, 5)):
        right = PolygonMesh.from_cells([[1, 0], [2, 0], [2, 1], [1, 1], [1 + off, 0.5]], [[0, 1, 2, 3, 4]])
        assert weld([left, right], off_side=0.011).n_sides_c.tolist() == [sides, 5]
        assert weld([left, right]).n_sides_c.tolist() == [5 if off < 1e-9 else 4, 5]
    with pytest.raises(InputError, match=r"^weld needs at least one mesh$"):
        weld([])
    other = PolygonMesh.from_cells(np.array(SQUARE) + np.array([1, 0]), [[0, 1, 2, 3]], [0], ("x",), {"p": 0})
    first = PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]], [0], ("x",), {"p": 3})
    with pytest.raises(InputError) as refused:
        weld([first, other])
    assert str(refused.value) == (
        "named point 'p' is at (0, 1) in one mesh and at (1, 0) in another: rename one of them"
    )


# -- sides between solids and medium -----------------------------------------------------------------------------------

MEDIUM = np.array([False, True, True, False])


def test_interface_by_hand() -> None:
    """A row of four squares, solid at its ends: the solid is on the left of each side."""
    mesh = grid(4)
    found = interface(mesh, MEDIUM)
    assert sorted(found.ends_sv.tolist()) == [[1, 6], [8, 3]]
    s = found.ends_sv.tolist().index([1, 6])
    assert (found.solid_s[s], found.medium_s[s], found.solid_s[1 - s], found.medium_s[1 - s]) == (0, 1, 3, 2)
    assert found.normal_sx[[s, 1 - s]].tolist() == [[1, 0], [-1, 0]]
    assert found.arm_sx[[s, 1 - s]].tolist() == [[0, 1], [0, -1]]
    points = np.array([[1.0, 0.5], [1.0, 0.5], [1.5, 2.0], [3.5, 0.5]])
    normals = np.array([[[1.0, 0.0]], [[-1.0, 0.0]], [[0.0, -1.0]], [[-1.0, 0.0]]])
    ahead = found.nearest(points, normals, 0.8, 0.8)
    assert ahead.side_n.tolist() == [1 - s, -1, -1, s]
    assert (ahead.point_nx[0].tolist(), ahead.distance_n[0]) == ([3.0, 0.5], 2.0)
    seen = found.seen(points)
    assert seen.side_n[[0, 2]].tolist() == [s, s]
    assert seen.point_nx[2].tolist() == [1, 1]
    assert seen.distance_n[[0, 2]] == pytest.approx([0.0, math.hypot(0.5, 1.0)])
    assert seen.side_n[3] == s  # behind the other
    beyond = found.seen(np.array([[1.0, 3.0]]))  # on the line of a side
    assert (beyond.side_n[0], beyond.distance_n[0]) == (s, 2.0)
    large = PolygonMesh(3.0 * mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, validate=False,
                        region_c=mesh.region_c, region_names=mesh.region_names)  # fmt: skip
    wide = interface(large, MEDIUM)
    assert wide.normal_sx.tolist() == found.normal_sx.tolist()
    slanted = np.array([[[0.8, 0.6]]])  # the way to the side has the cosine 0.8 with it, and 1 with the side's normal
    for facing, opposite, side in ((0.79, 0.99, 1 - s), (0.81, 0.5, -1), (0.5, 0.99, 1 - s)):
        assert wide.nearest(np.array([[4.0, 1.5]]), slanted, facing, opposite).side_n[0] == side
    assert body_numbers(mesh, ~MEDIUM).tolist() == [0, -1, -1, 1]
    assert body_numbers(mesh, MEDIUM).tolist() == [-1, 0, 0, -1]
    chains = [chain.tolist() for chain in free_chains(mesh, MEDIUM)]
    assert sorted(chains) == [[1, 2, 3], [8, 7, 6]]
    assert free_chains(mesh, np.ones(4, dtype=bool)) == []
    right = np.pi / 2
    assert solid_angles(mesh, ~MEDIUM) == pytest.approx([right, right, 0, right, right] * 2)
    bent = PolygonMesh.from_cells([[0, 0], [2, 0], [2, 2], [1, 1], [0, 2]], [[0, 1, 2, 3, 4]])
    assert solid_angles(bent, np.array([True])) / np.pi == pytest.approx([0.5, 0.5, 0.25, 1.5, 0.25])
    assert len(found.nearest(np.zeros((0, 2)), np.zeros((0, 1, 2)), 0.5, 0.5).side_n) == 0


# -- between cells -----------------------------------------------------------------------------------------------------


def test_slits_and_junctions_by_hand() -> None:
    """Two squares a little apart, by a fraction of their sides."""

    def pair(width: float, node: float | None = None) -> Outline:
        points = [*SQUARE, [1 + width, 0], [2, 0], [2, 1], [1 + width, 1]]
        cells = [[0, 1, 2, 3], [4, 5, 6, 7]]
        if node is not None:
            points.append([1 + width, node])
            cells[1].append(8)
        return Outline.of(unchecked(points, cells))

    both = pair(1e-4)
    assert both.pairs_sv.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4]]
    assert both.cell_s.tolist() == [0] * 4 + [1] * 4
    assert both.length_s == pytest.approx([1, 1, 1, 1, 0.9999, 1, 0.9999, 1])
    assert near_vertices(both) == [(1, 4), (2, 7)]
    assert (near_vertices(pair(1.1e-3)), near_vertices(pair(9.9e-4)), near_vertices(pair(0.0))) == (
        [],
        [(1, 4), (2, 7)],
        [],
    )
    fault = next(slits(both))
    assert (fault.kind, fault.fixable, fault.message) == (
        "near vertices", True,
        "vertices 1 and 4 nearly coincide at (1, 0), 0.0001 apart: the cells there do not hang together",
    )  # fmt: skip
    found = list(t_junctions(pair(1e-4, 0.5)))
    assert [fault.message for fault in found] == [
        "vertex 8 lies on the side of cell 0 between vertices 1 and 2 but is not one of its vertices: insert it as a "
        "hanging node"
    ]
    assert (found[0].kind, found[0].fixable) == ("T-junction", True)
    assert (list(t_junctions(pair(1.1e-3, 0.5))), list(t_junctions(both))) == ([], [])
    assert len(list(t_junctions(pair(9e-4, 0.5)))) == 1
    assert parts_of(both.mesh).tolist() == [0, 1]
    assert parts_of(grid(3)).tolist() == [0, 0, 0]
    apart = unchecked([*SQUARE, [0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]], [[0, 1, 2, 3], [4, 5, 6, 7]])
    assert [fault.message for fault in overlaps(Outline.of(apart), shapes_of(apart))] == ["cells 0 and 1 overlap"]
    assert list(overlaps(both, shapes_of(both.mesh))) == []
    for cells, n in (([[0, 1, 2, 3], [0, 1, 4]], 1), ([[0, 1, 4], [0, 1, 2, 3]], 1), ([[0, 1, 2, 3], [1, 2, 5]], 0)):
        folded = unchecked([*SQUARE, [0.5, 0.5], [2.0, 0.5]][: 1 + max(map(max, cells))], cells)
        folded_faults = [f for f in overlaps(Outline.of(folded), shapes_of(folded)) if f.kind == "overlap"]
        assert [(f.message, f.fixable) for f in folded_faults] == [("cells 0 and 1 overlap", False)] * n


# -- sizes and places --------------------------------------------------------------------------------------------------

BOX = Region("box", [(0, 0), (4, 0), (4, 2), (0, 2)])


def test_numbers_of_cells_are_estimated() -> None:
    """By the area over the square of the size, and by the edges along the outlines, which two regions may share."""
    constant = estimate([BOX], 0.5, 2.0, 1e6)
    assert (constant.n_cells, constant.smallest, constant.at_least) == (pytest.approx(64.0), 0.5, False)
    assert estimate([BOX, BOX], 0.5, 2.0, 1e6).n_cells == pytest.approx(128.0)
    assert estimate([BOX], 4.0, 1e-3, 1e6).n_cells == pytest.approx(0.5 * 12 / 4.0)
    same = estimate([BOX], lambda x: np.full(len(x), 0.5), 2.0, 1e6)
    assert (same.n_cells, same.smallest, same.at_least) == (pytest.approx(64.0, rel=1e-9), 0.5, False)
    graded = estimate([BOX], lambda x: 0.05 + 0.1 * x[:, 0], 1.0, 1e6)
    assert graded.n_cells == pytest.approx(2.0 / 0.1 * (1 / 0.05 - 1 / 0.45), rel=0.003)
    assert graded.smallest == pytest.approx(0.05, rel=0.1)
    assert estimate([BOX], lambda x: np.full(len(x), 1e-4), 1.0, 1e4).at_least
    with pytest.raises(InputError, match=r"cells of size 0\.001 on a domain of 4 x 2; use a larger size"):
        check_size([BOX], 1e-3, 1.0, 1e6)
    with pytest.raises(
        InputError, match=r"size 0\.001, near \(0.0\d+, 0.0\d+\), on a domain of 4 x 2; use larger sizes, or small"
    ):
        check_size([BOX], lambda x: np.full(len(x), 1e-3), 1.0, 1e4)


@pytest.mark.parametrize(
    ("low", "high", "origin"),
    [
        ((0, 0), (1, 1), None), ((1e4 - 1, 0), (1e4, 0.5), None), ((1e4, 0), (1e4 + 1, 1), (1e4, 0)),
        ((4.2e6, -5.5e6), (4.2e6 + 30, -5.5e6 + 10), (4.20002e6, -5.5e6)), ((2, 2), (2, 2), None),
        ((-3e4 - 2, 7), (-3e4, 8.4), (-30001.0, 8.0)), ((1e11, 0), (1e11 + 5, 1), None),
        ((0, 9e9), (1, 9e9 + 0.5), (0, 9e9)), ((np.nan, 0), (1, 1), None),
    ],
)  # fmt: skip
def test_places_near_domains_that_are_far(low: Any, high: Any, origin: Any) -> None:
    found = origin_for(np.array([low, high], dtype=float))
    assert found == (None if origin is None else pytest.approx(origin, abs=1e-9))
    assert origin_for(np.zeros((0, 2))) is None
    assert relative(4200000.45, 4200000.0) == 0.45
    assert relative(-0.3, 1000.0) == -1000.3


def test_domains_far_away_are_meshed_near_the_origin() -> None:
    seen: list[Any] = []

    def mesher(regions: Any, size: Any, points: Any = None, **more: Any) -> PolygonMesh:
        seen.append((regions, size, points, more))
        if more.get("fails"):
            raise InputError("bad")
        return PolygonMesh.from_cells(SQUARE, [[0, 1, 2, 3]], [0], ("r",), {"p": 2}, {"e": np.array([[1, 2]])})

    far = [(1e6, 2e6), (1e6 + 2, 2e6), (1e6 + 2, 2e6 + 2), (1e6, 2e6 + 2)]
    hole = [Arc((1e6 + 1, 2e6 + 1), 0.25, 0.0, 2 * np.pi)]
    mesh = meshed_near_origin(mesher)([Region("r", far, [hole])], lambda x: x[:, 0], {"p": far[2]}, key=3)
    regions, size, points, more = seen[0]
    assert regions[0].outline == [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    arc = regions[0].holes[0][0]
    assert (regions[0].name, arc.center, arc.radius, arc.first, arc.last) == ("r", (0, 0), 0.25, 0.0, 2 * np.pi)
    assert (points, more) == ({"p": (1, 1)}, {"key": 3})
    assert size(np.array([[0.5, 7.0]])).tolist() == [1e6 + 1.5]
    assert mesh.points_vx.tolist() == [[x + 1e6 + 1, y + 2e6 + 1] for x, y in SQUARE]
    assert (mesh.region_names, dict(mesh.named_points), edges(mesh)) == (("r",), {"p": 2}, {"e": [[1, 2]]})
    with pytest.raises(InputError) as refused:
        meshed_near_origin(mesher)([Region("r", far)], 0.5, fails=True)
    assert str(refused.value) == "bad (places are counted from (1000001, 2000001) on)"
    assert seen[1][1:3] == (0.5, {})
    meshed_near_origin(mesher)([BOX], 0.5, {"q": (0, 0)}, key=1)
    assert seen[2] == ([BOX], 0.5, {"q": (0, 0)}, {"key": 1})
    assert moved(mesh, (-1e6, 3)).points_vx[2].tolist() == [2.0, 2e6 + 5]
