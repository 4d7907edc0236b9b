"""Points in virtual elements, and the weights of the nodes for the displacement there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tmc_vem.mesh.geometry import centroids, diameters
from tmc_vem.mesh.locate import find_cells
from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.system.places import ROUNDING, Located
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.spaces.projector import n_scalar_dofs
from tmc_vem.vem.spaces.quadrature import gauss_lobatto
from tmc_vem.vem.spaces.tabulated import points_and_values

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def locate(
    distributed: DistributedMesh, dofmap: DofMap, blocks: Sequence[Block], points_nx: Float, tolerance: float
) -> Located:
    """Points (n, 2) in the cells of this rank.

    Inside a cell a point gets the weights of Pi0_k. On a side, up to the tolerance, it gets those of the side's nodes
    at the nearest point of the side, and by how much Pi0_k differs between there and the point.
    """
    mesh, order = distributed.mesh, dofmap.order
    loops = [mesh.points_vx[loop] for loop in mesh.cells()]
    cells = find_cells(loops, distributed.cell_ids, points_nx, ROUNDING * tolerance)
    weights = csr_array((len(points_nx), dofmap.n_nodes))
    if not mesh.n_cells:
        return Located(cells, np.full(len(points_nx), -1), weights)
    rows, columns, values = [], [], []
    for block in blocks:
        position = np.full(mesh.n_cells, -1)
        position[block.cells] = np.arange(len(block.cells))
        chosen = np.flatnonzero(position[cells.cell_n] >= 0)
        if not len(chosen):
            continue
        local = position[cells.cell_n[chosen]]
        polygons = block.polygons(mesh)[local]
        side, t, nearest, away = _nearest_side(polygons, points_nx[chosen])
        on = np.flatnonzero(away <= tolerance)
        projected = _projection(polygons, order, points_nx[chosen])
        projected[on] -= _projection(polygons[on], order, nearest[on])
        nodes = block.batch.nodes_ca[local]
        rows.append(np.repeat(chosen, nodes.shape[1]))
        columns.append(nodes.ravel())
        values.append(projected.ravel())
        # edges run in the same direction on all ranks
        entry = mesh.cell_offsets[block.cells[local[on]]] + side[on]
        edge, along = distributed.edges.cell_edges[entry], distributed.edges.forward[entry]
        start, end = dofmap.vertex_nodes[distributed.edges.vertices_ev[edge]].T
        nodes = np.column_stack([start, dofmap.edge_nodes[edge], end])
        rows.append(np.repeat(chosen[on], order + 1))
        columns.append(nodes.ravel())
        values.append(_lagrange(order, np.where(along, t[on], 1.0 - t[on])).ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return Located(cells, distributed.cell_ids[cells.cell_n], csr_array(entries, shape=weights.shape))


def _projection(polygons_cvx: Float, order: int, points_cx: Float) -> Float:
    """Values (n, n_basis) of Pi0_k of the basis of each polygon at a point."""
    if not len(polygons_cvx):
        return np.empty((0, n_scalar_dofs(polygons_cvx.shape[1], order)))
    xi = (points_cx - centroids(polygons_cvx)) / diameters(polygons_cvx)[:, None]
    values: Float = points_and_values(polygons_cvx, order, xi[:, None])[1][:, 0]
    return values


def _nearest_side(polygons_cvx: Float, points_cx: Float) -> tuple[Int, Float, Float, Float]:
    """Of each polygon, the side (n,) nearest to a point; where on it, from 0 to 1 and as a point; how far away."""
    arm = np.roll(polygons_cvx, -1, axis=1) - polygons_cvx
    from_start = points_cx[:, None] - polygons_cvx
    t = np.clip((from_start * arm).sum(axis=2) / (arm * arm).sum(axis=2), 0.0, 1.0)
    nearest = polygons_cvx + t[..., None] * arm
    away = np.linalg.norm(points_cx[:, None] - nearest, axis=2)
    side = away.argmin(axis=1)
    every = np.arange(len(side))
    return side, t[every, side], nearest[every, side], away[every, side]


def _lagrange(order: int, t: Float) -> Float:
    """Values (n, k + 1) of the Lagrange polynomials of the Gauss-Lobatto points at t (n,)."""
    nodes = gauss_lobatto(order + 1)[0]
    values: Float = np.linalg.solve(np.vander(nodes, increasing=True).T, np.vander(t, order + 1, increasing=True).T).T
    return values
