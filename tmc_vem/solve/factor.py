"""A factorisation that recovers from too little work space, and tells what it found.

PETSc hands the matrix to MUMPS again only if the factorisation before did not fail: after a single shortage of work
space every later one, of whatever matrix, would fail with it. Status codes are those of the MUMPS user's guide,
section 8.
"""

from __future__ import annotations

from dataclasses import dataclass

from tmc_vem.support.distributed import Ksp, Pc
from tmc_vem.support.petsc import PETSc

WORK_SPACE_TOO_SMALL = (-8, -9, -14, -15)  # ICNTL(14), the percentage by which it exceeds the estimate, is too low
NO_MEMORY = (-13, -19)
SINGULAR = -10
ORDERINGS = {0: "AMD", 1: "given", 2: "AMF", 3: "SCOTCH", 4: "PORD", 5: "METIS", 6: "QAMD"}
PARALLEL_ORDERINGS = {1: "PT-SCOTCH", 2: "ParMETIS"}
MOST_ENLARGEMENTS = 10  # each at least doubles the percentage, from 50 to 51 200


@dataclass(frozen=True)
class FactorState:
    """What the last factorisation says, the same on all ranks.

    Attributes:
        status: INFOG(1), negative if it failed.
        detail: INFOG(2), what the status is about.
        negative_pivots: INFOG(12); of no meaning if it failed.
        null_pivots: INFOG(28), pivots that are zero up to rounding; neither negative nor positive.
        work_space: ICNTL(14), percent.
        ordering: what MUMPS has ordered the unknowns by, INFOG(7) and INFOG(32); it depends on what it is built with.
    """

    status: int
    detail: int
    negative_pivots: int
    null_pivots: int
    work_space: int
    ordering: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no factor."""
        return self.status < 0

    @property
    def lacks_memory(self) -> bool:
        """Whether it failed because memory or work space was short."""
        return self.status in (*WORK_SPACE_TOO_SMALL, *NO_MEMORY)

    def complaint(self) -> str:
        """What went wrong, in words; empty if nothing did."""
        if self.status in WORK_SPACE_TOO_SMALL:
            return (
                f"MUMPS ran out of work space, INFOG(1) = {self.status}, with {self.work_space} % more memory than it "
                "estimated; a coarser mesh, more ranks or --solver iterative need less"
            )
        if self.status in NO_MEMORY:
            amount = f"{self.detail} numbers" if self.detail >= 0 else f"{-self.detail} million numbers"
            return (
                f"there is no memory for the factors, INFOG(1) = {self.status}: {amount} asked for; a coarser mesh, "
                "more ranks on more machines or --solver iterative need less"
            )
        if self.status == SINGULAR:
            return f"the tangent is singular, INFOG(1) = {self.status}: something can move freely"
        if self.failed:
            return f"MUMPS failed, INFOG(1) = {self.status}, INFOG(2) = {self.detail}"
        if self.null_pivots:
            return f"the tangent is singular ({self.null_pivots} null pivots): something can move freely"
        return ""


def factor_state(pc: Pc) -> FactorState | None:
    """State of a preconditioner that is a MUMPS factorisation, None for any other; collective if it is gathered."""
    if pc.getType() == PETSc.PC.Type.PYTHON:
        tell = getattr(pc.getPythonContext(), "factor_state", None)
        state: FactorState | None = tell(pc) if tell else None
        return state
    if pc.getType() not in (PETSc.PC.Type.CHOLESKY, PETSc.PC.Type.LU) or pc.getFactorSolverType() != "mumps":
        return None
    try:
        factor = pc.getFactorMatrix()
        status, detail, negative, null = (int(factor.getMumpsInfog(k)) for k in (1, 2, 12, 28))
        names = PARALLEL_ORDERINGS if factor.getMumpsInfog(32) == 2 else ORDERINGS
        ordering = names.get(int(factor.getMumpsInfog(7)), "")
        return FactorState(status, detail, negative, null, int(factor.getMumpsIcntl(14)), ordering)
    except PETSc.Error:  # nothing has been factorised yet
        return None


def factorise(ksp: Ksp, before: FactorState | None) -> None:
    """Factorise the matrix of a KSP; where its work space is too small, again with more.

    What was enough once is kept. A failure of another kind is left for :func:`factor_state` to tell. With a
    preconditioner that is no factorisation this only sets it up.

    Args:
        ksp: whose matrix.
        before: state of its last factorisation, None if there was none: asking PETSc 3.22 would make one without
            its options.
    """
    pc = ksp.getPC()
    if before and before.failed and pc.getType() != PETSc.PC.Type.PYTHON:
        _forget(ksp, before.work_space)
    else:
        ksp.setUp()
    for _ in range(MOST_ENLARGEMENTS):
        state = factor_state(pc)
        if pc.getType() == PETSc.PC.Type.PYTHON or state is None or state.status not in WORK_SPACE_TOO_SMALL:
            return
        _forget(ksp, max(2 * state.work_space, 50))


def _forget(ksp: Ksp, space: int) -> None:
    """Factorise from the beginning, the analysis included, with a percentage of extra work space."""
    database, name = PETSc.Options(), f"{ksp.getOptionsPrefix() or ''}mat_mumps_icntl_14"
    wanted = database.getString(name) if database.hasName(name) else None
    database.setValue(name, space)
    try:
        operators = ksp.getOperators()
        ksp.getPC().reset()  # lets go of these too
        ksp.setOperators(*operators)
        ksp.setUp()
    finally:
        if wanted is None:
            database.delValue(name)
        else:
            database.setValue(name, wanted)
