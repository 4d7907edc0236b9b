"""How far estimated errors are from true ones in contact: recovered gradients against a finer mesh.

    python benchmarks/estimators.py [box box-light cbox]

For meshes of a problem: energy in excess of that of the finest mesh and its estimate, then gap and reaction less those
of the finest mesh, the estimate with the adjoint field, and the sum of the cells' indicators with the part that the
medium has in it. Solutions have re-entrant corners and loads at single nodes: the finest mesh has errors too, and what
is called true is only a part of it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from tmc_vem import Box, RunOptions
from tmc_vem.adapt.recovery import dual_indicators, energy_indicators
from tmc_vem.problems import CBox, Problem
from tmc_vem.sensitivity.equilibrium import Equilibrium
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.simulation.simulation import prepare
from tmc_vem.system.control import Control

RESULTS = ("gap", "reaction")
Make = Callable[[int], Problem]


def cbox(n: int) -> CBox:
    """The C-box with n times as many cells along each side."""
    return CBox(cells=(20 * n, 10 * n), solid_cells="quadrilaterals", column_cells=n)


CASES: dict[str, tuple[Make, tuple[int, ...]]] = {
    "box": (lambda n: Box(cells=(20 * n, 5 * n)), (1, 2, 4, 8)),
    "box-light": (lambda n: Box(cells=(20 * n, 5 * n), uy=-0.01), (1, 2, 4, 8)),
    "cbox": (cbox, (1, 2, 4)),
}


def solved(problem: Problem) -> tuple[Any, Any, dict[str, Any]]:
    """A run, its state with the equations linearised there, and derivatives of its results."""
    run = prepare(problem, None, RunOptions())
    result = run.go()
    if not result.complete:
        raise SystemExit(f"{problem.name}: {result.reason}")
    state = Equilibrium(run.solver, run.system, result.end.give(run.system), Control(1.0))
    return run, state, {name: functional_of(name, problem, run.system).derivative(state.state) for name in RESULTS}


def study(name: str, make: Make, sizes: tuple[int, ...]) -> None:
    """Print effectivities on all meshes but the finest."""
    run, state, found = solved(make(sizes[-1]))
    finest = {name: derivative.value for name, derivative in found.items()}
    least = run.system.energy(state.state.u).energy
    print(f"{name}: {run.n_cells} cells in the finest mesh")
    for n in sizes[:-1]:
        problem = make(n)
        run, state, found = solved(problem)
        mesh, u = problem.make_mesh(), state.state.u
        excess = run.system.energy(u).energy - least
        estimate = (energy_indicators(problem, run.system, mesh, u) ** 2).sum()
        ratio = estimate / excess
        print(f"{run.n_cells:6} cells  energy   true {excess:10.3e}  estimate {estimate:10.3e}  ratio {ratio:.2f}")
        for result, derivative in found.items():
            field = state.adjoint(derivative).field
            integral, indicators = dual_indicators(problem, run.system, mesh, u, field)
            true = finest[result] - derivative.value
            medium = indicators[mesh.region_c == mesh.region_names.index("medium")].sum() / indicators.sum()
            print(
                f"              {result:8} true {true:10.3e}  estimate {-integral:10.3e}  ratio {-integral / true:.2f}"
                f"  indicators {indicators.sum():9.3e}, {medium:.1e} of them medium"
            )


if __name__ == "__main__":
    for case in sys.argv[1:] or CASES:
        study(case, *CASES[case])
