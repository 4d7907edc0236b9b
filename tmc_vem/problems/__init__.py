"""Benchmark problems: geometry, materials, boundary conditions and probes, as data.

The names below import what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tmc_vem.support.lazy import lazily

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

__getattr__ = lazily(__name__, _MODULES)
