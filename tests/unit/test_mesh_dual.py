"""The dual of a mesh tiles what the mesh covers, region by region, and keeps outlines and names."""

from __future__ import annotations

import numpy as np
import pytest

from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.dual import dual_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError


def triangles(n: int = 6, shift: float = 0.25) -> PolygonMesh:
    """A unit square in triangles, moved about inside; the upper half is another region."""
    x, y = np.meshgrid(np.arange(n + 1) / n, np.arange(n + 1) / n, indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    inner = ((points > 0) & (points < 1)).all(axis=1) & (abs(points[:, 1] - 0.5) > 1e-9)
    points[inner] += shift / n * np.random.default_rng(3).uniform(-1.0, 1.0, (inner.sum(), 2))
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    cells = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    upper = points[cells].mean(axis=1)[:, 1] > 0.5
    names = {"bottom": np.stack([number[:-1, 0], number[1:, 0]], axis=1), "middle": number[[[0, 1]], n // 2]}
    named = {"corner": int(number[0, 0]), "side": int(number[n, n // 2])}
    return PolygonMesh.from_cells(points, cells.tolist(), upper.astype(int), ("lower", "upper"), named, names)


def region_areas(mesh: PolygonMesh) -> np.ndarray:
    total = np.zeros(len(mesh.region_names))
    for _, cells, vertices in mesh.cells_by_size():
        np.add.at(total, mesh.region_c[cells], areas(mesh.points_vx[vertices]))
    return total


@pytest.mark.parametrize("n", [2, 6, 8])
def test_it_tiles_every_region(n: int) -> None:
    mesh = triangles(n)
    dual = dual_mesh(mesh)
    assert region_areas(dual) == pytest.approx(region_areas(mesh), rel=1e-13)
    # a polygon around each vertex, and a second one where two regions meet
    assert dual.n_cells == mesh.n_vertices + n + 1
    boundary = dual.edges.vertices_ev[dual.edges.n_cells_e == 1]
    lengths = np.linalg.norm(np.diff(dual.points_vx[boundary], axis=1)[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(4.0)
    assert lengths == pytest.approx(np.full(len(lengths), 0.5 / n))


def test_names_stay_where_they_are() -> None:
    mesh = triangles()
    dual = dual_mesh(mesh)
    for name, vertex in mesh.named_points.items():
        assert dual.points_vx[dual.named_points[name]] == pytest.approx(mesh.points_vx[vertex])
    assert len(dual.named_edges["bottom"]) == 2 * len(mesh.named_edges["bottom"])
    for name, pairs in dual.named_edges.items():
        length = np.linalg.norm(np.diff(dual.points_vx[pairs], axis=1), axis=2).sum()
        wanted = np.linalg.norm(np.diff(mesh.points_vx[mesh.named_edges[name]], axis=1), axis=2).sum()
        assert length == pytest.approx(wanted)


def test_quadrilaterals_and_mixed_cells_have_one_too() -> None:
    points = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 2], [1, 2], [2, 2]]
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8], [4, 8, 7]]
    dual = dual_mesh(PolygonMesh.from_cells(points, cells))
    assert region_areas(dual) == pytest.approx([4.0])
    assert dual.n_cells == 9
    assert sorted(dual.n_sides_c.tolist())[-1] == 5  # the five cells around the middle


def test_two_bodies_that_touch_in_a_vertex_get_a_polygon_each() -> None:
    points = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]]
    dual = dual_mesh(PolygonMesh.from_cells(points, [[0, 1, 2, 3], [2, 4, 5, 6]]))
    assert dual.n_cells == 8
    assert region_areas(dual) == pytest.approx([2.0])


def test_names_inside_of_a_region_are_refused() -> None:
    mesh = triangles()
    inside = int(np.argmin(np.linalg.norm(mesh.points_vx - (0.3, 0.3), axis=1)))
    parts = (mesh.points_vx, list(mesh.cells()), mesh.region_c, mesh.region_names)
    with pytest.raises(InputError, match="point 'core' lies inside a region"):
        dual_mesh(PolygonMesh.from_cells(*parts, {"core": inside}))
    edge = mesh.edges.vertices_ev[(mesh.edges.vertices_ev == inside).any(axis=1)][:1]
    with pytest.raises(InputError, match=r"edges 'cut': that of vertices \d+ and \d+ lies inside a region"):
        dual_mesh(PolygonMesh.from_cells(*parts, None, {"cut": edge}))
