"""The problem's mesh arrives in dolfinx with its cells, regions and names."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_fem import SOLID, grid, layered, make_system, problem_system

from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.remesh import gmsh_triangles
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.problems import Box
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.fem_settings import FemSettings


def region_areas(mesh: PolygonMesh) -> list[float]:
    """Area of each region."""
    per_cell = np.array([areas(mesh.points_vx[cell][None])[0] for cell in mesh.cells()])
    assert (per_cell > 0.0).all()
    return [float(per_cell[mesh.region_c == number].sum()) for number in range(len(mesh.region_names))]


@pytest.mark.parametrize("triangles", [False, True])
def test_cells_regions_and_names_survive(triangles: bool) -> None:
    problem = Box(cells=(20, 5))
    mesh = problem.make_mesh()
    system = problem_system(problem, triangles=triangles)
    assert system.n_cells_global == mesh.n_cells * (2 if triangles else 1)
    assert system.cell_areas().sum() == pytest.approx(1.0)
    polygons = system.output_polygons()
    for c in range(polygons.n_cells):
        origin = int(system.mesh.cell_ids[c])
        centre = polygons.points_nx[polygons.cell(c)].mean(axis=0)
        low, high = mesh.points_vx[mesh.cell(origin)].min(axis=0), mesh.points_vx[mesh.cell(origin)].max(axis=0)
        assert ((low < centre) & (centre < high)).all()
        assert polygons.region_c[c] == mesh.region_c[origin]
    for name, vertex in mesh.named_points.items():
        assert system.nodes.points_nx[system.nodes.named(name)] == pytest.approx(mesh.points_vx[[vertex]])
        assert system.point_coordinates([name]) == pytest.approx(mesh.points_vx[[vertex]])


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("triangles", [False, True])
def test_named_edges_hold_all_their_nodes(order: int, triangles: bool) -> None:
    system = make_system(grid(3, 2), SOLID, [Prescribed("boundary", 0, 1.0)], order=order, triangles=triangles)
    x = system.nodes.points_nx[system.nodes.named("boundary")]
    on_border = (np.isclose(x, 0.0) | np.isclose(x, 1.0)).any(axis=1)
    assert on_border.all()
    assert len(x) == 2 * (3 + 2) * order
    assert (system.constrained() % 2 == 0).all()
    assert system.prescribed(Control(0.5)) == pytest.approx(np.full(len(x), 0.5))


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("triangles", [False, True])
def test_output_polygons_run_around_the_cells(order: int, triangles: bool) -> None:
    system = make_system(grid(3, 3, distort=0.2), SOLID, order=order, triangles=triangles)
    polygons = system.output_polygons()
    assert (np.diff(polygons.offsets) == order * (3 if triangles else 4)).all()
    corners = np.stack([polygons.points_nx[polygons.cell(c)] for c in range(polygons.n_cells)])
    assert areas(corners) == pytest.approx(system.cell_areas())
    segments = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).reshape(len(corners), -1, order)
    ends = corners[:, ::order]
    sides = np.linalg.norm(np.roll(ends, -1, axis=1) - ends, axis=2)
    assert segments.sum(axis=2) == pytest.approx(sides)  # no way back and forth
    u = system.interpolate(lambda x: x**2)
    assert system.output_displacements(u) == pytest.approx(polygons.points_nx**2)


def test_split_keeps_area_symmetry_and_origin() -> None:
    mesh = layered(4, 4, distort=0.0)
    triangles, parents = split_quadrilaterals(mesh)
    assert (triangles.n_sides_c == 3).all()
    assert region_areas(triangles) == pytest.approx(region_areas(mesh))
    assert (triangles.region_c == mesh.region_c[parents]).all()
    centres = triangles.points_vx[triangles.cell_vertices.reshape(-1, 3)].mean(axis=1)
    mirrored = np.column_stack([1.0 - centres[:, 0], centres[:, 1]])
    assert {tuple(p) for p in centres.round(9)} == {tuple(p) for p in mirrored.round(9)}


def test_split_takes_the_shorter_diagonal() -> None:
    mesh = PolygonMesh.from_cells([(0, 0), (2, 0), (2.5, 1), (0.5, 1)], [[0, 1, 2, 3]])
    triangles, _ = split_quadrilaterals(mesh)
    assert (1, 3) in {tuple(pair) for pair in triangles.edges.vertices_ev.tolist()}


def test_unstructured_triangles_conform_to_regions_and_names() -> None:
    problem = Box(cells=(20, 5))
    mesh = gmsh_triangles(problem.make_mesh(), 0.05)
    again = PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, mesh.named_points
    )  # validated
    assert region_areas(again) == pytest.approx(region_areas(problem.make_mesh()))
    assert mesh.n_cells > 400
    for name, vertex in problem.make_mesh().named_points.items():
        expected = problem.make_mesh().points_vx[vertex]
        assert mesh.points_vx[mesh.named_points[name]] == pytest.approx(expected)


def test_unstructured_triangles_keep_named_edges_holes_and_inner_points() -> None:
    mesh = grid(6, 6)
    ring = np.array([c for c in range(36) if not (2 <= c % 6 <= 3 and 2 <= c // 6 <= 3)])
    cells = [mesh.cell(c).tolist() for c in ring]
    used, compact = np.unique(np.concatenate(cells), return_inverse=True)
    number = {int(v): n for n, v in enumerate(used)}
    holed = PolygonMesh.from_cells(
        mesh.points_vx[used], compact.reshape(-1, 4).tolist(),
        named_points={"inside": number[8]},
        named_edges={"bottom": np.array([[number[v], number[v + 1]] for v in range(6)])},
    )  # fmt: skip
    triangles = gmsh_triangles(holed, 0.1)
    assert region_areas(triangles) == pytest.approx([32.0 / 36.0])
    assert triangles.points_vx[triangles.named_points["inside"]] == pytest.approx([1 / 6, 1 / 6])
    bottom = triangles.named_edges["bottom"]
    lengths = np.linalg.norm(np.diff(triangles.points_vx[bottom], axis=1)[:, 0], axis=1)
    assert (triangles.points_vx[bottom][..., 1] == 0.0).all()
    assert lengths.sum() == pytest.approx(1.0)
    assert len(bottom) > 8


def test_regions_that_touch_in_a_point() -> None:
    points = [(x, y) for y in range(3) for x in range(3)]
    quads = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    board = PolygonMesh.from_cells(points, quads, [0, 1, 1, 0], ["a", "b"])
    assert region_areas(gmsh_triangles(board, 0.4)) == pytest.approx([2.0, 2.0])


def test_cells_that_finite_elements_cannot_use() -> None:
    pentagon = PolygonMesh.from_cells([(0, 0), (1, 0), (1, 1), (0.5, 1.2), (0, 1)], [[0, 1, 2, 3, 4]])
    with pytest.raises(InputError, match="cell 0 has 5 vertices: finite elements need"):
        make_system(pentagon, SOLID)
    with pytest.raises(InputError, match="cell 0 has 5 vertices: quadrilaterals can be cut"):
        make_system(pentagon, SOLID, triangles=True)
    mixed = PolygonMesh.from_cells([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0.5)], [[0, 1, 2, 3], [1, 4, 2]])
    with pytest.raises(InputError, match="cell 1 has 3 vertices"):
        make_system(mixed, SOLID)
    arrow = PolygonMesh.from_cells([(0, 0), (1, 0.6), (2, 0), (1, 2)], [[0, 1, 2, 3]])
    with pytest.raises(InputError, match="cell 0 is not convex"):
        make_system(arrow, SOLID)
    corners = [(-2.0, 0.0), (-1.0, 2.0), (-1.0, -1.0), (0.0, 0.0), (1.0, 0.6), (2.0, 0.0), (1.0, 2.0)]
    second = PolygonMesh.from_cells(corners, [[0, 2, 3, 1], [3, 4, 5, 6]])
    with pytest.raises(InputError, match="cell 1 is not convex"):
        make_system(second, SOLID)


def test_names_and_settings_that_do_not_exist() -> None:
    with pytest.raises(InputError, match="neither a point nor edges named 'nowhere'"):
        make_system(grid(2, 2), SOLID, [Prescribed("nowhere", 0)])
    with pytest.raises(InputError, match="region 'all' has no energy"):
        make_system(grid(2, 2), {"other": SOLID})
    with pytest.raises(InputError, match="order 1: use 2 or 3"):
        FemSettings(order=1)
    with pytest.raises(InputError, match="choose one of none, penalty, full"):
        FemSettings(interior_penalty="some")
    with pytest.raises(InputError, match="eta = -1"):
        FemSettings(eta=-1.0)
    with pytest.raises(InputError, match="quadrature degree 1"):
        FemSettings(quadrature=1)
    with pytest.raises(InputError, match="must be a positive number"):
        gmsh_triangles(grid(2, 2), 0.0)
