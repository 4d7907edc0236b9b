"""Polygons and small meshes that the tests share: a zoo of shapes, Voronoi cells, hanging nodes, non-convex cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Voronoi

from tmc_vem.mesh import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def subdivide(corners: Sequence[tuple[float, float]], parts: Sequence[int]) -> Float:
    """Polygon whose side s is divided into ``parts[s]`` equal pieces."""
    points = []
    for s, n in enumerate(parts):
        a, b = np.array(corners[s]), np.array(corners[(s + 1) % len(corners)])
        points += [a + (b - a) * i / n for i in range(n)]
    return np.array(points)


_SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
_TRIANGLE = [(0.0, 0.0), (1.1, 0.1), (0.3, 0.9)]


def regular(n_sides: int, turn: float = 0.2) -> Float:
    """Regular polygon about the origin."""
    angles = turn + 2.0 * np.pi * np.arange(n_sides) / n_sides
    return np.column_stack([np.cos(angles), np.sin(angles)])


SHAPES: dict[str, Float] = {
    "triangle": np.array(_TRIANGLE),
    "square": np.array(_SQUARE),
    "quadrilateral": np.array([(0.0, 0.0), (1.0, 0.2), (1.3, 1.0), (-0.1, 0.8)]),
    "pentagon": np.array([(0.0, 0.0), (1.0, -0.1), (1.3, 0.7), (0.6, 1.2), (-0.2, 0.8)]),
    "regular pentagon": regular(5),
    "hexagon": np.array([(0.0, 0.0), (0.8, -0.2), (1.3, 0.3), (1.2, 0.9), (0.5, 1.2), (-0.2, 0.6)]),
    "L": np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]),
    "U": np.array([(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float),
    "arrow": np.array([(0.0, 0.0), (1.0, 0.6), (2.0, 0.0), (1.0, 2.0)]),
    "square, one hanging node": subdivide(_SQUARE, [2, 1, 1, 1]),
    "square, off-centre hanging node": np.array([(0, 0), (0.3, 0), (1, 0), (1, 1), (0, 1)], dtype=float),
    "square, hanging node on every edge": subdivide(_SQUARE, [2, 2, 2, 2]),
    "triangle, halved sides": subdivide(_TRIANGLE, [2, 2, 2]),
    "square, three hanging nodes on one edge": subdivide(_SQUARE, [4, 1, 1, 1]),
}
# Full rank needs so high a degree that only the rank tests use it.
SQUARE_IN_THREE = subdivide(_SQUARE, [3, 3, 3, 3])


def mesh_of(polygon: Float) -> PolygonMesh:
    """Mesh of one cell."""
    return PolygonMesh.from_cells(polygon, [list(range(len(polygon)))])


def with_boundary(points: Float, cells: Sequence[Sequence[int]], **more: object) -> PolygonMesh:
    """Mesh with all edges on its boundary named ``boundary``."""
    bare = PolygonMesh.from_cells(points, cells)
    edges = bare.edges
    outer = edges.vertices_ev[edges.n_cells_e == 1]
    return PolygonMesh.from_cells(points, cells, named_edges={"boundary": outer}, **more)  # type: ignore[arg-type]


def voronoi(n_cells: int, seed: int = 1, smoothing: int = 6) -> PolygonMesh:
    """Voronoi cells of smoothed random points in the unit square, without very short edges."""
    rng = np.random.default_rng(seed)
    sites = rng.random((n_cells, 2))
    for _ in range(smoothing):
        sites = np.array([_centroid(points) for points in _bounded_cells(sites)])
    polygons = _bounded_cells(sites)
    tolerance = 0.1 / np.sqrt(n_cells)
    points, cells = _merge(polygons, tolerance)
    return with_boundary(points, cells)


def _bounded_cells(sites: Float) -> list[Float]:
    """Voronoi cells within the unit square: mirror images of the sites bound them exactly."""
    images = [sites]
    for axis in (0, 1):
        for wall in (0.0, 1.0):
            image = sites.copy()
            image[:, axis] = 2.0 * wall - image[:, axis]
            images.append(image)
    diagram = Voronoi(np.vstack(images))
    cells = []
    for site in range(len(sites)):
        points = diagram.vertices[diagram.regions[diagram.point_region[site]]]
        angle = np.arctan2(*(points - sites[site]).T[::-1])
        cells.append(np.clip(points[np.argsort(angle)], 0.0, 1.0))
    return cells


def _centroid(polygon: Float) -> Float:
    x, y = polygon.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    moment = (polygon + np.roll(polygon, -1, axis=0)) * cross[:, None]
    centroid: Float = moment.sum(axis=0) / (3.0 * cross.sum())
    return centroid


def _merge(polygons: Sequence[Float], tolerance: float) -> tuple[Float, list[list[int]]]:
    """Shared vertices, with those closer than the tolerance merged; vertices on the unit square stay on it."""
    stacked = np.vstack(polygons)
    on_wall = (np.abs(stacked) < 1e-9).astype(int) + (np.abs(stacked - 1.0) < 1e-9)
    rank = on_wall.sum(axis=1)  # 2: corner, 1: side, 0: inside; the higher one absorbs the other
    order = np.argsort(-rank, kind="stable")
    points: list[Float] = []
    label = np.empty(len(stacked), dtype=int)
    for i in order.tolist():
        distance = np.hypot(*(np.array(points) - stacked[i]).T) if points else np.empty(0)
        if len(distance) and distance.min() < tolerance:
            label[i] = int(distance.argmin())
        else:
            label[i] = len(points)
            points.append(stacked[i])
    cells, first = [], 0
    for polygon in polygons:
        loop = label[first : first + len(polygon)].tolist()
        first += len(polygon)
        cells.append([v for n, v in enumerate(loop) if v != loop[n - 1]])
    return np.array(points), cells


def hanging(n: int, distort: float = 0.0) -> PolygonMesh:
    """n x n squares of the unit square of which every second one (like a chess board's) is cut into four.

    Uncut squares get a hanging node on every side within the domain. ``distort`` moves all points by a smooth map that
    keeps the boundary, so that cells are no longer congruent and hanging nodes no longer in the middle of a straight
    side.
    """
    fine = 2 * n + 1
    used: dict[int, int] = {}
    cells = []

    def vertex(i: int, j: int) -> int:
        return used.setdefault(j * fine + i, len(used))

    cut = {(i, j) for i in range(n) for j in range(n) if (i + j) % 2 == 0}
    for i in range(n):
        for j in range(n):
            x, y = 2 * i, 2 * j
            if (i, j) in cut:
                for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    a, b = x + dx, y + dy
                    cells.append([vertex(a, b), vertex(a + 1, b), vertex(a + 1, b + 1), vertex(a, b + 1)])
                continue
            loop = [(x, y)]
            loop += [(x + 1, y)] if (i, j - 1) in cut else []
            loop += [(x + 2, y)]
            loop += [(x + 2, y + 1)] if (i + 1, j) in cut else []
            loop += [(x + 2, y + 2)]
            loop += [(x + 1, y + 2)] if (i, j + 1) in cut else []
            loop += [(x, y + 2)]
            loop += [(x, y + 1)] if (i - 1, j) in cut else []
            cells.append([vertex(*p) for p in loop])
    keys = np.array(list(used))
    points = np.column_stack([keys % fine, keys // fine]) / (2.0 * n)
    bump = distort * np.sin(np.pi * points[:, 0]) * np.sin(np.pi * points[:, 1])
    return with_boundary(points + bump[:, None] * np.array([1.0, -0.7]), cells)


def non_convex() -> PolygonMesh:
    """Two U-shaped cells and the two squares that fill them, on [0, 3] x [0, 4]."""
    lower = [(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)]
    upper = [(x, 4 - y) for x, y in reversed(lower)]
    plugs = [[(1, 1), (2, 1), (2, 2), (1, 2)], [(1, 2), (2, 2), (2, 3), (1, 3)]]
    number: dict[tuple[int, int], int] = {}
    cells = [[number.setdefault(p, len(number)) for p in loop] for loop in (lower, upper, *plugs)]
    return with_boundary(np.array(list(number), dtype=float), cells)


def grid(n: int, m: int, width: float = 1.0, height: float = 1.0) -> PolygonMesh:
    """n x m rectangles."""
    x, y = np.meshgrid(np.linspace(0.0, width, n + 1), np.linspace(0.0, height, m + 1))
    points = np.column_stack([x.ravel(), y.ravel()])
    first = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel()
    return with_boundary(points, (first[:, None] + np.array([0, 1, n + 2, n + 1])).tolist())
