"""Linear solves: MUMPS on the symmetric tangent by default, anything else through PETSc options (prefix ``tmc_``)."""

from __future__ import annotations

import math
from typing import Any

from petsc4py import PETSc

PREFIX = "tmc_"


class LinearSolver:
    """PETSc KSP for the tangent; the symbolic factorisation is done once, as the pattern never changes.

    The default is a direct solve with MUMPS' symmetric factorisation, whose inertia counts negative pivots. Override
    with PETSc options, for example ``-tmc_ksp_type gmres -tmc_pc_type gamg``.
    """

    def __init__(self, matrix: Any, comm: Any) -> None:
        self.ksp = PETSc.KSP().create(comm)
        self.ksp.setOptionsPrefix(PREFIX)
        self.ksp.setOperators(matrix)
        self.ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self.ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(14, 50)  # extra work space, in percent: pivots that are delayed need it
        factor.setMumpsIcntl(24, 1)  # report null pivots instead of dividing by them
        self.ksp.setFromOptions()

    def solve(self, rhs: Any, out: Any) -> bool:
        """Solve with the matrix's present values; whether it worked."""
        self.ksp.setOperators(self.ksp.getOperators()[0])  # the values changed: factorise again
        self.ksp.solve(rhs, out)
        return self.ksp.getConvergedReason() > 0 and math.isfinite(out.norm())

    def solve_again(self, rhs: Any, out: Any) -> bool:
        """Solve with the last factorisation; whether it worked."""
        self.ksp.solve(rhs, out)
        return self.ksp.getConvergedReason() > 0 and math.isfinite(out.norm())

    def negative_pivots(self) -> int | None:
        """Negative eigenvalues of the last factorised matrix, or None if the solver cannot tell."""
        pc = self.ksp.getPC()
        if pc.getType() != PETSc.PC.Type.CHOLESKY:
            return None
        try:
            return int(pc.getFactorMatrix().getInertia()[0])
        except PETSc.Error:
            return None

    def destroy(self) -> None:
        """Free the factorisation."""
        self.ksp.destroy()
