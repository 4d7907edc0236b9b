"""The limit for gamma to 0 with friction: every gamma goes the whole path of the load.

Friction depends on the way, and lowering gamma at a load is another one: what sticks would begin to slip, as the gap
closes in proportion. So the run is repeated beside the path, from the undeformed body on, and the state at its end is
recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.limit import Lowering
from tmc_vem.simulation.recorder import Recorder
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.friction_steps import FrictionSteps
from tmc_vem.solve.newton import NewtonSolver, OnIteration
from tmc_vem.solve.path import ControlPath
from tmc_vem.solve.sizes import DONE
from tmc_vem.solve.states import Beginning, States
from tmc_vem.solve.stepping import LoadStepper, Step, StepperState, SteppingOptions
from tmc_vem.support.distributed import Vec
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.point_values import PointValues

Float = NDArray[np.float64]

SMALLEST_FIRST = 1e-4  # part of the problem's first step that the first one with a lower gamma is at least


@dataclass
class Repeats:
    """Repetitions of a run with lower gamma; all ranks make and go through them together.

    Args:
        lowering: by how much gamma is lowered.
        path: of the load.
        stepping: how it is divided into steps.
        system: with friction.
        solver: Newton's method of the run.
        recorder: knows the load steps, and records what the repetitions end with.
        budget: limits the work.
        friction: what the stepping asks about it.
        on_iteration: called after every iteration; what it raises ends the work.
    """

    lowering: Lowering
    path: ControlPath
    stepping: SteppingOptions
    system: Discretisation
    solver: NewtonSolver
    recorder: Recorder
    budget: Budget
    friction: FrictionSteps
    on_iteration: OnIteration | None = None

    def offer(self, u: Vec) -> None:
        """Nothing is repeated while the load path goes on."""

    def descend(self, u: Vec) -> None:
        """Repeat the run that has ended at its last load step, unless that is done; ``u`` is left as it is.

        Raises:
            OutOfBudget: a limit on the work is reached; the repetition goes on when the run does.
        """
        recorder = self.recorder
        if not recorder.history or recorder.history[-1].step in recorder.lowered.done:
            return
        if any(record.jumped for record in recorder.history):
            recorder.end_descent("the run jumped to another branch before")  # no limit would be given
            return
        start, beginning = recorder.history[-1], recorder.main[0].beginning if recorder.main is not None else None
        try:
            with self.solver.aside(), recorder.watch.aside():
                self._repeat_all()
        finally:
            self.system.set_parameters(self.lowering.at(1.0))
            self.system.set_position(Control(start.load, start.parameters))
            self._take_up(beginning)

    def _repeat_all(self) -> None:
        """Go through the path with every gamma that it has not been gone through with.

        Raises:
            OutOfBudget: a limit on the work is reached.
        """
        begun, why, failed = self.recorder.descending, "", 0
        done = 1 + (len(begun.records) if begun is not None else 0)
        for factor in self.lowering.factors[done:]:
            outcome = self._stepper(factor).run(*self._start(factor))
            if self.budget.used_up:
                raise OutOfBudget(outcome.reason)
            if not outcome.complete:
                gammas = ", ".join(f"{name} = {gamma:.3g}" for name, gamma in self.lowering.at(factor).items())
                why, failed = f"{outcome.reason} (at load {outcome.load:.4g}, {gammas})", outcome.failed_iterations
                break
        self.recorder.end_descent(why, failed)

    def _start(self, factor: float) -> tuple[Vec, States | None, StepperState | None]:
        """Where the path with a gamma begins: undeformed and without friction, or where it was cut short."""
        self.system.set_parameters(self.lowering.at(factor))
        begun, u = self.recorder.descending, self.system.create_vector()
        if begun is None or begun.position.time > self.path.end - DONE:  # that of the gamma before is done
            self._take_up(Beginning(u, PointValues(np.empty((0, 2)), np.empty(0))))
            self.solver.last_shift = 0.0  # as at the beginning of any run
            return u, None, None
        self._take_up(begun.states.beginning)
        begun.states.vectors[-1].copy(u)
        return u, begun.states, begun.position

    def _take_up(self, beginning: Beginning | None) -> None:
        """Take up a step again where it began, with the shear of then; none where it is not known."""
        if beginning is not None:
            known = len(beginning.shear.points_px) > 0
            self.system.remember_shear(beginning.u, beginning.shear.at if known else _none)

    def _stepper(self, factor: float) -> LoadStepper:
        corners = [Control(corner.load, self.lowering.at(factor)) for corner in self.path.corners]
        path = ControlPath(corners, self.path.loads, self.path.kinks)

        def on_step(step: Step, states: States, position: StepperState) -> None:
            self.recorder.record_lowered(step, states, position, passed=position.time < path.end - DONE)

        # what is open and pressed by a force gives way as one over gamma
        small = max(factor, SMALLEST_FIRST)
        stepping = replace(self.stepping, first=small * self.stepping.first, smallest=small * self.stepping.smallest)
        return LoadStepper(
            self.solver, stepping, on_step, path, on_iteration=self.on_iteration, jumps=False,
            friction=self.friction,
        )  # fmt: skip


def _none(points_px: Float) -> Float:
    return np.zeros(len(points_px))
