"""Scaling of objective and constraints for the methods of nlopt, and how far from an optimum a design is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from tmc_vem.design.evaluation import Evaluation

Float = NDArray[np.float64]

# A value times its factor is at most this multiple of the number of variables. A function proportional to their sum has
# about 1; a gradient that is far smaller, such as of contact that is still open, says nothing.
LARGEST = 10.0
# A constraint is active if it is closer to its limit than this, and a variable on a bound within this of its range.
ACTIVE, ON_BOUND = 1e-3, 1e-6


@dataclass(frozen=True)
class Scaling:
    """Positive factors.

    MMA and CCSAQ of nlopt begin with a penalty of 1 for every variable, beside the derivative times half its range, and
    never go below 1e-5. With the root of the mean square of that product at 1, first steps are neither tiny nor wild,
    however many variables there are; constraints that are scaled much less than the objective end up violated.

    Attributes:
        objective: of the objective.
        constraints: (n_constraints,) of the constraints, 1 at least.
    """

    objective: float
    constraints: Float

    @staticmethod
    def of(evaluation: Evaluation, width_z: Float) -> Scaling:
        """From the first evaluation and the ranges (n_variables,) of the variables."""
        largest = LARGEST * len(width_z)

        def factor(value: float, gradient: Float) -> float:
            mean = float(np.sqrt(np.mean((0.5 * width_z * gradient) ** 2)))
            return 1.0 / max(mean, abs(value) / largest, 1e-250)

        constraints = [
            min(max(factor(float(value), row), 1.0), largest)
            for value, row in zip(evaluation.constraints, evaluation.jacobian, strict=True)
        ]
        whole = factor(evaluation.objective, evaluation.gradient)
        return Scaling(whole if whole < 1e200 else 1.0, np.array(constraints, dtype=np.float64))


def stationarity(z: Float, evaluation: Evaluation, lower_z: Float, upper_z: Float) -> float:
    """What is left of the gradient after multipliers of active constraints and bounds, over the gradient; 0 to about 1.

    The multipliers are those of least squares over the variables between their bounds (Kuhn-Tucker conditions).

    Args:
        z: (n_variables,) the design.
        evaluation: what it has.
        lower_z, upper_z: (n_variables,) bounds.
    """
    width = upper_z - lower_z
    gradient = evaluation.gradient * width
    length = float(np.linalg.norm(gradient))
    if length == 0.0 or not np.isfinite(evaluation.objective):
        return 0.0 if length == 0.0 and np.isfinite(evaluation.objective) else 1.0
    active = evaluation.constraints >= -ACTIVE
    jacobian = evaluation.jacobian[active] * width
    at_lower, at_upper = z - lower_z <= ON_BOUND * width, upper_z - z <= ON_BOUND * width
    free = ~(at_lower | at_upper)
    lagrangian = gradient
    if active.any():
        rows = free if free.any() else np.ones(len(z), dtype=bool)
        sizes = np.maximum(np.linalg.norm(jacobian, axis=1), np.finfo(float).tiny)
        multipliers = nnls((jacobian / sizes[:, None])[:, rows].T, -gradient[rows] / length)[0] * length / sizes
        lagrangian = gradient + multipliers @ jacobian
    held = (at_lower & (lagrangian > 0.0)) | (at_upper & (lagrangian < 0.0))
    return float(np.linalg.norm(np.where(held, 0.0, lagrangian)) / length)
