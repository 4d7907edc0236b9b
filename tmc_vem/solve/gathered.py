"""A factorisation of the whole matrix on rank 0 as a PETSc preconditioner: no sum depends on what arrives first."""

from __future__ import annotations

from typing import Any

import numpy as np

from tmc_vem.solve.factor import FactorState, factor_state, factorise
from tmc_vem.support.distributed import Ksp, Mat, Pc, Vec
from tmc_vem.support.petsc import PETSc


class GatheredFactor:
    """PC of type 'python'; options of the factorisation have ``gathered_`` behind the prefix of the outer solver."""

    def __init__(self) -> None:
        self._ksp: Ksp | None = None
        self._rows: Any = None
        self._gathered: Mat | None = None
        self._scatter: Any = None
        self._whole: Vec | None = None
        self._solution: Vec | None = None
        self._state: FactorState | None = None

    def setUp(self, pc: Pc) -> None:
        """Bring the matrix to rank 0 and factorise it there."""
        matrix = pc.getOperators()[1]
        comm = matrix.getComm().tompi4py()
        here = matrix.getSize()[0] if comm.rank == 0 else 0
        if self._rows is None:
            self._rows = PETSc.IS().createStride(here, step=1, comm=comm)
            self._scatter, self._whole = PETSc.Scatter.toZero(matrix.createVecRight())
            self._solution = self._whole.duplicate()
        self._gathered = matrix.createSubMatrix(self._rows, self._rows, self._gathered)
        local = self._gathered.getDiagonalBlock()
        if comm.rank == 0:
            prefix = f"{pc.getOptionsPrefix() or ''}gathered_"
            local.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            if self._ksp is None:
                self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
                self._ksp.setOptionsPrefix(prefix)
                self._ksp.setType(PETSc.KSP.Type.PREONLY)
                self._ksp.setFromOptions()
            self._ksp.setOperators(local)
            factorise(self._ksp, self._state)
            self._state = factor_state(self._ksp.getPC())

    def apply(self, pc: Pc, rhs: Vec, out: Vec) -> None:
        """``out`` = inverse of the matrix times ``rhs``; not numbers if there is no factor."""
        self._scatter.scatter(rhs, self._whole)
        if self._ksp is not None and self._whole is not None and self._solution is not None:
            self._ksp.solve(self._whole, self._solution)
            if self._ksp.getConvergedReason() <= 0:
                self._solution.set(np.nan)
        self._scatter.scatter(self._solution, out, mode=PETSc.ScatterMode.REVERSE)

    def factor_state(self, pc: Pc) -> FactorState | None:
        """What the factorisation on rank 0 says; called on all ranks."""
        comm = pc.getComm().tompi4py()
        state: FactorState | None = comm.bcast(self._state)
        return state
