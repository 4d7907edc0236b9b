"""Linear solver presets: what they are, what they refuse, and that they leave PETSc's options as they were."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from petsc4py import PETSc

from tmc_vem.errors import InputError
from tmc_vem.solve.linear import LinearSolver, preset_names, read_options

FACTORISING = ("direct", "reproducible")


def available() -> list[str]:
    """Presets that this PETSc can do: Debian 13's has no ML."""
    missing = () if PETSc.Sys.hasExternalPackage("ml") else ("iterative",)
    return [preset for preset in preset_names() if preset not in missing]


@pytest.mark.skipif("iterative" in available(), reason="this PETSc has ML")
def test_a_preset_that_this_petsc_cannot_do_says_so() -> None:
    with pytest.raises(InputError, match=r"solver 'iterative' preconditions with ML, .* use --solver direct"):
        LinearSolver(matrix(np.full(3, 4.0)), PETSc.COMM_SELF, "iterative")


def matrix(diagonal: Any) -> Any:
    """A tridiagonal matrix with ones beside the diagonal."""
    n = len(diagonal)
    dense = np.diag(np.asarray(diagonal, dtype=float)) + np.eye(n, k=1) + np.eye(n, k=-1)
    made = PETSc.Mat().createAIJ([n, n], nnz=3, comm=PETSc.COMM_SELF)
    for i, j in zip(*np.nonzero(dense), strict=True):
        made.setValue(i, j, dense[i, j])
    made.assemble()
    made.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return made


def solved(solver: LinearSolver, made: Any) -> tuple[bool, float]:
    """Whether it worked, and the largest error against an exact solution."""
    exact, rhs = made.createVecs()
    exact.getArray()[:] = np.arange(1.0, exact.getSize() + 1.0)
    made.mult(exact, rhs)
    out = rhs.duplicate()
    worked = solver.solve(rhs, out)
    return worked, float(np.abs(out.getArray() - exact.getArray()).max())


@pytest.mark.parametrize("preset", available())
def test_presets_solve_and_notice_new_values(preset: str) -> None:
    made = matrix(np.full(30, 4.0))
    solver = LinearSolver(made, PETSc.COMM_SELF, preset)
    for _ in range(2):
        worked, error = solved(solver, made)
        assert worked
        assert error < 1e-4
        made.shift(1.0)


@pytest.mark.parametrize("preset", FACTORISING)
def test_factorisations_count_negative_pivots(preset: str) -> None:
    made = matrix([5.0, -5.0, 5.0, -6.0, -7.0, 5.0])
    solver = LinearSolver(made, PETSc.COMM_SELF, preset)
    assert solved(solver, made)[0]
    assert solver.negative_pivots() == 3


def test_conjugate_gradients_refuse_an_indefinite_matrix_and_say_why(tmp_path: Path) -> None:
    options = tmp_path / "cg.petsc"
    options.write_text("-tmc_ksp_type cg  # no preconditioner\n\n-tmc_pc_type none\n")
    made = matrix([5.0, -5.0, 5.0, 5.0])
    solver = LinearSolver(made, PETSc.COMM_SELF, str(options))
    assert not solved(solver, made)[0]
    assert solver.negative_pivots() == 1
    assert "DIVERGED_INDEFINITE_MAT after" in solver.complaint()
    made = matrix([5.0, 5.0, 5.0, 5.0])
    solver = LinearSolver(made, PETSc.COMM_SELF, str(options))
    assert solved(solver, made)[0]
    assert solver.complaint() == ""
    assert solver.negative_pivots() is None  # none were met, which proves nothing


def test_presets_leave_no_options_behind_and_the_user_wins() -> None:
    database = PETSc.Options()
    database.setValue("tmc_ksp_type", "gmres")
    try:
        solver = LinearSolver(matrix(np.full(5, 4.0)), PETSc.COMM_SELF)
        assert solver.ksp.getType() == "gmres"
        assert database.getAll() == {"tmc_ksp_type": "gmres"}
    finally:
        database.delValue("tmc_ksp_type")


def test_unknown_presets_and_bad_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'fast' is neither one of direct, .*reproducible nor a readable file"):
        read_options("fast")
    bad = tmp_path / "bad.petsc"
    bad.write_text("-tmc_ksp_type cg\nksp_type cg\n")
    with pytest.raises(InputError, match=r"bad\.petsc, line 2: 'ksp_type cg' is not '-option value'"):
        read_options(str(bad))
