"""Optimality-criteria update for one constraint that grows with every variable, such as the volume.

Where the objective falls with every variable, b_i = -(df/dz_i) / (lambda dg/dz_i) is 1 at an optimum between bounds.
z_i b_i^eta is the next design, with lambda such that the constraint is just satisfied (Bendsoe & Sigmund, Topology
Optimization, 2003, section 1.2.1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tmc_vem.design.evaluation import Evaluation
from tmc_vem.design.history import CONVERGED, USED_UP, History
from tmc_vem.support import notes
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

SMALLEST = (
    1e-3  # of its range: what a variable on its lower bound is multiplied as, which it would never leave otherwise
)
VANISHED = 1e-12  # of its range: a variable that is on its lower bound but for that
ROUNDING = 1e-9  # of the largest derivative: a sign below that says nothing
HALVINGS = 6  # of a step to a design that cannot be evaluated
SHORTER, LONGER = 0.7, 1.1  # of the move limit after a design that is worse, or better
SMALLEST_EXPONENT = 0.1
STUCK = "no design near the last one could be evaluated"


def optimality_criteria(
    history: History,
    z0: Float,
    lower_z: Float,
    upper_z: Float,
    *,
    evaluations: int,
    tolerance: float,
    move: float,
    damping: float,
    constraint: Callable[[Float], float] | None,
) -> str:
    """Iterate until designs hardly change.

    After a design that is worse than the one before, though that was feasible, exponent and move limit shrink: with a
    stiffness of a high power of the variables, the update goes to and fro otherwise.

    Args:
        history: evaluates.
        z0: (n_variables,) where to begin.
        lower_z, upper_z: (n_variables,) bounds.
        evaluations: how many there may be.
        tolerance: an iteration that changes no variable by more ends it, in fractions of their ranges.
        move: largest change at first of a variable in an iteration, in fractions of its range.
        damping: exponent eta at first.
        constraint: its value at a design; without it, that of its tangent at the last design.

    Returns:
        Why it ended.

    Raises:
        InputError: the constraint falls with a variable.
    """
    z, said, limit, exponent = z0, False, move, damping
    evaluation = history.at(z)
    while history.evaluations < evaluations:
        target = update(z, evaluation, lower_z, upper_z, limit, exponent, constraint)
        said = said or _note_wrong_signs(evaluation)
        following = history.at(target)
        for _ in range(HALVINGS):
            if np.isfinite(following.objective) or history.evaluations >= evaluations:
                break
            target = 0.5 * (z + target)
            following = history.at(target)
        if not np.isfinite(following.objective):
            return USED_UP if history.evaluations >= evaluations else STUCK
        change = history.change(target, z)
        if following.objective > evaluation.objective and history.feasible(evaluation):
            limit, exponent = SHORTER * limit, max(SHORTER * exponent, SMALLEST_EXPONENT)
        else:
            limit = min(LONGER * limit, move)
        z, evaluation = target, following
        if change <= tolerance:
            return CONVERGED
    return USED_UP


def update(
    z: Float,
    evaluation: Evaluation,
    lower_z: Float,
    upper_z: Float,
    move: float,
    damping: float,
    constraint: Callable[[Float], float] | None = None,
) -> Float:
    """The next design (n_variables,); the arguments are those of :func:`optimality_criteria`.

    Raises:
        InputError: the constraint falls with a variable.
    """
    width = upper_z - lower_z
    growth = evaluation.jacobian[0]
    falling = np.flatnonzero(growth < -ROUNDING * np.abs(growth).max())
    if len(falling):
        n = falling[0]
        raise InputError(
            f"the constraint of the optimality criteria falls with variable {n} ({growth[n]:.3g}): they need one that "
            "grows with all, such as the volume; use method 'mma'"
        )
    base = np.maximum(z - lower_z, SMALLEST * width)
    low, high = np.maximum(lower_z, z - move * width), np.minimum(upper_z, z + move * width)
    gains, costs = evaluation.gradient < 0.0, growth > 0.0
    # what costs nothing grows, what gains nothing shrinks, and what does neither stays
    one_sided = np.where(gains, high, np.where(costs, low, z))
    both = gains & costs
    if not both.any():
        return one_sided
    log_ratio = np.log(-evaluation.gradient[both]) - np.log(growth[both])

    def design(log_multiplier: float) -> Float:
        factor = np.exp(np.clip(damping * (log_ratio - log_multiplier), -700.0, 700.0))
        new = one_sided.copy()
        new[both] = np.clip(lower_z[both] + base[both] * factor, low[both], high[both])
        return new

    def excess(log_multiplier: float) -> float:
        new = design(log_multiplier)
        return float(evaluation.constraints[0] + growth @ (new - z)) if constraint is None else constraint(new)

    # at the first multiplier all are at their upper limits, at the second all at their lower ones
    first = float(log_ratio.min() + np.log(SMALLEST) / damping) - 1.0
    second = float(log_ratio.max() - np.log(VANISHED) / damping) + 1.0
    if excess(first) <= 0.0:
        return design(first)
    if excess(second) >= 0.0:
        return design(second)
    return design(float(brentq(excess, first, second, xtol=1e-12, rtol=1e-14)))


def _note_wrong_signs(evaluation: Evaluation) -> bool:
    wrong = evaluation.gradient > ROUNDING * np.abs(evaluation.gradient).max()
    if not wrong.any():
        return False
    notes.say(  # the same words each time, as it need be said only once
        "the objective grows with some variables, which optimality criteria take as gaining nothing: method 'mma' has "
        "no such limit",
        stacklevel=4,
    )
    return True
