"""Benchmark problems: geometry, materials, boundary conditions and probes, as data."""

from tmc_vem.problems.base import Material, Medium, Problem, RegionEnergy
from tmc_vem.problems.box import Box

__all__ = ["Box", "Material", "Medium", "Problem", "RegionEnergy"]
