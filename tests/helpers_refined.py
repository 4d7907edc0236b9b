"""Meshes to refine and coarsen, and what has to be true of every mesh that comes of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.make.change import MeshChange
from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.parts import with_names

Float = NDArray[np.float64]
Int = NDArray[np.int64]

CENTER, RADIUS = (0.5, 0.5), 0.3
CIRCLE = [Arc(CENTER, RADIUS, 0, 180), Arc(CENTER, RADIUS, 180, 360)]
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def disc(size: float = 0.12, seed: int = 0) -> PolygonMesh:
    """Voronoi cells of a disc in a square, with a named point on the circle, a named side and cell data."""
    mesh = voronoi_mesh(
        [Region("around", SQUARE, [CIRCLE]), Region("disc", CIRCLE)], size, {"right": (0.8, 0.5)}, seed=seed
    )  # fmt: skip
    return _dressed(with_names(mesh, lines={"low": ((0.0, 0.0), (1.0, 0.0))}))


def squares(n: int = 4) -> PolygonMesh:
    """Squares of two regions, with names and cell data."""
    lines = np.linspace(0.0, 1.0, n + 1)
    regions = [Rectangle("a", 0, 1, 0, 1), Rectangle("b", 0, 0.5, 0, 0.5)]
    mesh = structured_quadrilaterals(lines, lines, regions, {"corner": (0, 0), "middle": (0.5, 0.5)})
    named = with_names(mesh, lines={"low": ((0.0, 0.0), (1.0, 0.0)), "between": ((0.0, 0.5), (0.5, 0.5))})
    return _dressed(named)


def triangles(n: int = 3) -> PolygonMesh:
    """Triangles of two regions, with names and cell data."""
    return split_quadrilaterals(squares(n + n % 2))[0]


def letters() -> PolygonMesh:
    """A U filled by a square, and an L beside them: cells that are not star-shaped among others."""
    points = [(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2), (4, 0), (4, 3), (0, 3)]
    cells = [[0, 1, 2, 3, 4, 5, 6, 7], [4, 3, 6, 5], [1, 8, 9, 10, 7, 6, 3, 2]]
    mesh = PolygonMesh.from_cells(points, cells, [0, 1, 0], ("a", "b"), {"inner": 4}, {"gap": np.array([(4, 3)])})
    return _dressed(mesh)


MESHES = {"squares": squares, "triangles": triangles, "voronoi": disc, "letters": letters}


def _dressed(mesh: PolygonMesh) -> PolygonMesh:
    return replace(mesh, cell_data={"modulus": 1.0 + np.arange(mesh.n_cells) ** 1.5})


def polygons(mesh: PolygonMesh) -> Iterator[Float]:
    return (mesh.points_vx[loop] for loop in mesh.cells())


def area_of(mesh: PolygonMesh, region: str | None = None) -> float:
    return sum(
        float(areas(polygon[None])[0])
        for polygon, r in zip(polygons(mesh), mesh.region_c, strict=True)
        if region is None or mesh.region_names[r] == region
    )


def interface_vertices(mesh: PolygonMesh) -> Int:
    """Vertices of all edges between two regions."""
    left, right = mesh.cells_of_edges
    between = (left >= 0) & (right >= 0) & (mesh.region_c[left] != mesh.region_c[right])
    return np.unique(mesh.edges.vertices_ev[between])


def most_hanging(mesh: PolygonMesh, flat: float, soft_v: NDArray[np.bool_]) -> int:
    """Largest number of hanging nodes on a side, counted vertex by vertex.

    A vertex hangs if the cell's boundary is straight there, or if it is a soft one and turns by less than ``flat``.
    """
    worst = 0
    for loop in mesh.cells():
        p = mesh.points_vx[loop]
        before, after = p - np.roll(p, 1, axis=0), np.roll(p, -1, axis=0) - p
        turn = np.degrees(np.abs(np.angle((after @ [1, 1j]) / (before @ [1, 1j]))))
        hangs = (turn < 1e-4) | (soft_v[loop] & (turn < flat))
        if (~hangs).sum() < 3:
            hangs = turn < 1e-4
        run = 0
        for h in [*hangs.tolist(), *hangs.tolist()]:
            run = run + 1 if h else 0
            worst = max(worst, run)
    return worst


def assert_lies_within(change: MeshChange, mesh: PolygonMesh) -> None:
    """Every new cell, with its vertices where they were, lies in its parent; regions and data are the parent's."""
    import shapely

    new = change.mesh
    assert not find_faults(new)
    assert change.before_vx.shape == new.points_vx.shape
    assert len(change.parent_c) == new.n_cells
    parents = [shapely.Polygon(polygon) for polygon in polygons(mesh)]
    for c, (loop, parent) in enumerate(zip(new.cells(), change.parent_c.tolist(), strict=True)):
        center = centroids(change.before_vx[loop][None])[0]
        assert parents[parent].contains(shapely.Point(center)), (c, parent)
        assert new.region_names[new.region_c[c]] == mesh.region_names[mesh.region_c[parent]]
        for name, values in mesh.cell_data.items():
            assert new.cell_data[name][c] == values[parent]
    assert {name: new.points_vx[v].tolist() for name, v in new.named_points.items()} == {
        name: mesh.points_vx[v].tolist() for name, v in mesh.named_points.items()
    }
