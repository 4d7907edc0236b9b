"""Punch problem, section 5.3 of Xu & Wriggers, CMAME 450 (2026) 118611."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import Arc, Region
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.problems.materials import Material, Medium
from tmc_vem.problems.probes import GAP, Gap, Probe
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.support.validation import check_fields, require_finite, require_positive
from tmc_vem.system.constraints import Prescribed

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Punch:
    """A round punch is pressed into a block; the right half of a symmetric problem.

    The block is [0, width] x [0, height], its bottom is fixed. The punch is a quarter of a disc whose lowest point is
    at (0, height + gap0); its flat top is moved by uy and free in x. The line x = 0 is the axis of symmetry: u_x = 0.
    Third medium fills the rest up to the height of the punch's top. All cells are relaxed Voronoi polygons.

    Attributes:
        size: of cells; smaller ones fill the gap below the punch.
        stiffness: of the punch relative to the block: 1 or 100 in the paper.
        gap0: initial gap below the punch. The paper gives it in a figure only. With 0.6, uy = -1.3 drives a rigid punch
            0.7 deep into a block of height 1; with 0.3 or less it would go through the bottom.
        medium: third medium.
        material: of the block.
        uy: displacement of the punch's top at full load (downwards is negative).
        width, height, radius: of the block and the punch.
    """

    size: float = 0.1
    stiffness: float = 1.0
    gap0: float = 0.6
    medium: Medium = field(default_factory=lambda: angle_medium(1e-4, 1.0))
    material: Material = field(default_factory=lambda: Material(K=5.0 / 3.0, mu=5.0 / 14.0))
    uy: float = -1.3
    width: float = 2.0
    height: float = 1.0
    radius: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self)
        for name, hint in (
            ("size", "the size of cells, try 0.1"),
            ("stiffness", "of the punch relative to the block, 1 or 100 in the paper"),
            ("gap0", "the medium needs room below the punch, try 0.6"),
            ("width", "the paper's block has width 2"),
            ("height", "the paper's block has height 1"),
            ("radius", "the paper's punch has radius 1"),
        ):
            require_positive(name, getattr(self, name), hint)
        if self.radius >= self.width:
            raise InputError(f"radius = {self.radius:g} must be smaller than the width {self.width:g} of the block")
        if self.size > 0.25 * min(self.radius, self.height, self.width - self.radius):
            raise InputError(
                f"size = {self.size:g} is too large for a punch of radius {self.radius:g}: use at most "
                f"{0.25 * min(self.radius, self.height, self.width - self.radius):g}"
            )
        if self.stiffness > 10.0 and -self.uy >= self.height + self.gap0:
            raise InputError(
                f"uy = {self.uy:g} moves the stiff punch through the bottom of the block: use more than "
                f"{-self.height - self.gap0:g}, or a larger gap0"
            )
        require_finite("uy", self.uy)

    @property
    def name(self) -> str:
        """Short name, as on the command line."""
        return "punch"

    @property
    def top(self) -> float:
        """Height of the punch's flat top."""
        return self.height + self.gap0 + self.radius

    def make_mesh(self) -> PolygonMesh:
        """Polygons; named points tip and surface; named edges top (of the punch), bottom and axis."""
        from tmc_vem.mesh.make.voronoi import voronoi_mesh

        w, h, r, top = self.width, self.height, self.radius, self.top
        regions = [
            Region("block", [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)]),
            Region("punch", [Arc((0.0, top), r, -90.0, 0.0), (0.0, top)]),
            Region("medium", [(0.0, h), (w, h), (w, top), (r, top), Arc((0.0, top), r, 0.0, -90.0)]),
        ]
        mesh = voronoi_mesh(regions, self._size)
        return with_names(
            mesh,
            {"tip": (0.0, h + self.gap0), "surface": (0.0, h)},
            {
                "top": ((0.0, top), (r, top)),
                "bottom": ((0.0, 0.0), (w, 0.0)),
                "axis": ((0.0, 0.0), (0.0, top)),
            },
        )

    def curves(self) -> Sequence[Arc]:
        """The round side of the punch."""
        return (Arc((0.0, self.top), self.radius, -90.0, 0.0),)

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Block, punch and the medium around them."""
        punch = self.material.stiffer(self.stiffness)
        return {
            "block": solid_region(self.material),
            "punch": solid_region(punch),
            "medium": medium_region(self.medium, self.material.moduli.mu, self.gap0),
        }

    def prescribed(self) -> Sequence[Prescribed]:
        """Fixed bottom, symmetry, and the load."""
        return (Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("axis", 0), self.load())

    def probes(self) -> Mapping[str, Probe]:
        """Distance of the punch's lowest point and the block's surface on the axis."""
        return {GAP: Gap("tip", "surface")}

    def units(self) -> Units:
        """Any consistent set."""
        return Units()

    def load(self) -> Prescribed:
        """u_y of the punch's flat top."""
        return Prescribed("top", 1, self.uy)

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values."""
        numbers = ("size", "stiffness", "gap0", "uy", "width", "height", "radius")
        return {
            "problem": self.name,
            **{name: getattr(self, name) for name in numbers},
            "material": self.material.as_dict(),
            "medium": self.medium.as_dict(self.material.moduli.mu, self.gap0),
        }

    def _size(self, points: Float) -> Float:
        """Two cells or more across the gap, the full size away from it."""
        distance = np.hypot(points[:, 0], points[:, 1] - (self.height + 0.5 * self.gap0))
        opening = self.gap0 + 0.45 * distance**2 / self.radius  # of the wedge between circle and surface
        size: Float = np.minimum(self.size, 0.6 * opening)
        return size
