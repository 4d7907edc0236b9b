"""Sides that hang together alike, packed for the kernel that computes their energy, residual and tangent.

What a point reads is linear in the displacement: F - I and G of the face's cell, its own *rows*, and the jump J across
the side, of which D = J / sqrt(h) and B = J (x) n are made, see :mod:`tmc_vem.vem.facets.energy`.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from codegen.layout import Layout, Take
from codegen.library import address
from tmc_vem.vem.facets.energy import JUMP_BY_NORMAL, SCALED_JUMP
from tmc_vem.vem.kernel.packs import packed

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]


class SidesStruct(ctypes.Structure):
    """``tmc_sides``; a test compares the fields with the header."""

    _fields_ = (
        ("n_sides", ctypes.c_int64),
        *((name, ctypes.c_int32) for name in ("n_faces", "n_points", "n_basis", "n_own")),
        ("first_a", ctypes.c_int32 * 2),
        ("n_a", ctypes.c_int32 * 2),
        *((name, ctypes.c_void_p) for name in ("nodes_sa", "w_spq", "coefficient_spe")),
        ("rows_spqra", ctypes.c_void_p * 2),
        *((name, ctypes.c_void_p) for name in ("jump_spqxa", "factor_fsk")),
    )


@dataclass(frozen=True)
class Faces:
    """Faces of cells with equally many basis functions.

    Attributes:
        rows_fqra: (n_faces, n_points, 6, n_basis) values and derivatives of the polynomials that the basis has for its
            gradient.
        nodes_fa: (n_faces, n_basis) nodes of the cells.
        area_f: areas of the cells.
        cell_f: cells of this rank, -1 for those of others.
        factor_fk: (n_faces, n_varying) what multiplies the parameters that vary from cell to cell.
    """

    rows_fqra: Float
    nodes_fa: Int
    area_f: Float
    cell_f: Int
    factor_fk: Float

    @property
    def n_basis(self) -> int:
        """Scalar basis functions of each cell."""
        return self.nodes_fa.shape[1]

    def take(self, chosen: Int) -> Faces:
        """Some of them."""
        return Faces(
            self.rows_fqra[chosen], self.nodes_fa[chosen], self.area_f[chosen], self.cell_f[chosen],
            self.factor_fk[chosen],
        )  # fmt: skip


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


@dataclass(frozen=True)
class SideBatch:
    """Sides with equally many faces and basis functions; see sides_abi.h for the meaning.

    Attributes:
        nodes_sa: (n_sides, n_basis) nodes of all faces.
        w_sp, coefficient_sp, jump_sp: per pack of sides.
        rows_sp: the same for each face.
        factor_fsk: (n_faces, n_sides, n_varying) of the faces.
    """

    nodes_sa: Int32
    w_sp: Float
    coefficient_sp: Float
    rows_sp: tuple[Float, ...]
    jump_sp: Float
    factor_fsk: Float

    @staticmethod
    def pack(layout: Layout, faces: tuple[Faces, ...], jump_fqxa: Float, side: Side) -> SideBatch:
        """Batch of arrays with one entry per side.

        Args:
            layout: what a point reads.
            faces: one or two per side.
            jump_fqxa: (n_sides, n_points, 2, n_basis) derivatives of the jump, on the basis of all faces.
            side: geometry.
        """
        n_own = own_rows(layout)
        normal = np.repeat(side.normal_fx, 2, axis=1)  # B_ijk = J_ij n_k, with j fastest
        scaled = np.repeat(1.0 / np.sqrt(side.h_f)[:, None], 2, axis=1)
        by_input = {SCALED_JUMP: scaled, JUMP_BY_NORMAL: normal}
        made = np.concatenate([by_input[entry] for entry in layout.inputs if entry.take is Take.JUMP], axis=1)
        return SideBatch(
            np.ascontiguousarray(np.concatenate([face.nodes_fa for face in faces], axis=1), dtype=np.int32),
            packed(side.w_fq / len(faces)),
            packed(made),
            tuple(packed(face.rows_fqra[:, :, :n_own]) for face in faces),
            packed(jump_fqxa),
            np.stack([face.factor_fk for face in faces]),
        )

    def take(self, sides: Int | slice) -> SideBatch:
        """Some of the sides."""

        def some(values_sp: Float) -> Float:
            return packed(np.moveaxis(values_sp, -1, 1).reshape(-1, *values_sp.shape[1:-1])[sides])

        return SideBatch(
            np.ascontiguousarray(self.nodes_sa[sides]), some(self.w_sp), some(self.coefficient_sp),
            tuple(some(rows) for rows in self.rows_sp), some(self.jump_sp),
            np.ascontiguousarray(self.factor_fsk[:, sides]),
        )  # fmt: skip

    @property
    def n_sides(self) -> int:
        """Number of sides."""
        return len(self.nodes_sa)

    @property
    def n_basis(self) -> int:
        """Basis functions of all faces of a side."""
        return self.nodes_sa.shape[1]

    @cached_property
    def struct(self) -> SidesStruct:
        """What C reads; it points into the arrays of this object."""
        sizes = [rows.shape[3] for rows in self.rows_sp]
        pair = sizes + [0] * (2 - len(sizes))
        rows = [address(rows) for rows in self.rows_sp] + [None] * (2 - len(sizes))
        return SidesStruct(
            self.n_sides, len(sizes), self.w_sp.shape[1], self.n_basis, self.rows_sp[0].shape[2],
            (ctypes.c_int32 * 2)(0, pair[0]), (ctypes.c_int32 * 2)(*pair), address(self.nodes_sa), address(self.w_sp),
            address(self.coefficient_sp), (ctypes.c_void_p * 2)(*rows), address(self.jump_sp),
            address(self.factor_fsk),
        )  # fmt: skip


def own_rows(layout: Layout) -> int:
    """Rows of the face's own cell that a layout reads: of F, or of F and G."""
    return layout.rows_of(entry.name for entry in layout.inputs if entry.take is not Take.JUMP)


def jump_of_faces(faces: tuple[Faces, Faces]) -> Float:
    """Rows (n_sides, n_points, 2, n_basis) of the jump of the gradient: the first face's minus the second's."""
    first, second = faces
    return np.concatenate([first.rows_fqra[:, :, :2], -second.rows_fqra[:, :, :2]], axis=3)
