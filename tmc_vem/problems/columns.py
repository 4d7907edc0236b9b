"""What is reported of loads and springs by their names: quantities in the history, and their kinds."""

from __future__ import annotations

from tmc_vem.problems.base import Problem, forces_of
from tmc_vem.problems.load_tables import Load
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import ANGLE, AREA, ENERGY, FORCE, LENGTH, NONE, STRESS
from tmc_vem.system.constraints import Condition, PrescribedRotation
from tmc_vem.system.forces import CavityPressure, FollowerPressure, Spring

KINDS = {
    "displacement": LENGTH,
    "reaction": FORCE,
    "angle": ANGLE,
    "moment": ENERGY,
    "force": FORCE,
    "area": AREA,
    "area_at_start": AREA,
    "swept": AREA,
    "pressure": STRESS,
    "force_x": FORCE,
    "force_y": FORCE,
    "amplitude": NONE,
    "potential": ENERGY,
    "energy": ENERGY,
    "work": ENERGY,
}


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


def quantities_of(load: Load) -> tuple[str, ...]:
    """What is reported of a load or of springs."""
    acting = ("force_x", "force_y", "moment", "amplitude", "potential")
    if isinstance(load, Spring):
        return (*acting, "energy")
    if isinstance(load, Condition):
        return (*pair_of(load), "work")
    return (*pair_of(load), *(("area_at_start",) if isinstance(load, CavityPressure) else ()), "work", *acting)


def check_names(problem: Problem) -> None:
    """Check that loads and springs have names of their own.

    Raises:
        InputError: two have the same.
    """
    names = [load.name for load in named_loads(problem)]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"two loads are called '{twice[0]}': give each a name of its own")
