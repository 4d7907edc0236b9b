"""In which ways Newton's method stops, exactly: on systems of two unknowns, one of them prescribed."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from helpers_spring import Admission, Refusal, Spring, at
from mpi4py import MPI

from tmc_vem.solve import factor, packages
from tmc_vem.solve.budget import OutOfBudget
from tmc_vem.solve.factor import FactorState
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.solve.newton import NewtonOptions, NewtonResult, NewtonSolver
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, RegionValues


def solved(system: Spring, x: float, d: float = 1.0, *, minimise: bool = False, **options: Any) -> tuple[Any, Any]:
    u = at(x, d)
    return NewtonSolver(system, NewtonOptions(**options)).solve(u, minimise=minimise), u


def records(result: NewtonResult) -> list[tuple[float, float, float]]:
    return [(i.residual, i.correction, i.step) for i in result.iterations]


# -- Newton's method -------------------------------------------------------------------------------------------------


def test_a_quadratic_potential_takes_one_correction_and_another_to_know_it() -> None:
    system = Spring()
    result, u = solved(system, 0.0)
    assert (result.converged, result.reason, result.negative_pivots) == (True, "converged", 0)
    first, second = records(result)
    assert first == pytest.approx((1 / math.sqrt(2), 0.5, 1.0))
    assert second == (0.0, 0.0, 1.0)
    assert u.getArray().tolist() == pytest.approx([0.5, 1.0])
    assert result.evaluation.energy == pytest.approx(0.25)
    assert result.residual.getArray().tolist() == pytest.approx([0.0, 0.5])


def stiff(factor: float) -> Spring:
    """Its tangent is too stiff: a correction leaves 1 - 1/factor of the residual."""
    return Spring(hessian=lambda x, d: (2.0 * factor, -1.0, 1.0))


def test_a_small_correction_alone_is_no_convergence() -> None:
    result, _ = solved(stiff(2.0), 0.0, correction=1.0, max_iterations=5)
    assert not result.converged
    assert len(result.iterations) == 5
    left = 1.0 * 0.5**5
    assert f"no convergence in 5 iterations (residual {left / math.hypot(left, 0.5 + left / 2):.1e})" == result.reason
    assert [i.correction for i in result.iterations] == pytest.approx([0.25 * 0.5**n for n in range(5)])


def test_a_small_residual_alone_is_no_convergence() -> None:
    """Nor is a shortened correction, however small."""
    result, _ = solved(Spring(), 0.0, residual=1.0, stalled_residual=1.0, max_iterations=1)
    assert not result.converged
    assert result.iterations[0].correction == 0.5
    short = Spring()
    short.reach = 1.0
    result, u = solved(short, 0.0, residual=1.0, correction=1.0, max_iterations=3)
    assert [i.step for i in result.iterations] == [0.9, 0.9, 0.9]
    assert (result.converged, u.getArray()[0]) == (False, pytest.approx(0.5 * (1.0 - 0.1**3)))


@pytest.mark.parametrize(("noise", "converges"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_residual_that_has_stopped_falling_is_rounding_up_to_a_limit(noise: float, converges: bool) -> None:
    """What is left does not depend on the state; relative to the reaction of 1/2 here."""
    rest = Spring(gradient=lambda x, d: ((2 * x - d) + math.copysign(0.25 * noise, 2 * x - d), d - x))
    result, _ = solved(rest, 0.0, correction=1e-3, reuse=0.0)
    assert result.converged is converges
    assert len(result.iterations) == (2 if converges else 20)


def test_a_residual_that_falls_still_goes_on() -> None:
    """A tenth a correction: not stalled, so that the sharp limit counts."""
    result, _ = solved(stiff(1.0 / 0.9), 0.5 + 1e-5, correction=1e-3, reuse=0.0)
    assert result.converged
    assert [i.residual for i in result.iterations] == pytest.approx([4e-5 * 0.1**n for n in range(4)], rel=1e-4)
    slow, _ = solved(stiff(2.0), 0.5 + 4e-7, correction=1e-3, reuse=0.0)  # halves: that is a stall
    assert len(slow.iterations) == 1


@pytest.mark.parametrize(
    ("start", "reuse", "minimise", "tangents"),
    [(0.5 + 0.9e-5, 1e-5, False, 3), (0.5 + 1.2e-5, 1e-5, False, 3), (0.5 + 1.3e-5, 1e-5, False, 4),
     (0.5 + 0.9e-5, 9e-8, False, 3), (0.5 + 0.9e-5, 7e-8, False, 4), (0.5 + 0.9e-5, 0.0, False, 4),
     (0.5 + 0.9e-5, 1e-5, True, 4)],
)  # fmt: skip
def test_a_tangent_serves_twice_after_a_small_correction(
    start: float, reuse: float, minimise: bool, tangents: int
) -> None:
    """Four iterations, each with a tenth of the residual before; the last one has 4 times the start's distance from 1/2
    by 1000, and twice a tenth of it has to be below 1e-8."""
    system = stiff(1.0 / 0.9)
    result, _ = solved(
        system, start, reuse=reuse, minimise=minimise, residual=1e-8, stalled_residual=0.0, correction=1.0
    )
    assert (result.converged, len(result.iterations), system.tangents) == (True, 4, tangents)


def test_a_line_search_that_finds_nothing_puts_the_state_back() -> None:
    """The energy rises along what its gradient calls downhill."""
    system = Spring(energy=lambda x, d: x)
    result, u = solved(system, 0.25)
    assert (result.converged, result.reason) == (False, "the line search found no decrease")
    assert records(result) == [(pytest.approx(0.5 / math.hypot(0.5, 0.75)), 0.25, 0.0)]
    assert u.getArray().tolist() == [0.25, 1.0]
    assert result.evaluation.energy == 0.25
    assert system.evaluations == 1 + 14 + 1, "before, steps from 1 to 2^-13 > 1e-4, and the start again"


@pytest.mark.parametrize(("left", "step"), [(1e-5, 0.5), (3e-4, 1.0)])
def test_a_decrease_must_be_a_part_of_what_the_slope_promises(left: float, step: float) -> None:
    """Armijo's: slope -1/2 and a correction of 1/2 promise 1/2, of which 1e-4 is asked; the energy begins at 0."""
    system = Spring(energy=lambda x, d: 0.0 if x == 0.0 else -left * 0.5 if x == 0.5 else -1.0)
    result, _ = solved(system, 0.0, max_iterations=1)
    assert result.iterations[0].step == step


