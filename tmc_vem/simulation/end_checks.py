"""Checks of the last state of a run that need the whole system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tmc_vem.results.records import StepRecord
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.friction_energy import stored_in_regions

# Reactions below this part of the largest energy over the size of the domain are those of an unloaded body.
UNLOADED = 1e-6


def imbalance(system: Discretisation, residual: Vec, history: Sequence[StepRecord]) -> float:
    """Resultant of all reactions, forces and springs, relative to the largest of them: 0 in equilibrium.

    Where all are gone at the end of a cycle, what is left is rounding: they count as at least a part of what the energy
    on the way has asked for.

    Args:
        system: the discretisation.
        residual: at the last state.
        history: load steps, whose last one knows the forces and springs.
    """
    loads = history[-1].forces if history else {}
    reaction_ni = np.concatenate(system.comm.allgather(system.held_forces(residual)))
    acting = np.array([(each["force_x"], each["force_y"]) for each in loads.values() if "force_x" in each])
    acting = acting.reshape(-1, 2)
    largest = max(float(np.abs(forces).max(initial=0.0)) for forces in (reaction_ni, acting))
    most = max((abs(sum(record.energy.values())) for record in history), default=0.0)
    largest = max(largest, UNLOADED * most / system.size)
    resultant = np.hypot(*(reaction_ni.sum(axis=0) + acting.sum(axis=0)))
    return float(resultant) / largest if largest else 0.0


def second_gradient_energy(
    system: Discretisation, u: Vec, evaluation: Evaluation, inputs: Mapping[str, Any]
) -> dict[str, float]:
    """Energy of the regulariser in cells and, if there is an interior penalty, between them."""
    cells = system.cell_energies(u).sum()
    share = cells - system.cell_energies(u, without="alpha_r").sum()
    found = {"regulariser_energy": float(system.comm.allreduce(share))}
    if inputs.get("interior_penalty", "none") != "none":
        whole = sum(stored_in_regions(system, u, evaluation).values())
        found["penalty_energy"] = whole - float(system.comm.allreduce(cells))
    return found
