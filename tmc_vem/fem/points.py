"""Displacement gradients at quadrature points in numpy: energies, J and the exact step limit, without compiled forms.

Axes in names: c cells, q quadrature points, a basis functions, v vertices, i components of u, j and k derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem import compat
from tmc_vem.mesh.geometry import triangle_lattice

Float = NDArray[np.float64]

ALONG = 9  # points along each side of a cell on a dense grid


@dataclass(frozen=True)
class QuadraturePoints:
    """Cells' quadrature points and the maps from the reference cell.

    Attributes:
        values_qa: (n_points, n_basis) basis at the points.
        table_rqa: (5, n_points, n_basis) reference derivatives d1, d2, d1d1, d1d2, d2d2 of the basis.
        K_cqrj: (n_cells, n_points, 2, 2) inverse of the map's gradient, dxi_r / dX_j.
        H_cx: (n_cells, 2) mixed second derivative of the map (zero on triangles and parallelograms).
        w_cq: (n_cells, n_points) weights times the map's determinant.
        X_cqx: (n_cells, n_points, 2) coordinates.
    """

    values_qa: Float
    table_rqa: Float
    K_cqrj: Float
    H_cx: Float
    w_cq: Float
    X_cqx: Float

    @staticmethod
    def create(cell: str, order: int, degree: int, points_cvx: Float) -> QuadraturePoints:
        """Points of the rule of a degree on cells with the given vertices (n_cells, 3 or 4, 2)."""
        return QuadraturePoints.at(cell, order, *compat.quadrature(cell, degree), points_cvx)

    @staticmethod
    def dense(cell: str, order: int, points_cvx: Float) -> QuadraturePoints:
        """A grid of points much finer than a rule's, sides and vertices included; the weights mean nothing."""
        t = np.linspace(0.0, 1.0, ALONG)
        square = np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2)
        xi_qr = triangle_lattice(ALONG)[:, :2] if cell == "triangle" else square
        return QuadraturePoints.at(cell, order, xi_qr, np.ones(len(xi_qr)), points_cvx)

    @staticmethod
    def at(cell: str, order: int, xi_qr: Float, weights: Float, points_cvx: Float) -> QuadraturePoints:
        """Points (n_points, 2) of the reference cell, with weights (n_points,), on cells with the given vertices."""
        table = compat.lagrange_table(cell, order, xi_qr, 2)
        geometry = compat.lagrange_table(cell, 1, xi_qr, 2)
        map_cqxr = np.einsum("rqv,cvx->cqxr", geometry[1:3], points_cvx)
        det = map_cqxr[..., 0, 0] * map_cqxr[..., 1, 1] - map_cqxr[..., 0, 1] * map_cqxr[..., 1, 0]
        inverse = np.empty_like(map_cqxr)
        inverse[..., 0, 0], inverse[..., 1, 1] = map_cqxr[..., 1, 1], map_cqxr[..., 0, 0]
        inverse[..., 0, 1], inverse[..., 1, 0] = -map_cqxr[..., 0, 1], -map_cqxr[..., 1, 0]
        inverse /= det[..., None, None]
        return QuadraturePoints(
            values_qa=table[0],
            table_rqa=table[1:],
            K_cqrj=inverse,
            H_cx=np.einsum("v,cvx->cx", geometry[4, 0], points_cvx),
            w_cq=weights * np.abs(det),
            X_cqx=np.einsum("qv,cvx->cqx", geometry[0], points_cvx),
        )

    def first_gradient(self, u_cai: Float, cells: NDArray[np.intp] | slice = slice(None)) -> Float:
        """du_i/dX_j (n_cells, n_points, 2, 2) of nodal displacements (n_cells, n_basis, 2) of some cells."""
        return self._physical(self._reference(u_cai, 2), cells)

    def gradients(self, u_cai: Float, cells: NDArray[np.intp] | slice = slice(None)) -> tuple[Float, Float]:
        """First and second gradients: (n_cells, n_points, 2, 2) and (n_cells, n_points, 2, 2, 2)."""
        reference = self._reference(u_cai, 5)
        K, H = self.K_cqrj[cells], self.H_cx[cells]
        first = self._physical(reference[:, :2], cells)
        second = np.empty((*reference.shape[:1], reference.shape[2], 2, 2, 2))  # c q i s t
        second[..., 0, 0], second[..., 1, 1] = reference[:, 2], reference[:, 4]
        # second derivatives of the map enter through the chain rule; on straight cells only the mixed one is not zero
        bent = np.einsum("cqij,cj->cqi", first, H)
        second[..., 0, 1] = second[..., 1, 0] = reference[:, 3] - bent
        half: Float = second @ K[:, :, None]
        physical: Float = K.swapaxes(2, 3)[:, :, None] @ half
        return first, physical

    def nodal_loads(self, f_cqi: Float) -> Float:
        """Work-equivalent nodal forces (n_cells, n_basis, 2) of a force per area at the points."""
        loads: Float = np.einsum("cq,qa,cqi->cai", self.w_cq, self.values_qa, f_cqi)
        return loads

    def nodal_forces(
        self, P_cqij: Float, T_cqijk: Float | None, cells: NDArray[np.intp] | slice = slice(None)
    ) -> Float:
        """Forces (n_cells, n_basis, 2) whose work on a displacement v is ``sum_q w (P : grad v + T :. grad grad v)``.

        The transpose of :meth:`gradients`.

        Args:
            P_cqij, T_cqijk: what works on gradients and second gradients at the points of some cells; no T is zero.
            cells: these cells.
        """
        K, w_cq = self.K_cqrj[cells], self.w_cq[cells]
        first = P_cqij
        reference = np.empty((len(w_cq), 2 if T_cqijk is None else 5, *w_cq.shape[1:], 2))
        if T_cqijk is not None:
            second = K[:, :, None] @ (T_cqijk @ K.swapaxes(2, 3)[:, :, None])
            mixed = second[..., 0, 1] + second[..., 1, 0]
            reference[:, 2], reference[:, 3], reference[:, 4] = second[..., 0, 0], mixed, second[..., 1, 1]
            first = first - np.einsum("cqi,cj->cqij", mixed, self.H_cx[cells])
        reference[:, :2] = np.moveaxis(first @ K.swapaxes(2, 3), 3, 1)
        reference *= w_cq[:, None, :, None]
        table = self.table_rqa[: reference.shape[1]].reshape(-1, self.table_rqa.shape[2])
        forces: Float = table.T @ reference.reshape(len(w_cq), -1, 2)
        return forces

    def _reference(self, u_cai: Float, n_rows: int) -> Float:
        """Reference derivatives (n_cells, n_rows, n_points, 2)."""
        table = self.table_rqa[:n_rows]
        flat = table.reshape(-1, table.shape[2]) @ u_cai
        return flat.reshape(len(u_cai), n_rows, table.shape[1], 2)

    def _physical(self, reference_crqi: Float, cells: NDArray[np.intp] | slice) -> Float:
        gradient: Float = reference_crqi.transpose(0, 2, 3, 1) @ self.K_cqrj[cells]  # much faster than np.einsum
        return gradient