@pytest.mark.parametrize(("rise", "step"), [(0.9e-12, 1.0), (1.1e-12, 0.0)])
def test_an_increase_within_rounding_is_none(rise: float, step: float) -> None:
    system = Spring(energy=lambda x, d: 2.0 + (rise if x > 0.5 else 2.0 * rise if x < 0.5 else 0.0))
    system.gradient = lambda x, d: (1e-9, 1.0)
    result, _ = solved(system, 0.5, max_iterations=1)
    assert result.iterations[0].step == step


@pytest.mark.parametrize(("reach", "step"), [(0.5, 0.45), (1.2, 1.0)])
def test_a_step_ends_before_the_boundary(reach: float, step: float) -> None:
    system = Spring()
    system.reach = reach
    assert solved(system, 0.0, max_iterations=1)[0].iterations[0].step == pytest.approx(step)
    solver = NewtonSolver(system)
    assert solver.is_admissible(at(0, 0), at(1, 1)) == (0.9 * reach >= 1.0)
    assert solver.predict(at(0, 0), Control(1.0), at(0, 0)) == (0.9 * reach >= 1.0)


def test_no_direction_is_found_where_nothing_is_stiff() -> None:
    """The diagonal is 0, and so are its multiples."""
    result, u = solved(Spring(hessian=lambda x, d: (0.0, -1.0, 1.0)), 0.25)
    assert not result.converged
    assert result.reason.startswith("no direction of descent was found (linear solver: the tangent is singular")
    assert (result.iterations, result.negative_pivots, result.residual) == ((), 0, None)
    assert u.getArray().tolist() == [0.25, 1.0]


