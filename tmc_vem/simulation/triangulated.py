"""A problem on unstructured triangles, for finite elements where the problem's own mesh is of polygons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.wrapped import Wrapped


@dataclass(frozen=True)
class Triangulated(Wrapped):
    """The same outlines, regions, supports and loads as another problem, on triangles made by gmsh.

    Attributes:
        size: edge length of the triangles.
    """

    size: float

    def make_mesh(self) -> PolygonMesh:
        """Triangles in the outlines of the problem's regions.

        Raises:
            InputError: gmsh is missing.
        """
        from tmc_vem.mesh.make.remesh import gmsh_triangles

        return gmsh_triangles(self.problem.make_mesh(), self.size)

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem and the size of the triangles."""
        return {**self.problem.inputs(), "triangle_size": self.size}
