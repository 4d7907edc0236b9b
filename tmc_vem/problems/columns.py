"""What is reported of loads and springs by their names: columns of the history, and what they measure."""

from __future__ import annotations

from typing import Protocol

from tmc_vem.problems.base import Problem, forces_of
from tmc_vem.problems.load_tables import Load
from tmc_vem.problems.probes import RESERVED, RESERVED_STARTS
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import ANGLE, AREA, ENERGY, FORCE, LENGTH, STRESS
from tmc_vem.system.constraints import Condition, PrescribedRotation
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Spring


class Named(Protocol):
    """Whatever has a name."""

    @property
    def name(self) -> str:
        """The name."""


def named_loads(problem: Problem) -> list[Load]:
    """Loads and springs that are reported by name."""
    return [*(each for each in problem.prescribed() if each.name), *forces_of(problem)]


def pair_of(load: Load) -> tuple[str, str]:
    """What a load is reported by: a displacement of some kind, and the force that does work on it."""
    if isinstance(load, PrescribedRotation):
        return "angle", "moment"
    if isinstance(load, Condition):
        return "displacement", "reaction"
    if isinstance(load, CavityPressure):
        return "area", "pressure"
    return ("swept", "pressure") if isinstance(load, FollowerPressure) else ("displacement", "force")


def quantities_of(load: Load) -> dict[str, str]:
    """Kinds of the quantities that are reported of a load, by what their columns end with."""
    if isinstance(load, Spring):
        return {"force_x": FORCE, "force_y": FORCE, "energy": ENERGY}
    moved, force = pair_of(load)
    return {moved: _KINDS[moved], force: _KINDS[force], "work": ENERGY}


_KINDS = {
    "angle": ANGLE,
    "moment": ENERGY,
    "displacement": LENGTH,
    "reaction": FORCE,
    "area": AREA,
    "swept": AREA,
    "pressure": STRESS,
    "force": FORCE,
}


def column(load: Named, quantity: str) -> str:
    """Name of the column with a quantity of a load."""
    return f"{load.name}_{quantity}"


def columns_of(problem: Problem) -> dict[str, str]:
    """Kinds of the quantities in the columns of all loads and springs that have names."""
    return {
        column(load, quantity): kind for load in named_loads(problem) for quantity, kind in quantities_of(load).items()
    }


def check_columns(problem: Problem) -> None:
    """Check that names of loads, springs and probes give columns that differ.

    Raises:
        InputError: they do not.
    """
    names = [load.name for load in named_loads(problem)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"two loads are called '{twice[0]}': give each a name of its own")
    known = set(problem.probes())
    for load in named_loads(problem):
        for quantity in quantities_of(load):
            name = column(load, quantity)
            if name in known:
                raise InputError(f"load '{load.name}' and a probe are both reported as {name}: rename one of them")
            if name in RESERVED or name.startswith(RESERVED_STARTS):
                raise InputError(
                    f"load '{load.name}' would be reported as {name}, a column that history.csv has already: choose "
                    "another name"
                )
