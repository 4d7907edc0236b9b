"""Cells as polygons through the nodes on their boundary, for output."""

from __future__ import annotations

import numpy as np

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.system.fields import Polygons
from tmc_vem.vem.spaces.quadrature import gauss_lobatto


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
