"""Newton's method for a potential whose domain is bounded by J > 0.

A loop of our own on PETSc's KSP: SNES of PETSc 3.18 cannot be told from Python that a state is outside the domain, and
its line search gives up on NaN instead of shortening the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.solve.linear import DIRECT, LinearSolver
from tmc_vem.support.distributed import Vec
from tmc_vem.support.timing import Timer
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Admission, Evaluation, NonlinearSystem, Refused

# Fraction of the largest admissible step that is taken at most (fraction-to-the-boundary rule).
TO_THE_BOUNDARY = 0.9
# Sufficient decrease of the potential, as a fraction of what the slope promises (Armijo).
ARMIJO = 1e-4
SHORTEST_STEP = 1e-4
# By how much more slowly the residual falls with the tangent of the iteration before, than the last one fell.
SLOWER = 2.0
STALLED = 0.3  # a residual above this fraction of the one before, where Newton converges quadratically, does not fall
# Multiples of the tangent's diagonal that are added where the tangent is indefinite.
NEAR_EQUILIBRIUM = 1e-4
SMALLEST_SHIFT, LARGEST_SHIFT = 1e-9, 10.0
# Where friction slips, the tangent is nearly singular, and its step leads far beyond the next point that sticks or
# slips back. After a step that had to be cut, points that slip have this fraction of the stiffness of those that stick,
# ten times more after the next; after a full one next to nothing.
FIRST_DAMPING, MORE_DAMPING, LESS_DAMPING = 1e-3, 10.0, 1e-2
DESCENDING = 10  # so many times more iterations does a descent to a far minimum take
# Changes of the energy below this fraction of it are rounding, not information.
ENERGY_ROUNDING = 1e-12
# Without load there are no reactions to compare the residual with: they count as at least this fraction of the largest
# stiffness times the size of the domain.
SMALLEST_REACTION = 1e-6


@dataclass(frozen=True)
class NewtonOptions:
    """Tolerances and limits.

    Attributes:
        residual: largest norm of the residual at free degrees of freedom, relative to the norm with the reactions.
        correction: largest entry of the last full Newton correction, relative to the size of the domain. As the
            iteration converges quadratically, the error left is about the square of it.
        stalled_residual: the same, for a residual that has stopped falling while the corrections are within their
            tolerance: what is left is rounding.
        reuse: correction, relative to the size of the domain, from which on the next iteration takes the tangent and
            its factors again, once, if the residual has fallen so fast that this is expected to be enough; 0 for never.
        max_iterations: after which the load step is given up.
    """

    residual: float = 1e-8
    correction: float = 1e-7
    stalled_residual: float = 1e-6
    reuse: float = 1e-5
    max_iterations: int = 20


@dataclass(frozen=True)
class Iteration:
    """One Newton iteration: relative residual before it, relative correction and the fraction of it that was taken; and
    the correction's Euclidean norm relative to the domain, which does not depend on the axes."""

    residual: float
    correction: float
    step: float
    length: float = 0.0


# What is told of every iteration, with the number of those that a solver has done so far.
OnIteration = Callable[[Iteration, int], None]


@dataclass(frozen=True)
class NewtonResult:
    """Outcome of solving for equilibrium at one load.

    Attributes:
        converged: whether both tolerances were met.
        reason: why it stopped, in words.
        evaluation: potential and extremes at the last state.
        iterations: the iterations, one record each.
        negative_pivots: of the last factorised tangent; above zero the state is unstable. None if unknown.
        residual: gradient of the potential at the equilibrium, with the reactions at constrained degrees of freedom; a
            vector of its own. None if it has not converged.
        refusal: of the state that it has converged to, if that is why it counts as not converged.
    """

    converged: bool
    reason: str
    evaluation: Evaluation
    iterations: tuple[Iteration, ...] = ()
    negative_pivots: int | None = None
    residual: Vec | None = None
    refusal: Refused | None = None


