"""Elastic bodies of quadratic elements: energy, internal forces and tangent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from conventional import lagrange, neohooke

Float = NDArray[np.float64]
Int = NDArray[np.int64]
GAUSS = 4  # in each direction, as in tmc_vem on quadrilaterals


@dataclass
class _Group:
    """Cells with equally many nodes: nodes (c, k), dN/dX (c, q, k, 2), weights (c, q), moduli (c,)."""

    nodes_ck: Int
    dNdX_cqki: Float
    w_cq: Float
    K_c: Float
    mu_c: Float

    def gradients(self, u_ni: Float) -> Float:
        """(c q, 2, 2) deformation gradients."""
        H = np.einsum("cki,cqkj->cqij", u_ni[self.nodes_ck], self.dNdX_cqki)
        F: Float = (H + np.eye(2)).reshape(-1, 2, 2)
        return F

    def moduli(self) -> tuple[Float, Float]:
        """K and mu (c q,) at the points."""
        n = self.w_cq.shape[1]
        return np.repeat(self.K_c, n), np.repeat(self.mu_c, n)

    def dofs(self) -> Int:
        """(c, 2 k) degrees of freedom, x and y of a node after each other."""
        return (2 * self.nodes_ck[:, :, None] + np.arange(2)).reshape(len(self.nodes_ck), -1)


@dataclass
class Body:
    """Quadrilaterals and triangles with quadratic sides.

    Attributes:
        X_ni: (n, 2) nodes, undeformed.
        cells: nodes of every cell, 9 of a quadrilateral and 6 of a triangle, in the order of
            :mod:`conventional.lagrange`.
        K_c, mu_c: bulk and shear modulus of every cell (force per area).
    """

    X_ni: Float
    cells: Sequence[Sequence[int]]
    K_c: Float
    mu_c: Float
    _groups: list[_Group] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        sizes = np.array([len(cell) for cell in self.cells])
        self._groups = [self._group(np.flatnonzero(sizes == size), size) for size in sorted(set(sizes.tolist()))]

    def _group(self, chosen: Int, size: int) -> _Group:
        nodes = np.array([self.cells[c] for c in chosen], dtype=np.int64)
        _, dN_qkj, w_q = lagrange.square(GAUSS) if size == 9 else lagrange.triangle(GAUSS)
        jacobian = np.einsum("cki,qkj->cqij", self.X_ni[nodes], dN_qkj)
        determinant = np.linalg.det(jacobian)
        if (determinant <= 0.0).any():
            raise ValueError("a cell is turned inside out: its nodes must go around counter-clockwise")
        dNdX = np.einsum("qkj,cqji->cqki", dN_qkj, np.linalg.inv(jacobian))
        return _Group(nodes, dNdX, w_q * determinant, self.K_c[chosen], self.mu_c[chosen])

    def energy(self, u_ni: Float) -> float:
        """Strain energy; infinite where J <= 0 at a point."""
        total = 0.0
        for group in self._groups:
            F = group.gradients(u_ni)
            if (neohooke.determinant(F) <= 0.0).any():
                return float("inf")
            total += float(group.w_cq.ravel() @ neohooke.energy(F, *group.moduli()))
        return total

    def forces(self, u_ni: Float) -> Float:
        """(2 n,) internal forces."""
        r = np.zeros(2 * len(self.X_ni))
        for group in self._groups:
            P = neohooke.stress(group.gradients(u_ni), *group.moduli()).reshape(*group.w_cq.shape, 2, 2)
            r_cki = np.einsum("cq,cqij,cqkj->cki", group.w_cq, P, group.dNdX_cqki)
            np.add.at(r, group.dofs().ravel(), r_cki.ravel())
        return r

    def tangent(self, u_ni: Float) -> csr_matrix:
        """Derivative of :meth:`forces`."""
        n = 2 * len(self.X_ni)
        total = csr_matrix((n, n))
        for group in self._groups:
            A = neohooke.tangent(group.gradients(u_ni), *group.moduli()).reshape(*group.w_cq.shape, 4, 4)
            n_cells, n_points, n_nodes, _ = group.dNdX_cqki.shape
            B = np.zeros((n_cells, n_points, 2, 2, n_nodes, 2))  # F_ij per displacement i of node k
            for i in (0, 1):
                B[:, :, i, :, :, i] = group.dNdX_cqki.transpose(0, 1, 3, 2)
            B = B.reshape(n_cells, n_points, 4, 2 * n_nodes)
            stressed = (group.w_cq[:, :, None, None] * (A @ B)).reshape(n_cells, 4 * n_points, -1)
            K_cab = B.reshape(n_cells, 4 * n_points, -1).transpose(0, 2, 1) @ stressed
            dofs = group.dofs()
            size = dofs.shape[1]
            rows, columns = np.repeat(dofs, size, axis=1), np.tile(dofs, (1, size))
            total = total + coo_matrix((K_cab.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)).tocsr()
        return total


Middles = Mapping[tuple[int, int], int]


def with_middles(points_vi: Float, polygons: Sequence[Sequence[int]]) -> tuple[Float, list[list[int]], Middles]:
    """Nodes and cells of quadratic elements on straight triangles and quadrilaterals.

    Returns:
        Nodes (vertices first), nodes of the cells, and the middle node of each pair of neighbouring vertices (smaller
        first).
    """
    middles: dict[tuple[int, int], int] = {}
    nodes = [tuple(point) for point in np.asarray(points_vi, dtype=float)]
    cells = []
    for polygon in polygons:
        cell = [int(v) for v in polygon]
        sides = list(zip(cell, [*cell[1:], cell[0]], strict=True))
        for a, b in sides:
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(nodes)
                nodes.append(tuple((np.array(nodes[a]) + np.array(nodes[b])) / 2))
            cell.append(middles[key])
        if len(polygon) == 4:
            cell.append(len(nodes))
            nodes.append(tuple(np.mean([nodes[int(v)] for v in polygon], axis=0)))
        cells.append(cell)
    return np.array(nodes), cells, middles