def ridge() -> Spring:
    """(x^2 - 1)^2 / 4: a maximum at 0 between minima at -1 and 1."""
    return Spring(
        lambda x, d: (x * x - 1.0) ** 2 / 4, lambda x, d: (x**3 - x, 0.0), lambda x, d: (3 * x * x - 1.0, 0.0, 1.0)
    )


def test_the_diagonal_is_raised_by_powers_of_eight_until_the_tangent_is_positive() -> None:
    """From 1e-9 on the first above 1 is 8^10; from a third of that on it is 8/3 of that."""
    x, factor = 0.1, 8.0**10 * 1e-9
    system, seen = ridge(), list[float]()

    def stop(iteration: Any, done: int) -> None:
        seen.append(iteration.correction)
        raise OutOfBudget

    solver = NewtonSolver(system)
    for _ in range(2):
        with pytest.raises(OutOfBudget):
            solver.solve(at(x, 0.0), minimise=True, on_iteration=stop)
    stiffness = 1.0 - 3 * x * x
    assert seen == pytest.approx([(x - x**3) / (stiffness * (shift - 1.0)) for shift in (factor, factor * 8 / 3)])


class Answers:
    """A linear solver that gives one direction and then one that is good."""

    def __init__(self, solved: bool, direction: float, negative: int | None, lacks_memory: bool) -> None:
        self._first, self.lacks_memory, self.solves = (solved, direction, negative), lacks_memory, 0

    def solve(self, rhs: Any, out: Any) -> bool:
        self.solves += 1
        solved, direction, self._negative = self._first if self.solves == 1 else (True, 1.0, 0)
        out.setArray([direction, 0.0])
        return solved

    def negative_pivots(self) -> int | None:
        return self._negative


@pytest.mark.parametrize(
    ("stable", "answer", "accepted"),
    [
        (True, (True, 1.0, 0), True),
        (True, (True, 1.0, None), True),
        (True, (True, 1.0, 1), False),  # descends, but on a ridge
        (True, (True, -1.0, 0), False),
        (True, (False, 1.0, 0), False),
        (False, (True, 1.0, 1), True),
        (False, (True, -1.0, 1), False),
        (False, (True, -0.9e-4, 1), True),  # next to an equilibrium that is not stable
        (False, (True, -1.1e-4, 1), False),
        (True, (True, -0.9e-4, 1), False),
        (False, (False, 1.0, 0), False),
    ],
)
def test_which_directions_are_taken(stable: bool, answer: tuple[bool, float, int | None], accepted: bool) -> None:
    for lacks_memory in (False, True):
        solver = NewtonSolver(Spring())
        solver._matrix.setDiagonal(at(1.0, 1.0))
        solver._linear = linear = Answers(*answer, lacks_memory)  # type: ignore[assignment]
        solver._rhs.setArray([1.0, 0.0])
        found, pivots = solver._descent_direction(stable)
        assert found is (accepted or not lacks_memory)
        assert (linear.solves, pivots) == (1 if accepted or lacks_memory else 2, answer[2])
        assert solver._shifted is (linear.solves == 2)


def test_a_minimum_is_looked_for_across_a_ridge_and_a_stationary_point_is_not() -> None:
    result, u = solved(ridge(), 1e-5, 0.0)
    assert (result.converged, result.negative_pivots) == (True, 1)
    assert abs(u.getArray()[0]) < 1e-12
    result, u = solved(ridge(), 1e-5, 0.0, minimise=True)
    assert (result.converged, result.negative_pivots) == (True, 0)
    assert u.getArray()[0] == pytest.approx(1.0, abs=1e-12)
    # so far away that the direction to the maximum does not count as near it
    _, u = solved(ridge(), 1e-3, 0.0)
    assert abs(u.getArray()[0]) == pytest.approx(1.0, abs=1e-9)


def test_more_iterations_are_allowed_for_a_minimum() -> None:
    for minimise, limit in ((False, 3), (True, 30)):
        result, _ = solved(stiff(100.0), 0.0, minimise=minimise, max_iterations=3)
        assert len(result.iterations) == limit
        assert result.reason.startswith(f"no convergence in {limit} iterations (residual ")


