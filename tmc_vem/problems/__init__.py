"""Benchmark problems: geometry, materials, boundary conditions and probes, as data.

The names below import what they need when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tmc_vem.problems.base import Problem, RegionEnergy
    from tmc_vem.problems.bodies import Bodies
    from tmc_vem.problems.box import Box
    from tmc_vem.problems.cbox import CBox
    from tmc_vem.problems.materials import Material, Medium
    from tmc_vem.problems.punch import Punch

__all__ = ["Bodies", "Box", "CBox", "Material", "Medium", "Problem", "Punch", "RegionEnergy"]

_MODULES = {
    "Bodies": "bodies",
    "Box": "box",
    "CBox": "cbox",
    "Material": "materials",
    "Medium": "materials",
    "Problem": "base",
    "Punch": "punch",
    "RegionEnergy": "base",
}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
