"""Cells cut into triangles for filters of VTK, with the solution evaluated at all nodes of the triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Vec
from tmc_vem.support.vtk_types import POLYGON, cell_types
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fields import Polygons
from tmc_vem.vem.spaces.quadrature import sub_triangles
from tmc_vem.vem.spaces.triangulation import equal_topologies

Float = NDArray[np.float64]
Int = NDArray[np.int64]


class SubTriangles:
    """The cells of a discretisation, those that are no plain triangles or quadrilaterals cut into quadratic triangles.

    On the sides of cells the solution is taken as it is, inside virtual elements its projection on polynomials.

    Args:
        system: the discretisation.
        polygons: its cells, as it gives them.
        order: nodes on a side, the first vertex included.

    Attributes:
        polygons: the cut cells; six points in each triangle.
        cell_t: (n,) cell of ``polygons`` given that each of them is a part of.
    """

    def __init__(self, system: Discretisation, polygons: Polygons, order: int) -> None:
        self._system = system
        types = cell_types(polygons.points_nx, polygons.offsets, polygons.connectivity)
        sizes = np.diff(polygons.offsets)
        loops: list[Int] = []
        cells: list[Int] = []
        new: list[Float] = []
        n_points = len(polygons.points_nx)
        for plain in np.flatnonzero(types != POLYGON).tolist():
            loops.append(polygons.cell(plain))
            cells.append(np.array([plain]))
        for size in np.unique(sizes[types == POLYGON]).tolist():
            group = np.flatnonzero((types == POLYGON) & (sizes == size))
            rings = polygons.connectivity[polygons.offsets[group][:, None] + np.arange(size)]
            corners = polygons.points_nx[rings[:, ::order]]
            for chosen, triangles in sub_triangles(corners):
                for same, corners_tp in equal_topologies(corners[chosen], triangles):
                    part = chosen[same]
                    points, nodes = _cut(corners[part], rings[part], triangles[same], corners_tp, order, n_points)
                    n_points += len(points)
                    new.append(points)
                    loops += list(nodes)
                    cells.append(np.repeat(group[part], len(corners_tp)))
        self._inner = np.concatenate([np.zeros((0, 2)), *new])
        self._weights = system.locate(self._inner).weights if len(self._inner) else None
        self.cell_t: Int = np.concatenate([np.empty(0, dtype=np.int64), *cells])
        # nodes on sides that are not in their middle are left out: filters would find them in no cell
        nodes = np.concatenate([np.empty(0, dtype=np.int64), *loops])
        self._used, connectivity = np.unique(nodes, return_inverse=True)
        self.polygons = Polygons(
            points_nx=np.concatenate([polygons.points_nx, self._inner])[self._used],
            offsets=np.concatenate([[0], np.cumsum([len(loop) for loop in loops], dtype=np.int64)]),
            connectivity=connectivity,
            region_c=polygons.region_c[self.cell_t],
            region_names=polygons.region_names,
            media=polygons.media,
        )

    def displacements(self, u: Vec) -> Float:
        """Displacements (n_points, 2) of the points of the cut cells."""
        outer = self._system.output_displacements(u)
        inner = self._inner if self._weights is None else self._weights @ self._system.nodal_values(u)
        together: Float = np.concatenate([outer, inner])[self._used]
        return together


def _cut(
    corners_cvx: Float, rings: Int, triangles_ctpx: Float, corners_tp: Int, order: int, first: int
) -> tuple[Float, Int]:
    """New points (n, 2), numbered from ``first`` on, and the nodes (n_cells * n_triangles, 6) around every triangle.

    Args:
        corners_cvx: vertices of the cells.
        rings: (n_cells, n_sides * order) nodes around them.
        triangles_ctpx: their sub-triangles.
        corners_tp: the vertices at the corners of these, the same in all cells; numbers from n_sides on stand for hubs.
        order: nodes on a side, the first vertex included.
    """
    n_cells, n_sides = corners_cvx.shape[:2]
    nodes: dict[tuple[int, ...], Int] = {(v,): rings[:, v * order] for v in range(n_sides)}
    places = {v: corners_cvx[:, v] for v in range(n_sides)}
    if order == 2:
        nodes |= {tuple(sorted((s, (s + 1) % n_sides))): rings[:, 2 * s + 1] for s in range(n_sides)}
    new: list[Float] = []

    def node(key: tuple[int, ...], at: Float) -> Int:
        if key not in nodes:
            nodes[key] = first + len(new) * n_cells + np.arange(n_cells)
            new.append(at)
        return nodes[key]

    around = []
    for t, corners in enumerate(corners_tp.tolist()):
        for p, corner in enumerate(corners):
            places.setdefault(corner, triangles_ctpx[:, t, p])
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            around.append(node((a,), places[a]))
            around.append(node(tuple(sorted((a, b))), 0.5 * (places[a] + places[b])))
    points = np.concatenate(new) if new else np.zeros((0, 2))
    return points, np.stack(around, axis=1).reshape(-1, 6)
