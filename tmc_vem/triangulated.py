"""A problem on unstructured triangles, for finite elements where the problem's own mesh is of polygons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tmc_vem.constraints import Gap, Prescribed
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, RegionEnergy


@dataclass(frozen=True)
class Triangulated:
    """The same outlines, regions, supports and loads as another problem, on triangles made by gmsh.

    Attributes:
        problem: the other one.
        size: edge length of the triangles.
    """

    problem: Problem
    size: float

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.problem.name

    def make_mesh(self) -> PolygonMesh:
        """Triangles in the outlines of the problem's regions.

        Raises:
            InputError: gmsh is missing.
        """
        from tmc_vem.fem.unstructured import gmsh_triangles

        return gmsh_triangles(self.problem.make_mesh(), self.size)

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Regions of the problem."""
        return self.problem.regions()

    def prescribed(self) -> Sequence[Prescribed]:
        """Supports and loads of the problem."""
        return self.problem.prescribed()

    def gap(self) -> Gap | None:
        """Gap of the problem."""
        return self.problem.gap()

    def load(self) -> Prescribed:
        """Load of the problem."""
        return self.problem.load()

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem and the size of the triangles."""
        return {**self.problem.inputs(), "triangle_size": self.size}
