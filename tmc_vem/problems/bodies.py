"""Complex contact of several bodies, section 5.4 of Xu & Wriggers, CMAME 450 (2026) 118611."""

from __future__ import annotations

import math
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
class Bodies:
    """A beam between nearly rigid half discs that are pushed towards it, alternately from above and from below.

    The beam is [0, length] x [0, thickness]; the half discs stand at equal distances with their round side to the beam,
    the first above it. Third medium fills the space between the flat sides of the upper and of the lower ones.

    The half discs' flat sides are moved by uy towards the beam. Case 1: both ends of the beam are fixed, and the flat
    sides cannot move in x. Case 2: the beam is fixed at its left end and its lower right corner slides in x, and the
    half discs are free in x; nothing but the medium holds them there.

    Attributes:
        case: 1 or 2, boundary conditions as above.
        size: of cells; smaller ones fill the gaps between beam and half discs.
        discs: number of half discs; their centres divide the length into equal parts. The paper has 7, placed as in a
            figure.
        gap0: initial gap between beam and half discs, in the paper's figure only.
        medium: third medium.
        beam, disc: materials.
        uy: how far the half discs move towards the beam at full load (length, positive); in the paper's figures only.
        length, thickness, radius: of the beam and the half discs.
    """

    case: int = 1
    size: float = 0.1
    discs: int = 7
    gap0: float = 0.1
    medium: Medium = field(default_factory=lambda: angle_medium(1e-4, 10.0))
    beam: Material = field(default_factory=lambda: Material(K=50.0, mu=10.0))
    disc: Material = field(default_factory=lambda: Material(K=50000.0, mu=10000.0))
    uy: float = 0.25
    length: float = 8.0
    thickness: float = 0.2
    radius: float = 0.2

    def __post_init__(self) -> None:
        check_fields(self)
        for name, hint in (
            ("size", "the size of cells, try 0.1"),
            ("gap0", "the medium needs room between beam and half discs, try 0.1"),
            ("length", "the paper's beam has length 8"),
            ("thickness", "the paper's beam has thickness 0.2"),
            ("radius", "the paper's half discs have radius 0.2"),
        ):
            require_positive(name, getattr(self, name), hint)
        if self.case not in (1, 2):
            raise InputError(f"case = {self.case}: use 1 (ends fixed, half discs guided) or 2 (half discs free in x)")
        require_finite("uy", self.uy)
        if self.discs < 1:
            raise InputError(f"discs = {self.discs}: use at least 1")
        if 4.0 * self.radius * self.discs > 2.0 * self.length:
            raise InputError(
                f"{self.discs} half discs of radius {self.radius:g} do not fit on a beam of length {self.length:g}"
            )
        if self.size > min(self.thickness, self.radius):
            raise InputError(
                f"size = {self.size:g} is too large for a beam of thickness {self.thickness:g} and half discs of "
                f"radius {self.radius:g}: use at most {min(self.thickness, self.radius):g}"
            )

    @property
    def name(self) -> str:
        """Short name, as on the command line."""
        return "bodies"

    def centers(self) -> list[tuple[float, float]]:
        """Centres of the half discs, on their flat sides; every second one is below the beam."""
        pitch = self.length / (self.discs + 1)
        high, low = self.thickness + self.gap0 + self.radius, -self.gap0 - self.radius
        return [(pitch * (n + 1), high if n % 2 == 0 else low) for n in range(self.discs)]

    def make_mesh(self) -> PolygonMesh:
        """Polygons; named edges left and right (ends of the beam), upper and lower (flat sides of the half discs);
        named points tip and surface (first half disc and the beam below it), right_corner."""
        from tmc_vem.mesh.make.voronoi import voronoi_mesh

        length, r, t = self.length, self.radius, self.thickness
        high, low = t + self.gap0 + r, -self.gap0 - r
        regions = [Region("beam", [(0.0, 0.0), (length, 0.0), (length, t), (0.0, t)])]
        above: list[tuple[float, float] | Arc] = [(0.0, t), (length, t), (length, high)]
        below: list[tuple[float, float] | Arc] = [(length, 0.0), (0.0, 0.0), (0.0, low)]
        flat: dict[str, list[tuple[float, float]]] = {"upper": [], "lower": []}
        for x, y in reversed(self.centers()):
            if y > 0.0:
                regions.append(Region("discs", [Arc((x, y), r, -180.0, 0.0)]))
                above += [(x + r, y), Arc((x, y), r, 0.0, -180.0)]
                flat["upper"].append((x, y))
        for x, y in self.centers():
            if y < 0.0:
                regions.append(Region("discs", [Arc((x, y), r, 0.0, 180.0)]))
                below += [(x - r, y), Arc((x, y), r, 180.0, 0.0)]
                flat["lower"].append((x, y))
        regions += [Region("medium", [*above, (0.0, high)]), Region("medium", [*below, (length, low)])]
        x_first, y_first = self.centers()[0]
        probes = {"tip": (x_first, y_first - r), "surface": (x_first, t)}
        mesh = voronoi_mesh(regions, self._size, probes)
        mesh = with_names(
            mesh,
            {"right_corner": (length, 0.0)},
            {"left": ((0.0, 0.0), (0.0, t)), "right": ((length, 0.0), (length, t))},
        )
        edges = dict(mesh.named_edges)
        for name, places in flat.items():
            if not places:
                continue
            pieces = [with_names(mesh, lines={"side": ((x - r, y), (x + r, y))}).named_edges["side"] for x, y in places]
            edges[name] = np.concatenate(pieces)
        return PolygonMesh(
            mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names,
            named_points=mesh.named_points, named_edges=edges,
        )  # fmt: skip

    def curves(self) -> Sequence[Arc]:
        """The round sides of the half discs."""
        turned = [(x, y, -180.0 if y > 0.0 else 0.0) for x, y in self.centers()]
        return [Arc((x, y), self.radius, first, first + 180.0) for x, y, first in turned]

    def regions(self) -> Mapping[str, RegionEnergy]:
        """Beam, half discs and the medium between them, with the beam's shear modulus."""
        return {
            "beam": solid_region(self.beam),
            "discs": solid_region(self.disc, hold="medium" if self.case == 2 else None),
            "medium": medium_region(self.medium, self.beam.moduli.mu, self.gap0),
        }

    def prescribed(self) -> Sequence[Prescribed]:
        """Supports of the beam, guides of the half discs, and the load."""
        lower = self.discs > 1
        conditions = [Prescribed("left", 0), Prescribed("left", 1), self.load()]
        conditions += [Prescribed("lower", 1, self.uy)] if lower else []
        if self.case == 1:
            conditions += [Prescribed("right", 0), Prescribed("right", 1), Prescribed("upper", 0)]
            conditions += [Prescribed("lower", 0)] if lower else []
        else:
            conditions += [Prescribed("right_corner", 1)]
        return tuple(conditions)

    def probes(self) -> Mapping[str, Probe]:
        """Distance of the first half disc's lowest point and the beam's surface below it."""
        return {GAP: Gap("tip", "surface")}

    def units(self) -> Units:
        """Any consistent set."""
        return Units()

    def load(self) -> Prescribed:
        """u_y of the upper half discs; the lower ones move as far upwards."""
        return Prescribed("upper", 1, -self.uy)

    def inputs(self) -> dict[str, Any]:
        """All parameters as plain values."""
        numbers = ("case", "size", "discs", "gap0", "uy", "length", "thickness", "radius")
        return {
            "problem": self.name,
            **{name: getattr(self, name) for name in numbers},
            "beam": self.beam.as_dict(),
            "disc": self.disc.as_dict(),
            "medium": self.medium.as_dict(self.beam.moduli.mu, self.gap0),
        }

    def _size(self, points: Float) -> Float:
        """Three cells or more across each gap, the full size away from them."""
        distance = np.full(len(points), np.inf)
        for x, y in self.centers():
            middle = y - math.copysign(self.radius + 0.5 * self.gap0, y)
            np.minimum(distance, np.hypot(points[:, 0] - x, points[:, 1] - middle), out=distance)
        size: Float = np.minimum(self.size, 0.3 * self.gap0 + 0.3 * distance)
        return size
