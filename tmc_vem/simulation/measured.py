"""Reads loads off converged states: how far each has gone, the force that does work on it, and the work so far.

A load is reported by a pair whose product is work: displacement and reaction, angle and moment, the displacement of a
dead force along itself and the force, area and pressure. Work is summed over the steps by the trapezoidal rule.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, forces_of
from tmc_vem.problems.columns import column, named_loads, pair_of
from tmc_vem.problems.load_tables import Load
from tmc_vem.support.distributed import Vec
from tmc_vem.system.constraints import Condition, Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Force, Spring
from tmc_vem.system.histories import History

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """Loads at a state.

    Attributes:
        displacement, reaction: of the load that is reported first.
        columns: of all loads and springs that have names.
        held: forces that prescribe displacements on this rank, and these displacements.
        work: what loads, moving supports and springs have done on the body so far; None where neither histories nor
            forces ask for it.
    """

    displacement: float
    reaction: float
    columns: Mapping[str, float]
    held: tuple[Float, Float]
    work: float | None


class LoadGauge:
    """The loads of a problem on its discretisation; all ranks make and read it together.

    Args:
        problem: whose loads.
        system: its discretisation.
    """

    def __init__(self, problem: Problem, system: Discretisation) -> None:
        self._system = system
        self._main, self._named = problem.load(), named_loads(problem)
        self._across = {
            (each.where, each.direction): each for each in system.conditions if isinstance(each, PrescribedAcross)
        }
        self.sums_work = bool(self._named) or any(isinstance(each.amplitude, History) for each in problem.prescribed())
        self._magnitude = {force.name: self._at_amplitude_1(force) for force in forces_of(problem) if _is_dead(force)}

    def read(self, u: Vec, residual: Vec, position: Control, before: Reading | None) -> Reading:
        """The loads at a state with its residual, equal on all ranks.

        Args:
            u: displacements.
            residual: full gradient of the potential at ``u``.
            position: on the path.
            before: what was read at the last state; None at the beginning.
        """
        measures = self._system.measures(u, position)
        columns: dict[str, float] = {}
        force_work = 0.0
        for load in self._named:
            if isinstance(load, Spring):
                of_spring = {name: measures[load.name][name] for name in ("force_x", "force_y", "energy")}
                columns |= {column(load, name): value for name, value in of_spring.items()}
                stored = before.columns[column(load, "energy")] if before else 0.0
                force_work -= of_spring["energy"] - stored
                continue
            moved_by, force = self._pair(load, u, residual, position, measures)
            names = [column(load, name) for name in (*pair_of(load), "work")]
            start = (self._start(load, measures), 0.0, 0.0)
            was_at, was_force, work = (before.columns[name] for name in names) if before else start
            step = 0.5 * (force + was_force) * (moved_by - was_at)
            step = math.radians(step) if isinstance(load, PrescribedRotation) else step
            columns |= dict(zip(names, (moved_by, force, work + step), strict=True))
            force_work += 0.0 if isinstance(load, Condition) else step
        held = residual.getArray(readonly=True)[self._system.constrained()], self._system.prescribed(position)
        was_held = before.held if before else (np.zeros_like(held[0]), np.zeros_like(held[1]))
        step = 0.5 * float((held[0] + was_held[0]) @ (held[1] - was_held[1]))
        total = None
        if self.sums_work:
            total = (before.work or 0.0 if before else 0.0) + force_work + float(self._system.comm.allreduce(step))
        main = self._first(columns, u, residual, position)
        return Reading(*main, columns, held, total)

    def again(
        self, u: Vec, residual: Vec, position: Control, columns: Mapping[str, float], work: float | None
    ) -> Reading:
        """What was read at a state that a run goes on from.

        Args:
            u, residual, position: the state.
            columns, work: as they were recorded.
        """
        held = residual.getArray(readonly=True)[self._system.constrained()], self._system.prescribed(position)
        return Reading(math.nan, math.nan, columns, held, work)

    def _first(self, columns: Mapping[str, float], u: Vec, residual: Vec, position: Control) -> tuple[float, float]:
        """Displacement and reaction of the load that is reported first."""
        load = self._main
        if load.name:
            moved, force = (columns[column(load, name)] for name in pair_of(load))
            return moved, force
        return self._pair(load, u, residual, position, {})

    def _pair(
        self, load: Load, u: Vec, residual: Vec, position: Control, measures: Mapping[str, Mapping[str, float]]
    ) -> tuple[float, float]:
        """How far a load has gone, and its force."""
        if isinstance(load, Prescribed):
            return load.at(position), self._system.reaction(residual, load.where, load.component)
        if isinstance(load, PrescribedAcross):
            (axis,) = self._across[load.where, load.direction].axes
            force = self._system.resultant(u, residual, load.where, (0.0, 0.0))[:2]
            return load.at(position), float(force @ np.asarray(axis))
        if isinstance(load, PrescribedRotation):
            return load.at(position), float(self._system.resultant(u, residual, load.where, load.about)[2])
        measured = measures[load.name]
        if isinstance(load, CavityPressure):
            return measured["area"], measured["pressure"]
        if isinstance(load, FollowerPressure):
            return measured["potential"] / load.pressure, measured["pressure"]
        magnitude = self._magnitude[load.name]
        return measured["potential"] / magnitude, measured["amplitude"] * magnitude

    def _start(self, load: Load, measures: Mapping[str, Mapping[str, float]]) -> float:
        """How far a load has gone at the beginning: the area of a cavity is there from the start."""
        return measures[load.name]["area_at_start"] if isinstance(load, CavityPressure) else 0.0

    def _at_amplitude_1(self, force: Force) -> float:
        """Magnitude of a dead force's resultant where its amplitude is 1."""
        amplitude = force.amplitude
        times = amplitude.times if isinstance(amplitude, History) else (1.0,)
        position = max((Control(time) for time in times), key=lambda position: abs(amplitude.at(position)))
        measured = self._system.measures(self._system.create_vector(), position)[force.name]
        return math.hypot(measured["force_x"], measured["force_y"]) / abs(measured["amplitude"])


def _is_dead(force: Force) -> bool:
    return "pressure" not in pair_of(force) and not isinstance(force, Spring)
