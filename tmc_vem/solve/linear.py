"""Linear solves, all through PETSc options with the prefix ``tmc_``; presets are files of such options.

``direct`` (the default), ``reproducible`` and ``iterative`` are in ``tmc_vem/solve/presets``; any other file will do.
Options that are in PETSc's database already (from ``--petsc`` or ``PETSC_OPTIONS``) win over those of a preset.
"""

from __future__ import annotations

import atexit
import math
import shlex
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tmc_vem.solve.factor import FactorState, factor_state, factorise
from tmc_vem.solve.packages import has
from tmc_vem.support.distributed import Comm, Ksp, Mat, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc

PREFIX = "tmc_"
DIRECT = "direct"
# PETSc's error codes for options: not supported, wrong or out of range, of an unknown type, of a missing package
BAD_OPTION = (56, 60, 62, 63, 86, 92)
# Residual of a direct solution, relative to the right-hand side, above which the matrix is singular up to rounding and
# the equations contradict each other. It is below 1e-8 for gamma down to 1e-6 and J down to 1e-4, and 1 if they do.
INCONSISTENT = 1e-3
CONTRADICTION = "the tangent is singular up to rounding: something can move freely"
_PRESETS = Path(__file__).parent / "presets"
PETSC_PYTHON = "python"
# Solvers with a preconditioner in Python. PETSc is finalised after Python and would still call it: they are destroyed
# when Python ends. Not before by us: ranks collect garbage at times of their own, and to destroy is collective.
_in_python: list[weakref.ref[LinearSolver]] = []


@atexit.register
def _destroy_in_python() -> None:
    for reference in _in_python:
        solver = reference()
        if solver is not None:
            solver.ksp.destroy()


def preset_names() -> list[str]:
    """Names of the presets that come with the program."""
    return sorted(path.stem for path in _PRESETS.glob("*.petsc"))


def read_options(solver: str) -> dict[str, str]:
    """PETSc options, without their dash, of a preset or of a file.

    Raises:
        InputError: there is neither a preset nor a file of that name, or a line of it is not an option.
    """
    path = _PRESETS / f"{solver}.petsc" if solver in preset_names() else Path(solver)
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        names = ", ".join(preset_names())
        raise InputError(f"solver '{solver}' is neither one of {names} nor a readable file ({reason})") from None
    options = {}
    for number, line in enumerate(lines, start=1):
        words = shlex.split(line, comments=True)
        if not words:
            continue
        if not words[0].startswith("-") or len(words) > 2:
            raise InputError(f"{path}, line {number}: '{line.strip()}' is not '-option value'")
        options[words[0][1:]] = words[1] if len(words) == 2 else ""
    return options


