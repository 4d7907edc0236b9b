"""Where the next state of a path is, from the last ones: slopes, extrapolation, and how far it can be relied on."""

from __future__ import annotations

from collections.abc import Sequence

from tmc_vem.solve.newton import Iteration, NewtonSolver
from tmc_vem.solve.states import Float, States
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import EvaluationError
from tmc_vem.system.control import Control

# Way along the path over which a slope is a difference: far above rounding, and nothing bends over it.
SMALL_WAY = 1e-6
# Solutions with the last factors that a slope takes. They are those of the iterate before the last: each makes what is
# left of the error some hundred times smaller.
SOLUTIONS = 2
# With equal steps, slopes are worth their solutions where extrapolation of states alone has a first correction that is
# followed by one of more than this part of it.
WORTH = 1e-3
WRONG = 0.5  # last change of a slope, relative to it, above which the factors say nothing about it
# Automatic steps reach to where J is still expected to be positive after this many times the step, and two orders of
# extrapolation differ by so little that Newton's first correction would be followed by one that is this part of it.
REACH, CONTRACTION = 2.0, 0.1
# A step is cut to a little less than what should do, at most to this part at once, and so often.
A_LITTLE_LESS, LEAST, CUTS = 0.95, 0.25, 5


def slope_of(solver: NewtonSolver, u: Vec, residual: Vec, ahead: Control) -> Vec | None:
    """Change of a state per length of the path, by the factors that have led to it.

    Args:
        solver: whose last solution is ``u``.
        u: the state.
        residual: there, with the reactions.
        ahead: a point of the path, ``SMALL_WAY`` beyond that of ``u``; the system has its parameters.

    Returns:
        A new vector; None where the factors do not give it. The system has the position ``ahead`` afterwards.
    """
    if not solver.has_factors:
        return None
    rate, change, there = u.duplicate(), u.duplicate(), u.duplicate()
    rate.set(0.0)
    found = False
    try:
        for _ in range(SOLUTIONS):
            there.waxpy(SMALL_WAY, rate, u)
            solver.set_prescribed(there, ahead)
            imbalance = solver.evaluate(there)
            if not imbalance.evaluation.admissible:
                return None
            rate.waxpy(-1.0, u, there)  # now with what is prescribed
            rate.scale(1.0 / SMALL_WAY)
            there.waxpy(-1.0, residual, imbalance.residual)
            if not solver.correction(there, change):
                return None
            rate.axpy(1.0 / SMALL_WAY, change)
        found = change.norm(3) <= WRONG * SMALL_WAY * rate.norm(3)
        return rate if found else None
    except EvaluationError:
        return None
    finally:
        for vector in (change, there) if found else (change, there, rate):
            vector.destroy()


def extrapolate(
    solver: NewtonSolver, u: Vec, states: States, point: Float, highest: int, out: Vec, *, slopes: bool = True
) -> int:
    """Extrapolate with the highest order that keeps J > 0.

    Args:
        solver: of the system.
        u: the last state.
        states: it and those before it.
        point: of the path, at which the state is wanted.
        highest: order.
        out: the state there.
        slopes: whether along slopes as well.

    Returns:
        The order; 0 if there is none.
    """
    increment = u.duplicate()
    try:
        for order in states.orders(point, slopes=slopes):
            if order <= highest:
                states.extrapolate(point, order, out, slopes=slopes)
                increment.waxpy(-1.0, u, out)
                if solver.is_admissible(u, increment):
                    return order
        return 0
    finally:
        increment.destroy()


def reliable(solver: NewtonSolver, u: Vec, states: States, point: Float, highest: int, bend: float) -> float:
    """Up to which part of the way to a point extrapolation along slopes can be relied on; 1 for all of it, and where no
    slope is known.

    Args:
        solver, u, states, point, highest: those of :func:`extrapolate`.
        bend: what :func:`bend_of` has said of the last step; 0 if nothing is known.
    """
    orders = [order for order in states.orders(point) if order <= highest]
    if not orders or not states.knows_slope(point):
        return 1.0
    first, second = u.duplicate(), u.duplicate()
    states.extrapolate(point, orders[0], first)
    second.waxpy(-1.0, u, first)
    reach = solver.system.max_step(u, second) / REACH
    error = 0.0
    if bend > 0.0 and len(orders) > 1:
        states.extrapolate(point, orders[1], second)
        second.axpy(-1.0, first)
        error = bend / CONTRACTION * second.norm() / solver.system.size
    first.destroy()
    second.destroy()
    part = min(1.0, reach, error ** (-1.0 / (orders[1] + 1)) if error > 1.0 else 1.0)
    return 1.0 if part == 1.0 else max(LEAST, A_LITTLE_LESS * part)


def bend_of(iterations: Sequence[Iteration], before: float) -> float:
    """How fast the tangent turns: the second correction of Newton's method by the square of the first, in Euclidean
    norms relative to the domain; what was known before, if there is only one."""
    if len(iterations) < 2 or iterations[0].length == 0.0:
        return before
    first, second = iterations[:2]
    shrunk = second.length / first.length if first.step == 1.0 else max(1.0, before * first.length)
    return shrunk / first.length
