"""Where the work of a run went: into stored energy, into friction, or lost in jumps from one branch to another.

Along a branch the stored energy grows by the work of the loads. Where the branch ends, the body falls to another state
at that load: what is missing afterwards went into motion, heat or sound, of which a static computation knows nothing.

Friction takes work in every step: its elastic slip stores some, the rest is dissipated. Between steps the pressure
changes, and with it the stiffness of the elastic slip: what is stored at the same shear is then more or less.

A force a(load) with the work W at amplitude 1 does the work ``int a dW``. A spring stores -a W; where its stiffness a
changes, ``int -W da`` comes in from outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tmc_vem.results.records import StepRecord, is_spring


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
    """Stored energy at the end = work + parameters + integration_error - lost - dissipated - released.

    Attributes:
        work: of the loads, prescribed displacements and forces, by the trapezoidal rule over the steps.
        stored: energy at the end, of regions, springs and elastic slip.
        lost: in all jumps.
        parameters: energy that came in by changes of the medium's parameters, integration error of those steps
            included.
        integration_error: stored energy minus work, over the steps that neither jump nor change a parameter.
        jumps: one by one.
        slip: of the stored energy, what elastic slip stores.
        dissipated: by friction.
        released: what elastic slip has stored less when steps began than when the ones before ended, as the pressure
            had changed; of the order of the elastic slip.
    """

    work: float
    stored: float
    lost: float
    parameters: float
    integration_error: float
    jumps: tuple[Jump, ...]
    slip: float | None = None
    dissipated: float | None = None
    released: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain values for result files; without friction nothing is said of it."""
        return {name: value for name, value in asdict(self).items() if value is not None}


def energy_balance(history: Sequence[StepRecord]) -> EnergyBalance | None:
    """Balance over the steps of a run; None for one without steps, or written before forces were recorded."""
    if not history or any(record.load_force is None for record in history):
        return None
    work = stored = load = force = parameters = error = moved = rubbed = 0.0
    jumps: list[Jump] = []
    before, forces = history[0].parameters, dict[str, Mapping[str, float]]()
    for record in history:
        assert record.load_force is not None
        energy = sum(record.energy.values()) + sum(each.get("energy", 0.0) for each in record.forces.values())
        by_forces = [_work(forces.get(name, {}), now) for name, now in record.forces.items() if "amplitude" in now]
        held = 0.5 * (force + record.load_force) * (record.load - load)
        if record.load_work is not None:  # histories have kinks, at which the work per load factor jumps
            held = record.load_work - moved
            moved = record.load_work
        done = held + sum(each for each, _ in by_forces)
        into_friction = _sum(record, "work")
        surplus = energy - stored + into_friction - rubbed - done
        rubbed = into_friction
        if record.parameters != before:
            parameters += surplus
        elif record.jumped:
            doubt = 0.5 * abs((record.load_force - force) * (record.load - load)) + sum(each for _, each in by_forces)
            jumps.append(Jump(record.step, record.load, -surplus, doubt))
        else:
            error += surplus
        work, stored, load, force, before = work + done, energy, record.load, record.load_force, record.parameters
        forces = dict(record.forces)
    lost, last = sum(jump.lost for jump in jumps), history[-1]
    if not last.friction:
        return EnergyBalance(work, stored, lost, parameters, error, tuple(jumps))
    slip, dissipated = _sum(last, "slip_energy"), _sum(last, "dissipated")
    released = _sum(last, "work") - dissipated - slip
    return EnergyBalance(
        work, stored + slip, lost, parameters, error, tuple(jumps), slip=slip, dissipated=dissipated, released=released
    )


def _sum(record: StepRecord, quantity: str) -> float:
    """Of friction in all regions."""
    return sum(values[quantity] for values in record.friction.values())


def _work(before: Mapping[str, float], now: Mapping[str, float]) -> tuple[float, float]:
    """Work of a force in a step, or what a change of a spring's stiffness brings in; and how far it depends on the way.

    Args:
        before, now: the force's measures; nothing before the first step, when all is in the reference state. What acts
            there already is taken as brought up in the first step, springs as there before.
    """
    spring = is_spring(now)
    first, last = before.get("amplitude", now["amplitude"] if spring else 0.0), now["amplitude"]
    start, end = before.get("potential", 0.0), now["potential"]
    doubt = 0.5 * abs((last - first) * (end - start))
    if spring:
        return -0.5 * (start + end) * (last - first), doubt
    return 0.5 * (first + last) * (end - start), doubt
