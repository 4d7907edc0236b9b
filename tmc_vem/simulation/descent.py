"""Lowering gamma at a load that was reached, for the limit of a contact without medium between the bodies.

A descent is made beside the path: from a copy of a load step's state gamma is lowered in the logarithm of gamma, at the
same load, and what is reported is recorded on the way. The path then goes on from the state that it has left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tmc_vem.problems.base import Problem
from tmc_vem.results.extrapolation import PER_DECADE
from tmc_vem.results.limit import Lowering
from tmc_vem.results.plausibility import SAME, differing_parameters
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.recorder import Recorder
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.newton import NewtonSolver, OnIteration
from tmc_vem.solve.path import ControlPath
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control, parameter_of

GAMMA = "gamma"
LOADS = 10  # descents along a path, besides those at loads that are hit exactly
# A descent does not look for other branches: their values say nothing about the limit of this one.
SMALLEST = 1e-4
REMEDY = "begin with a larger gamma, or take smaller cells or more medium there"


def lowering_of(problem: Problem, options: RunOptions) -> Lowering | None:
    """How a problem's gamma is lowered, or None if no limit is asked for; all media together if they have several.

    Raises:
        InputError: the problem has no medium with a gamma.
    """
    if not options.extrapolate_gamma:
        return None
    gammas = gammas_of(problem)
    if not gammas:
        raise InputError(
            "extrapolate_gamma: the problem has no third medium with a parameter gamma, so that there is no limit of it"
        )
    factors = [10.0 ** (-k / PER_DECADE) for k in range(PER_DECADE * options.gamma_decades + 1)]
    if len(set(gammas.values())) == 1:
        return Lowering({GAMMA: next(iter(gammas.values()))}, factors)
    named = {parameter_of(name, GAMMA): gamma for name, gamma in gammas.items()}
    return Lowering(named, factors, {parameter_of(name, GAMMA): name for name in gammas})


def gammas_of(problem: Problem) -> dict[str, float]:
    """gamma of every medium that has one, by the name of its region."""
    media = {name: region.values for name, region in problem.regions().items() if region.is_medium}
    return {name: values[GAMMA] for name, values in media.items() if GAMMA in values}


@dataclass
class Descents:
    """Descents of a run; all ranks make and go through them together.

    Args:
        lowering: by how much gamma is lowered.
        along_path: also at loads along the path, and not at its end alone.
        stops: coordinates along the path that are hit exactly.
        end: of the path.
        solver: Newton's method of the run.
        recorder: knows the load steps, and records the descents.
        budget: limits the work.
        on_iteration: called after every iteration; what it raises ends the work.
    """

    lowering: Lowering
    along_path: bool
    stops: Sequence[float]
    end: float
    solver: NewtonSolver
    recorder: Recorder
    budget: Budget
    on_iteration: OnIteration | None = None

    def offer(self, u: Vec) -> None:
        """The last load step has converged to ``u``: lower gamma from there if that is wanted along the path.

        Raises:
            OutOfBudget: a limit on the work is reached; the descent goes on when the run does.
        """
        if self.along_path and self._is_due():
            self.descend(u)

    def descend(self, u: Vec) -> None:
        """Lower gamma from the last load step, whose state is ``u``, unless that is done.

        Raises:
            OutOfBudget: a limit on the work is reached; the descent goes on when the run does.
        """
        recorder = self.recorder
        if not recorder.history or recorder.history[-1].step in recorder.lowered.done:
            return
        start = recorder.history[-1]
        if differing_parameters(start, recorder.inputs):
            recorder.end_descent("gamma or alpha_r was not that of the problem at this load")
            return
        if any(record.jumped for record in recorder.history):
            recorder.end_descent("the run jumped to another branch before")  # no limit would be given
            return
        own = {**start.parameters, **self.lowering.at(1.0)}
        system = self.solver.system
        try:
            with self.solver.aside(), recorder.watch.aside():
                self._lower(u, [Control(start.load, {**own, **self.lowering.at(f)}) for f in self.lowering.factors])
        finally:
            system.set_parameters(own)
            system.set_position(Control(start.load, start.parameters))

    def _lower(self, u: Vec, corners: Sequence[Control]) -> None:
        """Go through values of gamma at one load, from a state that is left as it is."""
        path, begun = ControlPath(corners), self.recorder.descending
        largest = float(path.times[1])
        options = SteppingOptions(first=0.5 * largest, largest=largest, smallest=SMALLEST)
        stepper = LoadStepper(
            self.solver, options, self.recorder.record_lowered, path, on_iteration=self.on_iteration, jumps=False
        )
        v = u.copy()
        try:
            if begun is None:
                outcome = stepper.run(v)
            else:
                begun.states.vectors[-1].copy(v)
                outcome = stepper.run(v, begun.states, begun.position)
        finally:
            v.destroy()
        if self.budget.used_up:
            raise OutOfBudget(outcome.reason)
        why = "" if outcome.complete else f"{outcome.reason}; {REMEDY}"
        self.recorder.end_descent(why, outcome.failed_iterations)

    def _is_due(self) -> bool:
        """Whether the last load step is the first at or beyond one of the marks."""
        history, tiny, apart = self.recorder.history, SAME * self.end, self.end / LOADS
        now, before = history[-1].coordinate + tiny, (history[-2].coordinate if len(history) > 1 else 0.0) + tiny
        return now // apart > before // apart or any(before < stop <= now for stop in self.stops)
