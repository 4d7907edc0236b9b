"""Energy, residual and tangent of sides that hang together alike, from the energy at a point of a face.

What a point reads is linear in the displacement: F - I and G of the face's cell, and the jump J across the side. Of
these three, the *rows*, everything else is made by one small matrix per side: D = J / sqrt(h) and B = J (x) n.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import DEFORMATION_GRADIENT, SECOND_GRADIENT
from codegen.kernel import ENERGY, GRADIENT, TANGENT, Kernel
from codegen.layout import Layout
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.facets.energy import JUMP_BY_NORMAL, SCALED_JUMP
from tmc_vem.vem.facets.faces import Faces

Float = NDArray[np.float64]
Int = NDArray[np.int64]

CHUNK = 512  # sides whose dense arrays are held at a time
N_JUMP = 2  # rows of the jump: its derivative in each direction


@dataclass(frozen=True)
class Side:
    """Geometry of sides.

    Attributes:
        normal_fx: (n_sides, 2) unit normal, out of the first face's cell.
        h_f: (n_sides,) width across the side, area over length.
        w_fq: (n_sides, n_points) weights of the points, length included.
    """

    normal_fx: Float
    h_f: Float
    w_fq: Float

    def take(self, chosen: Int | slice) -> Side:
        """Some of them."""
        return Side(self.normal_fx[chosen], self.h_f[chosen], self.w_fq[chosen])


@dataclass(frozen=True)
class FacetTerms:
    """Sides of one region with equally many faces and basis functions.

    Attributes:
        region: name.
        kernel: the energy at a point of a face.
        parameters: its parameters.
        faces: one or two per side.
        jump_fqja: (n_sides, n_points, 2, n) rows of the jump on the basis of all faces, one after the other.
        side: geometry.
    """

    region: str
    kernel: Kernel
    parameters: Float
    faces: tuple[Faces, ...]
    jump_fqja: Float
    side: Side

    @property
    def n_sides(self) -> int:
        """Number of sides."""
        return len(self.side.h_f)

    @property
    def nodes_fa(self) -> Int:
        """(n_sides, n) nodes of all faces."""
        return np.concatenate([face.nodes_fa for face in self.faces], axis=1)

    def energies(self, u_ni: Float, residual_ni: Float | None = None) -> Float:
        """Energy (n_sides, n_faces) of each face; residuals are added to ``residual_ni`` if it is given."""
        energy = np.empty((self.n_sides, len(self.faces)))
        for chosen in self._chunks():
            for number in range(len(self.faces)):
                rows, nodes, x = self._state(number, chosen, u_ni)
                psi, g, _ = self.kernel.points(ENERGY if residual_ni is None else GRADIENT, x, self.parameters)
                w = self._weights(chosen)
                energy[chosen, number] = (w * psi.reshape(w.shape)).sum(axis=1)
                if residual_ni is not None and g is not None:
                    stress = self._matrices(chosen).swapaxes(1, 2)[:, None] @ g.reshape(*w.shape, -1, 2)
                    forces = np.einsum("fq,fqra,fqri->fai", w, rows, stress, optimize=True)
                    np.add.at(residual_ni, nodes, forces)
        return energy

    def tangents(self, u_ni: Float, chosen: slice | Int) -> Float:
        """Tangents (n, n_basis, 2, n_basis, 2) of some sides."""
        total: Float | None = None
        for number in range(len(self.faces)):
            rows, _, x = self._state(number, chosen, u_ni)
            hessian = self.kernel.points(TANGENT, x, self.parameters)[2]
            assert hessian is not None
            n_f, n_q, n_r, n_a = rows.shape
            matrix = self._matrices(chosen)
            n_x = matrix.shape[1]
            # (f, q, x, i, y, j) to (f, q, i, j, x, y)
            pairs = hessian.reshape(n_f, n_q, n_x, 2, n_x, 2).transpose(0, 1, 3, 5, 2, 4)
            small = matrix.swapaxes(1, 2)[:, None, None, None] @ pairs @ matrix[:, None, None, None]
            small *= self._weights(chosen)[:, :, None, None, None, None]
            right = small @ rows[:, :, None, None]  # f, q, i, j, r, b
            stacked = right.transpose(0, 1, 4, 2, 3, 5).reshape(n_f, n_q * n_r, 4 * n_a)
            product = rows.reshape(n_f, n_q * n_r, n_a).swapaxes(1, 2) @ stacked  # f, a, (i, j, b)
            total = product if total is None else total + product
        assert total is not None
        return total.reshape(n_f, n_a, 2, 2, n_a).transpose(0, 1, 2, 4, 3)

    def smallest_jacobians(self, u_ni: Float) -> Float:
        """Smallest J (n_sides, n_faces) at the points of each face."""
        return np.stack([_det(H).min(axis=1) for H in self._gradients(u_ni)], axis=1)

    def gradients(self, u_ni: Float) -> Float:
        """Gradients (n_faces n_sides, n_points, 2, 2) of the trace: [..., x, i] is the derivative with respect to x."""
        return np.concatenate(self._gradients(u_ni))

    def _gradients(self, u_ni: Float) -> list[Float]:
        return [face.rows_fqra[:, :, :2] @ u_ni[face.nodes_fa][:, None] for face in self.faces]

    def _chunks(self) -> Iterator[slice]:
        for first in range(0, self.n_sides, CHUNK):
            yield slice(first, min(first + CHUNK, self.n_sides))

    def chunks(self) -> Iterator[slice]:
        """Positions of the sides, not too many at a time."""
        return self._chunks()

    def _weights(self, chosen: slice | Int) -> Float:
        return self.side.w_fq[chosen] / len(self.faces)

    def _state(self, number: int, chosen: slice | Int, u_ni: Float) -> tuple[Float, Int, Float]:
        """Rows (n, n_points, n_rows, n_basis) of a face and the jump, nodes, and what the points of the face read."""
        face = self.faces[number]
        n_own = _own_rows(self.kernel.layout)
        jump = self.jump_fqja[chosen]
        rows = np.zeros((*jump.shape[:2], n_own + N_JUMP, jump.shape[3]))
        before = sum(other.n_basis for other in self.faces[:number])
        rows[:, :, :n_own, before : before + face.n_basis] = face.rows_fqra[chosen][:, :, :n_own]
        rows[:, :, n_own:] = jump
        nodes = np.concatenate([other.nodes_fa[chosen] for other in self.faces], axis=1)
        values = rows @ u_ni[nodes][:, None]
        x = self._matrices(chosen)[:, None] @ values
        return rows, nodes, x.reshape(-1, self.kernel.layout.n_inputs)

    def _matrices(self, chosen: slice | Int) -> Float:
        """What the layout reads (n, n_x, n_rows) of the rows: F - I, G where it is read, and the jump."""
        side, layout = self.side.take(chosen), self.kernel.layout
        n_own = _own_rows(layout)
        matrix = np.zeros((len(side.h_f), layout.n_rows, n_own + N_JUMP))
        row = np.arange(n_own)
        matrix[:, row, row] = 1.0
        for j in range(N_JUMP):
            matrix[:, _first_row(layout, SCALED_JUMP.name) + j, n_own + j] = 1.0 / np.sqrt(side.h_f)
            if JUMP_BY_NORMAL in layout.inputs:
                for k in range(2):
                    row_jk = _first_row(layout, JUMP_BY_NORMAL.name) + j + 2 * k
                    matrix[:, row_jk, n_own + j] = side.normal_fx[:, k]
        return matrix


def _first_row(layout: Layout, name: str) -> int:
    return layout.part(name).start // layout.n_components


def _own_rows(layout: Layout) -> int:
    """Rows of the face's own cell that a layout reads: of F, or of F and G."""
    names = [entry.name for entry in (DEFORMATION_GRADIENT, SECOND_GRADIENT) if entry in layout.inputs]
    return layout.rows_of(names)


def _det(H: Float) -> Float:
    """J at displacement gradients (..., 2, 2)."""
    J: Float = (1.0 + H[..., 0, 0]) * (1.0 + H[..., 1, 1]) - H[..., 0, 1] * H[..., 1, 0]
    return J


def dofs(nodes: Int) -> Int:
    """Degrees of freedom (n_sides, 2 n) of nodes (n_sides, n)."""
    return DISPLACEMENT.dofs(nodes).reshape(len(nodes), -1)


def jump_of_faces(faces: Sequence[Faces]) -> Float:
    """Rows (n_sides, n_points, 2, n) of the jump of the gradient: the first face's minus the second's."""
    first, second = faces
    return np.concatenate([first.rows_fqra[:, :, :2], -second.rows_fqra[:, :, :2]], axis=3)
