"""Benchmark problems: geometry, materials, boundary conditions and probes, as data."""

from tmc_vem.problems.base import Material, Medium, Problem, RegionEnergy
from tmc_vem.problems.box import Box
from tmc_vem.problems.cbox import CBox

__all__ = ["Box", "CBox", "Material", "Medium", "Problem", "RegionEnergy"]
