"""Which way of stepping needs how many Newton iterations: strategies against cases, as a table for docs/solver.md.

    python benchmarks/solver_strategies.py                      # hard cases, all strategies, VEM
    python benchmarks/solver_strategies.py --table2             # all nine pairs of table 2 and gamma 1e-7, 1e-8
    python benchmarks/solver_strategies.py --table2 --method fem --strategies default continuation

Iterations include those of failed attempts; tangent predictors, one more linear solve each, are counted apart.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mpi4py import MPI

from tmc_vem.problems import Box, CBox, Medium, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.simulation import RunOptions, control_path, discretise
from tmc_vem.solve.budget import Budget
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.fem_settings import INTERIOR_PENALTIES, FemSettings
from tmc_vem.vem.spaces.element_settings import RULES, ElementSettings


@dataclass(frozen=True)
class Strategy:
    """Options of the stepping, and values that are continued from."""

    stepping: SteppingOptions = field(default_factory=SteppingOptions)
    continuation: Mapping[str, float] = field(default_factory=dict)


STRATEGIES = {
    "equal": Strategy(SteppingOptions(steps=100, order=1)),
    "linear": Strategy(SteppingOptions(order=1, target_iterations=5, growth=1.5)),
    "quadratic": Strategy(SteppingOptions(order=2)),
    "default": Strategy(),
    "continuation": Strategy(continuation={"gamma": 1e-4}),
}
TABLE_2 = [(alpha_r, gamma) for alpha_r in (10.0, 1.0, 0.1) for gamma in (1e-4, 1e-5, 1e-6)]


def cases(cells: tuple[int, int], table2: bool) -> dict[str, Any]:
    """Problems by name."""
    pairs = TABLE_2 if table2 else [(1.0, 1e-5), (0.1, 1e-6)]
    found: dict[str, Any] = {
        f"box {alpha_r:g}, {gamma:.0e}": Box(cells=cells, medium=Medium(gamma=gamma, alpha_r=alpha_r))
        for alpha_r, gamma in [*pairs, (0.1, 1e-7), (0.1, 1e-8)]
    }
    if not table2:
        found["cbox -1, alpha_r 1"] = CBox(uy=-1.0, medium=angle_medium(1e-5, 1.0))
        found["stiff punch, 1e-5"] = Punch(stiffness=100.0, medium=angle_medium(1e-5, 1.0))
    return found


def measure(problem: Any, strategy: Strategy, method: str, penalty: str, rule: str, limit: int) -> str:
    """Load reached, steps and iterations, as a cell of the table."""
    if strategy.continuation and problem.medium.gamma >= strategy.continuation["gamma"]:
        return ""
    fem = FemSettings(interior_penalty=penalty)
    element = ElementSettings(rule=rule)
    options = RunOptions(method=method, fem=fem, element=element, continuation=strategy.continuation)
    system = discretise(problem, options, MPI.COMM_WORLD)
    solver, budget = NewtonSolver(system), Budget(limit)
    steps: list[Any] = []
    stepper = LoadStepper(
        solver,
        strategy.stepping,
        lambda step, *_: steps.append(step),
        control_path(problem, options),
        {"gamma": problem.medium.gamma},
        on_iteration=lambda *_: budget.spend(),
    )
    begin = time.monotonic()
    result = stepper.run(system.create_vector())
    reached = "" if result.complete else f", stops at {result.load:.1%}"
    jumps = sum(step.jumped for step in steps)
    jumped = f", {jumps} jump{'s' * (jumps > 1)}" if jumps else ""
    stiffened = ", stiffened" if not strategy.continuation and any(step.control.parameters for step in steps) else ""
    cell = f"{solver.iterations_done} in {len(steps)}{reached}{jumped}{stiffened}"
    print(f"    {cell} ({time.monotonic() - begin:.1f} s, {result.reason})", flush=True)
    return cell


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table2", action="store_true", help="the box only, all pairs of table 2")
    parser.add_argument("--method", choices=["vem", "fem"], default="vem")
    parser.add_argument("--interior-penalty", choices=INTERIOR_PENALTIES, default="none", help="of --method fem")
    parser.add_argument("--rule", choices=RULES, default="auto", help="of --method vem")
    parser.add_argument("--cells", type=int, nargs=2, default=(40, 10))
    parser.add_argument("--strategies", nargs="+", choices=STRATEGIES, default=list(STRATEGIES))
    parser.add_argument("--cases", nargs="+", help="beginnings of the names of the cases to run; default: all")
    parser.add_argument("--limit", type=int, default=3000, help="Newton iterations a run")
    arguments = parser.parse_args()
    rows = [f"| case | {' | '.join(arguments.strategies)} |", "|---|" + "---|" * len(arguments.strategies)]
    for name, problem in cases(tuple(arguments.cells), arguments.table2).items():
        if arguments.cases and not name.startswith(tuple(arguments.cases)):
            continue
        row = []
        for strategy in arguments.strategies:
            print(f"{name}, {strategy}", flush=True)
            settings = (arguments.method, arguments.interior_penalty, arguments.rule, arguments.limit)
            row.append(measure(problem, STRATEGIES[strategy], *settings))
        rows.append(f"| {name} | {' | '.join(row)} |")
    print(f"\nNewton iterations in load steps, {arguments.method}\n\n" + "\n".join(rows))


if __name__ == "__main__":
    main()
