"""Pseudo-arc-length continuation: the load is an unknown, so that a branch is followed through its limit points.

H. B. Keller, Numerical solution of bifurcation and nonlinear eigenvalue problems (1977): besides r(u, lambda) = 0 a
step fulfils t_u . (u - u0) + t_lambda (lambda - lambda0) = ds, with the branch's unit tangent t at the last state.
Where the tangent of load control is singular, that of this system is not. Displacements count by their mean square over
the nodes, relative to the largest prescribed one, so that the load factor and they are of one size; where none is
prescribed and forces alone act, relative to a tenth of the domain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from tmc_vem.solve.budget import OutOfBudget
from tmc_vem.solve.newton import TO_THE_BOUNDARY, Iteration, NewtonResult, NewtonSolver, OnIteration
from tmc_vem.solve.states import States
from tmc_vem.solve.stepping import OnStep, Step, StepperState, SteppingResult
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control

# A residual that grows by this factor in one correction is on its way to nowhere.
DIVERGED = 1e3
# Length of a step relative to its part along the tangent: 45 degrees. A longer one has met another part of the branch.
STRAIGHT = 1.4
# Displacements that count like the load factor 1 where none is prescribed, as a fraction of the domain's size.
UNDER_FORCES = 0.1

REMEDY = "Try smaller cells there, or larger alpha_r or gamma"


@dataclass(frozen=True)
class ArcOptions:
    """Steps along the branch.

    Attributes:
        first, largest, smallest: sizes.
        target_iterations: steps grow while they need fewer, and shrink above.
        growth: largest factor between two steps.
        max_iterations: after which a step is given up.
        max_steps: after which the whole is given up: a branch need not lead to the full load.
    """

    first: float = 0.01
    largest: float = 0.1
    smallest: float = 1e-6
    target_iterations: int = 4
    growth: float = 1.5
    max_iterations: int = 12
    max_steps: int = 5000

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise InputError(
                f"arc lengths need 0 < smallest <= first <= largest, got {self.smallest:g}, {self.first:g}, "
                f"{self.largest:g}"
            )


@dataclass
class ArcLengthStepper:
    """Follows the branch that begins without load until the full load is reached for the first time.

    Args:
        solver: Newton's method for the system, whose matrix and factorisation are used.
        options: step sizes.
        on_step, on_iteration: as for :class:`tmc_vem.solve.stepping.LoadStepper`; a step's time is the length of the
            branch so far.
    """

    solver: NewtonSolver
    options: ArcOptions = field(default_factory=ArcOptions)
    on_step: OnStep | None = None
    on_iteration: OnIteration | None = None

    def __post_init__(self) -> None:
        system = self.solver.system
        self._direction, self._trial, self._before, self._along, self._at_load = (
            system.create_vector() for _ in range(5)
        )
        self._tangent_at, self._t_load = math.nan, math.nan
        # the largest prescribed displacement is as long as the load factor 1
        largest = float(np.abs(system.prescribed(Control(1.0))).max(initial=0.0))
        largest = max(system.comm.allgather(largest))
        self._weight = 1.0 / (largest or UNDER_FORCES * system.size) ** 2

    def run(self, u: Vec, states: States | None = None, position: StepperState | None = None) -> SteppingResult:
        """Follow the branch.

        Args:
            u: the state to start from, without load; it is left at the last converged state.
            states, position: to go on from, as ``on_step`` was given them; the beginning by default.
        """
        if states is None or position is None:
            states, position = States(u), StepperState(size=self.options.first)
            states.append(np.array([0.0, 0.0]), u)  # length of the branch, load factor
        cut_backs, done, last, refusal = 0, self.solver.iterations_done, None, None
        load = float(states.controls[-1][1])
        try:
            while position.number < self.options.max_steps:
                result, reached = self._attempt(u, states, position.size)
                if not result.converged:
                    cut_backs, refusal = cut_backs + 1, result.refusal or refusal
                    position = replace(position, size=0.5 * position.size)
                    if position.size >= self.options.smallest:
                        continue
                    wasted = self.solver.iterations_done - done
                    why, remedy = (refusal.sentence(), refusal.advice()) if refusal else (result.reason, REMEDY)
                    reason = (
                        f"{why}; smallest {self.solver.system.energy(u).worst}. Tried: steps along the "
                        f"branch down to {self.options.smallest:g}. {remedy}"
                    )
                    return self._ended(load, reason, last, wasted, cut_backs)
                length = position.time + self._distance(self._trial, u, reached - load)
                self._trial.copy(u)
                load = reached
                states.append(np.array([length, load]), u)
                wanted, needed = self.options.target_iterations, max(len(result.iterations), 1)
                factor = self.options.growth if needed < wanted else max(0.5, wanted / needed)
                size = min(self.options.largest, position.size * min(factor, 1.0 if cut_backs else factor))
                position = StepperState(length, size, position.number + 1)
                wasted = self.solver.iterations_done - done - len(result.iterations)
                last = Step(position.number, length, Control(load), result, cut_backs, wasted)
                cut_backs, done, refusal = 0, self.solver.iterations_done, None
                if self.on_step:  # it may solve beside the branch
                    self.on_step(last, states, position)
                    done = self.solver.iterations_done
                if load == 1.0:
                    return self._ended(load, "full load", last, complete=True)
        except OutOfBudget as limit:
            return self._ended(load, str(limit), last, self.solver.iterations_done - done, cut_backs)
        return self._ended(load, f"the branch was followed for {self.options.max_steps} steps", last)

    def _ended(
        self,
        load: float,
        reason: str,
        last: Step | None,
        wasted: int = 0,
        cut_backs: int = 0,
        *,
        complete: bool = False,
    ) -> SteppingResult:
        self.solver.system.set_position(Control(load))
        linear = (self.solver.linear_iterations, self.solver.ordering)
        return SteppingResult(load, complete, reason, wasted, cut_backs, last, *linear)

    def _attempt(self, u: Vec, states: States, size: float) -> tuple[NewtonResult, float]:
        """One step of a length, into ``trial``: how it converged, and the load factor."""
        load = float(states.controls[-1][1])
        if len(states) == 1:  # the first step is one of load control
            return self._at(u, Control(load + size), None), load + size
        t_load = self._set_direction(u, states)
        if not math.isfinite(t_load):
            return NewtonResult(False, "the tangent could not be factorised", self.solver.system.energy(u)), load
        target = load + size * t_load
        if target >= 1.0 > load:  # the end of the path is hit exactly, under load control
            share = (1.0 - load) / t_load
            self._trial.waxpy(share, self._direction, u)
            return self._at(u, Control(1.0), self._trial), 1.0
        return self._correct(u, load, target, t_load, size)

    def _set_direction(self, u: Vec, states: States) -> float:
        """Unit tangent of the branch, away from the state before; its part of the load factor, NaN if there is none."""
        length = float(states.controls[-1][0])
        if self._tangent_at != length:  # not again for a shorter step from the same state
            self._tangent_at, self._t_load = length, math.nan
            solved, _ = self.solver.per_load(u, Control(float(states.controls[-1][1])), self._direction)
            size = math.sqrt(1.0 + self._dot(self._direction, self._direction))
            if solved and math.isfinite(size):
                change = float(states.controls[-1][1] - states.controls[-2][1])
                self._before.waxpy(-1.0, states.vectors[-2], u)
                forward = math.copysign(1.0, self._dot(self._direction, self._before) + change)
                self._direction.scale(forward / size)
                self._t_load = forward / size
        return self._t_load

    def _distance(self, a: Vec, b: Vec, load_change: float) -> float:
        self._before.waxpy(-1.0, b, a)
        return math.sqrt(load_change**2 + self._dot(self._before, self._before))

    def _dot(self, a: Vec, b: Vec) -> float:
        """Mean product of displacements, relative to the largest prescribed one."""
        return float(a.dot(b) * self._weight / (a.getSize() / 2))

    def _at(self, u: Vec, position: Control, guess: Vec | None) -> NewtonResult:
        """Equilibrium at a given load, from a guess or the tangent predictor."""
        if guess is None:
            if not self.solver.predict(u, position, self._trial):
                evaluation = self.solver.system.energy(u)
                return NewtonResult(False, f"the predictor inverts the mesh ({evaluation.worst})", evaluation)
        else:
            self.solver.set_prescribed(self._trial, position)
        return self.solver.solve(self._trial, on_iteration=self.on_iteration)

    def _correct(self, u: Vec, load: float, target: float, t_load: float, size: float) -> tuple[NewtonResult, float]:
        """Newton's method for equilibrium and length together, from the predicted state."""
        solver, system = self.solver, self.solver.system
        self._before.set(0.0)
        self._before.axpy(size, self._direction)
        reach = system.max_step(u, self._before) * TO_THE_BOUNDARY
        if reach < 1.0:
            return NewtonResult(False, "the predictor inverts the mesh", system.energy(u)), load
        self._trial.waxpy(size, self._direction, u)
        solver.set_prescribed(self._trial, Control(target))
        now, iterations, before = target, list[Iteration](), math.inf
        correction, pivots = math.inf, None
        while True:
            state = solver.evaluate(self._trial)
            evaluation, residual, reference = state.evaluation, state.free, state.all
            if not evaluation.admissible:
                return NewtonResult(False, f"inadmissible state ({evaluation.worst})", evaluation, ()), load
            relative = residual / reference if reference else 0.0
            if relative <= solver.options.residual and correction <= solver.options.correction:
                if self._distance(self._trial, u, now - load) > STRAIGHT * size:
                    reason = "the branch turns too sharply for the step, or it is another branch"
                    return NewtonResult(False, reason, evaluation, tuple(iterations), pivots), load
                return solver.converged(self._trial, evaluation, tuple(iterations), pivots), now
            if len(iterations) >= self.options.max_iterations or residual > DIVERGED * before:
                reason = f"no convergence along the branch in {len(iterations)} iterations (residual {relative:.1e})"
                return NewtonResult(False, reason, evaluation, tuple(iterations), pivots), load
            before = residual
            solved, pivots = solver.per_load(self._trial, Control(now), self._at_load)
            if not (solved and solver.correction(state.residual, self._along)):
                return NewtonResult(False, "the tangent could not be factorised", evaluation, tuple(iterations)), load
            # du = along + dlambda at_load, chosen so that the length stays as it is
            self._before.waxpy(-1.0, u, self._trial)
            off = self._dot(self._direction, self._before) + t_load * (now - load) - size
            slope = self._dot(self._direction, self._at_load) + t_load
            change = -(off + self._dot(self._direction, self._along)) / slope
            self._along.axpy(change, self._at_load)
            step = min(1.0, TO_THE_BOUNDARY * system.max_step(self._trial, self._along))
            self._trial.axpy(step, self._along)
            now += step * change
            solver.set_prescribed(self._trial, Control(now))
            correction = self._along.norm(3) / system.size if step == 1.0 else math.inf
            iterations.append(Iteration(relative, correction, step))
            solver.count(iterations[-1], self.on_iteration)
