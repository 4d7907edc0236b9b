"""Finding the best design: MMA and CCSAQ of nlopt, and an optimality-criteria update without dependencies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design import nlopt_methods
from tmc_vem.design.evaluation import Evaluate, Iterate, Optimum
from tmc_vem.design.history import CONVERGED, USED_UP, History
from tmc_vem.design.optimality_criteria import optimality_criteria
from tmc_vem.design.scaling import Scaling, stationarity
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice, require_within

Float = NDArray[np.float64]

METHODS = ("mma", "ccsaq", "oc")
# A method of nlopt that says it has converged is started again from its best design while more of the gradient than the
# first is left there, as long as each start betters the objective by the second (a fraction of it).
NOT_STATIONARY, WORTH_IT = 0.1, 1e-3


class FirstDesignFailed(InputError):
    """There is nothing to begin with."""


def require(method: str) -> None:
    """Check that a method is there, before anything long is done.

    Raises:
        InputError: it needs nlopt, which is not installed.
    """
    if method != "oc":
        nlopt_methods.library(method)


def minimise(
    evaluate: Evaluate,
    z0: Float,
    bounds: tuple[Float | float, Float | float],
    n_constraints: int,
    method: str = "mma",
    max_iterations: int = 100,
    tolerance: float = 0.01,
    on_iteration: Callable[[Iterate], None] | None = None,
    *,
    feasibility: float = 1e-6,
    scaling: Scaling | None = None,
    move: float = 0.2,
    damping: float = 0.5,
    constraint: Callable[[Float], float] | None = None,
) -> Optimum:
    """Make the objective of a design as small as its constraints allow.

    MMA and CCSAQ of nlopt stop when steps are short, which they also are when the method is stuck: then it is started
    again from its best design. What is returned is the best design of all evaluations, which need not be the last.

    Args:
        evaluate: objective, constraints and gradients at variables (n_variables,); what it raises comes out as it is.
        z0: (n_variables,) where to begin.
        bounds: lower and upper bounds, numbers or arrays (n_variables,).
        n_constraints: how many constraints there are.
        method: ``mma``, ``ccsaq``, or ``oc`` for one constraint that grows with every variable.
        max_iterations: how many evaluations there may be, those of steps that are then shortened among them.
        tolerance: the method has converged when an iteration changes no variable by more, in fractions of its range.
        on_iteration: told of every evaluation.
        feasibility: up to which value constraints count as satisfied.
        scaling: of objective and constraints, instead of that by the first evaluation; not for ``oc``.
        move, damping: of ``oc``: largest change of a variable in an iteration in fractions of its range, and exponent.
        constraint: of ``oc``: the value of the constraint at variables (n_variables,), cheap, as it is asked for some
            dozen times an iteration. Without it, the constraint is taken as linear in an iteration.

    Raises:
        InputError: an argument is out of range, the method does not fit the constraints or is not installed, or an
            evaluation has a wrong shape, values that are no numbers, or at ``z0`` none at all.
    """
    require_choice("method", method, METHODS)
    if isinstance(max_iterations, bool) or not isinstance(max_iterations, int) or max_iterations < 1:
        raise InputError(f"max_iterations = {max_iterations!r}: use a whole number from 1 on")
    require_within("tolerance of designs", tolerance, 0.0, 1.0)
    require_within("feasibility of constraints", feasibility, 0.0, 1.0, "a fraction of their limits")
    require_within("move limit", move, 1e-6, 1.0, "a fraction of the range of a variable")
    require_within("damping", damping, 0.01, 1.0, "0.5 is usual")
    if method == "oc" and n_constraints != 1:
        raise InputError(
            f"optimality criteria are for one constraint, the volume; here are {n_constraints}: use method 'mma'"
        )
    z0, lower, upper = _start_and_bounds(z0, bounds)
    history = History(evaluate, upper - lower, n_constraints, feasibility, on_iteration)
    first = history.at(z0)
    if not np.isfinite(first.objective):
        raise FirstDesignFailed("the first design could not be evaluated: begin with another one")
    starts = 1
    if method == "oc":
        reason = optimality_criteria(
            history, z0, lower, upper, evaluations=max_iterations, tolerance=tolerance, move=move, damping=damping,
            constraint=constraint,
        )  # fmt: skip
    else:
        reason, starts = _started(
            method, history, z0, lower, upper, scaling or Scaling.of(first, upper - lower), max_iterations, tolerance,
            feasibility,
        )  # fmt: skip
    return _optimum(history, reason, starts, lower, upper)


def _started(
    method: str,
    history: History,
    z0: Float,
    lower: Float,
    upper: Float,
    scaling: Scaling,
    evaluations: int,
    tolerance: float,
    feasibility: float,
) -> tuple[str, int]:
    """Start a method of nlopt, again where it is stuck; why it ended, and how many starts there were."""
    z, starts = z0, 0
    while True:
        starts += 1
        before = history.best
        assert before is not None
        left = evaluations - history.evaluations + 1  # the first of a start is known already
        reason = nlopt_methods.start(
            method, history, z, lower, upper, scaling, evaluations=left, tolerance=tolerance, feasibility=feasibility
        )
        assert history.best is not None
        z, best = history.best
        gained = before[1].objective - best.objective > WORTH_IT * abs(before[1].objective)
        gained |= before[1].violation > best.violation
        if reason == USED_UP or history.evaluations >= evaluations or not (gained and _stuck(history, lower, upper)):
            return reason, starts


def _stuck(history: History, lower: Float, upper: Float) -> bool:
    """Whether the best design is no optimum."""
    assert history.best is not None
    z, best = history.best
    return not history.feasible(best) or stationarity(z, best, lower, upper) > NOT_STATIONARY


def _start_and_bounds(z0: Float, bounds: tuple[Float | float, Float | float]) -> tuple[Float, Float, Float]:
    z0 = np.array(z0, dtype=np.float64)
    if z0.ndim != 1 or not len(z0):
        raise InputError(f"the first design has shape {z0.shape}: give its variables one after the other, one at least")
    lower, upper = (np.broadcast_to(np.asarray(bound, dtype=np.float64), z0.shape).copy() for bound in bounds)
    bad = np.flatnonzero(~(np.isfinite(lower) & np.isfinite(upper) & (lower < upper)))
    if len(bad):
        raise InputError(f"variable {bad[0]} has bounds {lower[bad[0]]:g} and {upper[bad[0]]:g}: lower < upper, finite")
    out = np.flatnonzero(~((z0 >= lower) & (z0 <= upper)))
    if len(out):
        n = out[0]
        raise InputError(f"variable {n} of the first design is {z0[n]:g}: its bounds are {lower[n]:g} and {upper[n]:g}")
    return z0, lower, upper


def _optimum(history: History, reason: str, starts: int, lower: Float, upper: Float) -> Optimum:
    assert history.best is not None
    z, best = history.best
    feasible = history.feasible(best)
    left = stationarity(z, best, lower, upper)
    converged = feasible and reason == CONVERGED
    if not feasible:
        worst = int(np.argmax(best.constraints))
        reason += (
            f"; no design satisfies the constraints: constraint {worst} of the best one is violated by "
            f"{best.constraints[worst]:.3g} of its limit"
        )
    elif converged and left > NOT_STATIONARY:
        reason += f"; {left:.0%} of the gradient is left, so this need not be an optimum: start again from here"
    return Optimum(z, best, feasible, converged, reason, left, history.evaluations, history.iterations, starts)
