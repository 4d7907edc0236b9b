"""What an optimiser asks of a design, what it tells on its way, and what it ends with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Evaluation:
    """Objective and constraints of a design, with their gradients.

    Attributes:
        objective: what is made small; infinite where the design could not be evaluated, which methods take as a step
            that was too long.
        gradient: (n_variables,) its derivatives.
        constraints: (n_constraints,) satisfied where not positive; in fractions of their limits, value / limit - 1.
        jacobian: (n_constraints, n_variables) their derivatives.
    """

    objective: float
    gradient: Float
    constraints: Float
    jacobian: Float

    @staticmethod
    def failed(n_variables: int, n_constraints: int) -> Evaluation:
        """That of a design without an equilibrium that could be found."""
        return Evaluation(
            np.inf, np.zeros(n_variables), np.zeros(n_constraints), np.zeros((n_constraints, n_variables))
        )

    @property
    def violation(self) -> float:
        """The largest constraint, 0 where none is violated; infinite where there are no values."""
        return max(0.0, float(self.constraints.max(initial=0.0))) if np.isfinite(self.objective) else np.inf

    def check(self, n_variables: int, n_constraints: int) -> None:
        """Compare shapes and look for values that are no numbers.

        Raises:
            InputError: a shape is wrong, or a value is not a number; the message names it.
        """
        for name, values, shape in (
            ("gradient", self.gradient, (n_variables,)),
            ("constraints", self.constraints, (n_constraints,)),
            ("jacobian", self.jacobian, (n_constraints, n_variables)),
        ):
            if np.shape(values) != shape:
                raise InputError(f"the {name} of a design has shape {np.shape(values)}: it needs {shape}")
            if not np.isfinite(values).all():
                where = tuple(int(n) for n in np.argwhere(~np.isfinite(values))[0])
                raise InputError(f"the {name} of a design has an entry that is no finite number, at {where}")
        if np.isnan(self.objective) or self.objective == -np.inf:
            raise InputError(f"the objective of a design is {self.objective}; one that cannot be evaluated has inf")


Evaluate = Callable[[Float], Evaluation]


@dataclass(frozen=True)
class Iterate:
    """An evaluation on the way.

    Attributes:
        number: of the evaluation, from 1 on.
        iteration: how many evaluations until now were better than all before them: with fewer violated constraints, or
            with a smaller objective. MMA and CCSAQ also evaluate steps that they then shorten.
        z: (n_variables,) the variables.
        evaluation: what they have.
        change: largest difference of a variable from the best design before, in fractions of its range; 0 at first.
        better: whether this is the best design until now.
    """

    number: int
    iteration: int
    z: Float
    evaluation: Evaluation
    change: float
    better: bool


@dataclass(frozen=True)
class Optimum:
    """The best design that was met.

    Attributes:
        z: (n_variables,) its variables.
        evaluation: what they have.
        feasible: whether its constraints are satisfied; if not, it is the one that violates them least.
        converged: whether the method ended because designs hardly changed any more, with a feasible one.
        reason: why it ended and what is wrong, in words.
        stationarity: what is left of the objective's gradient after the best multipliers of the constraints and the
            bounds, over the gradient itself: 0 at an optimum, 1 where nothing holds the design.
        evaluations: how many there were.
        iterations: how many of them were better than all before.
        starts: how often the method was started, see :func:`tmc_vem.design.optimisers.minimise`.
    """

    z: Float
    evaluation: Evaluation
    feasible: bool
    converged: bool
    reason: str
    stationarity: float
    evaluations: int
    iterations: int
    starts: int
