"""Central differences of results: runs of a problem with values of a number nearby, to check derivatives by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tmc_vem.problems.base import Problem, RegionEnergy
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.sensitivity.changes import parameter_by_name
from tmc_vem.sensitivity.functionals import Functionals
from tmc_vem.sensitivity.functionals_record import FunctionalState
from tmc_vem.sensitivity.numbers import value_of, with_value
from tmc_vem.sensitivity.table import Entry, SensitivityTable
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.simulation import prepare
from tmc_vem.solve.newton import NewtonOptions
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError

# Relative: their error is of the order of the square, and what equilibria are uncertain by is divided by it.
STEP = 1e-4
# Equilibria are found as exactly as rounding allows.
TIGHT = NewtonOptions(residual=1e-12, correction=1e-11)


@dataclass(frozen=True)
class OtherParameter(Wrapped):
    """A problem with another value for a parameter of one energy alone.

    Attributes:
        region, parameter: which.
        value: of it.
    """

    region: str
    parameter: str
    value: float

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Regions of the problem, one of them with the value."""
        regions = dict(self.problem.regions())
        of = regions[self.region]
        regions[self.region] = replace(of, values={**of.values, self.parameter: self.value})
        return regions

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem, and the value."""
        return {**self.problem.inputs(), f"{self.region}.{self.parameter}": self.value}


def changed(problem: Problem, name: str, value: float) -> Problem:
    """A problem with another value for a number that has derivatives.

    Raises:
        InputError: there is no such number, or the value is out of its range.
    """
    own = parameter_by_name(problem, name)
    return with_value(problem, name, value) if own is None else OtherParameter(problem, *own, value)


def number_of(problem: Problem, name: str) -> float:
    """Value of such a number.

    Raises:
        InputError: there is none.
    """
    own = parameter_by_name(problem, name)
    return value_of(problem, name) if own is None else problem.regions()[own[0]].values[own[1]]


def values_of(
    problem: Problem, options: RunOptions, results: Sequence[str], comm: Comm, monitor: Monitor | None = None
) -> dict[str, float]:
    """Results at the end of a run, which is found as exactly as rounding allows.

    Raises:
        InputError: the run does not get to its end.
    """
    simulation = prepare(problem, None, replace(options, snapshots=0, checkpoint_every=0), comm=comm, monitor=monitor)
    simulation.solver.options = TIGHT
    result = simulation.go()
    if not result.complete:
        raise InputError(f"a run with a value nearby did not get to the full load ({result.reason})")
    u = result.end.give(simulation.system)
    residual = simulation.system.create_vector()
    simulation.system.set_position(result.end.position)
    simulation.system.residual(u, residual)
    state = FunctionalState(u, residual, result.end.position)
    functionals = Functionals(problem, simulation.system)
    return {name: functionals.of(name).derivative(state).value for name in results}


def central_differences(
    problem: Problem,
    options: RunOptions,
    results: Sequence[str],
    by: str,
    comm: Comm,
    step: float = STEP,
    monitor: Monitor | None = None,
) -> dict[str, float]:
    """Derivatives of results by a number, from two runs.

    Args:
        problem, options: of the run.
        results: their names.
        by: name of the number.
        comm: ranks.
        step: relative to the number; itself where the number is 0.
        monitor: hears about the runs.

    Raises:
        InputError: there is no such number, the values are out of its range, or a run does not get to its end.
    """
    number = number_of(problem, by)
    h = step * (abs(number) or 1.0)
    ahead, behind = (
        values_of(changed(problem, by, number + sign * h), options, results, comm, monitor) for sign in (1, -1)
    )
    return {name: (ahead[name] - behind[name]) / (2.0 * h) for name in results}


def checked(
    table: SensitivityTable, problem: Problem, options: RunOptions, comm: Comm, monitor: Monitor | None = None
) -> SensitivityTable:
    """A table with central differences beside its derivatives; two runs for each number.

    Raises:
        InputError: a run does not get to its end, or the values are out of a number's range.
    """
    names = list(dict.fromkeys(entry.of for entry in table.entries))
    found = {
        by: central_differences(problem, options, names, by, comm, monitor=monitor)
        for by in dict.fromkeys(entry.by for entry in table.entries)
    }
    entries: list[Entry] = [replace(entry, difference=found[entry.by][entry.of]) for entry in table.entries]
    return replace(table, entries=entries)
