"""Load stepping: from load factor 0 to 1 with a predictor, growth and cut-back of the step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from tmc_vem.errors import InputError
from tmc_vem.solve.newton import NewtonResult, NewtonSolver

DONE = 1e-12
JUMP = 100.0  # load over which a new branch is looked for where the old one ends, in units of the smallest step


@dataclass(frozen=True)
class SteppingOptions:
    """How the load is applied.

    Attributes:
        steps: number of equal steps, or None for automatic ones. Equal steps that fail are halved as often as needed,
            and the next equal load is still hit.
        first, largest, smallest: automatic step sizes, as fractions of the load.
        target_iterations: automatic steps grow while they need fewer iterations than this, and shrink above it.
        growth: largest factor between two steps.
    """

    steps: int | None = None
    first: float = 0.01
    largest: float = 0.1
    smallest: float = 1e-5
    target_iterations: int = 5
    growth: float = 1.5

    def __post_init__(self) -> None:
        if self.steps is not None and not 1 <= self.steps <= 1_000_000:
            raise InputError(f"{self.steps} load steps: use 1 to 1000000")
        if not 0.0 < self.smallest <= self.first <= self.largest <= 1.0:
            raise InputError(
                f"load step sizes need 0 < smallest <= first <= largest <= 1, got {self.smallest:g}, {self.first:g}, "
                f"{self.largest:g}"
            )


@dataclass(frozen=True)
class Step:
    """A converged load step.

    Attributes:
        number: 1 for the first.
        load: load factor reached.
        newton: how it converged.
        cut_backs: failed attempts since the step before.
        wasted_iterations: Newton iterations of those attempts.
        jumped: the branch that was followed ended or bifurcated; this state is a minimum of the potential beyond it.
    """

    number: int
    load: float
    newton: NewtonResult
    cut_backs: int
    wasted_iterations: int
    jumped: bool = False


@dataclass(frozen=True)
class Position:
    """Where the load stepping stands after a converged step; with the last two states, all it needs to go on.

    Attributes:
        load: load factor of the step.
        last_size: its size, 0 if there is nothing to extrapolate from.
        size: size of the next step.
        number: steps so far.
    """

    load: float = 0.0
    last_size: float = 0.0
    size: float = 0.0
    number: int = 0


@dataclass(frozen=True)
class SteppingResult:
    """Where the load stepping ended: the full load, or the last converged one and why not further."""

    load: float
    complete: bool
    reason: str
    failed_iterations: int = 0
    failed_attempts: int = 0


@dataclass
class LoadStepper:
    """Applies the load factor from 0 to 1.

    Args:
        solver: Newton's method for the system.
        options: step sizes.
        on_step: called after every converged step with the step, the state, the state before and the position from
            which the stepping could go on; the residual (with the reactions) is in ``solver.residual``.
    """

    solver: NewtonSolver
    options: SteppingOptions = field(default_factory=SteppingOptions)
    on_step: Callable[[Step, Any, Any, Position], None] | None = None

    def run(self, u: Any, previous: Any = None, start: Position | None = None) -> SteppingResult:
        """Load up to 1.

        Args:
            u: the state to start from; it is left at the last converged state.
            previous: the state before it, if the stepping goes on from a position.
            start: position to go on from; load 0 by default.
        """
        start = start or Position(size=self._first_size())
        previous = u.duplicate() if previous is None else previous
        trial = u.duplicate()
        load, last_size, size, number = start.load, start.last_size, start.size, start.number
        cut_backs, wasted = 0, 0
        while load < 1.0 - DONE:
            target = self._target(load, size)
            result = self._attempt(u, previous, trial, load, last_size, target)
            jumped = False
            if not result.converged:
                cut_backs += 1
                wasted += len(result.iterations)
                size = 0.5 * (target - load)
                if size >= self.options.smallest:
                    continue
                reason = self._why(result, u)
                # the branch that was followed may have ended, at a limit point or a bifurcation
                target = self._target(load, JUMP * self.options.smallest)
                result = self._descend(u, trial, target)
                if not result.converged:
                    return SteppingResult(load, False, reason, wasted + len(result.iterations), cut_backs)
                jumped = True
            u.copy(previous)
            trial.copy(u)
            # there is nothing to extrapolate across a jump to another branch
            taken = target - load
            last_size, load, number = 0.0 if jumped else taken, target, number + 1
            size = self._next_size(size, taken, len(result.iterations), cut_backs > 0 and not jumped)
            if self.on_step:
                step = Step(number, load, result, cut_backs, wasted, jumped)
                self.on_step(step, u, previous, Position(load, last_size, size, number))
            cut_backs, wasted = 0, 0
        return SteppingResult(1.0, True, "full load")

    def _attempt(self, u: Any, previous: Any, trial: Any, load: float, last_size: float, target: float) -> NewtonResult:
        """Try to find equilibrium at ``target`` in ``trial``, starting from an extrapolation or the tangent."""
        if last_size > 0.0:
            increment = previous  # reused below only after it is restored
            ratio = (target - load) / last_size
            trial.waxpy(-1.0, increment, u)
            trial.scale(ratio)
            admissible = self.solver.is_admissible(u, trial)
            if admissible:
                trial.axpy(1.0, u)
                self.solver.set_prescribed(trial, target)
                result = self.solver.solve(trial)
                if result.converged:
                    return result
                spent = result.iterations
            else:
                spent = ()
        else:
            spent = ()
        if not self.solver.predict(u, target, trial):
            evaluation = self.solver.system.energy(u)
            return NewtonResult(False, f"the predictor inverts the mesh ({evaluation.worst})", evaluation, spent)
        result = self.solver.solve(trial)
        return NewtonResult(
            result.converged, result.reason, result.evaluation, (*spent, *result.iterations), result.negative_pivots
        )

    def _descend(self, u: Any, trial: Any, target: float) -> NewtonResult:
        """Look for a stable equilibrium at ``target`` downhill from the last one, with the load moved on."""
        u.copy(trial)
        self.solver.set_prescribed(trial, target)
        return self.solver.solve(trial, minimise=True)

    def _why(self, result: NewtonResult, u: Any) -> str:
        """Why the load cannot be increased, what was tried and what to try."""
        worst = self.solver.system.energy(u).worst
        return (
            f"{result.reason}; smallest {worst}. Tried: steps down to {self.options.smallest:g} of the load, "
            "extrapolated and tangent predictors, descent to another equilibrium. Try a larger alpha_r or gamma, or a "
            "finer medium there"
        )

    def _first_size(self) -> float:
        return 1.0 / self.options.steps if self.options.steps else self.options.first

    def _target(self, load: float, size: float) -> float:
        if self.options.steps:  # the next equal load, unless the step was cut
            following = (int(load * self.options.steps + 1e-9) + 1) / self.options.steps
            return following if load + size > following - DONE else load + size
        target = load + size
        if target > 1.0 - 0.3 * size:  # no sliver of a last step
            return 1.0
        return target

    def _next_size(self, size: float, taken: float, iterations: int, was_cut: bool) -> float:
        options = self.options
        if options.steps:
            return 1.0 / options.steps if not was_cut else taken
        factor = min(options.growth, max(0.5, (options.target_iterations / max(iterations, 1))))
        if was_cut:
            factor = min(factor, 1.0)
        return min(options.largest, taken * factor)
