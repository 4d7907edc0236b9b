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
from tmc_vem.problems.columns import named_loads, pair_of, quantities_of
from tmc_vem.problems.load_tables import Load
from tmc_vem.support.distributed import Vec
from tmc_vem.system.constraints import Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Force, Spring
from tmc_vem.system.histories import History

Float = NDArray[np.float64]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Reading:
    """Loads at a state.

    Attributes:
        displacement, reaction: of the load that is reported first.
        loads: what is reported of loads and springs that have names, by these.
        held: forces (n,) that hold this rank's degrees of freedom, and their displacements.
        work: of all that holds so far, supports that move and that have ended too; None where nothing asks for it.
    """

    displacement: float
    reaction: float
    loads: Mapping[str, Values]
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
        across = [each for each in system.conditions if isinstance(each, PrescribedAcross)]
        self._axis = {(each.where, each.direction): np.asarray(each.axes[0]) for each in across}
        histories = [each for each in problem.prescribed() if isinstance(each.amplitude, History)]
        staged = [each for each in problem.prescribed() if each.stages]
        self._sums_work = bool(self._named or histories or staged)
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
        loads: dict[str, Values] = {}
        for load in self._named:
            values = dict(measures.get(load.name, {}))
            if not isinstance(load, Spring):
                values |= dict(zip(pair_of(load), self._pair(load, u, residual, position, values), strict=True))
                values["work"] = _work(load, values, before.loads[load.name] if before else None)
            loads[load.name] = {quantity: values[quantity] for quantity in quantities_of(load)}
        held = self._held(u, residual)
        main = (
            tuple(loads[self._main.name][quantity] for quantity in pair_of(self._main))
            if self._main.name
            else self._pair(self._main, u, residual, position, {})
        )
        return Reading(main[0], main[1], loads, held, self._work_of(held, before) if self._sums_work else None)

    def again(self, u: Vec, residual: Vec, loads: Mapping[str, Values], work: float | None) -> Reading:
        """What was read at a state that a run goes on from.

        Args:
            u, residual: there.
            loads, work: as they were recorded.
        """
        return Reading(math.nan, math.nan, loads, self._held(u, residual), work)

    # -- parts -----------------------------------------------------------------------------------------------------

    def _held(self, u: Vec, residual: Vec) -> tuple[Float, Float]:
        return self._system.holding_forces(residual), u.getArray(readonly=True).copy()

    def _work_of(self, held: tuple[Float, Float], before: Reading | None) -> float:
        """Work of all that holds so far."""
        was = before.held if before else (np.zeros_like(held[0]), np.zeros_like(held[1]))
        step = 0.5 * float((held[0] + was[0]) @ (held[1] - was[1]))
        done = before.work if before and before.work is not None else 0.0
        return done + float(self._system.comm.allreduce(step))

    def _pair(
        self, load: Load, u: Vec, residual: Vec, position: Control, measured: Mapping[str, float]
    ) -> tuple[float, float]:
        """How far a load has gone, and its force."""
        if isinstance(load, Prescribed):
            return load.at(position), self._system.reaction(residual, load.where, load.component)
        if isinstance(load, PrescribedAcross):
            force = self._system.resultant(u, residual, load.where, (0.0, 0.0))[:2]
            return load.at(position), float(force @ self._axis[load.where, load.direction])
        if isinstance(load, PrescribedRotation):
            return load.at(position), float(self._system.resultant(u, residual, load.where, load.about)[2])
        if isinstance(load, CavityPressure):
            return measured["area"], measured["pressure"]
        if isinstance(load, FollowerPressure):
            return measured["potential"] / load.pressure, measured["pressure"]
        magnitude = self._magnitude[load.name]
        return measured["potential"] / magnitude, measured["amplitude"] * magnitude

    def _at_amplitude_1(self, force: Force) -> float:
        """Magnitude of a dead force's resultant where its amplitude is 1."""
        amplitude = force.amplitude
        times = amplitude.times if isinstance(amplitude, History) else (1.0,)
        position = max((Control(time) for time in times), key=lambda position: abs(amplitude.at(position)))
        measured = self._system.measures(self._system.create_vector(), position)[force.name]
        return math.hypot(measured["force_x"], measured["force_y"]) / abs(measured["amplitude"])


def _is_dead(force: Force) -> bool:
    return not isinstance(force, CavityPressure | FollowerPressure | Spring)


def _work(load: Load, now: Values, before: Values | None) -> float:
    """Work of a load so far, of its pair now and at the last state; None is the beginning."""
    moved, force = pair_of(load)
    if before is None:
        before = {moved: now["area_at_start"] if isinstance(load, CavityPressure) else 0.0, force: 0.0, "work": 0.0}
    step = 0.5 * (now[force] + before[force]) * (now[moved] - before[moved])
    return before["work"] + (math.radians(step) if isinstance(load, PrescribedRotation) else step)