@pytest.mark.parametrize(("reach", "step"), [(1000.0, 256.0), (284.0, 128.0), (2.3, 2.0), (2.2, 1.0)])
def test_a_step_off_a_ridge_is_doubled_while_the_energy_falls(reach: float, step: float) -> None:
    """Downhill to x = 45, at a slope of 1e-2; up to nine tenths of the way to the boundary."""
    whole = 1e-2 / (8.0**10 * 1e-9 - 1.0)
    system = Spring(lambda x, d: -1e-2 * min(x, 90.0 - x), lambda x, d: (-1e-2, 0.0), lambda x, d: (-1.0, 0.0, 1.0))
    system.reach = reach
    result, _ = solved(system, 0.0, 0.0, minimise=True, max_iterations=1)
    assert result.iterations[0].correction == pytest.approx(whole)
    assert result.iterations[0].step == step


def test_an_inadmissible_state_is_said_with_its_place() -> None:
    system = Spring()
    system.energy = lambda u: Evaluation(0.0, {"spring": RegionValues(0.0, 0.0)}, "J = 0 in cell 3")
    result, _ = solved(system, 0.0)
    assert (result.converged, result.reason) == (False, "inadmissible state (J = 0 in cell 3)")


@pytest.mark.parametrize("most", [0.4, 0.6])
def test_an_equilibrium_that_is_not_admitted_is_none(most: float) -> None:
    solver = NewtonSolver(Spring(), admission=Admission(most))
    result = solver.solve(at(0.0, 1.0))
    assert result.converged == (most > 0.5)
    assert result.reason == ("converged" if most > 0.5 else "bodies overlap")
    assert (result.refusal is None, result.residual is None) == (most > 0.5, most < 0.5)
    assert len(result.iterations) == 2
    assert solver.timer.seconds.keys() >= {"assembly", "linear solve", "overlap"}


def test_a_jump_that_is_not_admitted_is_no_solution() -> None:
    solver = NewtonSolver(Spring(), admission=Admission(1.0, 0.3))
    u = at(0.0, 1.0)
    result = solver.solve(u)
    assert solver.admitted_jump(at(0.3, 1.0), u, result) is result
    refused = solver.admitted_jump(at(0.1, 1.0), u, result)
    assert (refused.converged, refused.reason, refused.residual) == (False, "bodies overlap", None)
    assert isinstance(refused.refusal, Refusal)
    assert refused.iterations == result.iterations
    failed = NewtonResult(False, "before", result.evaluation)
    assert solver.admitted_jump(at(0.1, 1.0), u, failed) is failed
    assert NewtonSolver(Spring()).admitted_jump(at(0.1, 1.0), u, result) is result


# -- the linear solver -----------------------------------------------------------------------------------------------


def test_an_option_that_petsc_refuses_is_said_and_nothing_stays_behind(tmp_path: Any) -> None:
    file = tmp_path / "bad.petsc"
    file.write_text("-tmc_ksp_type nonsense\n-tmc_pc_type none\n")
    database = PETSc.Options()
    database.setValue("tmc_pc_type", "jacobi")
    try:
        with pytest.raises(
            InputError, match=r"PETSc refuses an option of the linear solver \(--petsc, --solver FILE\): .*nonsense"
        ):
            LinearSolver(Spring().create_matrix(), MPI.COMM_SELF, str(file))
        assert database.getAll() == {"tmc_pc_type": "jacobi"}
        file.write_text("-tmc_ksp_type cg\n-tmc_pc_type none\n-tmc_flag\n")
        assert LinearSolver(Spring().create_matrix(), MPI.COMM_SELF, str(file)).ksp.getPC().getType() == "jacobi"
        assert database.getAll() == {"tmc_pc_type": "jacobi"}
    finally:
        database.delValue("tmc_pc_type")


def test_an_iterative_solver_that_gives_up_says_after_how_many_iterations(tmp_path: Any) -> None:
    file = tmp_path / "cg.petsc"
    file.write_text("-tmc_ksp_type cg\n-tmc_pc_type none\n-tmc_ksp_max_it 1\n")
    n = 20
    matrix = PETSc.Mat().createAIJ([n, n], nnz=1)
    for i in range(n):
        matrix.setValue(i, i, 1.0 + i)
    matrix.assemble()
    rhs, out = matrix.createVecs()
    rhs.set(1.0)
    solver = LinearSolver(matrix, MPI.COMM_SELF, str(file))
    assert (solver.ordering, solver.lacks_memory) == ("", False)
    assert not solver.solve(rhs, out)
    assert solver.complaint() == (
        " (linear solver: DIVERGED_MAX_IT after 1 iterations; --solver direct has no such limit)"
    )
    assert (solver.iterations, solver.negative_pivots()) == (1, None)