def jacobian(gradient: Float) -> Float:
    """J = det(I + grad u) over the leading axes, from 1 + tr(grad u) + det(grad u)."""
    a, b, c, d = gradient[..., 0, 0], gradient[..., 0, 1], gradient[..., 1, 0], gradient[..., 1, 1]
    J: Float = 1.0 + a + d + (a * d - b * c)
    return J


def largest_step(gradient: Float, direction: Float) -> float:
    """Smallest s > 0 at which J(u + s du), a quadratic in s, vanishes at any point; 0 if it has, infinite if never.

    Args:
        gradient, direction: (..., 2, 2) gradients of u and du at the points.
    """
    h, d = gradient, direction
    c0 = jacobian(h)
    c1 = (1 + h[..., 1, 1]) * d[..., 0, 0] - h[..., 0, 1] * d[..., 1, 0]
    c1 = c1 - h[..., 1, 0] * d[..., 0, 1] + (1 + h[..., 0, 0]) * d[..., 1, 1]
    c2 = d[..., 0, 0] * d[..., 1, 1] - d[..., 0, 1] * d[..., 1, 0]
    if not c0.size:
        return np.inf
    if not (c0 > 0.0).all() or not np.isfinite(c1).all():
        return 0.0
    # roots as 2 c0 / (-c1 -+ sqrt(...)): no cancellation for c0 > 0, and right for c2 = 0
    discriminant = c1 * c1 - 4.0 * c0 * c2
    root = np.sqrt(np.maximum(discriminant, 0.0))
    grows = c1 > 0.0
    falls = np.where(grows, -4.0 * c0 * c2 / np.where(grows, c1 + root, 1.0), root - c1)
    falls = np.where(discriminant >= 0.0, falls, 0.0)
    steepest = falls / c0  # = 2 / s where the root s is positive
    largest = float(steepest.max())
    return 2.0 / largest if largest > 0.0 else np.inf
