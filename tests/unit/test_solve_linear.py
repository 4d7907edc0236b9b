"""Linear solver presets: what they are, what they refuse, and that they leave PETSc's options as they were."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_mesh import grid
from helpers_process import process
from helpers_system import make_system, region
from mpi4py import MPI

from tmc_vem import Box, RunOptions, run
from tmc_vem.solve.factor import ORDERINGS
from tmc_vem.solve.linear import LinearSolver, preset_names, read_options
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc

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


def indefinite(n: int = 200) -> Any:
    """A symmetric matrix with a zero diagonal: every pivot is of two rows, half of the eigenvalues are negative."""
    dense = np.random.default_rng(1).normal(size=(n, n))
    dense = dense + dense.T
    np.fill_diagonal(dense, 0.0)
    made = PETSc.Mat().createAIJ([n, n], nnz=n, comm=PETSc.COMM_SELF)
    made.setValues(range(n), range(n), dense)
    made.assemble()
    made.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return made


def with_work_space(preset: str, percent: str, directory: Path) -> str:
    """A file of options: a preset with other work space."""
    options = {name: percent if "icntl_14" in name else value for name, value in read_options(preset).items()}
    path = directory / "space.petsc"
    path.write_text("".join(f"-{name} {value}\n" for name, value in options.items()))
    return str(path)


@pytest.mark.parametrize("preset", FACTORISING)
def test_too_little_work_space_is_made_up_for(preset: str, tmp_path: Path) -> None:
    made = indefinite()
    dense = made.getValues(range(200), range(200))
    solver = LinearSolver(made, PETSc.COMM_SELF, with_work_space(preset, "-90", tmp_path))
    worked, error = solved(solver, made)
    assert worked
    assert error < 1e-8
    assert solver.negative_pivots() == (np.linalg.eigvalsh(dense) < 0.0).sum()
    assert solver.complaint() == ""
    assert not [name for name in PETSc.Options().getAll() if "mumps" in name]
    made.zeroEntries()
    made.shift(2.0)
    worked, error = solved(solver, made)
    assert worked
    assert error < 1e-12
    assert solver.negative_pivots() == 0


@pytest.mark.parametrize("preset", FACTORISING)
def test_a_failed_factorisation_is_no_end_and_has_no_pivots(preset: str, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("tmc_vem.solve.factor.MOST_ENLARGEMENTS", 0)
    made = indefinite()
    solver = LinearSolver(made, PETSc.COMM_SELF, with_work_space(preset, "-90", tmp_path))
    rhs, out = made.createVecs()
    rhs.set(1.0)
    assert not solver.solve(rhs, out)
    assert solver.lacks_memory
    assert solver.negative_pivots() is None
    assert not solver.solve_again(rhs, out)
    assert "MUMPS ran out of work space, INFOG(1) = -9, with " in solver.complaint()
    assert "memory" in solver.complaint()
    monkeypatch.undo()
    made.scale(2.0)
    assert solver.solve(rhs, out)
    assert not solver.lacks_memory
    assert solver.negative_pivots() is not None


@pytest.mark.parametrize("preset", FACTORISING)
def test_a_singular_matrix_does_not_solve_equations_that_contradict_each_other(preset: str) -> None:
    made = matrix([1.0, 2.0, 2.0, 2.0, 1.0])
    for i in range(5):  # the stiffness of a chain of springs that nothing holds
        for j in {max(i - 1, 0), min(i + 1, 4)} - {i}:
            made.setValue(i, j, -1.0)
    made.assemble()
    solver = LinearSolver(made, PETSc.COMM_SELF, preset)
    rhs, out = made.createVecs()
    rhs.set(1.0)
    assert not solver.solve(rhs, out)
    assert solver.negative_pivots() == 0
    assert solver.complaint() == " (linear solver: the tangent is singular (1 null pivots): something can move freely)"
    rhs.setArray([1.0, 0.0, 0.0, 0.0, -1.0])  # balanced
    assert solver.solve(rhs, out)
    assert out.getArray()[0] - out.getArray()[-1] == pytest.approx(4.0)


@pytest.mark.parametrize("preset", FACTORISING)
@pytest.mark.parametrize("cells", [4, 16])
def test_rigid_motions_of_a_free_body_are_not_negative_whatever_rounding_says(preset: str, cells: int) -> None:
    """MUMPS' own threshold counts 1 to 3 of the three as negative here, and takes the others for stiffness."""
    system = make_system(grid(cells, cells), region("solid", K=50.0, mu=10.0), comm=MPI.COMM_SELF)
    u, rhs, out = (system.create_vector() for _ in range(3))
    tangent = system.create_matrix()
    system.jacobian(u, tangent)
    rhs.set(1.0)
    solver = LinearSolver(tangent, PETSc.COMM_SELF, preset)
    assert not solver.solve(rhs, out)
    assert solver.negative_pivots() == 0
    assert "something can move freely" in solver.complaint()


def test_a_solver_that_lives_as_long_as_its_process_does_not_crash_it() -> None:
    """PETSc is finalised after Python: a preconditioner written in Python has to be gone by then."""
    code = (
        "from tmc_vem.support.petsc import PETSc\n"
        "from tmc_vem.solve.linear import LinearSolver\n"
        "matrix = PETSc.Mat().createAIJ([2, 2], nnz=2, comm=PETSc.COMM_SELF)\n"
        "for i in (0, 1): matrix.setValue(i, i, 2.0)\n"
        "matrix.assemble()\n"
        "rhs, out = matrix.createVecs()\n"
        "rhs.set(1.0)\n"
        "solver = LinearSolver(matrix, PETSc.COMM_SELF, 'reproducible')\n"
        "assert solver.solve(rhs, out)\n"
    )
    done = process(["-c", code], timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("number", "name"), [(0, "AMD"), (4, "PORD"), (6, "QAMD")])
def test_the_ordering_that_was_used_is_told(number: int, name: str) -> None:
    database = PETSc.Options()
    database.setValue("tmc_mat_mumps_icntl_7", number)
    try:
        solver = LinearSolver(matrix(np.full(400, 4.0)), PETSc.COMM_SELF, "direct")
        assert solver.ordering == ""
        assert solved(solver, solver.ksp.getOperators()[0])[0]
        assert solver.ordering == name
    finally:
        database.delValue("tmc_mat_mumps_icntl_7")


def test_results_have_the_ordering() -> None:
    result = run(Box(cells=(20, 5), uy=-0.02), options=RunOptions(steps=1))
    assert result.parallel["ordering"] in ORDERINGS.values()