# -- factorisations --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "failed", "lacks_memory", "said"),
    [
        (FactorState(0, 0, 3, 0, 20), False, False, ""),
        (FactorState(-9, 5, 0, 0, 20), True, True,
         "MUMPS ran out of work space, INFOG(1) = -9, with 20 % more memory than it estimated; a coarser mesh, more "
         "ranks or --solver iterative need less"),
        (FactorState(-13, 5, 0, 0, 20), True, True,
         "there is no memory for the factors, INFOG(1) = -13: 5 numbers asked for; a coarser mesh, more ranks on more "
         "machines or --solver iterative need less"),
        (FactorState(-19, -5, 0, 0, 20), True, True,
         "there is no memory for the factors, INFOG(1) = -19: 5 million numbers asked for; a coarser mesh, more ranks "
         "on more machines or --solver iterative need less"),
        (FactorState(-10, 5, 0, 0, 20), True, False,
         "the tangent is singular, INFOG(1) = -10: something can move freely"),
        (FactorState(-6, 5, 0, 0, 20), True, False, "MUMPS failed, INFOG(1) = -6, INFOG(2) = 5"),
        (FactorState(0, 0, 0, 2, 20), False, False,
         "the tangent is singular (2 null pivots): something can move freely"),
    ],
)  # fmt: skip
def test_what_a_factorisation_says(state: FactorState, failed: bool, lacks_memory: bool, said: str) -> None:
    assert (state.failed, state.lacks_memory, state.complaint()) == (failed, lacks_memory, said)


@pytest.mark.parametrize("wanted", [None, "35"])
def test_work_space_is_asked_for_and_the_user_s_put_back(wanted: str | None) -> None:
    database, name, seen = PETSc.Options(), "odd_mat_mumps_icntl_14", list[Any]()
    ksp: Any = SimpleNamespace(
        getOptionsPrefix=lambda: "odd_", getOperators=lambda: ("A", "P"), getPC=lambda: SimpleNamespace(reset=list),
        setOperators=lambda *given: seen.append(given), setUp=lambda: seen.append(database.getString(name)),
    )  # fmt: skip
    if wanted:
        database.setValue(name, wanted)
    try:
        factor._forget(ksp, 70)
        assert seen == [("A", "P"), "70"]
        assert database.getAll() == ({name: wanted} if wanted else {})
    finally:
        database.delValue(name)


def test_work_space_doubles_until_it_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    states = [FactorState(-9, 0, 0, 0, space) for space in (20, 50, 100)] + [FactorState(0, 0, 0, 0, 200)]
    monkeypatch.setattr(factor, "_forget", lambda ksp, space: asked.append(space))
    monkeypatch.setattr(factor, "factor_state", lambda pc: states[min(len(asked), 3)])
    ksp: Any = SimpleNamespace(getPC=lambda: SimpleNamespace(getType=lambda: "cholesky"), setUp=lambda: None)
    factor.factorise(ksp, None)
    assert asked == [50, 100, 200]
    asked.clear()
    factor.factorise(ksp, FactorState(-9, 0, 0, 0, 35))  # after a failure with what was enough then
    assert asked == [35, 100, 200]


def test_what_petsc_is_built_with_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    there: set[str] = set()
    monkeypatch.setattr(packages, "has", there.__contains__)
    names = ("mumps", "superlu_dist", "metis", "parmetis", "ptscotch", "ml", "hypre")
    assert packages.described() == f"none but its own; without {', '.join(names)}"
    there |= {"mumps", "ml"}
    assert packages.described() == "mumps, ml; without superlu_dist, metis, parmetis, ptscotch, hypre"
    there |= set(names)
    assert packages.described() == ", ".join(names)
