"""Self-contact within a box, section 5.1 of Xu & Wriggers, CMAME 450 (2026) 118611."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import check_refined
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.materials import Material, Medium
from tmc_vem.problems.probes import GAP, Gap, Probe
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.support.validation import check_fields, require_choice, require_finite, require_positive
from tmc_vem.system.constraints import Prescribed

CELL_KINDS = ("quadrilaterals", "voronoi")
# A hexagon has half as many degrees of freedom again as a quadrilateral.
VORONOI_SIZE = 1.2
# The rows of cells along both faces of the wall fit into it up to this size relative to it.
WIDEST = 0.7


@dataclass(frozen=True)
class Box:
    """A hollow box that is pressed at the middle of its top until its flanges touch.

    Supports are single nodes: the lower left corner is fixed, the lower right corner is free to slide in x, and the
    middle of the top has its u_y prescribed and its u_x free. The third medium fills the cavity.

    Attributes:
        cells: equal squares or rectangles in x and y over the whole box; the wall must be a whole number of them.
        medium_refinement: into how many parts the medium's cells divide each edge of the solid's cells; from 2 on, the
            solid gets hanging nodes (the paper's meshes 1 to 3).
        cell_kind: 'quadrilaterals', or 'voronoi' for relaxed Voronoi cells in about as many degrees of freedom.
        medium: third medium.
        material: solid.
        uy: displacement of the middle of the top at full load (downwards is negative).
        length, height, wall: outer dimensions and thickness of the wall.
    """

    cells: tuple[int, int] = (40, 10)
    medium: Medium = field(default_factory=Medium)
    material: Material = field(default_factory=lambda: Material(K=20.0, mu=10.0))
    uy: float = -1.0
    length: float = 2.0
    height: float = 0.5
    wall: float = 0.1
    medium_refinement: int = 1
    cell_kind: str = "quadrilaterals"

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("length", "height", "wall"):
            require_positive(name, getattr(self, name), f"the paper's box has {name} {_DEFAULTS[name]:g}")
        if 2.0 * self.wall >= min(self.length, self.height):
            raise InputError(f"wall = {self.wall:g} leaves no cavity in a box of {self.length:g} x {self.height:g}")
        require_finite("uy", self.uy)
        if len(self.cells) != 2 or min(self.cells) < 1:
            raise InputError(f"cells = {self.cells}: give the number of cells in x and in y, for example 40 10")
        require_choice("cell_kind", self.cell_kind, CELL_KINDS)
        if self.cell_kind == "voronoi" and self.medium_refinement != 1:
            raise InputError(f"medium_refinement = {self.medium_refinement}: Voronoi cells are refined by 'cells' only")
        if not 1 <= self.medium_refinement <= 64:
            raise InputError(f"medium_refinement = {self.medium_refinement}: use 1 (none) to 64")
        for axis, count, extent in zip("xy", self.cells, (self.length, self.height), strict=True):
            self._check_resolution(axis, count, extent)
        cavity = (1.0 - 2.0 * self.wall / self.length) * (1.0 - 2.0 * self.wall / self.height)
        check_refined(self.cells, cavity, self.medium_refinement, cells_allowed())

    def _check_resolution(self, axis: str, count: int, extent: float) -> None:
        in_wall = self.wall / extent * count
        if abs(in_wall - round(in_wall)) > 1e-9 * count or round(in_wall) < 1:
            unit = Fraction(self.wall / extent).limit_denominator(1000).denominator
            raise InputError(
                f"{count} cells in {axis} do not resolve the wall: {self.wall:g} is {in_wall:g} cells of "
                f"{extent / count:g}; use a multiple of {unit}"
            )
        if axis == "x" and count % 2:
            raise InputError(
                f"{count} cells in x leave no node in the middle of the top, where the load is; use an even number"
            )

    @property
    def name(self) -> str:
        """Short name, as on the command line."""
        return "box"

    def make_mesh(self) -> PolygonMesh:
        """Equal quadrilaterals in each region; named points: support_left, support_right, load, flange_top,
        flange_bottom."""
        nx, ny = self.cells
        t, middle = self.wall, self.length / 2
        points = {
            "support_left": (0.0, 0.0),
            "support_right": (self.length, 0.0),
            "load": (middle, self.height),
            "flange_top": (middle, self.height - t),
            "flange_bottom": (middle, t),
        }
        if self.cell_kind == "voronoi":
            return self._voronoi(points)
        x, y = np.linspace(0.0, self.length, nx + 1), np.linspace(0.0, self.height, ny + 1)
        cavity = Rectangle("medium", t, self.length - t, t, self.height - t)
        mesh = structured_quadrilaterals(x, y, [Rectangle("solid", 0.0, self.length, 0.0, self.height), cavity])
        if self.medium_refinement > 1:
            walls = submesh(mesh, mesh.region_c == mesh.region_names.index("solid"))
            fine_x, fine_y = (_divided(line, t, self.medium_refinement) for line in (x, y))
            mesh = weld([walls, structured_quadrilaterals(fine_x, fine_y, [cavity])])
        return with_names(mesh, points)

    def _voronoi(self, points: Mapping[str, tuple[float, float]]) -> PolygonMesh:
        from tmc_vem.mesh.make.outline import Region
        from tmc_vem.mesh.make.voronoi import voronoi_mesh

        a, b, t = self.length, self.height, self.wall
        cavity = [(t, t), (a - t, t), (a - t, b - t), (t, b - t)]
        walls = Region("solid", [(0.0, 0.0), (a, 0.0), (a, b), (0.0, b)], [cavity])
        size = min(VORONOI_SIZE * a / self.cells[0], WIDEST * t)
        return voronoi_mesh([walls, Region("medium", cavity)], size, points)

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Solid wall and medium in the cavity."""
        return {
            "solid": solid_region(self.material),
            "medium": medium_region(self.medium, self.material.moduli.mu, self.height - 2.0 * self.wall),
        }

    def prescribed(self) -> Sequence[Prescribed]:
        """Single-node supports and the load."""
        return (
            Prescribed("support_left", 0),
            Prescribed("support_left", 1),
            Prescribed("support_right", 1),
            self.load(),
        )

    def probes(self) -> Mapping[str, Probe]:
        """Distance of the middles of the inner flange surfaces."""
        return {GAP: Gap("flange_top", "flange_bottom")}

    def units(self) -> Units:
        """Any consistent set."""
        return Units()

    def load(self) -> Prescribed:
        """u_y at the middle of the top."""
        return Prescribed("load", 1, self.uy)

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values."""
        return {
            "problem": self.name,
            "cells": list(self.cells),
            "uy": self.uy,
            "length": self.length,
            "height": self.height,
            "wall": self.wall,
            "medium_refinement": self.medium_refinement,
            "cell_kind": self.cell_kind,
            "material": self.material.as_dict(),
            "medium": self.medium.as_dict(self.material.moduli.mu, self.height - 2.0 * self.wall),
        }


_DEFAULTS = {"length": 2.0, "height": 0.5, "wall": 0.1}


def _divided(lines: NDArray[np.float64], wall: float, parts: int) -> NDArray[np.float64]:
    """The mesh lines within the walls, with every spacing divided into equal parts."""
    inner = lines[(lines > wall * (1 - 1e-9)) & (lines < lines[-1] - wall * (1 - 1e-9))]
    fine = np.interp(np.arange((len(inner) - 1) * parts + 1) / parts, np.arange(len(inner)), inner)
    fine[-1] = inner[-1]
    return fine
