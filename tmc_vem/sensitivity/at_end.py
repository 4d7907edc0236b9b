"""Derivatives at the last state of a run: one that is made here, a result, or a directory with a checkpoint."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.results.records import PROBLEM, StepRecord
from tmc_vem.results.run_result import RunResult, refuse_search
from tmc_vem.sensitivity.changes import Changes, require_cells
from tmc_vem.sensitivity.equilibrium import Equilibrium
from tmc_vem.sensitivity.functionals import Functionals
from tmc_vem.sensitivity.functionals_record import Functional
from tmc_vem.sensitivity.gradient import Gradients, refuse_friction
from tmc_vem.sensitivity.table import Entry, SensitivityTable
from tmc_vem.sensitivity.units import of_number, of_result
from tmc_vem.simulation.adapted import on_adapted_mesh
from tmc_vem.simulation.checkpoint import Checkpoint, require_same_inputs
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.simulation.plan import run_inputs
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.simulation.saved import Saved
from tmc_vem.simulation.simulation import Simulation, prepare
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import ConvergenceError, InputError
from tmc_vem.system.control import Control

Float = NDArray[np.float64]

SET = "set"  # what was changed in a problem file: the copy of it in a run directory has it, and does not say so


class SensitivityWarning(UserWarning):
    """A derivative is that of a branch that another problem nearby may not follow."""


class Sensitivities:
    """Derivatives at one state, all with the factors of one tangent; all ranks make and use it together.

    Args:
        problem: what was solved.
        equilibrium: the state.
        history: the steps that have led to it.

    Attributes:
        problem: the same.
        gradients: what makes them.
        doubts: why values nearby may not follow the derivatives, in sentences; empty if nothing is known.
    """

    def __init__(self, problem: Problem, equilibrium: Equilibrium, history: Sequence[StepRecord] = ()) -> None:
        self.problem = problem
        self.gradients = Gradients(problem, equilibrium)
        self.doubts = _doubts(equilibrium, history)
        self._has_warned = False

    def value(self, of: str | Functional) -> float:
        """A result itself.

        Raises:
            InputError: there is no such result, or it has no derivative.
        """
        return self.gradients.sensitivity(of).value

    def per_load(self, of: str | Functional) -> float:
        """Its derivative along the path, per load factor.

        Raises:
            InputError: there is no such result, or it has no derivative.
        """
        return self.gradients.per_load(of)

    def gradient(self, of: str | Functional, by: str, *, per_cell: bool = False) -> float | Float:
        """Derivative of a result with respect to a number of the problem.

        Args:
            of: a probe by name, ``reaction``, ``displacement``, ``energy``, ``compliance``, ... or a functional.
            by: a number by name as in ``--set``, or ``REGION.PARAMETER`` of an energy alone.
            per_cell: an array (n_cells of the whole mesh,) with the derivative by the number in each cell alone, 0
                where cells do not have it; its sum is the derivative by the number.

        Returns:
            In the unit of the result per unit of the number; the same on all ranks.

        Raises:
            InputError: there is no such result or number, or no derivative.
        """
        self._warn()
        change = self.gradients.by(by)
        return self.gradients.by_cells(of, change) if per_cell else self.gradients.derivative(of, change)

    def table(self, of: Sequence[str], by: Sequence[str]) -> SensitivityTable:
        """Each result with each number; one back-substitution a result.

        Args:
            of, by: names, as in :meth:`gradient`.

        Raises:
            InputError: there is no such result or number, or no derivative.
        """
        self._warn()
        units, entries = self.problem.units(), []
        changes = {name: self.gradients.by(name) for name in by}
        for result in of:
            of_value, value = of_result(result, self.problem), self.value(result)
            for name, change in changes.items():
                of_change = of_number(name, self.problem)
                dimensions = (of_value, of_change, of_value.over(of_change) if of_value and of_change else None)
                words = [each.text(units) if each and units.declared else "" for each in dimensions]
                derivative = self.gradients.derivative(result, change)
                entries.append(
                    Entry(result, name, value, change.value, derivative, (words[0], words[1], words[2]))
                )  # fmt: skip
        load = self.gradients.equilibrium.state.position.load
        return SensitivityTable(self.problem.name, load, entries, self.doubts)

    def _warn(self) -> None:
        if self.doubts and not self._has_warned:
            self._has_warned = True
            for doubt in self.doubts:
                warnings.warn(doubt, SensitivityWarning, stacklevel=3)


def sensitivities(result: RunResult) -> Sensitivities:
    """Derivatives at the last state of a run; the discretisation is made once more, nothing is solved again.

    Args:
        result: of :func:`tmc_vem.simulation.simulation.run`, or read from the directory of a run of a problem file;
            then on all ranks.

    Raises:
        InputError: the result has no state: no step has converged, or the directory has no problem file or checkpoint.
    """
    end = result.end
    if end is None:
        if result.directory is None:
            raise InputError("the result has no state to differentiate at: no step has converged")
        return of_directory(result.directory)
    refuse_friction(end.problem)
    return _at_end(prepare(end.problem, None, end.options, comm=end.comm), result)


def solved(
    problem: Problem,
    options: RunOptions,
    of: Sequence[str] = (),
    by: Sequence[str] = (), *, in_cells: bool = False,
    comm: Comm | None = None, monitor: Monitor | None = None,
) -> tuple[RunResult, Sensitivities]:  # fmt: skip
    """Solve a problem, and derivatives at its last state.

    Args:
        problem, options: what to solve, and how.
        of, by: names of results and numbers; those that are wrong are found before anything is solved.
        in_cells: whether derivatives in cells will be asked for, so that a number has to belong to some.
        comm: ranks; all by default.
        monitor: hears about the run.

    Raises:
        InputError: there is no such result or number, or no derivative.
        ConvergenceError: the load could not be applied in full.
    """
    refuse_friction(problem)
    simulation = prepare(problem, None, options, comm=comm, monitor=monitor)
    system = simulation.system
    functionals = Functionals(problem, system)
    for name in of:
        functionals.of(name)
    u = system.create_vector()
    changes = Changes(problem, system, u, Control(0.0))
    found = [changes.by(name) for name in by]
    if in_cells:
        require_cells(found)
    for _ in system.parameter_derivatives(u):
        break
    result = simulation.go()
    if not result.complete:
        raise ConvergenceError(f"stopped at load {result.load:.4g}: {result.reason}; there are no derivatives")
    return result, _at_end(simulation, result)


def of_directory(
    directory: str | Path, problem: Problem | None = None, options: RunOptions | None = None, comm: Comm | None = None
) -> Sensitivities:
    """Derivatives at the state of a run directory's last checkpoint.

    Args:
        directory: of a run.
        problem, options: that it was made with; by default those of the problem file in it.
        comm: ranks; all by default.

    Raises:
        InputError: there is no checkpoint, or no problem file and no problem was given.
    """
    path = Path(directory)
    refuse_search(path)
    if problem is None:
        problem, options = problem_of(path)
    refuse_friction(problem)
    simulation = prepare(problem, None, options, comm=comm or MPI.COMM_WORLD)
    u = simulation.system.create_vector()
    history = _read_state(path, simulation, u)
    last = history[-1]
    return _at(simulation, u, Control(last.load, last.parameters), history)


def problem_of(directory: Path) -> tuple[Problem, RunOptions]:
    """Problem and options of a run directory that has a problem file.

    Raises:
        InputError: it has none.
    """
    file = directory / PROBLEM
    if not file.is_file():
        raise InputError(
            f"{directory} has no {PROBLEM}, as no run of a benchmark from Python has: ask the result of run() for its "
            "gradient, or give the problem by its name"
        )
    return on_adapted_mesh(directory, *read_problem(file))


def _at_end(simulation: Simulation, result: RunResult) -> Sensitivities:
    u = result.end.give(simulation.system)
    return _at(simulation, u, result.end.position, result.history)


def _at(simulation: Simulation, u: Vec, position: Control, history: Sequence[StepRecord]) -> Sensitivities:
    """Derivatives at a state that the discretisation stands at."""
    watch = simulation.solver.admission
    assert isinstance(watch, OverlapWatch)
    watch.go_on(history)
    equilibrium = Equilibrium(simulation.solver, simulation.system, u, position, partial(watch.behind, u))
    return Sensitivities(simulation.problem, equilibrium, history)


def _read_state(directory: Path, simulation: Simulation, u: Vec) -> list[StepRecord]:
    """The steps of a checkpoint; ``u`` and the discretisation stand at the last of them afterwards."""
    system, checkpoint = simulation.system, Checkpoint.read(directory)
    facts = checkpoint.facts
    before, now = (
        {name: value for name, value in inputs.items() if name != SET}
        for inputs in (facts["inputs"], run_inputs(simulation.problem, simulation.options))
    )
    require_same_inputs(before, now)
    saved = Saved.read(checkpoint, system.node_labels(), np.empty((0, 2)), u)
    saved.give(system, facts.get("stage", 0))
    history = [StepRecord.from_plain(entry) for entry in facts["history"]]
    if not history:
        raise InputError(f"no step of the run in {directory} has converged")
    if history[-1].parameters:
        system.set_parameters(history[-1].parameters)
    return history


def _doubts(equilibrium: Equilibrium, history: Sequence[StepRecord]) -> tuple[str, ...]:
    found = []
    if equilibrium.is_unstable:
        found.append(
            f"the state is unstable ({equilibrium.negative_pivots} negative pivots): the derivative is that of its "
            "branch, and a run with other numbers may end on another one"
        )
    jumps = [record.load for record in history if record.jumped]
    if jumps:
        found.append(
            f"the state lies behind a jump at load factor {jumps[-1]:g}: the derivative is that of the branch that it "
            "is on; with other numbers the jump may not happen, or lead elsewhere"
        )
    return tuple(found)