class LinearSolver:
    """PETSc KSP for the tangent; its pattern never changes, so symbolic work is done once.

    Args:
        matrix: the tangent.
        comm: its ranks.
        solver: a preset, or a file of PETSc options.

    Raises:
        InputError: there is no such preset or file, or PETSc refuses an option's value. A factorisation reads its
            options when something is solved for the first time, so that :meth:`solve` may raise this too.
    """

    def __init__(self, matrix: Mat, comm: Comm, solver: str = DIRECT) -> None:
        self._options = read_options(solver)
        self.iterations = 0
        self._factor: FactorState | None = None  # of the last factorisation, where nothing but it solves
        self._solves = True  # whether what came out fulfils the equations
        self.ksp: Ksp = PETSc.KSP().create(comm)
        self.ksp.setOptionsPrefix(PREFIX)
        self.ksp.setOperators(matrix)
        with self._in_database():
            wanted = PETSc.Options().getString(f"{PREFIX}pc_type", "")
            if wanted == PETSc.PC.Type.ML and not has("ml"):
                raise InputError(
                    f"solver '{solver}' preconditions with ML, and this PETSc is built without it, as Debian 13's and "
                    "that of wheels: use --solver direct, or a file of PETSc options with another preconditioner"
                )
            self.ksp.setFromOptions()
        if self.ksp.getPC().getType() == PETSC_PYTHON:
            _in_python.append(weakref.ref(self))

    def solve(self, rhs: Vec, out: Vec) -> bool:
        """Solve with the matrix's present values; whether it worked."""
        self.ksp.setOperators(self.ksp.getOperators()[0])  # the values changed: factorise again
        before, self._factor, self._solves = self._factor, None, True
        with self._in_database():  # factorisations read their options when they are made
            factorise(self.ksp, before)
            self.ksp.solve(rhs, out)
        self._factor = factor_state(self.ksp.getPC()) if self.ksp.getType() == PETSc.KSP.Type.PREONLY else None
        self.iterations += self.ksp.getIterationNumber()
        return self._worked(rhs, out)

    def prepare(self) -> bool:
        """Factorise the matrix's present values, for :meth:`solve_again`; whether that worked."""
        self.ksp.setOperators(self.ksp.getOperators()[0])
        before, self._factor, self._solves = self._factor, None, True
        with self._in_database():
            factorise(self.ksp, before)
        self._factor = factor_state(self.ksp.getPC()) if self.ksp.getType() == PETSc.KSP.Type.PREONLY else None
        return self._factor is None or not self._factor.failed

    def solve_again(self, rhs: Vec, out: Vec) -> bool:
        """Solve with the last factorisation; whether it worked."""
        if self._factor and self._factor.failed:
            return False
        self.ksp.solve(rhs, out)
        return self._worked(rhs, out)

    def _worked(self, rhs: Vec, out: Vec) -> bool:
        """Whether there is a solution. A singular factorisation hands out a vector too, which solves nothing."""
        if self.ksp.getConvergedReason() <= 0 or not math.isfinite(out.norm()):
            return False
        if self._factor is None:
            return True
        left = rhs.duplicate()
        self.ksp.getOperators()[0].mult(out, left)
        left.axpy(-1.0, rhs)
        self._solves = left.norm() <= INCONSISTENT * rhs.norm()
        left.destroy()
        return self._solves

    @property
    def ordering(self) -> str:
        """What the last factorisation has ordered the unknowns by; empty if there is none or it cannot tell."""
        return self._factor.ordering if self._factor is not None else ""

    @property
    def has_factors(self) -> bool:
        """Whether the last matrix is factorised, and nothing else is needed to solve with it."""
        return self._factor is not None and not self._factor.failed

    @property
    def lacks_memory(self) -> bool:
        """Whether the last factorisation failed because memory was short: no other matrix of this size will do."""
        return self._factor is not None and self._factor.lacks_memory

    def negative_pivots(self) -> int | None:
        """Negative eigenvalues of the last matrix, or None if the solver cannot tell.

        Pivots that are zero up to rounding do not count: their sign is that of the rounding. Conjugate gradients tell
        only that there is one, when they meet a direction of negative curvature: 1 is a lower bound then, and the solve
        has failed. Meeting none proves nothing.
        """
        if self.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT:
            return 1
        pc = self.ksp.getPC()
        if self.ksp.getType() != PETSc.KSP.Type.PREONLY:  # the factors may be those of another matrix, or rough
            return None
        if self._factor is not None:
            return None if self._factor.failed else self._factor.negative_pivots
        if pc.getType() != PETSc.PC.Type.CHOLESKY or self.ksp.getConvergedReason() <= 0:
            return None
        try:
            return int(pc.getFactorMatrix().getInertia()[0])
        except PETSc.Error:
            return None

    def complaint(self) -> str:
        """Why the last solve failed, with the remedy, in brackets; empty if there is nothing to say."""
        if self._factor is not None:
            said = self._factor.complaint() or ("" if self._solves else CONTRADICTION)
            return f" (linear solver: {said})" if said else ""
        reason = self.ksp.getConvergedReason()
        if reason > 0 or self.ksp.getType() == PETSc.KSP.Type.PREONLY:
            return ""
        name = next(key for key, value in vars(PETSc.KSP.ConvergedReason).items() if value == reason)
        iterations = self.ksp.getIterationNumber()
        return f" (linear solver: {name} after {iterations} iterations; --solver direct has no such limit)"

    def destroy(self) -> None:
        """Free the factorisation."""
        self.ksp.destroy()

    @contextmanager
    def _in_database(self) -> Iterator[None]:
        """Put the options into PETSc's database where the user has not set them, and take them out again."""
        database = PETSc.Options()
        added = {name: value for name, value in self._options.items() if not database.hasName(name)}
        for name, value in added.items():
            database.setValue(name, value or None)
        try:
            yield
        except PETSc.Error as error:
            if error.ierr not in BAD_OPTION:
                raise
            said = str(error).strip().splitlines()[-1].partition("] ")[2]
            raise InputError(f"PETSc refuses an option of the linear solver (--petsc, --solver FILE): {said}") from None
        finally:
            for name in added:
                database.delValue(name)