@dataclass(frozen=True)
class Imbalance:
    """How far a state is from equilibrium.

    Attributes:
        evaluation: potential and extremes.
        residual: gradient of the potential; a vector of the solver, to be read before it evaluates another state.
        free, all: norms of the residual at free degrees of freedom, and with the reactions; the latter is at least that
            of the forces.
    """

    evaluation: Evaluation
    residual: Vec
    free: float
    all: float


@dataclass
class NewtonSolver:
    """Newton's method with a line search on the potential; keeps matrix, factorisation and work vectors.

    Args:
        system: what is solved.
        options: tolerances and limits.
        timer: collects the time of each phase.
        solver: preset or file of options of the linear solver, see :mod:`tmc_vem.solve.linear`.
        admission: what else an equilibrium has to fulfil, or None; one that does not counts as not converged.
    """

    system: NonlinearSystem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    timer: Timer = field(default_factory=Timer)
    solver: str = DIRECT
    admission: Admission | None = None

    def __post_init__(self) -> None:
        self._matrix = self.system.create_matrix()
        self._linear = LinearSolver(self._matrix, self.system.comm, self.solver)
        self._residual = self.system.create_vector()
        self._direction = self.system.create_vector()
        self._trial = self.system.create_vector()
        self._rhs = self.system.create_vector()
        self._diagonal = self._matrix.createVecLeft()
        self.last_shift = 0.0  # from a third of which the next one is tried
        self._shifted = False  # whether the matrix is the tangent plus a diagonal
        self.iterations_done = 0  # since the solver was made, whatever became of them

    @property
    def _constrained(self) -> NDArray[np.int32]:
        """Constrained entries of this rank, which stages of a run change."""
        return self.system.constrained()

    @property
    def has_factors(self) -> bool:
        """Whether there are factors of the last tangent, as it is, with which to solve costs little."""
        return self._linear.has_factors and not self._shifted

    @property
    def ordering(self) -> str:
        """What the linear solver has ordered the unknowns by; empty if it is no factorisation."""
        return self._linear.ordering

    @property
    def linear_iterations(self) -> int:
        """Iterations of the linear solver so far; one a solve with a factorisation."""
        return self._linear.iterations

    @property
    def linear_complaint(self) -> str:
        """Why the last linear solve failed, in brackets, or nothing."""
        return self._linear.complaint()

    def set_prescribed(self, u: Vec, position: Control) -> None:
        """Write the displacements that are prescribed at a position on the path into ``u``; forces are those there."""
        self.system.set_position(position)
        u.getArray()[self._constrained] = self.system.prescribed(position)

    def predict(self, u: Vec, position: Control, out: Vec) -> bool:
        """First-order predictor: ``out = u + du`` with the tangent at ``u`` and what is prescribed at a position.

        The residual is that with the forces there, so that ``du`` is what their change does as well.

        Returns:
            Whether the linear solve worked and J stays positive all the way (with a margin).
        """
        self.system.set_position(position)
        self.system.damp_slip(0.0)
        increment = self._trial
        increment.set(0.0)
        increment.getArray()[self._constrained] = (
            self.system.prescribed(position) - u.getArray(readonly=True)[self._constrained]
        )
        with self.timer("assembly"):
            self.system.residual(u, self._residual)
            self.system.jacobian(u, self._matrix)
            self.system.tangent_action(increment, self._rhs)
        self._rhs.axpy(1.0, self._residual)
        self._rhs.scale(-1.0)
        self._clear_constrained(self._rhs)
        with self.timer("linear solve"):
            solved = self._linear.solve(self._rhs, self._direction)
        if not solved:
            return False
        self._direction.axpy(1.0, increment)
        admissible = self.is_admissible(u, self._direction)
        out.waxpy(1.0, self._direction, u)
        return admissible

    def is_admissible(self, u: Vec, du: Vec) -> bool:
        """Whether J stays positive from ``u`` to ``u + du`` and some way beyond."""
        with self.timer("assembly"):
            return self.system.max_step(u, du) * TO_THE_BOUNDARY >= 1.0

    def solve(self, u: Vec, *, minimise: bool = False, on_iteration: OnIteration | None = None) -> NewtonResult:
        """Find equilibrium from ``u``, whose prescribed entries stay as they are; ``u`` is changed in place.

        Args:
            u: start, and the equilibrium afterwards.
            minimise: descend to a stable equilibrium, a minimum of the potential, wherever it is: past a limit point or
                a bifurcation the branch that was followed has ended or is unstable. Else the equilibrium nearest to
                the start is looked for, stable or not.
            on_iteration: called after every iteration; what it raises ends the work.
        """
        limit = self.options.max_iterations * (DESCENDING if minimise else 1)
        iterations: list[Iteration] = []
        evaluation = self._evaluate(u)
        correction, step, pivots, least, reused = math.inf, 0.0, None, 0.0, False
        damping, slips = 0.0, self.system.damp_slip(0.0)
        while True:
            if not evaluation.admissible:
                return NewtonResult(False, f"inadmissible state ({evaluation.worst})", evaluation, tuple(iterations))
            residual, reference = self._norms(evaluation)
            reference = max(reference, least)
            before = iterations[-1].residual if iterations else math.inf
            small = residual <= self.options.residual * reference or (
                # rounding: a stiff body that moves far leaves more of it than the reactions of a soft medium amount to
                STALLED * before * reference <= residual <= self.options.stalled_residual * reference
            )
            full = step == 1.0 and damping == 0.0
            if small and full and correction <= self.options.correction and not (minimise and pivots):
                return self.converged(u, evaluation, tuple(iterations), pivots)
            if len(iterations) >= limit:
                reason = f"no convergence in {limit} iterations (residual {residual / reference:.1e})"
                return NewtonResult(False, reason, evaluation, tuple(iterations), pivots)

            # the tangent of the iteration before is as good as a new one where the state has hardly changed since
            near = step == 1.0 and correction <= self.options.reuse and residual > 0.0
            enough = near and SLOWER * (residual / reference) ** 2 <= self.options.residual * before
            reused = not (reused or self._shifted or minimise or slips) and enough
            if not reused:
                damping = _damping(damping, step) if slips and iterations else 0.0
                self.system.damp_slip(damping)
                with self.timer("assembly"):
                    self.system.jacobian(u, self._matrix)
                self._shifted = False
            if not iterations:
                least = SMALLEST_REACTION * self._largest_stiffness() * self.system.size
            self._residual.copy(self._rhs)
            self._rhs.scale(-1.0)
            self._clear_constrained(self._rhs)
            solved, pivots = self._descent_direction(minimise)
            if not solved:
                reason = f"no direction of descent was found{self.linear_complaint}"
                return NewtonResult(False, reason, evaluation, tuple(iterations), pivots)
            correction = self._direction.norm(3) / self.system.size  # 3 is PETSc's infinity norm
            step, evaluation = self._line_search(u, evaluation, expand=minimise and bool(pivots))
            length = self._direction.norm() / self.system.size
            iterations.append(Iteration(residual / reference if reference else 0.0, correction, step, length))
            self.count(iterations[-1], on_iteration)
            if step == 0.0:
                return NewtonResult(False, "the line search found no decrease", evaluation, tuple(iterations), pivots)

    def converged(
        self, u: Vec, evaluation: Evaluation, iterations: tuple[Iteration, ...], pivots: int | None
    ) -> NewtonResult:
        """The result of an iteration that has converged at ``u``, the state that was evaluated last; a failure if that
        state is not admitted."""
        if self.admission is not None:
            with self.timer("overlap"):
                refused = self.admission.refusal(u, evaluation)
            if refused is not None:
                return NewtonResult(False, refused.sentence(), evaluation, iterations, pivots, refusal=refused)
        return NewtonResult(True, "converged", evaluation, iterations, pivots, self._residual.copy())

    def admitted_jump(self, before: Vec, u: Vec, result: NewtonResult) -> NewtonResult:
        """The result for a state on another branch than the one before, or a failure if it is not admitted there."""
        if self.admission is None or not result.converged:
            return result
        with self.timer("overlap"):
            refused = self.admission.refusal_of_jump(before, u)
        if refused is None:
            return result
        return replace(result, converged=False, reason=refused.sentence(), residual=None, refusal=refused)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """For states beside the path: afterwards the solver goes on as if they had not been solved for."""
        shift = self.last_shift
        try:
            yield
        finally:
            self.last_shift = shift

    def count(self, iteration: Iteration, on_iteration: OnIteration | None) -> None:
        """An iteration is done: tell who wants to know."""
        self.iterations_done += 1
        if on_iteration:
            on_iteration(iteration, self.iterations_done)

    def evaluate(self, u: Vec) -> Imbalance:
        """Potential and residual at ``u``."""
        evaluation = self._evaluate(u)
        return Imbalance(evaluation, self._residual, *self._norms(evaluation))

    def per_load(self, u: Vec, position: Control, out: Vec) -> tuple[bool, int | None]:
        """Change of the equilibrium state at ``u``, which belongs to a position on the path, per load factor.

        Its constrained part, the derivative of what is prescribed, is exact. Afterwards, forces are those there.

        Returns:
            Whether it worked, and the negative pivots of the tangent. The change is in ``out``.
        """
        self.system.set_position(position)
        self.system.damp_slip(0.0)
        out.set(0.0)
        out.getArray()[self._constrained] = self.system.prescribed_per_load(position)
        with self.timer("assembly"):
            self.system.jacobian(u, self._matrix)
            self.system.tangent_action(out, self._rhs)
            self.system.add_residual_per_load(u, position, self._rhs)
        self._rhs.scale(-1.0)
        self._clear_constrained(self._rhs)
        with self.timer("linear solve"):
            solved = self._linear.solve(self._rhs, self._direction)
            pivots = self._linear.negative_pivots()
        out.axpy(1.0, self._direction)
        return solved, pivots

    def linearise(self, u: Vec, position: Control) -> tuple[bool, int | None]:
        """Put the tangent at ``u``, which belongs to a position on the path, together and factorise it.

        Returns:
            Whether it worked, and its negative pivots. :meth:`correction` solves with the factors.
        """
        self.system.set_position(position)
        self.system.damp_slip(0.0)
        with self.timer("assembly"):
            self.system.jacobian(u, self._matrix)
        self._shifted = False
        with self.timer("linear solve"):
            return self._linear.prepare(), self._linear.negative_pivots()

    def correction(self, residual: Vec, out: Vec) -> bool:
        """Newton's correction for a residual with the tangent that :meth:`per_load` or :meth:`linearise` has
        factorised."""
        residual.copy(self._rhs)
        self._rhs.scale(-1.0)
        self._clear_constrained(self._rhs)
        with self.timer("linear solve"):
            return self._linear.solve_again(self._rhs, out)

    def _descent_direction(self, stable: bool) -> tuple[bool, int | None]:
        """Solve for the direction; where the tangent is indefinite, shift it until the direction descends.

        The shift adds a multiple of the absolute diagonal, which respects the contrast between solid and medium. It
        starts from a third of the last one that was needed and grows by powers of 8.

        Returns:
            Whether it worked, and the negative pivots of the tangent without shift.
        """
        pivots: int | None = None
        shift = 0.0
        while shift <= LARGEST_SHIFT:
            if shift > 0.0:
                self._shift_diagonal(shift)
            with self.timer("linear solve"):
                solved = self._linear.solve(self._rhs, self._direction)
                negative = self._linear.negative_pivots()
            if shift == 0.0:
                pivots = negative
            descends = self._rhs.dot(self._direction) > 0.0
            near = shift == 0.0 and self._direction.norm(3) <= NEAR_EQUILIBRIUM * self.system.size
            if solved and (descends and not negative if stable else descends or near):
                self.last_shift = shift if shift > 0.0 else self.last_shift
                return True, pivots
            if self._linear.lacks_memory:
                break
            shift = max(SMALLEST_SHIFT, self.last_shift / 3.0) if shift == 0.0 else 8.0 * shift
        return False, pivots

    def _largest_stiffness(self) -> float:
        """Largest entry of the tangent's diagonal."""
        self._matrix.getDiagonal(self._diagonal)
        return float(self._diagonal.norm(3))

    def _shift_diagonal(self, shift: float) -> None:
        if not self._shifted:
            self._matrix.getDiagonal(self._diagonal)
        diagonal = self._diagonal.duplicate()
        self._diagonal.copy(diagonal)
        diagonal.abs()
        diagonal.scale(shift)
        diagonal.axpy(1.0, self._diagonal)
        self._matrix.setDiagonal(diagonal)
        self._shifted = True
        diagonal.destroy()

    def _line_search(self, u: Vec, before: Evaluation, expand: bool) -> tuple[float, Evaluation]:
        """Move ``u`` along the direction; the fraction taken and the evaluation there, with the residual updated.

        The potential must decrease as Armijo's rule asks. Where the direction does not descend (the tangent is
        indefinite) the admissible step is taken as it is.
        """
        slope = -self._rhs.dot(self._direction)
        with self.timer("assembly"):
            largest = self.system.max_step(u, self._direction)
        step = min(1.0, TO_THE_BOUNDARY * largest)
        rounding = ENERGY_ROUNDING * before.magnitude
        u.copy(self._trial)
        while step >= SHORTEST_STEP:
            u.waxpy(step, self._direction, self._trial)
            evaluation = self._evaluate(u)
            allowed = before.energy + ARMIJO * step * slope + rounding
            if evaluation.admissible and (slope >= 0.0 or evaluation.energy <= allowed):
                if expand and slope < 0.0:
                    return self._expand(u, step, evaluation, TO_THE_BOUNDARY * largest)
                return step, evaluation
            step *= 0.5
        self._trial.copy(u)
        return 0.0, self._evaluate(u)

    def _expand(self, u: Vec, step: float, best: Evaluation, largest: float) -> tuple[float, Evaluation]:
        """Double a step along a direction of descent for as long as the potential falls: the way off a saddle."""
        while 2.0 * step <= largest:
            u.waxpy(2.0 * step, self._direction, self._trial)
            with self.timer("assembly"):
                evaluation = self.system.energy(u)
            if not evaluation.admissible or evaluation.energy >= best.energy:
                break
            step, best = 2.0 * step, evaluation
        u.waxpy(step, self._direction, self._trial)
        return step, self._evaluate(u)

    def _evaluate(self, u: Vec) -> Evaluation:
        with self.timer("assembly"):
            return self.system.residual(u, self._residual)

    def _norms(self, evaluation: Evaluation) -> tuple[float, float]:
        """Norm of the residual at free entries, and of all entries (with the reactions), or of forces if that is more:
        springs may hold a body without any reaction."""
        reference = max(self._residual.norm(), evaluation.forces)
        self._residual.copy(self._rhs)
        self._clear_constrained(self._rhs)
        return self._rhs.norm(), reference

    def _clear_constrained(self, vector: Vec) -> None:
        vector.getArray()[self._constrained] = 0.0


def _damping(before: float, step: float) -> float:
    """Damping of slip in the next tangent, after one with some that has led to a step."""
    if step < 1.0:
        return min(1.0, max(FIRST_DAMPING, MORE_DAMPING * before))
    less = LESS_DAMPING * before
    return less if less >= FIRST_DAMPING else 0.0
