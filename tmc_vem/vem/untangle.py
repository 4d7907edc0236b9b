"""Cells that are inside out, or nearly, are untangled: nodes around them move until J is positive again.

After a transfer to another mesh, J can be negative at new quadrature points, above all where the medium is squeezed.
The potential is infinite there, so that its minimum cannot be looked for from such a state. Around such cells,

    E = sum of w (F : F / chi(J)),  chi = (J + sqrt(J^2 + 4 delta^2)) / 2,

is finite for any J and grows steeply where J < 0 (Garanzha, Comput. Math. Math. Phys. 40 (2000) 1617; Escobar et al.,
CMAME 192 (2003) 2775). It is lowered by Newton's method, delta going to 0 as J grows. All other nodes stay; what comes
out is a start for the equilibrium, not a result.

While delta is large, E is the smaller the smaller cells are, so that a factor would not keep a solid in shape: cells of
heavy regions have ``(weight - 1) w |F - F_0|^2`` in addition, F_0 being what F was, except those around heavy cells
that are inside out themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, diags
from scipy.sparse.linalg import splu

from tmc_vem.vem.cell_values import jacobians
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

RINGS = 5  # of cells around those that are inside out, whose nodes move
MOST_ITERATIONS = 60
SMALLEST_DELTA = 1e-6
# By how much delta is lowered where J is positive, which also is the change of the smallest J that counts as one; and
# where that no longer grows, which makes negative J dearer.
SOFTER, STEEPER = 0.1, 0.5
SHORTEST_STEP, ARMIJO = 1e-4, 1e-4
ROUNDING = 1e-10  # of the largest diagonal entry: what is added to it

# Second derivatives of J = F11 F22 - F12 F21, components in the order 11, 12, 21, 22.
_BY_TWICE = np.array([[0.0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]])


@dataclass(frozen=True)
class Untangled:
    """A state without cells that are inside out.

    Attributes:
        u_ni: (n_nodes, 2) displacements.
        n_cells: how many cells were.
        moved: the largest change of a component.
    """

    u_ni: Float
    n_cells: int
    moved: float


def untangled(
    system: VemSystem, u_ni: Float, fixed_ni: Bool, weights: Mapping[str, float], least: float = 0.0
) -> Untangled | None:
    """Move nodes until J is above ``least`` at all quadrature points.

    Args:
        system: on one rank.
        u_ni: (n_nodes, 2) displacements.
        fixed_ni: (n_nodes, 2) components that stay.
        weights: of cells by region, 1 or above: those of heavy regions hardly move.
        least: value of J, 0 or above.

    Returns:
        None if that was not possible.
    """
    smallest_c = jacobians(system.blocks, system.distributed.mesh.n_cells, u_ni)[1]
    inside_out = [smallest_c[block.cells] <= least for block in system.blocks]
    n_cells = sum(int(cells.sum()) for cells in inside_out)
    if not n_cells:
        return Untangled(u_ni, 0, 0.0)
    near_n, loose_n = np.zeros((2, len(u_ni)), dtype=bool)
    for block, cells in zip(system.blocks, inside_out, strict=True):
        nodes = block.batch.nodes_ca[cells].ravel()
        near_n[nodes] = True
        loose_n[nodes] |= weights[block.region] > 1.0
    for _ in range(RINGS):
        patch = _Patch.around(system, u_ni, near_n[:, None] & ~fixed_ni, weights, loose_n)
        change_ni = patch.lowered(least)
        if change_ni is not None:
            return Untangled(u_ni + change_ni, n_cells, float(np.abs(change_ni).max()))
        for block in system.blocks:
            nodes_ca = block.batch.nodes_ca
            near_n[nodes_ca[near_n[nodes_ca].any(axis=1)].ravel()] = True
    return None


@dataclass(frozen=True)
class _Cells:
    """Some cells of a patch.

    Attributes:
        B_cqsa: (n_cells, n_points, 4, n_basis 2) rows of F in the order 11, 12, 21, 22 for their displacements.
        F_cqs: (n_cells, n_points, 4) deformation gradients at the state to start from.
        w_cq: (n_cells, n_points) weights.
        hold_c: (n_cells,) how much they resist any change.
        dofs_ca: (n_cells, n_basis 2) numbers of their displacements in the patch, -1 for those that stay.
    """

    B_cqsa: Float
    F_cqs: Float
    w_cq: Float
    hold_c: Float
    dofs_ca: Int


class _Patch:
    """Cells around some nodes, and the energy of their displacements.

    Args:
        cells: the cells.
        free_ni: (n_nodes, 2) what moves.
    """

    def __init__(self, cells: list[_Cells], free_ni: Bool) -> None:
        self._cells, self._free_ni = cells, free_ni
        self._n_dofs = int(free_ni.sum())

    @staticmethod
    def around(system: VemSystem, u_ni: Float, free_ni: Bool, weights: Mapping[str, float], loose_n: Bool) -> _Patch:
        """All cells that have something that moves; those at loose nodes may change, whatever their region."""
        number_ni = np.full(free_ni.shape, -1)
        number_ni[free_ni] = np.arange(free_ni.sum())
        found = []
        for block in system.blocks:
            nodes_ca = block.batch.nodes_ca
            cells = np.flatnonzero(free_ni[nodes_ca].any(axis=(1, 2)))
            for shape in np.array_split(cells, -(-len(cells) // 256)) if len(cells) else ():
                rows = np.concatenate([block.rows(2, slice(c, c + 1)) for c in shape.tolist()])
                B = np.zeros((*rows.shape[:2], 4, 2 * rows.shape[3]))
                for i in (0, 1):
                    B[:, :, 2 * i : 2 * i + 2, i::2] = rows
                u_ca = u_ni[nodes_ca[shape]].reshape(len(shape), -1)
                F = np.eye(2).ravel() + np.einsum("cqsa,ca->cqs", B, u_ca)
                w = np.concatenate([block.weights(slice(c, c + 1)) for c in shape.tolist()])
                hold = np.where(loose_n[nodes_ca[shape]].any(axis=1), 0.0, weights[block.region] - 1.0)
                found.append(_Cells(B, F, w, hold, number_ni[nodes_ca[shape]].reshape(len(shape), -1)))
        return _Patch(found, free_ni)

    def lowered(self, least: float) -> Float | None:
        """Changes (n_nodes, 2) of the displacements with which J is above ``least``; None if none were found."""
        if not self._n_dofs:
            return None
        x, before = np.zeros(self._n_dofs), -np.inf
        delta = max(-self._smallest(x), 1e-4)
        for _ in range(MOST_ITERATIONS):
            energy, gradient, hessian = self._evaluated(x, delta)
            try:
                step = -splu(hessian).solve(gradient)
            except RuntimeError:  # a singular matrix
                return None
            length = self._searched(x, step, delta, energy, float(gradient @ step))
            if not length:
                return None
            x = x + length * step
            smallest = self._smallest(x)
            if smallest > least:
                change_ni = np.zeros(self._free_ni.shape)
                change_ni[self._free_ni] = x
                return change_ni
            improves = smallest > before + SOFTER * abs(before) or np.isinf(before)
            following = max(-smallest, 0.0) + SOFTER * delta if improves else STEEPER * delta
            delta, before = max(min(delta, following), SMALLEST_DELTA), smallest
        return None

    def _at(self, cells: _Cells, x: Float) -> Float:
        x_ca = np.where(cells.dofs_ca >= 0, np.append(x, 0.0)[cells.dofs_ca], 0.0)
        F: Float = cells.F_cqs + np.einsum("cqsa,ca->cqs", cells.B_cqsa, x_ca)
        return F

    def _smallest(self, x: Float) -> float:
        return min(float(_det(self._at(cells, x)).min()) for cells in self._cells)

    def _energy(self, x: Float, delta: float) -> float:
        total = 0.0
        for cells in self._cells:
            F = self._at(cells, x)
            change = F - cells.F_cqs
            psi = (F * F).sum(axis=2) / _chi(_det(F), delta)[0]
            psi += cells.hold_c[:, None] * (change * change).sum(axis=2)
            total += float((cells.w_cq * psi).sum())
        return total

    def _searched(self, x: Float, step: Float, delta: float, energy: float, slope: float) -> float:
        """How much of a step lowers the energy; 0 if nothing does."""
        length = 1.0
        while length >= SHORTEST_STEP:
            if self._energy(x + length * step, delta) <= energy + ARMIJO * length * slope:
                return length
            length *= 0.5
        return 0.0

    def _evaluated(self, x: Float, delta: float) -> tuple[float, Float, csc_array]:
        """Energy, gradient, and a positive Hessian: that of every point without its negative part."""
        energy, gradient = 0.0, np.zeros(self._n_dofs + 1)
        rows, columns, values = [], [], []
        for cells in self._cells:
            F = self._at(cells, x)
            psi, P, H = _derivatives(F, delta)
            change, hold_c = F - cells.F_cqs, cells.hold_c[:, None]
            psi += hold_c * (change * change).sum(axis=2)
            P += 2.0 * hold_c[..., None] * change
            H += 2.0 * hold_c[..., None, None] * np.eye(4)
            energy += float((cells.w_cq * psi).sum())
            np.add.at(gradient, cells.dofs_ca, np.einsum("cq,cqs,cqsa->ca", cells.w_cq, P, cells.B_cqsa))
            weighted = cells.w_cq[..., None, None] * H
            K = np.einsum("cqsa,cqst,cqtb->cab", cells.B_cqsa, weighted, cells.B_cqsa, optimize=True)
            both = np.broadcast_arrays(cells.dofs_ca[:, :, None], cells.dofs_ca[:, None, :])
            free = (both[0] >= 0) & (both[1] >= 0)
            rows.append(both[0][free])
            columns.append(both[1][free])
            values.append(K[free])
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        hessian = coo_array(entries, shape=(self._n_dofs, self._n_dofs)).tocsc()
        added = ROUNDING * np.abs(hessian.diagonal()).max() * np.ones(self._n_dofs)
        return energy, gradient[:-1], csc_array(hessian + diags(added, format="csc"))


def _det(F_cqs: Float) -> Float:
    J: Float = F_cqs[..., 0] * F_cqs[..., 3] - F_cqs[..., 1] * F_cqs[..., 2]
    return J


def _chi(J: Float, delta: float) -> tuple[Float, Float, Float]:
    """chi and its first two derivatives by J."""
    root = np.sqrt(J * J + 4.0 * delta * delta)
    return 0.5 * (J + root), 0.5 * (1.0 + J / root), 2.0 * delta * delta / root**3


def _derivatives(F: Float, delta: float) -> tuple[Float, Float, Float]:
    """F : F / chi(J), its gradient (..., 4), and the positive part (..., 4, 4) of its Hessian."""
    chi, first, second = (values[..., None] for values in _chi(_det(F), delta))
    squares = (F * F).sum(axis=-1, keepdims=True)
    cofactor = F[..., ::-1] * (1.0, -1.0, -1.0, 1.0)
    by_J = -squares / chi**2 * first
    by_J_twice = 2.0 * squares / chi**3 * first**2 - squares / chi**2 * second
    mixed = (-2.0 * first / chi**2 * F)[..., :, None] * cofactor[..., None, :]
    H = (
        (2.0 / chi)[..., None] * np.eye(4)
        + mixed
        + np.swapaxes(mixed, -1, -2)
        + (by_J_twice * cofactor)[..., :, None] * cofactor[..., None, :]
        + by_J[..., None] * _BY_TWICE
    )
    eigenvalues, vectors = np.linalg.eigh(H)
    positive = (vectors * np.maximum(eigenvalues, 0.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return (squares / chi)[..., 0], 2.0 * F / chi + by_J * cofactor, positive
