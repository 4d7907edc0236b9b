"""A problem on another mesh than its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.wrapped import Wrapped


@dataclass(frozen=True)
class OnMesh(Wrapped):
    """A problem on an adapted mesh.

    Attributes:
        mesh: with the same regions and names as that of the problem.
        adapted: how the mesh came about, as its inputs say it.
    """

    mesh: PolygonMesh
    adapted: Mapping[str, Any] = field(default_factory=dict)

    def make_mesh(self) -> PolygonMesh:
        """The adapted mesh."""
        return self.mesh

    def inputs(self) -> dict[str, Any]:
        """Inputs of the problem, and how its mesh came about."""
        inputs = self.problem.inputs()
        return {**inputs, "adapt": dict(self.adapted)} if self.adapted else inputs
