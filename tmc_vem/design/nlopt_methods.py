"""MMA and CCSAQ of nlopt (Svanberg, SIAM J. Optim. 12 (2002) 555), with scaling, and with exceptions that come out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.history import CONVERGED, USED_UP, History
from tmc_vem.design.scaling import Scaling
from tmc_vem.support.optional import load

Float = NDArray[np.float64]

METHODS = {"mma": "LD_MMA", "ccsaq": "LD_CCSAQ"}
# How a run ended, by nlopt's number.
ENDS = {
    1: "the method is at an end", 3: "the objective hardly changes any more", 4: CONVERGED, 5: USED_UP,
    -4: "rounding errors leave no progress",
}  # fmt: skip


def start(
    method: str,
    history: History,
    z0: Float,
    lower_z: Float,
    upper_z: Float,
    scaling: Scaling,
    *,
    evaluations: int,
    tolerance: float,
    feasibility: float,
) -> str:
    """One start of a method.

    Args:
        method: ``mma`` or ``ccsaq``.
        history: evaluates.
        z0: (n_variables,) where to begin.
        lower_z, upper_z: (n_variables,) bounds.
        scaling: of objective and constraints.
        evaluations: how many there may be.
        tolerance: an iteration that changes no variable by more ends it, in fractions of their ranges.
        feasibility: which violation is none.

    Returns:
        Why it ended, one of the values of :data:`ENDS`.

    Raises:
        InputError: nlopt is not installed. Whatever an evaluation raises, Ctrl-C too, comes out as it is.
    """
    nlopt = library(method)
    raised: list[BaseException] = []
    opt = nlopt.opt(getattr(nlopt, METHODS[method]), len(z0))
    opt.set_lower_bounds(lower_z)
    opt.set_upper_bounds(upper_z)
    opt.set_xtol_abs(tolerance * (upper_z - lower_z))
    opt.set_maxeval(evaluations)

    def objective(z: Float, gradient: Float) -> float:
        try:
            evaluation = history.at(z)
            if gradient.size:
                gradient[:] = scaling.objective * evaluation.gradient
            return float(scaling.objective * evaluation.objective)
        except BaseException as error:
            raised.append(error)
            raise nlopt.ForcedStop from None

    def constraints(result: Float, z: Float, gradient: Float) -> None:
        try:
            evaluation = history.at(z)
            # without a value they count as violated: else a design that fails is taken in place of one that violates
            known = np.isfinite(evaluation.objective)
            result[:] = scaling.constraints * evaluation.constraints if known else np.inf
            if gradient.size:
                gradient[:] = scaling.constraints[:, None] * evaluation.jacobian
        except BaseException as error:
            raised.append(error)
            raise nlopt.ForcedStop from None

    opt.set_min_objective(objective)
    if len(scaling.constraints):
        opt.add_inequality_mconstraint(constraints, feasibility * scaling.constraints)
    _optimise(nlopt, opt, z0, raised)
    return ENDS.get(opt.last_optimize_result(), f"nlopt ended with {opt.last_optimize_result()}")


def library(method: str) -> Any:
    """nlopt.

    Raises:
        InputError: it is not installed.
    """
    return load("nlopt", f"the method '{method}' needs")


def _optimise(nlopt: Any, opt: Any, z0: Float, raised: list[BaseException]) -> None:
    try:
        opt.optimize(z0)
    except nlopt.RoundoffLimited:
        pass  # the best design is known all the same
    except BaseException:
        if not raised:
            raise
    if raised:
        raise raised[0]
