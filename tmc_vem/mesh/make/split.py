"""Quadrilaterals cut into triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def split_quadrilaterals(mesh: PolygonMesh) -> tuple[PolygonMesh, Int]:
    """Cut every quadrilateral along its shorter diagonal; triangles stay.

    Where both diagonals are equally long, neighbouring cells are cut in opposite directions, so that a symmetric grid
    with an even number of cells stays symmetric.

    Returns:
        The triangles, and for each the cell that it came from.

    Raises:
        InputError: a cell has more than four vertices.
    """
    many = np.flatnonzero(mesh.n_sides_c > 4)
    if len(many):
        raise InputError(f"cell {many[0]} has {mesh.n_sides_c[many[0]]} vertices: quadrilaterals can be cut in two")
    quads = np.flatnonzero(mesh.n_sides_c == 4)
    whole = np.flatnonzero(mesh.n_sides_c == 3)
    corners = mesh.cell_vertices[mesh.cell_offsets[quads][:, None] + np.arange(4)]
    points = mesh.points_vx[corners]
    first = np.hypot(*(points[:, 2] - points[:, 0]).T)
    second = np.hypot(*(points[:, 3] - points[:, 1]).T)
    equal = np.abs(first - second) <= 1e-9 * (first + second)
    turned = np.where(equal, _colours(mesh)[quads] == 1, second < first)
    corners[turned] = np.roll(corners[turned], -1, axis=1)  # now all are cut from their first to their third vertex
    triangles = np.concatenate(
        [
            mesh.cell_vertices[mesh.cell_offsets[whole][:, None] + np.arange(3)],
            corners[:, [0, 1, 2]],
            corners[:, [0, 2, 3]],
        ]
    )
    parents = np.concatenate([whole, quads, quads])
    order = np.argsort(parents, kind="stable")
    parents = parents[order]
    result = PolygonMesh(
        mesh.points_vx, np.arange(len(parents) + 1) * 3, triangles[order].ravel(), mesh.region_c[parents],
        mesh.region_names, mesh.named_points, mesh.named_edges,
        {name: values[parents] for name, values in mesh.cell_data.items()}, validate=False,
    )  # fmt: skip
    return result, parents


def _colours(mesh: PolygonMesh) -> Int:
    """0 or 1 for every cell, different for neighbours on a grid of quadrilaterals."""
    edges = mesh.edges
    cell_of_side = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    order = np.argsort(edges.cell_edges, kind="stable")
    sorted_edges = edges.cell_edges[order]
    pairs = np.flatnonzero(sorted_edges[1:] == sorted_edges[:-1])
    a, b = cell_of_side[order[pairs]], cell_of_side[order[pairs + 1]]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(mesh.n_cells, mesh.n_cells)).tocsr()
    colours = np.full(mesh.n_cells, -1, dtype=np.int64)
    while (colours < 0).any():  # once for every connected part
        visited, before = breadth_first_order(graph, int(np.argmin(colours)), directed=False)
        colours[visited[0]] = 0
        for cell in visited[1:].tolist():
            colours[cell] = 1 - colours[before[cell]]
    return colours
