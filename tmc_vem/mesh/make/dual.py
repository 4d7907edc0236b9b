"""The dual of a mesh: one polygon around every vertex, through the centroids of the cells that meet there.

Where the boundary or an interface of regions passes a vertex, the polygon ends there: it runs along the edges to their
midpoints and has the vertex itself as a corner, once in every region. So outlines, interfaces and regions stay as they
are, up to midpoints on their edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def dual_mesh(mesh: PolygonMesh) -> PolygonMesh:
    """One polygon around every vertex of a mesh of convex cells, in every region that meets there.

    Named points stay vertices, and named edges become their two halves.

    Raises:
        InputError: a named point or edge lies inside a region, where the dual has no such vertex or edge, or the dual
            of so distorted cells has a polygon that intersects itself.
    """
    edges = mesh.edges
    left, right = mesh.cells_of_edges
    kept = np.flatnonzero((left < 0) | (right < 0) | (mesh.region_c[left] != mesh.region_c[right]))
    node_of_edge = np.full(len(edges), -1)  # that of its midpoint
    node_of_edge[kept] = mesh.n_cells + np.arange(len(kept))
    corners = np.unique(edges.vertices_ev[kept])
    node_of_vertex = np.full(mesh.n_vertices, -1)
    node_of_vertex[corners] = mesh.n_cells + len(kept) + np.arange(len(corners))

    centres_cx = np.empty((mesh.n_cells, 2))
    for _, group, vertices in mesh.cells_by_size():
        centres_cx[group] = centroids(mesh.points_vx[vertices])
    midpoints_ex = mesh.points_vx[edges.vertices_ev[kept]].mean(axis=1)
    points = np.concatenate([centres_cx, midpoints_ex, mesh.points_vx[corners]])
    cells, regions = _around_vertices(mesh, node_of_edge, node_of_vertex)
    return PolygonMesh.from_cells(
        points,
        cells,
        regions,
        mesh.region_names,
        {name: _vertex(name, node_of_vertex[vertex]) for name, vertex in mesh.named_points.items()},
        {name: _halves(mesh, name, node_of_edge, node_of_vertex) for name in mesh.named_edges},
    )


def _around_vertices(mesh: PolygonMesh, node_of_edge: Int, node_of_vertex: Int) -> tuple[list[list[int]], list[int]]:
    """Polygons through centroids, and their regions.

    A corner is a cell at one of its vertices. From there the next one counter-clockwise around the vertex lies across
    the side that ends in it.
    """
    n_corners = len(mesh.cell_vertices)
    cell_of = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    out = mesh.edges.cell_edges  # the side that starts at each corner
    before = np.arange(n_corners) - 1
    before[mesh.cell_offsets[:-1]] = mesh.cell_offsets[1:] - 1
    into = out[before]  # the side that ends there
    forward = mesh.edges.forward
    corner_of = np.full((2, len(mesh.edges)), -1)  # that at which the side on the left, on the right starts
    corner_of[0, out[forward]] = np.flatnonzero(forward)
    corner_of[1, out[~forward]] = np.flatnonzero(~forward)
    across = corner_of[forward[before].astype(int), into]  # a side's other cell runs the other way
    following = np.where(node_of_edge[into] < 0, across, -1)

    begun = np.flatnonzero(node_of_edge[out] >= 0)
    done = np.zeros(n_corners, dtype=bool)
    cells: list[list[int]] = []
    regions: list[int] = []
    for start in [*begun.tolist(), *range(n_corners)]:
        if done[start]:
            continue
        fan, corner = [], start
        while corner >= 0 and not done[corner]:
            done[corner] = True
            fan.append(corner)
            corner = int(following[corner])
        polygon = cell_of[fan].tolist()
        if corner < 0:  # it ends at the outline of its region
            vertex = node_of_vertex[mesh.cell_vertices[start]]
            polygon = [int(vertex), int(node_of_edge[out[start]]), *polygon, int(node_of_edge[into[fan[-1]]])]
        cells.append(polygon)
        regions.append(int(mesh.region_c[cell_of[start]]))
    return cells, regions


def _vertex(name: str, node: int) -> int:
    """The node that a named vertex is.

    Raises:
        InputError: there is none.
    """
    if node < 0:
        raise InputError(f"point '{name}' lies inside a region, where the dual has no vertex: name one on an outline")
    return int(node)


def _halves(mesh: PolygonMesh, name: str, node_of_edge: Int, node_of_vertex: Int) -> Int:
    """Both halves of every edge of a set.

    Raises:
        InputError: an edge lies inside a region.
    """
    pairs = np.sort(mesh.named_edges[name], axis=1)
    keys = mesh.edges.vertices_ev @ [mesh.n_vertices, 1]
    middle = node_of_edge[np.searchsorted(keys, pairs @ [mesh.n_vertices, 1])]
    if (middle < 0).any():
        a, b = pairs[int(np.argmin(middle))]
        raise InputError(f"edges '{name}': that of vertices {a} and {b} lies inside a region, where the dual has none")
    ends = node_of_vertex[pairs]
    return np.concatenate([np.stack([ends[:, 0], middle], axis=1), np.stack([middle, ends[:, 1]], axis=1)])
