"""Where the work of a run went: into stored energy, or lost in jumps from one branch of equilibria to another.

Along a branch the stored energy grows by the work of the loads. Where the branch ends, the body falls to another state
at that load: what is missing afterwards went into motion, heat or sound, of which a static computation knows nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tmc_vem.results.records import StepRecord


@dataclass(frozen=True)
class Jump:
    """A step to another branch.

    Attributes:
        step, load: number of the step, and load factor after it.
        lost: stored energy before, plus the work of the step, minus stored energy after.
        uncertainty: half the work that the change of the force during the step makes; the force that the old branch
            ends with is not known.
    """

    step: int
    load: float
    lost: float
    uncertainty: float


@dataclass(frozen=True)
class EnergyBalance:
    """Stored energy at the end = work + parameters + integration_error - lost.

    Attributes:
        work: of the loads, by the trapezoidal rule over the steps; less what springs have stored.
        stored: energy at the end.
        lost: in all jumps.
        parameters: energy that came in by changes of the medium's parameters, integration error of those steps
            included.
        integration_error: stored energy minus work, over the steps that neither jump nor change a parameter.
        jumps: one by one.
    """

    work: float
    stored: float
    lost: float
    parameters: float
    integration_error: float
    jumps: tuple[Jump, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for result files."""
        return asdict(self)


def energy_balance(history: Sequence[StepRecord]) -> EnergyBalance | None:
    """Balance over the steps of a run; None for one without steps, or written before forces were recorded."""
    if not history or any(record.load_force is None for record in history):
        return None
    work = stored = load = force = parameters = error = 0.0
    jumps: list[Jump] = []
    before = history[0].parameters
    for record in history:
        assert record.load_force is not None
        energy = sum(record.energy.values())
        done = 0.5 * (force + record.load_force) * (record.load - load)
        if record.load_work is not None:  # histories have kinks, and forces do work where the load does not change
            done = record.load_work - work
        surplus = energy - stored - done
        if record.parameters != before:
            parameters += surplus
        elif record.jumped:
            jumps.append(
                Jump(record.step, record.load, -surplus, 0.5 * abs((record.load_force - force) * (record.load - load)))
            )
        else:
            error += surplus
        work, stored, load, force, before = work + done, energy, record.load, record.load_force, record.parameters
    return EnergyBalance(work, stored, sum(jump.lost for jump in jumps), parameters, error, tuple(jumps))
