"""Which way of stepping needs how many Newton iterations: what stands behind the tables of docs/solver.md, printed.

    python benchmarks/solver_strategies.py                      # all, some minutes
    python benchmarks/solver_strategies.py reuse                # one of them

Studies: strategies (of load stepping, all pairs of table 2 and smaller gammas), reuse (of a tangent), hard (C-box,
stiff punch and several bodies to full load). ``scripts/refresh-numbers solver-strategies`` measures the same, keeps
it, and writes it into the page. Iterations include those of failed attempts; tangent predictors, one more linear solve
each, are counted apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI

from tmc_vem.problems import Box, Medium
from tmc_vem.simulation import RunOptions, control_path, discretise
from tmc_vem.solve.budget import Budget
from tmc_vem.solve.newton import NewtonOptions, NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings


@dataclass(frozen=True)
class Strategy:
    """Options of the stepping, and values that are continued from."""

    stepping: SteppingOptions = field(default_factory=SteppingOptions)
    continuation: Mapping[str, float] = field(default_factory=dict)


STRATEGIES = {
    "equal": Strategy(SteppingOptions(steps=100, order=1, slopes=False)),
    "linear": Strategy(SteppingOptions(order=1, target_iterations=5, growth=1.5, slopes=False, foresee=False)),
    "cubic": Strategy(SteppingOptions(slopes=False, foresee=False)),
    "default": Strategy(),
    "continuation": Strategy(continuation={"gamma": 1e-4}),
}


def effort(
    alpha_r: float, gamma: float, strategy: str, *, method: str = "vem", penalty: str = "none", rule: str = "auto",
    limit: int = 3000,
) -> dict[str, Any]:  # fmt: skip
    """Load reached, steps, iterations and jumps of the box of 40 x 10 cells.

    Args:
        alpha_r, gamma: of the medium.
        strategy: of ``STRATEGIES``.
        method: 'vem' or 'fem'.
        penalty: interior penalty of the finite elements.
        rule: quadrature of the virtual elements.
        limit: Newton iterations.
    """
    problem, chosen = Box(cells=(40, 10), medium=Medium(gamma=gamma, alpha_r=alpha_r)), STRATEGIES[strategy]
    fem, element = FemSettings(interior_penalty=penalty), ElementSettings(rule=rule)
    options = RunOptions(method=method, fem=fem, element=element, continuation=chosen.continuation)
    system = discretise(problem, options, MPI.COMM_WORLD)
    solver, budget = NewtonSolver(system), Budget(limit)
    steps: list[Any] = []
    stepper = LoadStepper(
        solver,
        chosen.stepping,
        lambda step, *_: steps.append(step),
        control_path(problem, options),
        {"gamma": gamma},
        on_iteration=lambda *_: budget.spend(),
    )
    result = stepper.run(system.create_vector())
    return {
        "iterations": solver.iterations_done, "steps": len(steps), "load": 1.0 if result.complete else result.load,
        "jumps": sum(bool(step.jumped) for step in steps),
        "stiffened": not chosen.continuation and any(step.control.parameters for step in steps),
    }  # fmt: skip


def reused(cells: tuple[int, int], reuse: bool) -> dict[str, float]:
    """Iterations, factorisations and gap of the box, alpha_r = 1, gamma = 1e-5, with and without reuse of a tangent."""
    system = discretise(Box(cells=(cells[0], cells[1]), medium=Medium(gamma=1e-5, alpha_r=1.0)), RunOptions(),
                        MPI.COMM_WORLD)  # fmt: skip
    options = NewtonOptions() if reuse else NewtonOptions(reuse=0.0)
    solver, counted = NewtonSolver(system, options), [0]
    assemble = system.jacobian

    def jacobian(*arguments: Any) -> Any:
        counted[0] += 1
        return assemble(*arguments)

    system.jacobian = jacobian  # type: ignore[method-assign]
    u = system.create_vector()
    assert LoadStepper(solver, SteppingOptions()).run(u).complete
    names = ("flange_top", "flange_bottom")
    top, bottom = system.point_coordinates(names) + system.point_displacements(u, names)
    gap = float(np.hypot(*(top - bottom)))
    return {"iterations": solver.iterations_done, "factorisations": counted[0], "gap": gap}


if __name__ == "__main__":
    from pages.solver import BLOCKS
    from pages.study import main

    main(__doc__, BLOCKS, "solver-")
