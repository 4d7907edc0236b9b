"""Energies without friction's: what the discretisation calls an energy has the potential of friction's step in it."""

from __future__ import annotations

from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation, Evaluation


def stored_in_regions(system: Discretisation, u: Vec, evaluation: Evaluation) -> dict[str, float]:
    """Energies by region, those on the sides between cells included, friction's left out; equal on all ranks.

    Args:
        system: the discretisation.
        u: the state.
        evaluation: of the potential there.
    """
    energies = {name: values.energy for name, values in evaluation.regions.items()}
    mine = dict.fromkeys(energies, 0.0)
    for states in system.friction_states(u):
        mine[states.points.region] += float((states.points.w_cq * states.response.energy).sum())
    parts = system.comm.allgather(mine)
    return {name: energy - sum(part[name] for part in parts) for name, energy in energies.items()}
