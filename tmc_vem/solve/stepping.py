"""Stepping along a path of loads, and of parameters that are continued: prediction, growth and cut-back of the step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ParamSpec

from tmc_vem.solve.budget import OutOfBudget
from tmc_vem.solve.friction_steps import FrictionRecord, FrictionSteps
from tmc_vem.solve.newton import NewtonResult, NewtonSolver, OnIteration
from tmc_vem.solve.path import ControlPath, load_path
from tmc_vem.solve.prediction import CUTS, SMALL_WAY, WORTH, bend_of, extrapolate, reliable, slope_of
from tmc_vem.solve.sizes import DONE, StepSizes
from tmc_vem.solve.states import ORDER, Slope, States
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import EvaluationError, InputError
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation, Refused

P = ParamSpec("P")

# Way over which a new branch is looked for where the old one ends, in units of the smallest step; also the longest step
# that may end on another branch.
JUMP = 100.0
# A state farther from the predicted one than this, in units of the predicted increment and of the domain's size, may
# be on another branch, which Newton's method has found without being asked to. Where the branch only turns quickly,
# half the step stays on it; so a step longer than JUMP that ends far away is halved, and only a shorter one has jumped.
FAR, FAR_AT_LEAST = 3.0, 1e-3
DETOURS = (10.0, 100.0)  # by how much gamma is raised to get past a load where the branch ends
# By how much it is raised for the rest of the path where that does not help; it is brought back at the end.
STIFFER = (10.0, 100.0, 1000.0)
REMEDY = "Try a larger alpha_r or gamma, --continuation from a larger gamma, --rule triangles, or a finer medium there"


@dataclass(frozen=True)
class SteppingOptions:
    """How the path is divided into steps.

    Attributes:
        steps: number of equal steps on every leg of the path, or None for automatic ones. Equal steps that fail are
            halved as often as needed, and the next equal step's end is still hit.
        first, largest, smallest: automatic step sizes, as fractions of the load.
        target_iterations: automatic steps grow while they need fewer iterations than this, and shrink above it.
        growth: largest factor between two steps.
        order: of the polynomial that is extrapolated through the last states, as far as there are enough of them.
        slopes: extrapolate along the slopes of the last states as well.
        foresee: automatic steps are no longer than extrapolation can be relied on.
    """

    steps: int | None = None
    first: float = 0.01
    largest: float = 0.1
    smallest: float = 1e-5
    target_iterations: int = 4
    growth: float = 2.0
    order: int = ORDER
    slopes: bool = True
    foresee: bool = True

    def __post_init__(self) -> None:
        if self.steps is not None and not 1 <= self.steps <= 1_000_000:
            raise InputError(f"{self.steps} load steps: use 1 to 1000000")
        if not 0.0 < self.smallest <= self.first <= self.largest <= 1.0:
            raise InputError(
                f"load step sizes need 0 < smallest <= first <= largest <= 1, got {self.smallest:g}, {self.first:g}, "
                f"{self.largest:g}"
            )
        if not 1 <= self.order <= ORDER:
            raise InputError(f"extrapolation of order {self.order}: use 1 to {ORDER}")


@dataclass(frozen=True)
class Step:
    """A converged step.

    Attributes:
        number: 1 for the first.
        time: coordinate along the path; the load factor itself where the load goes from 0 to 1.
        control: load factor and parameters reached.
        newton: how it converged.
        cut_backs: failed attempts since the step before.
        wasted_iterations: Newton iterations of those attempts.
        jumped: the branch that was followed ended or bifurcated; this state is on another one.
    """

    number: int
    time: float
    control: Control
    newton: NewtonResult
    cut_backs: int
    wasted_iterations: int
    jumped: bool = False

    @property
    def load(self) -> float:
        """Load factor reached."""
        return self.control.load


@dataclass(frozen=True)
class StepperState:
    """Where the stepping stands after a converged step; with the last states, all it needs to go on.

    Attributes:
        time: coordinate along the path.
        size: size of the next step.
        number: steps so far.
        stiffer: times at which the path was given up for one with a stiffer medium, and by what factor each.
        far_at: the last time at which a state was found far from its prediction, in a step that was halved then.
        rate: the increment that was predicted then, per time.
        friction: how far friction has been behind so far.
        bend: how fast the tangent turned in the last step, see :func:`tmc_vem.solve.prediction.bend_of`.
        shift: of the last indefinite tangent, see :class:`tmc_vem.solve.newton.NewtonSolver`.
    """

    time: float = 0.0
    size: float = 0.0
    number: int = 0
    stiffer: tuple[tuple[float, float], ...] = ()
    far_at: float = 0.0
    rate: float = 0.0
    friction: FrictionRecord = field(default_factory=FrictionRecord)
    bend: float = 0.0
    shift: float = 0.0


OnStep = Callable[[Step, States, StepperState], None]


@dataclass(frozen=True)
class SteppingResult:
    """Where the stepping ended: the end of the path, or the last converged step and why not further.

    Attributes:
        load: load factor reached.
        complete: whether that is the end of the path.
        reason: why it ended, in words.
        failed_iterations, failed_attempts: since the last converged step.
        last: that step, None if there was none.
        linear_iterations: of the linear solver since it was made.
        ordering: what its factorisations have ordered the unknowns by, if they are any.
        refusal: of the last state that has converged since the last step and was not admitted, if there was one.
        friction: how far friction has been behind; nothing without.
    """

    load: float
    complete: bool
    reason: str
    failed_iterations: int = 0
    failed_attempts: int = 0
    last: Step | None = None
    linear_iterations: int = 0
    ordering: str = ""
    refusal: Refused | None = None
    friction: FrictionRecord = field(default_factory=FrictionRecord)


@dataclass(frozen=True)
class Attempt:
    """What became of a step.

    Attributes:
        result: of Newton's method.
        far: the state is far from where it was predicted: it may be on another branch.
        refusal: of the last state on the way to it that has converged and was not admitted, if there was one.
        expected, moved: largest entry of the increment that was predicted and of the one that was found.
        off: Euclidean norm of their difference.
    """

    result: NewtonResult
    far: bool = False
    refusal: Refused | None = None
    expected: float = 0.0
    moved: float = 0.0
    off: float = 0.0


@dataclass
class LoadStepper:
    """Goes along a path from its start to its end.

    Args:
        solver: Newton's method for the system.
        options: step sizes.
        on_step: called after every converged step with the step, the last states and the position from which the
            stepping could go on.
        path: what is controlled; the load factor from 0 to 1 by default.
        soften: parameters that may be raised where a branch ends, with the problem's values: a stiffer medium may get
            past that load, and is softened again beyond it, or at the end of the path.
        on_failure: called when the first attempt at a step fails, with the state that it started from.
        on_iteration: called after every iteration of Newton's method; what it raises ends the work.
        jumps: look for another branch where one ends; else the stepping ends there.
        friction: of the system, if it has some.
    """

    solver: NewtonSolver
    options: SteppingOptions = field(default_factory=SteppingOptions)
    on_step: OnStep | None = None
    path: ControlPath = field(default_factory=load_path)
    soften: Mapping[str, float] = field(default_factory=dict)
    on_failure: Callable[[Vec], None] | None = None
    on_iteration: OnIteration | None = None
    jumps: bool = True
    friction: FrictionSteps = field(default_factory=FrictionSteps)

    @property
    def _sizes(self) -> StepSizes:
        return StepSizes(self.options, self.path)

    def start(self, u: Vec) -> tuple[States, StepperState]:
        """States and position at the beginning of the path."""
        states = States(u)
        states.append(self.path.vector(self.path.at(0.0)), u)
        return states, StepperState(size=self._sizes.first(0.0))

    def run(self, u: Vec, states: States | None = None, position: StepperState | None = None) -> SteppingResult:
        """Go to the end of the path.

        Args:
            u: the state to start from; it is left at the last converged state.
            states, position: to go on from, as ``on_step`` was given them; the beginning by default.
        """
        if states is None or position is None:
            states, position = self.start(u)
        else:
            self.solver.last_shift = position.shift
        for time, factor in position.stiffer:
            self.path = self.path.stiffened(time, self.soften, factor) or self.path
        self.solver.system.set_position(self.path.at(position.time))
        trial, last, refusal = u.duplicate(), None, None
        cut_backs, done = 0, self.solver.iterations_done
        failed, begun = False, None
        try:
            while position.time < self.path.end - DONE:
                begun = begun or self.friction.begin(u)
                target = self._foreseen(u, states, position)
                attempt = _outcome(self._attempt, u, states, trial, position.time, target)
                result, jumped = attempt.result, attempt.far
                if result.converged and self._to_be_halved(attempt, position, target):
                    result = replace(result, converged=False, reason="a state far from its prediction", residual=None)
                    position = _suspicious(position, attempt, target)
                elif jumped:
                    result = self.solver.admitted_jump(u, trial, result)
                refusal = result.refusal or attempt.refusal or refusal
                if not result.converged:
                    cut_backs += 1
                    if self.on_failure and not failed:
                        self.on_failure(u)
                    failed = True
                    position = replace(position, size=0.5 * (target - position.time))
                    if position.size >= self.options.smallest:
                        continue
                    # the branch that was followed may have ended, at a limit point or a bifurcation
                    target, jumped = self._sizes.target(position.time, JUMP * self.options.smallest), True
                    other = Attempt(result)
                    if self.jumps:
                        other = _outcome(self._other_branch, u, trial, position.time, target)
                    refusal = other.refusal or refusal
                    if not other.result.converged:
                        self._control(position.time)
                        stiffer = self._stiffen(position) if self.jumps else None
                        if stiffer is not None:
                            position = stiffer
                            states.restart(self.path.vector(self.path.at(position.time)))
                            continue
                        wasted = self.solver.iterations_done - done
                        why = self._why(result, refusal, u)
                        self.friction.go_back(begun, states)
                        return replace(self._ended(position, why, last, wasted, cut_backs), refusal=refusal)
                    result = other.result
                lag = self.friction.lag(begun, trial)
                error = self.friction.ratio(lag, position.friction)
                leg = self.path.length_of_leg(position.time)
                shorter = self.friction.shortened(error, target - position.time, leg)
                if shorter is not None and not (jumped or self.options.steps):
                    cut_backs, position = cut_backs + 1, replace(position, size=shorter)
                    continue
                trial.copy(u)
                assert result.residual is not None  # it has converged
                bend = bend_of(result.iterations, position.bend)
                easy = bool(self.options.steps) and bend * attempt.off <= WORTH * self.solver.system.size
                slope = None if jumped or easy else self._slope(u, result.residual, target)
                self.solver.system.accept(u, result.residual, self.path.at(target))
                states.append(self.path.vector(self.path.at(target)), u, slope)
                if jumped:  # there is nothing to extrapolate across a jump to another branch, nor to compare with
                    states.forget()
                    position = replace(position, far_at=0.0)
                elif self.path.is_kink(target) or (self.friction.is_there and self.path.is_corner(target)):
                    states.forget()  # nor across a kink of what is prescribed, or back along a way with friction
                was_cut, taken = cut_backs > 0 and not jumped, target - position.time
                size = self._sizes.following(position.size, taken, target, len(result.iterations), was_cut)
                if not self.options.steps:
                    size = min(size, self.friction.largest_next(error, taken, leg))
                behind = position.friction.with_step(lag, self.path.at(target).load)
                position = replace(position, time=target, size=size, number=position.number + 1, friction=behind)
                position = replace(position, bend=bend, shift=self.solver.last_shift)
                states.beginning, begun, failed = begun, None, False
                wasted = self.solver.iterations_done - done - len(result.iterations)
                last = Step(position.number, target, self.path.at(target), result, cut_backs, wasted, jumped)
                cut_backs, done, refusal = 0, self.solver.iterations_done, None
                if self.on_step:  # it may solve beside the path
                    self.on_step(last, states, position)
                    done = self.solver.iterations_done
        except OutOfBudget as limit:
            self._control(position.time)
            self.friction.go_back(begun, states)
            wasted = self.solver.iterations_done - done
            return self._ended(position, str(limit), last, wasted, cut_backs)
        finally:
            trial.destroy()
        return self._ended(position, "full load", last, complete=True)

    def _ended(
        self, position: StepperState, reason: str, last: Step | None, wasted: int = 0, cut_backs: int = 0,
        *, complete: bool = False,
    ) -> SteppingResult:  # fmt: skip
        load = self.path.at(position.time).load
        linear = (self.solver.linear_iterations, self.solver.ordering)
        return SteppingResult(load, complete, reason, wasted, cut_backs, last, *linear, friction=position.friction)

    def _attempt(self, u: Vec, states: States, trial: Vec, now: float, target: float) -> Attempt:
        """Try to find equilibrium at ``target`` in ``trial``, starting from an extrapolation or the tangent."""
        control, far, expected, refusal = self._control(target), False, 0.0, None
        point = self.path.vector(control)
        order = extrapolate(self.solver, u, states, point, self.options.order, trial)
        if order:
            self.solver.set_prescribed(trial, control)
            usual = trial.copy()
            if any(states.slopes):  # they grow without limit where a branch ends, and would predict any other one
                if extrapolate(self.solver, u, states, point, self.options.order, usual, slopes=False):
                    self.solver.set_prescribed(usual, control)
                else:
                    trial.copy(usual)
            attempt = self._solve(u, trial, usual)
            if attempt.result.converged:
                return attempt
            far, expected, refusal = attempt.far, attempt.expected, attempt.refusal
        if self._tangent(u, states, trial, target, order):
            attempt = self._solve(u, trial, trial.copy())
            return replace(attempt, refusal=attempt.refusal or refusal)
        if control.load == self.path.at(now).load:  # parameters change, and the old state is admissible still
            u.copy(trial)
            result = self.solver.solve(trial, on_iteration=self.on_iteration)
            # where the extrapolation went off, this may as well
            return Attempt(result, far, result.refusal or refusal, expected)
        evaluation, complaint = self.solver.system.energy(u), self.solver.linear_complaint
        reason = f"no predictor{complaint}" if complaint else f"the predictor inverts the mesh ({evaluation.worst})"
        return Attempt(NewtonResult(False, reason, evaluation), refusal=refusal)

    def _solve(self, u: Vec, trial: Vec, usual: Vec) -> Attempt:
        """Find equilibrium from a predicted state; the usual one, which is destroyed, says what is far."""
        increment = u.duplicate()
        increment.waxpy(-1.0, u, usual)
        expected = increment.norm(3)
        result = self.solver.solve(trial, on_iteration=self.on_iteration)
        increment.waxpy(-1.0, usual, trial)
        off = increment.norm()
        far = increment.norm(3) > max(FAR * expected, FAR_AT_LEAST * self.solver.system.size)
        increment.waxpy(-1.0, u, trial)
        moved = increment.norm(3)
        usual.destroy()
        increment.destroy()
        return Attempt(result, far, result.refusal, expected, moved, off)

    def _to_be_halved(self, attempt: Attempt, position: StepperState, target: float) -> bool:
        """Whether a step leads so far that a shorter one should tell whether the branch goes there.

        Close to the end of a branch any increment is predicted. So up to the time of a state that was found far away,
        steps are compared with what was predicted before it as well.
        """
        taken = target - position.time
        if taken <= JUMP * self.options.smallest * (1.0 + DONE):
            return False
        usual = max(FAR * position.rate * taken, FAR_AT_LEAST * self.solver.system.size)
        return attempt.far or (position.time < position.far_at and attempt.moved > usual)

    def _tangent(self, u: Vec, states: States, trial: Vec, target: float, tried: int) -> bool:
        """Predict along the tangent, into ``trial``, where extrapolation of another order was tried; whether J > 0."""
        point, control = self.path.vector(self.path.at(target)), self._control(target)
        if not states.knows_slope(point):
            return self.solver.predict(u, control, trial)
        if tried < 2 or not extrapolate(self.solver, u, states, point, 1, trial):
            return False  # it has been tried, or inverts cells
        self.solver.set_prescribed(trial, control)
        return True

    def _slope(self, u: Vec, residual: Vec, time: float) -> Slope | None:
        """Slope of a state that Newton's method has just converged to; None where it is of no use."""
        if not self.options.slopes or self.friction.is_there or self.path.is_kink(time) or time > self.path.end - DONE:
            return None
        ahead = self._control(time + SMALL_WAY)
        rate = slope_of(self.solver, u, residual, ahead)
        here = self._control(time)
        if rate is None:
            return None
        return Slope((self.path.vector(ahead) - self.path.vector(here)) / SMALL_WAY, rate)

    def _foreseen(self, u: Vec, states: States, position: StepperState) -> float:
        """Time that a step leads to, which is shorter than its size where extrapolation is not to be relied on."""
        time, target = position.time, self._sizes.target(position.time, position.size)
        if self.options.steps or self.friction.is_there or not self.options.foresee:
            return target
        for _ in range(CUTS):
            point = self.path.vector(self.path.at(target))
            part = reliable(self.solver, u, states, point, self.options.order, position.bend)
            size = part * (target - time)
            shorter = self._sizes.target(time, size)
            if part == 1.0 or size < JUMP * self.options.smallest or shorter >= target:
                break
            target = shorter
        return target

    def _other_branch(self, u: Vec, trial: Vec, now: float, target: float) -> Attempt:
        """Look for an equilibrium at ``target`` that the branch followed so far does not lead to.

        First downhill from the last state with the load moved on, then with a stiffer medium that is softened again
        at the target.
        """
        control = self._control(target)
        u.copy(trial)
        self.solver.set_prescribed(trial, control)
        lowest = self.solver.solve(trial, minimise=True, on_iteration=self.on_iteration)
        result = self.solver.admitted_jump(u, trial, lowest)
        if result.converged:
            return Attempt(result, far=True)
        refusal = result.refusal
        here, there = self.path.at(now), self.path.at(target)
        for factor in DETOURS if self.soften else ():
            before, after = ({**self.soften, **control.parameters} for control in (here, there))
            stiff = {name: factor * value for name, value in before.items()}
            corners = [Control(here.load, before), Control(here.load, stiff), Control(there.load, stiff)]
            if here.load == there.load:  # it is a parameter that changes
                del corners[-1]
            path = ControlPath([*corners, Control(there.load, after)])
            options = replace(self.options, steps=None, smallest=min(1e-3, self.options.first))
            u.copy(trial)
            outcome = LoadStepper(self.solver, options, path=path, on_iteration=self.on_iteration).run(trial)
            if outcome.complete and outcome.last is not None:
                return Attempt(outcome.last.newton, far=True)
            refusal = outcome.refusal or refusal
        return Attempt(result, refusal=refusal)

    def _stiffen(self, position: StepperState) -> StepperState | None:
        """Give up the path for one with a stiffer medium that is softened at the end; None if that has been tried."""
        unused = [factor for factor in STIFFER if all(factor > used for _, used in position.stiffer)]
        if not (self.soften and unused) or (
            self.path.names and not position.stiffer
        ):  # or it is a continuation already
            return None
        path = self.path.stiffened(position.time, self.soften, unused[0])
        if path is None:
            return None
        self.path = path
        size = min(self.options.first, self.options.largest)
        return replace(position, size=size, far_at=0.0, stiffer=(*position.stiffer, (position.time, unused[0])))

    def _control(self, time: float) -> Control:
        """Give the system the parameters and forces of a time; the point of the path there."""
        control = self.path.at(time)
        self.solver.system.set_position(control)
        parameters = {**self.soften, **control.parameters}
        if parameters:
            self.solver.system.set_parameters(parameters)
        return control

    def _why(self, result: NewtonResult, refusal: Refused | None, u: Vec) -> str:
        """Why there is no way to go on, what was tried and what to try."""
        worst = self.solver.system.energy(u).worst
        softened = ""
        if self.soften:
            softened = f", {', '.join(self.soften)} raised up to {STIFFER[-1]:g} times to get past this load"
        elif self.friction.is_there:
            softened = "; not a stiffer medium, as its friction would remain"
        reason, remedy = (refusal.sentence(), refusal.advice()) if refusal else (result.reason, REMEDY)
        if not self.jumps:
            return reason
        return (
            f"{reason}; smallest {worst}. Tried: steps down to {self.options.smallest:g} of the load, extrapolated and "
            f"tangent predictors, descent to another equilibrium{softened}. {remedy}"
        )


def _suspicious(position: StepperState, attempt: Attempt, target: float) -> StepperState:
    """The position with the time of a state that is far away, and with what was predicted before the first of them."""
    if not attempt.far:
        return position
    known = position.time < position.far_at
    rate = position.rate if known else attempt.expected / (target - position.time)
    return replace(position, far_at=max(position.far_at, target), rate=rate)


def _outcome(attempt: Callable[P, Attempt], *arguments: P.args, **named: P.kwargs) -> Attempt:
    """What became of an attempt; it has failed, on all ranks alike, where the potential cannot be evaluated."""
    try:
        return attempt(*arguments, **named)
    except EvaluationError as error:
        return Attempt(NewtonResult(False, str(error), Evaluation(math.nan, {}, str(error))))
