"""Self-contact of the C-box, section 5.2 of Xu & Wriggers, CMAME 450 (2026) 118611."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

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

SOLID_CELLS = ("quadrilaterals", "polygons")


def angle_medium(gamma: float, alpha_r: float) -> Medium:
    """Third medium of sections 5.2 to 5.4: regulariser (15), not damped."""
    return Medium(gamma=gamma, alpha_r=alpha_r, beta=0.0, regulariser="angle")


@dataclass(frozen=True)
class CBox:
    """A C whose upper arm is pushed down at its tip until it presses on the lower arm.

    The whole line x = 0 is fixed; the upper right corner has its u_y prescribed and its u_x free. Third medium fills
    the cavity and a column to the right of the arms, over the full height, so that the tips have medium around the
    point of contact. The column is some ``cells`` wide however fine the medium is: where it is thin (0.025 is), the tip
    slips sideways past the medium and into the lower arm, with J > 0 at all quadrature points.

    Attributes:
        cells: squares or rectangles in x and y over length x height that resolve the solid.
        medium_refinement: into how many parts the medium divides each edge of these cells; the paper's two densities
            are 1 and 2 here.
        solid_cells: 'polygons' (relaxed Voronoi cells, as in the paper) or 'quadrilaterals'.
        medium: third medium.
        material: solid.
        uy: displacement of the upper right corner at full load (downwards is negative).
        length, height, wall: outer dimensions and thickness of arms and back.
        polygons_across: polygons across the wall; with 3, the middle ones are true polygons between two regular rows.
        column_cells: width of the column, in ``cells``. It is a part of the geometry: keep it at the same width when
            meshes are compared.
    """

    cells: tuple[int, int] = (20, 10)
    medium_refinement: int = 1
    solid_cells: str = "polygons"
    medium: Medium = field(default_factory=lambda: angle_medium(1e-5, 1.0))
    material: Material = field(default_factory=lambda: Material(K=5.0 / 3.0, mu=5.0 / 14.0))
    uy: float = -0.5
    length: float = 1.0
    height: float = 0.5
    wall: float = 0.1
    polygons_across: int = 3
    column_cells: int = 1

    def __post_init__(self) -> None:
        check_fields(self)
        for name, default in (("length", 1.0), ("height", 0.5), ("wall", 0.1)):
            require_positive(name, getattr(self, name), f"the paper's C-box has {name} {default:g}")
        if self.wall >= self.length or 2.0 * self.wall >= self.height:
            raise InputError(f"wall = {self.wall:g} leaves no cavity in a C-box of {self.length:g} x {self.height:g}")
        require_finite("uy", self.uy)
        require_choice("solid_cells", self.solid_cells, SOLID_CELLS)
        if not 3 <= self.polygons_across <= 64:
            raise InputError(f"polygons_across = {self.polygons_across}: use 3 to 64")
        if not 1 <= self.column_cells <= 64:
            raise InputError(f"column_cells = {self.column_cells}: use 1 to 64")
        if not 1 <= self.medium_refinement <= 64:
            raise InputError(f"medium_refinement = {self.medium_refinement}: use 1 (none) to 64")
        if len(self.cells) != 2 or min(self.cells) < 1:
            raise InputError(f"cells = {self.cells}: give the number of cells in x and in y, for example 20 10")
        for axis, count, extent in zip("xy", self.cells, (self.length, self.height), strict=True):
            in_wall = self.wall / extent * count
            if abs(in_wall - round(in_wall)) > 1e-9 * count or round(in_wall) < 1:
                raise InputError(
                    f"{count} cells in {axis} do not resolve the wall: {self.wall:g} is {in_wall:g} cells of "
                    f"{extent / count:g}; the paper's C-box takes multiples of 10 in x and of 5 in y"
                )
        cavity = (1.0 - self.wall / self.length) * (1.0 - 2.0 * self.wall / self.height)
        check_refined(self.cells, cavity, self.medium_refinement, cells_allowed())

    @property
    def name(self) -> str:
        """Short name, as on the command line."""
        return "cbox"

    def make_mesh(self) -> PolygonMesh:
        """Solid and medium, welded; named points load, tip_top, tip_bottom; named edges left (x = 0)."""
        solid = self._quadrilateral_solid() if self.solid_cells == "quadrilaterals" else self._polygonal_solid()
        length, height, t = self.length, self.height, self.wall
        mesh = weld([solid, self._medium()])
        return with_names(
            mesh,
            {"load": (length, height), "tip_top": (length, height - t), "tip_bottom": (length, t)},
            {"left": ((0.0, 0.0), (0.0, height))},
        )

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Solid C and medium in the cavity and to its right."""
        return {
            "solid": solid_region(self.material),
            "medium": medium_region(self.medium, self.material.moduli.mu, self.height - 2.0 * self.wall),
        }

    def prescribed(self) -> Sequence[Prescribed]:
        """The left side is fixed, one node is loaded."""
        return (Prescribed("left", 0), Prescribed("left", 1), self.load())

    def probes(self) -> Mapping[str, Probe]:
        """Distance of the inner corners of the two tips, 0.3 at the start."""
        return {GAP: Gap("tip_top", "tip_bottom")}

    def units(self) -> Units:
        """Any consistent set."""
        return Units()

    def load(self) -> Prescribed:
        """u_y at the upper right corner."""
        return Prescribed("load", 1, self.uy)

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values."""
        return {
            "problem": self.name,
            "cells": list(self.cells),
            "medium_refinement": self.medium_refinement,
            "solid_cells": self.solid_cells,
            "polygons_across": self.polygons_across,
            "uy": self.uy,
            "length": self.length,
            "height": self.height,
            "wall": self.wall,
            "column_cells": self.column_cells,
            "material": self.material.as_dict(),
            "medium": self.medium.as_dict(self.material.moduli.mu, self.height - 2.0 * self.wall),
        }

    def _lines(self, parts: int = 1) -> tuple[Any, Any]:
        return (
            np.linspace(0.0, self.length, self.cells[0] * parts + 1),
            np.linspace(0.0, self.height, self.cells[1] * parts + 1),
        )

    def _quadrilateral_solid(self) -> PolygonMesh:
        x, y = self._lines()
        t = self.wall
        whole = Rectangle("solid", 0.0, self.length, 0.0, self.height)
        cavity = Rectangle("medium", t, self.length, t, self.height - t)
        mesh = structured_quadrilaterals(x, y, [whole, cavity])
        return submesh(mesh, mesh.region_c == mesh.region_names.index("solid"))

    def _polygonal_solid(self) -> PolygonMesh:
        from tmc_vem.mesh.make.outline import Region
        from tmc_vem.mesh.make.voronoi import voronoi_mesh

        length, height, t = self.length, self.height, self.wall
        outline = [(0, 0), (length, 0), (length, t), (t, t), (t, height - t), (length, height - t), (length, height),
                   (0, height)]  # fmt: skip
        return voronoi_mesh([Region("solid", outline)], size=t / self.polygons_across)

    def _medium(self) -> PolygonMesh:
        x, y = self._lines(self.medium_refinement)
        length, height, t = self.length, self.height, self.wall
        column = length / self.cells[0] * self.column_cells
        parts = self.column_cells * self.medium_refinement
        mesh = structured_quadrilaterals(
            np.append(x, length + column * np.arange(1, parts + 1) / parts),
            y,
            [
                Rectangle("rest", 0.0, length + column, 0.0, height),
                Rectangle("medium", t, length, t, height - t),
                Rectangle("medium", length, length + column, 0.0, height),
            ],
        )
        return submesh(mesh, mesh.region_c == mesh.region_names.index("medium"))
