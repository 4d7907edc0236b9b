"""The search for the best design of a problem: levels of projection, evaluations on record, and who hears of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.design.evaluation import Evaluation, Iterate, Optimum
from tmc_vem.design.evaluator import Evaluator, Worth
from tmc_vem.design.optimisers import FirstDesignFailed, minimise, require
from tmc_vem.design.projection import Continuation, Projection
from tmc_vem.design.record import Record
from tmc_vem.design.replay import Replay
from tmc_vem.problems.design_table import DesignTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

FEASIBLE = 1e-4  # of limits, by which a design may violate them


@dataclass(frozen=True)
class DesignStep:
    """An evaluated design.

    Attributes:
        number: from 1 on.
        level: of the projection, from 0 on.
        projection: densities are projected so, if they are.
        iterate: variables, objective and constraints.
        worth: results.
        fresh: whether it was evaluated now, and not answered from the record.
    """

    number: int
    level: int
    projection: Projection | None
    iterate: Iterate
    worth: Worth
    fresh: bool = True


@dataclass(frozen=True)
class DesignResult:
    """The best design of the last level of projection.

    Attributes:
        optimum: its variables, and how the search ended.
        density_c: (n_cells of the mesh,) densities; not a number outside of design regions.
        stiffness_c: (n_cells of the mesh,) stiffnesses; 0 outside.
        worth: results of the design, loaded from the beginning.
        steps: all evaluations.
        projection: of the last level.
    """

    optimum: Optimum
    density_c: Float
    stiffness_c: Float
    worth: Worth | None
    steps: Sequence[DesignStep]
    projection: Projection | None

    @property
    def objective(self) -> float:
        """What was made small; with the other sign what was made large."""
        return self.optimum.evaluation.objective


OnDesign = Callable[[DesignStep], None]
# What is told of an evaluation that was made: its number, from 1, and the evaluation.
OnEvaluation = Callable[[int, Record], None]


class Optimisation:
    """A search that is prepared; all ranks make it and go through it together.

    Args:
        problem: with a table ``[design]``.
        options: how its load cases are solved.
        comm: ranks; all by default.

    Raises:
        InputError: the problem has no design, a load case is wrong, or NLopt is missing.

    Attributes:
        evaluator: evaluates designs.
        steps: evaluations until now.
        on_evaluation: told of every evaluation that is made, before the method has it; those on record are not made.
    """

    def __init__(
        self,
        problem: OwnProblem,
        options: RunOptions | None = None,
        comm: Comm | None = None,
    ) -> None:
        design = problem.table.design
        if design is not None:
            require(design.method)
        self.evaluator = Evaluator(problem, options or RunOptions(), MPI.COMM_WORLD if comm is None else comm)
        if self.table.method == "oc" and (self.table.volume is None or self.table.limits):
            raise InputError("design: method 'oc' is for a volume alone: give one and no limits, or use method 'mma'")
        self.replay = Replay(self._evaluate)
        self.steps: list[DesignStep] = []
        self.on_evaluation: OnEvaluation | None = None
        self._worths: list[Worth] = []

    @property
    def table(self) -> DesignTable:
        """What is wanted."""
        return self.evaluator.table

    def go_on(self, records: Sequence[Record]) -> None:
        """Begin with the evaluations of a search that was stopped, which are not made again. The load cases have to be
        brought to the state of the last of them."""
        self.replay = Replay(self._evaluate, [(record.z, record.evaluation) for record in records])
        self._worths = [record.worth for record in records]
        self.evaluator.evaluations = len(records)

    def go(self, on_design: OnDesign | None = None) -> DesignResult:
        """Search; whoever wants to hear of every design is told.

        Raises:
            InputError: the first design cannot be evaluated, or NLopt is missing.
        """
        z, left = self.evaluator.start(), self.table.iterations
        levels = self._levels()
        optimum: Optimum | None = None
        for level, (projection, most) in enumerate(levels):
            if left < 1 and optimum is not None:
                break
            self.evaluator.project(projection)
            last = level == len(levels) - 1
            try:
                found = self._search(z, left if last else min(most, left), level, projection, on_design)
            except FirstDesignFailed:
                why = "; ".join(self._worths[len(self.steps) - 1].notes)
                if optimum is None or projection is None:
                    raise InputError(
                        f"the first design could not be evaluated ({why}): begin with a stiffer one (start = 1), apply "
                        "a smaller load, and see that what is loaded and held is not void"
                    ) from None
                # steeper, the best design has no equilibrium: it stays as it is
                reason = f"with beta = {projection.beta:g}, the best design could not be evaluated ({why})"
                optimum = replace(optimum, reason=f"{optimum.reason}; {reason}", converged=False)
                self.evaluator.project(levels[level - 1][0])
                break
            optimum = found
            z, left = optimum.z, left - optimum.evaluations
        assert optimum is not None
        worth = self._at_the_end(z)
        return DesignResult(
            optimum,
            self.evaluator.densities(z),
            self.evaluator.stiffness(z),
            worth,
            tuple(self.steps),
            self.evaluator.parametrisation.projection,
        )

    # -- parts -----------------------------------------------------------------------------------------------------

    def _evaluate(self, z: Float) -> Evaluation:
        evaluation = self.evaluator(z)
        worth = self.evaluator.worth
        assert worth is not None
        if not self.steps:
            self._require_dependence(evaluation)
        del self._worths[len(self.steps) :]  # of a record that was of another search
        self._worths.append(worth)
        if self.on_evaluation is not None:
            self.on_evaluation(len(self.steps) + 1, Record(z, evaluation, worth))
        return evaluation

    def _require_dependence(self, evaluation: Evaluation) -> None:
        """Check that there is something to gain.

        Raises:
            InputError: the objective depends on no cell.
        """
        table = self.table
        if np.isfinite(evaluation.objective) and not evaluation.gradient.any():
            what = "minimise" if table.minimise else "maximise"
            raise InputError(
                f"design: {what} = '{table.objective}' does not depend on the design: its derivative is 0 in every "
                "cell; choose another result, such as compliance or reaction"
            )

    def _levels(self) -> list[tuple[Projection | None, int]]:
        """Projections with the most evaluations on each."""
        table = self.table.projection
        if table is None:
            return [(None, self.table.iterations)]
        continuation = Continuation(table.first, table.largest, every=table.every, eta=table.eta)
        return [(projection, table.every) for projection in continuation.levels()]

    def _search(
        self, z: Float, evaluations: int, level: int, projection: Projection | None, on_design: OnDesign | None
    ) -> Optimum:
        table, evaluator = self.table, self.evaluator

        def told(iterate: Iterate) -> None:
            number = len(self.steps) + 1
            fresh = self.replay.replayed < number
            step = DesignStep(number, level, projection, iterate, self._worths[number - 1], fresh)
            self.steps.append(step)
            if on_design is not None:
                on_design(step)

        volume = table.volume
        constraint = None if volume is None else (lambda z: evaluator.parametrisation.volume(z) / volume - 1.0)
        return minimise(
            self.replay, z, (0.0, 1.0), len(evaluator.constraints), table.method, evaluations, table.tolerance, told,
            feasibility=FEASIBLE, constraint=constraint,
        )  # fmt: skip

    def _at_the_end(self, z: Float) -> Worth | None:
        """The best design once more, loaded from the beginning: what a run of it gives."""
        for case in self.evaluator.cases.values():
            case.u = None
        self.evaluator(z)
        return self.evaluator.worth
