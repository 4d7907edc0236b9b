"""Reads probes of contact off what a state's contact gauge has found."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tmc_vem.problems.base import Problem
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.contact_quantities import FORCES_OF_FRICTION, UNKNOWN_APART
from tmc_vem.simulation.reading import Reader, State
from tmc_vem.system.discretisation import Discretisation


def contact_reader(probes: Mapping[str, Contact], problem: Problem, system: Discretisation) -> Reader:
    """What reads such probes.

    Bodies that do not face each other in a state have no force, no pressure and no width: 0. Their gap and the centre
    of their contact are not a number, and neither is what is not known of those that do, the half width of a pressure
    that is no round contact's. A medium without friction has no force of it, 0, so that coefficients of 0 can be among
    others; slip and coefficients are not a number then.
    """

    def value(state: State, probe: Contact) -> float:
        apart = math.nan if probe.quantity in UNKNOWN_APART else 0.0
        found = state.contact.get(probe.of)
        if found is None:
            return apart
        return found.get(probe.quantity, 0.0 if probe.quantity in FORCES_OF_FRICTION else math.nan)

    return lambda state: {name: value(state, probe) for name, probe in probes.items()}
