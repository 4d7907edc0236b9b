"""The work of a force as a function of the displacements over all ranks: W(u) = c . u + u . H u / 2.

All forces here are of this form, exactly: dead ones are linear, springs quadratic, and an area with sides that are
polynomials is a bilinear form of x and y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Comm, Mat, Vec
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.turned import Turned

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class WorkTerms:
    """Terms of equally many degrees of freedom each.

    Attributes:
        dofs_sm: (n, m) degrees of freedom, numbered over all ranks.
        linear_sm: (n, m) their parts of c.
        hessian_smm: (n, m, m) their parts of H, symmetric; None where W is linear.
    """

    dofs_sm: Int
    linear_sm: Float
    hessian_smm: Float | None = None

    def along(self, turned: Turned) -> WorkTerms:
        """The same for components along x and y of the nodes, in the degrees of freedom that turned nodes have."""
        axes_spij = turned.of(DISPLACEMENT.node(self.dofs_sm[:, :: DISPLACEMENT.components]))
        linear = np.einsum("spi,spij->spj", self.linear_sm.reshape(axes_spij.shape[:3]), axes_spij)
        hessian = self.hessian_smm
        if hessian is not None:
            blocks = hessian.reshape(*axes_spij.shape[:3], *axes_spij.shape[1:3])
            hessian = np.einsum("spik,spiqj,sqjl->spkql", axes_spij, blocks, axes_spij).reshape(hessian.shape)
        return WorkTerms(self.dofs_sm, linear.reshape(self.linear_sm.shape), hessian)


class WorkForm:
    """W over all ranks; they make and use it together.

    Args:
        comm: the ranks.
        linear: a vector of the system, zero, which this keeps.
        terms: this rank's.
    """

    def __init__(self, comm: Comm, linear: Vec, terms: Sequence[WorkTerms]) -> None:
        self.linear = linear
        for each in terms:
            _add(linear, each.dofs_sm, each.linear_sm)
        linear.assemble()
        self._quadratic = [
            (each.dofs_sm, each.hessian_smm) for each in terms if each.hessian_smm is not None and len(each.dofs_sm)
        ]
        self.is_linear = not any(comm.allgather(bool(self._quadratic)))
        if not self.is_linear:
            dofs = np.concatenate([np.empty(0, dtype=np.int64), *(dofs.ravel() for dofs, _ in self._quadratic)])
            needed = np.unique(dofs)
            self._places = [np.searchsorted(needed, dofs) for dofs, _ in self._quadratic]
            self._values: Vec = PETSc.Vec().createSeq(len(needed), comm=PETSc.COMM_SELF)
            rows = PETSc.IS().createGeneral(needed.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
            self._scatter: Any = PETSc.Scatter().create(linear, rows, self._values, None)

    def gradient(self, u: Vec, out: Vec) -> float:
        """c + H u into ``out``; W(u)."""
        self.linear.copy(out)
        self.add_product(u, 1.0, out)
        return 0.5 * (self.linear.dot(u) + out.dot(u))

    def add_product(self, du: Vec, factor: float, out: Vec) -> None:
        """Add ``factor H du`` to ``out``."""
        if self.is_linear:
            return
        self._scatter.scatter(du, self._values)
        values = self._values.getArray(readonly=True)
        for (dofs_sm, hessian_smm), places in zip(self._quadratic, self._places, strict=True):
            _add(out, dofs_sm, factor * np.einsum("sij,sj->si", hessian_smm, values[places]))
        out.assemble()

    def add_hessian(self, factor: float, constrained: Int, out: Mat) -> None:
        """Add ``factor H`` to a matrix, which all ranks assemble afterwards.

        Args:
            factor: a number.
            constrained: degrees of freedom of all ranks, whose rows and columns are left out.
            out: the matrix.
        """
        for dofs_sm, hessian_smm in self._quadratic:
            free = np.where(np.isin(dofs_sm, constrained), -1, dofs_sm).astype(PETSc.IntType)
            out.setValuesRCV(free, free, factor * hessian_smm, addv=PETSc.InsertMode.ADD_VALUES)


def _add(vector: Vec, dofs_sm: Int, values_sm: Float) -> None:
    vector.setValues(dofs_sm.astype(PETSc.IntType).ravel(), values_sm.ravel(), addv=PETSc.InsertMode.ADD_VALUES)
