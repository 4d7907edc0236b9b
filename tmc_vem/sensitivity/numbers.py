"""Numbers of a problem by the way to them, and what a problem changes by per unit of one.

A number is found as in ``--set``: ``regions.block.solid.E`` of a problem file, ``medium.gamma`` of a benchmark. What
it changes, parameters of energies, prescribed displacements, forces, follows from the problem itself, made anew with
values nearby: these are smooth functions that cost nothing, so that extrapolated differences are exact to rounding. The
equilibrium is not solved for again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.support.assignments import keys
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import key_of, require_known

Float = NDArray[np.float64]

# Steps of the differences relative to the number: what they are of is given by formulas, not by a solver.
FIRST_STEP, HALVINGS = 2e-3, 5
LAST_STEP = 1e-9
# What two extrapolations may differ by without smaller steps, and steps from which on no smaller ones are tried.
EXACT, SMALL_STEP = 1e-11, 1e-6
NEARBY = (1e-3, -1e-3, 1e-6, -1e-6)  # relative: where it is looked at what a number changes at all
_NAMES = ("name", "at")


def value_of(problem: Problem, name: str) -> float:
    """The number of a problem that a name leads to.

    Raises:
        InputError: there is nothing of that name, or no number.
    """
    place: Any = _root(problem)
    way = keys(name)
    for n, key in enumerate(way):
        place = _entries(place, ".".join(way[:n]))[_key(place, key, ".".join(way[:n]))]
    if isinstance(place, bool) or not isinstance(place, int | float):
        what = (
            "is not given"
            if place is None
            else f"= {place!r} is no number"
            if isinstance(place, str)
            else "is no number"
        )
        of_design = len(way) == 3 and (way[0], way[2]) == ("regions", "stiffness")
        level = f", or '{way[1]}.stiffness', by which the stiffnesses of all cells are multiplied" if of_design else ""
        raise InputError(f"'{name}' {what}: name a number of the problem{level}")
    return float(place)


def with_value(problem: Problem, name: str, value: float) -> Problem:
    """The problem with another value for one of its numbers.

    Raises:
        InputError: there is no such number, or the value is out of its range.
    """
    if isinstance(problem, OnMesh):
        return dataclasses.replace(problem, problem=with_value(problem.problem, name, value))
    root = _replaced(_root(problem), keys(name), value, "")
    made: Problem = problem.with_table(root) if isinstance(problem, OwnProblem) else root
    return made


def nearby(problem: Problem, name: str, value: float) -> Problem:
    """The problem with a value near that of one of its numbers, above it or below, where its range allows it.

    Raises:
        InputError: there is no such number, or it cannot change alone.
    """
    for step in NEARBY:
        try:
            return with_value(problem, name, value + step * (abs(value) or 1.0))
        except InputError:
            continue
    return with_value(problem, name, value + NEARBY[0] * (abs(value) or 1.0))


def rate(function: Callable[[float], Float], at: float, comm: Comm | None = None) -> Float:
    """Derivative of a smooth function of a number: differences, extrapolated (Ridders 1982), central ones unless the
    number is at an end of its range.

    Args:
        function: gives an array, always of the same shape.
        at: where.
        comm: ranks that call this together: then they take the same steps, and what is raised on one is on all.

    Raises:
        InputError: the function raises it on both sides however near.
    """
    if comm is not None:
        function = _on_all(function, comm)
    scale, faults = abs(at) if at else 1.0, []
    for sides in ((1.0, -1.0), (1.0, 0.0), (0.0, -1.0)):
        found: tuple[Float, Float] | None = None
        step = FIRST_STEP * scale
        while step >= LAST_STEP * scale:
            try:
                best, error = _extrapolated(function, at, step, sides)
            except InputError as fault:
                faults.append(fault)
            else:
                if found is not None:
                    better = error < found[1]
                    best, error = np.where(better, best, found[0]), np.where(better, error, found[1])
                size = np.abs(best) + np.abs(function(at)) / scale
                enough = bool((error <= EXACT * size).all())
                if (enough if comm is None else all(comm.allgather(enough))) or step < SMALL_STEP * scale:
                    return best
                found = best, error  # near a pole, as of the bulk modulus at nu = 0.5, the steps have to be smaller
            step /= 10.0
        if found is not None:
            return found[0]
    raise faults[0]


def _on_all(function: Callable[[float], Float], comm: Comm) -> Callable[[float], Float]:
    """A function of all ranks that raises on all what it raises on one."""

    def on_all(at: float) -> Float:
        value, fault = np.zeros(0), None
        try:
            value = function(at)
        except InputError as error:
            fault = error
        for raised in comm.allgather(fault):
            if raised is not None:
                raise raised
        return value

    return on_all


def _extrapolated(
    function: Callable[[float], Float], at: float, step: float, sides: tuple[float, float]
) -> tuple[Float, Float]:
    """Of the table of extrapolated differences, for each entry the value that its neighbours agree with best, and by
    how much they differ."""
    best, error = np.zeros(0), np.zeros(0)
    row: list[Float] = []
    ahead, behind = sides
    base = 4.0 if ahead == -behind else 2.0  # central differences have even powers of the step alone
    for n in range(HALVINGS):
        h = step / 2.0**n
        new = [(function(at + ahead * h) - function(at + behind * h)) / ((ahead - behind) * h)]
        for k in range(n):
            new.append(new[k] + (new[k] - row[k]) / (base ** (k + 1) - 1.0))
            spread = np.maximum(np.abs(new[k + 1] - new[k]), np.abs(new[k + 1] - row[k]))
            if n == 1:
                best, error = new[1], spread
            else:
                better = spread < error
                best, error = np.where(better, new[k + 1], best), np.where(better, spread, error)
        row = new
    return best, error


def _root(problem: Problem) -> Any:
    if isinstance(problem, OnMesh):
        return _root(problem.problem)
    return problem.table if isinstance(problem, OwnProblem) else problem


def _entries(place: Any, where: str) -> Any:
    """What has the entries of a place, to be asked by :func:`_key`."""
    if dataclasses.is_dataclass(place):
        return {key_of(field.name): getattr(place, field.name) for field in dataclasses.fields(place)}
    if isinstance(place, Mapping | tuple | list):
        return place
    raise InputError(f"'{where}' has no entries")


def _key(place: Any, key: str, where: str) -> Any:
    """Key or index of an entry.

    Raises:
        InputError: there is none.
    """
    if not isinstance(place, tuple | list):
        require_known([key], list(_entries(place, where)), where or "the problem")
        return key
    named = [n for n, entry in enumerate(place) if key in (getattr(entry, word, None) for word in _NAMES)]
    if len(named) == 1:
        return named[0]
    if key.isdecimal() and 1 <= int(key) <= len(place):
        return int(key) - 1
    raise InputError(f"{where} has no one entry '{key}': its {len(place)} entries are counted from 1")


def _replaced(place: Any, way: Sequence[str], value: float, where: str) -> Any:
    """A copy with one entry changed; dataclasses check it."""
    if not way:
        return value
    key = _key(place, way[0], where)
    inner = _replaced(_entries(place, where)[key], way[1:], value, f"{where}.{way[0]}" if where else way[0])
    if isinstance(place, tuple | list):
        return type(place)(inner if n == key else entry for n, entry in enumerate(place))
    if isinstance(place, Mapping):
        return {**place, key: inner}
    of_field = {key_of(field.name): field.name for field in dataclasses.fields(place)}
    return dataclasses.replace(place, **{of_field[key]: inner})
