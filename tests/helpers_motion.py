"""Turned, reflected, scaled, shifted and renumbered polygons, meshes and problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.system.constraints import Prescribed

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """``x -> scale turn reflect x + shift`` and new numbers; the order of a cell's vertices stays counter-clockwise.

    Attributes:
        angle: of the turn, in degrees.
        reflect: change the sign of x before.
        scale: how much larger.
        shift: added last, in units of what is moved.
        seed: of the new numbers of cells, vertices and where cells start; None keeps them.
    """

    angle: float = 0.0
    reflect: bool = False
    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    seed: int | None = None

    @property
    def linear(self) -> Float:
        """Matrix (2, 2) of the turn and the reflection."""
        c, s = np.cos(np.deg2rad(self.angle)), np.sin(np.deg2rad(self.angle))
        return np.array([[c, -s], [s, c]]) @ np.diag([-1.0 if self.reflect else 1.0, 1.0])

    def points(self, points_nx: Float, size: float) -> Float:
        """Moved points (n, 2) of something as large as ``size``."""
        moved: Float = self.scale * (points_nx @ self.linear.T + size * np.array(self.shift))
        return moved

    def polygon(self, polygon_vx: Float) -> Float:
        """Moved counter-clockwise polygon."""
        moved = self.points(polygon_vx, float(np.ptp(polygon_vx, axis=0).max()))
        moved = moved[::-1] if self.reflect else moved
        return moved if self.seed is None else np.roll(moved, self.seed, axis=0)

    def mesh(self, mesh: PolygonMesh) -> PolygonMesh:
        """Moved mesh."""
        rng = np.random.default_rng(self.seed)
        points = self.points(mesh.points_vx, float(np.ptp(mesh.points_vx, axis=0).max()))
        keep = self.seed is None
        old_v = np.arange(mesh.n_vertices) if keep else rng.permutation(mesh.n_vertices)
        old_c = np.arange(mesh.n_cells) if keep else rng.permutation(mesh.n_cells)
        new_v = np.empty_like(old_v)
        new_v[old_v] = np.arange(len(old_v))
        loops = []
        for c in old_c.tolist():
            loop = new_v[mesh.cell(c)]
            loop = loop[::-1] if self.reflect else loop
            loops.append((loop if keep else np.roll(loop, rng.integers(len(loop)))).tolist())
        return PolygonMesh.from_cells(
            points[old_v],
            loops,
            mesh.region_c[old_c],
            mesh.region_names,
            {name: int(new_v[v]) for name, v in mesh.named_points.items()},
            {name: new_v[edges] for name, edges in mesh.named_edges.items()},
        )


@dataclass(frozen=True)
class Moved(Wrapped):
    """A problem whose supports hold both components, moved; lengths scale, moduli do not.

    Attributes:
        motion: where to.
    """

    motion: Motion = Motion()

    def make_mesh(self) -> PolygonMesh:
        """The moved mesh."""
        return self.motion.mesh(self.problem.make_mesh())

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Weights of second gradients grow with the square of lengths."""

        def scaled(values: Mapping[str, float]) -> dict[str, Any]:
            weight = {"alpha_r": values["alpha_r"] * self.motion.scale**2} if "alpha_r" in values else {}
            return {**values, **weight}

        return {name: replace(r, values=scaled(r.values)) for name, r in self.problem.regions().items()}

    def prescribed(self) -> Sequence[Prescribed]:
        """Both components at every support and at the load."""
        held: dict[str, Float] = {}
        for condition in self.problem.prescribed():
            held.setdefault(condition.where, np.zeros(2))[condition.component] = condition.value
        moved = {where: self.motion.scale * self.motion.linear @ value for where, value in held.items()}
        return [Prescribed(where, i, float(value[i])) for where, value in moved.items() for i in (0, 1)]

    def load(self) -> Prescribed:
        """The component that moves further."""
        where = self.problem.load().where
        return max((p for p in self.prescribed() if p.where == where), key=lambda p: abs(p.value))
