"""Cells as polygons through the nodes on their boundary, and where nodes are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.system.fields import Polygons
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.spaces.quadrature import gauss_lobatto

Float = NDArray[np.float64]


def polygons_through_nodes(distributed: DistributedMesh, order: int) -> Polygons:
    """A rank's cells as polygons through vertices and the k - 1 Gauss-Lobatto points inside each side.

    Points are the vertices of the mesh, then those of its edges, edge after edge in the edges' own direction.

    Args:
        distributed: the mesh.
        order: k.
    """
    mesh, edges = distributed.mesh, distributed.edges
    interior = gauss_lobatto(order + 1)[0][1:-1]
    start, end = (mesh.points_vx[edges.vertices_ev[:, n]] for n in (0, 1))
    along = start[:, None] + (end - start)[:, None] * interior[:, None]
    on_edges = mesh.n_vertices + np.arange(len(edges))[:, None] * (order - 1) + np.arange(order - 1)
    side_points = on_edges[edges.cell_edges]
    side_points = np.where(edges.forward[:, None], side_points, side_points[:, ::-1])
    return Polygons(
        points_nx=np.concatenate([mesh.points_vx, along.reshape(-1, 2)]),
        offsets=mesh.cell_offsets * order,
        connectivity=np.column_stack([mesh.cell_vertices, side_points]).ravel(),
        region_c=mesh.region_c,
        region_names=mesh.region_names,
    )


def node_points(distributed: DistributedMesh, dofmap: DofMap) -> Float:
    """(n_nodes, 2) places of a rank's nodes on sides; 0 for moments of cells."""
    points_nx = np.zeros((dofmap.n_nodes, 2))
    on_sides = np.concatenate([dofmap.vertex_nodes, dofmap.edge_nodes.ravel()])
    points_nx[on_sides] = polygons_through_nodes(distributed, dofmap.order).points_nx
    return points_nx


def node_labels(distributed: DistributedMesh, dofmap: DofMap) -> Float:
    """Labels (n_owned_nodes, 3) of a rank's part of a vector that do not depend on the distribution.

    Coordinates and 0 for nodes on sides; a cell's centroid and 1, 2, ... for its moments.
    """
    labels = np.column_stack([node_points(distributed, dofmap), np.zeros(dofmap.n_nodes)])
    for _, cells, vertices_cv in distributed.mesh.cells_by_size():
        center_cx = centroids(distributed.mesh.points_vx[vertices_cv])
        for m, nodes in enumerate(dofmap.cell_moments[cells].T):
            labels[nodes] = np.column_stack([center_cx, np.full(len(cells), m + 1.0)])
    places = dofmap.owned_node_n
    ordered = np.empty((int((places >= 0).sum()), 3))
    ordered[places[places >= 0]] = labels[places >= 0]
    return ordered
