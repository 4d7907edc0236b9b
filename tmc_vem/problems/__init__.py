"""Benchmark problems: geometry, materials, boundary conditions and probes, as data."""

from tmc_vem.problems.base import Material, Medium, Problem, RegionEnergy
from tmc_vem.problems.bodies import Bodies
from tmc_vem.problems.box import Box
from tmc_vem.problems.cbox import CBox
from tmc_vem.problems.punch import Punch

__all__ = ["Bodies", "Box", "CBox", "Material", "Medium", "Problem", "Punch", "RegionEnergy"]
