"""What all methods have in common: every evaluation is checked, counted, compared with the best and told."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.evaluation import Evaluate, Evaluation, Iterate

Float = NDArray[np.float64]

CONVERGED, USED_UP = "designs hardly change any more", "the evaluations are used up"  # how most methods end


class History:
    """Evaluates designs and remembers the best.

    Args:
        evaluate: what is evaluated.
        width_z: (n_variables,) ranges of the variables.
        n_constraints: how many constraints there are.
        feasibility: up to which violation a design counts as feasible.
        on_iteration: told of every evaluation.
    """

    def __init__(
        self,
        evaluate: Evaluate,
        width_z: Float,
        n_constraints: int,
        feasibility: float,
        on_iteration: Callable[[Iterate], None] | None,
    ) -> None:
        self._evaluate = evaluate
        self._width_z = width_z
        self._n_constraints = n_constraints
        self._feasibility = feasibility
        self._on_iteration = on_iteration
        self.evaluations = 0
        self.iterations = 0
        self.best: tuple[Float, Evaluation] | None = None
        self._last: tuple[Float, Evaluation] | None = None

    def at(self, z: Float) -> Evaluation:
        """The evaluation of a design; asked again at the last or the best, it is not made again.

        Raises:
            InputError: what was evaluated has wrong shapes or values that are no numbers.
        """
        for known in (self._last, self.best):
            if known is not None and known[0].tobytes() == z.tobytes():
                return known[1]
        z = z.copy()  # that of nlopt is its own memory, which changes
        evaluation = self._evaluate(z.copy())
        evaluation.check(len(z), self._n_constraints)
        self._last = z, evaluation
        self.evaluations += 1
        before = self.best
        better = self.is_better(evaluation)
        change = 0.0 if before is None else self.change(z, before[0])
        if better:
            self.iterations += 1
            self.best = self._last
        if self._on_iteration is not None:
            told = Iterate(self.evaluations, self.iterations, z.copy(), evaluation, change, better)
            self._on_iteration(told)
        return evaluation

    def is_better(self, evaluation: Evaluation) -> bool:
        """Whether it is better than all before."""
        if self.best is None:
            return True
        return self._rank(evaluation) < self._rank(self.best[1])

    def feasible(self, evaluation: Evaluation) -> bool:
        """Whether its constraints are satisfied."""
        return evaluation.violation <= self._feasibility

    def change(self, z: Float, other_z: Float) -> float:
        """Largest difference of a variable in fractions of its range."""
        return float((np.abs(z - other_z) / self._width_z).max(initial=0.0))

    def _rank(self, evaluation: Evaluation) -> tuple[float, float]:
        return (0.0 if self.feasible(evaluation) else evaluation.violation), evaluation.objective
