"""Derivatives at equilibria against equilibria nearby: problems, and Taylor rates of results that are solved for again.

Equilibria are found to rounding; one with another value of a number begins at the one that is known.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.base import Problem
from tmc_vem.problems.description import ProblemTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.sensitivity.at_end import Sensitivities, _at_end
from tmc_vem.sensitivity.differences import TIGHT, changed, number_of
from tmc_vem.sensitivity.functionals import Functionals
from tmc_vem.sensitivity.functionals_record import FunctionalState
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.simulation import Simulation, prepare
from tmc_vem.support.distributed import Vec
from tmc_vem.support.validation import build
from tmc_vem.system.control import Control

STEPS = np.array([4e-3, 2e-3])  # relative to the number
EXACT = 1e-9  # of the result: a remainder below is rounding, of what is linear in the number
AGREED = 1e-6  # relative: derivatives and extrapolated central differences
SEAL = """
name = "plug"
gap = ["tip", "ground"]
shapes.frame = { rectangle = [0, 0, 1, 1] }
shapes.foot = { rectangle = [0, 0, 1, 0.3] }
shapes.block = { rectangle = [0.3, 0.5, 0.7, 1.0] }
regions.foot = { shape = "foot", solid = { E = 40, nu = 0.3 } }
regions.block = { shape = "block", solid = { K = 20, mu = 10, model = "gent", J_m = 30 } }
regions.medium = { shape = "frame - foot - block", medium = { mu = 10, gamma = 1e-3, alpha = 0.5, h = 0.2, beta = 1 } }
mesh = { cells = "voronoi", size = 0.18 }
points.tip = [0.5, 0.5]
points.ground = [0.5, 0.3]
edges.bottom = { line = [[0, 0], [1, 0]] }
edges.top = { line = [[0.3, 1], [0.7, 1]] }
probes.side = { displacement = "ux", at = [0.65, 0.75] }
probes.hold = { reaction = "uy", at = "bottom" }
probes.squeezed = { mean = "J", region = "medium" }
probes.cut = { cut_force = "y", line = [[-0.1, 0.15], [1.1, 0.16]] }
probes.mises = { mean = "von_mises", region = "foot" }
probes.stored = { energy = "stored", region = "block" }
support = [{ at = "bottom", ux = 0, uy = 0 }, { at = "top", ux = 0.02 }]
load = { at = "top", uy = -0.18 }
"""


def own(text: str = SEAL, *without: str, **more: Any) -> OwnProblem:
    """The problem of a text of TOML, less some of its lines by what they begin with, with more entries."""
    lines = [line for line in text.splitlines() if not line.startswith(without or ("#",))]
    table = tomllib.loads("\n".join(lines))
    return OwnProblem(build(ProblemTable, {**table, **more}, "case"))


@dataclass(frozen=True)
class OnMesh(Wrapped):
    """A problem on a mesh that is there."""

    mesh: PolygonMesh

    def make_mesh(self) -> PolygonMesh:
        """The mesh."""
        return self.mesh


@dataclass(frozen=True)
class Case:
    """A problem in equilibrium at its full load.

    Attributes:
        problem, options: of it.
        simulation: whose solver and system stand there.
        u, position: the state.
        mesh: of the problem.
        found: derivatives there.
    """

    problem: Problem
    options: RunOptions
    simulation: Simulation
    u: Vec
    position: Control
    mesh: PolygonMesh
    found: Sensitivities

    def nearby(self, name: str, value: float, results: Sequence[str]) -> dict[str, float]:
        """Results in the equilibrium of the problem with another value of a number."""
        problem = changed(self.problem, name, value)
        simulation = prepare(OnMesh(problem, self.mesh), None, self.options)
        system, solver, u = simulation.system, simulation.solver, self.u.copy()
        solver.options = TIGHT
        solver.predict(self.u, self.position, u)
        solved = solver.solve(u)
        assert solved.converged, solved.reason
        residual = system.create_vector()
        system.residual(u, residual)
        functionals, state = Functionals(problem, system), FunctionalState(u, residual, self.position)
        return {name: functionals.of(name).derivative(state).value for name in results}


def case_of(problem: Problem, method: str = "vem", **options: Any) -> Case:
    """A problem solved to rounding."""
    given = RunOptions(method, snapshots=0, **options)
    simulation = prepare(problem, None, given)
    simulation.solver.options = TIGHT
    result = simulation.go()
    assert result.complete, result.reason
    found = _at_end(simulation, result)
    state = found.gradients.equilibrium.state
    return Case(problem, given, simulation, state.u, state.position, problem.make_mesh(), found)


def wrong(case: Case, results: Sequence[str], numbers: Sequence[str]) -> list[str]:
    """Derivatives whose remainders do not fall with the square of the change, or that differ from differences."""
    table = case.found.table(results, numbers)
    said = []
    for name in numbers:
        number = number_of(case.problem, name)
        steps = STEPS * (abs(number) or 1.0)
        ahead, behind = ([case.nearby(name, number + sign * h, results) for h in steps] for sign in (1, -1))
        for result in results:
            entry = table.entry(result, name)
            up, down = (np.array([values[result] for values in side]) for side in (ahead, behind))
            said += _faults(f"d({result})/d({name})", entry.value, entry.derivative, steps, up, down)
    return said


def _faults(what: str, value: float, slope: float, steps: Any, up: Any, down: Any) -> list[str]:
    remainders = np.abs(up - value - steps * slope)
    scale = EXACT * max(abs(value), abs(slope) * steps[0])
    is_exact = remainders.max() < scale
    rate = np.inf if is_exact else float(np.diff(np.log(remainders))[-1] / np.diff(np.log(steps))[-1])
    centre = (up - down) / (2.0 * steps)
    once = float(centre[1] + (centre[1] - centre[0]) / 3.0)
    away = abs(once - slope)
    said = [] if rate > 1.9 else [f"{what}: rate {rate:.2f}, remainders {remainders}, slope {slope:g}"]
    if away > AGREED * max(abs(slope), scale / steps[0] / EXACT * 1e-3):
        said.append(f"{what}: {slope:.10g} is not {once:.10g}")
    return said


def per_cell_sums(case: Case, results: Sequence[str], numbers: Sequence[str]) -> Mapping[str, float]:
    """By how much, relatively, derivatives by the values in cells sum to something else than that by the number."""
    found: dict[str, float] = {}
    for result in results:
        for name in numbers:
            cells = case.found.gradient(result, name, per_cell=True)
            whole = case.found.gradient(result, name)
            size = float(np.abs(cells).sum())
            found[f"{result} {name}"] = abs(float(np.sum(cells)) - whole) / size if size else abs(float(whole))
    return found


def finer(problem: OwnProblem, **mesh: Any) -> OwnProblem:
    """The problem with other entries of its mesh."""
    table = replace(problem.table, mesh=replace(problem.table.mesh, **mesh))
    return replace(problem, table=table)
