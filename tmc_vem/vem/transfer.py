"""Displacements taken from one mesh to another one.

Traces are polynomials, and nodes on a side of the old mesh get them exactly. Inside a cell the displacement is read as
Pi0_k u of the old cell. Moments are integrals over the new cell; where a new cell is an old one, with other nodes on
its sides perhaps, they stay what they were, so that nothing changes in cells that nothing has happened to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.geometry import areas, centroids, diameters
from tmc_vem.vem.polygons import node_points
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.quadrature import sub_triangles, triangle
from tmc_vem.vem.spaces.tabulated import points_and_values
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SAME = 1e-9  # relative: areas of cells that are the same
AT_ONCE = 1 << 17  # points whose values are looked up at a time


def transferred(
    old: VemSystem, u_ni: Float, new: VemSystem, before_vx: Float | None = None, parent_c: Int | None = None
) -> Float:
    """Values (n_nodes, 2) of the nodes of a new mesh; both meshes lie on one rank each.

    Args:
        old: the system that the displacements are of.
        u_ni: (n_nodes, 2) values of its nodes.
        new: the system of the same region with other cells.
        before_vx: (n_vertices of the new mesh, 2) where its vertices are in the old mesh; a vertex that has moved onto
            a curved outline was elsewhere. None for where they are.
        parent_c: (n_cells of the new mesh,) an old cell that each new one lies in, or is made of; None if that is not
            known, as after a new mesh was made.
    """
    distributed = new.distributed
    if before_vx is not None:
        points_vx = np.asarray(before_vx)[distributed.vertex_ids]
        distributed = replace(distributed, mesh=replace(distributed.mesh, points_vx=points_vx, validate=False))
    values_ni = np.empty((new.dofmap.n_nodes, 2))
    on_sides = np.concatenate([new.dofmap.vertex_nodes, new.dofmap.edge_nodes.ravel()])
    values_ni[on_sides] = _located(old, u_ni, node_points(distributed, new.dofmap)[on_sides])
    source = _Source(old, u_ni)
    for _, cells, vertices_cv in distributed.mesh.cells_by_size():
        polygons_cvx = distributed.mesh.points_vx[vertices_cv]
        parents = None if parent_c is None else source.local(np.asarray(parent_c)[distributed.cell_ids[cells]])
        values_ni[new.dofmap.cell_moments[cells]] = source.moments(polygons_cvx, parents)
    return values_ni


class _Source:
    """Moments of a displacement over any polygons.

    Args:
        system, u_ni: whose displacement it is.
    """

    def __init__(self, system: VemSystem, u_ni: Float) -> None:
        self._system, self._u_ni = system, u_ni
        mesh = system.distributed.mesh
        self._area_c = centroids_and_areas(mesh)[1]
        self._local = np.argsort(system.distributed.cell_ids)
        self._block_c, self._position_c = np.empty((2, mesh.n_cells), dtype=np.int64)
        for number, block in enumerate(system.blocks):
            self._block_c[block.cells], self._position_c[block.cells] = number, np.arange(len(block.cells))

    def local(self, numbers: Int) -> Int:
        """Local cells of numbers in the whole mesh."""
        cells: Int = self._local[numbers]
        return cells

    def moments(self, polygons_cvx: Float, parents: Int | None) -> Float:
        """Moments (n_cells, n_moments, 2) over polygons.

        Args:
            polygons_cvx: (n_cells, n_sides, 2) vertices.
            parents: (n_cells,) local cells that they lie in or are made of, or None.
        """
        order = self._system.order
        found = np.empty((len(polygons_cvx), monomials.dimension(order - 2), 2))
        ratio = np.full(len(found), np.inf) if parents is None else areas(polygons_cvx) / self._area_c[parents]
        same, inside = np.abs(ratio - 1.0) <= SAME, ratio < 1.0 - SAME
        if parents is not None:
            found[same] = self._u_ni[self._system.dofmap.cell_moments[parents[same]]]
        chosen = np.flatnonzero(~same)
        for positions, triangles_ctpx in sub_triangles(polygons_cvx[chosen]) if len(chosen) else ():
            cells = chosen[positions]
            points_cqx, w_cq = _points(triangles_ctpx, 2 * order - 2)
            values_cqi = np.empty_like(points_cqx)
            within = inside[cells]
            if parents is not None:
                values_cqi[within] = self._projected(parents[cells[within]], points_cqx[within])
            elsewhere = points_cqx[~within]
            values_cqi[~within] = _located(self._system, self._u_ni, elsewhere.reshape(-1, 2)).reshape(elsewhere.shape)
            polygons = polygons_cvx[cells]
            xi_cqx = (points_cqx - centroids(polygons)[:, None]) / diameters(polygons)[:, None, None]
            m_cqm = monomials.values(order - 2, xi_cqx)
            found[cells] = np.einsum("cq,cqm,cqi->cmi", w_cq, m_cqm, values_cqi)
        return found

    def _projected(self, cells: Int, points_cqx: Float) -> Float:
        """Pi0_k u (n_cells, n_points, 2) of local cells at points."""
        values = np.empty_like(points_cqx)
        mesh, order = self._system.distributed.mesh, self._system.order
        for number, block in enumerate(self._system.blocks):
            chosen = np.flatnonzero(self._block_c[cells] == number)
            if not len(chosen):
                continue
            position = self._position_c[cells[chosen]]
            polygons = block.polygons(mesh, position)
            xi = (points_cqx[chosen] - centroids(polygons)[:, None]) / diameters(polygons)[:, None, None]
            basis_cqa = points_and_values(polygons, order, xi)[1]
            values[chosen] = basis_cqa @ self._u_ni[block.batch.nodes_ca[position]]
        return values


def _points(triangles_ctpx: Float, degree: int) -> tuple[Float, Float]:
    """Points (n_cells, n_points, 2) in triangles (n_cells, n_triangles, 3, 2) of each cell, and weights of sum 1."""
    barycentric_qp, w_q = triangle(degree)
    a, b = (triangles_ctpx[:, :, p] - triangles_ctpx[:, :, 0] for p in (1, 2))
    area_ct = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    w_cq = (area_ct[..., None] * w_q).reshape(len(area_ct), -1)
    points_cqx = np.einsum("qp,ctpx->ctqx", barycentric_qp, triangles_ctpx).reshape(len(area_ct), -1, 2)
    return points_cqx, w_cq / w_cq.sum(axis=1, keepdims=True)


def _located(system: VemSystem, u_ni: Float, points_nx: Float) -> Float:
    """Displacements (n, 2) at points, wherever they lie."""
    parts = [points_nx[first : first + AT_ONCE] for first in range(0, len(points_nx), AT_ONCE)]
    return np.concatenate([system.locate(part).weights @ u_ni for part in parts]) if parts else np.empty((0, 2))
