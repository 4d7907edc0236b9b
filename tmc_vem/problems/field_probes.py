"""Probes of fields at points, over regions and along lines, of energies, and of forces through cuts.

All places, lengths and areas are those of the reference configuration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.probes import Known, Place, Probe
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import AREA, ENERGY, FORCE, LENGTH, NONE, STRESS, VOLUME
from tmc_vem.support.validation import check_fields, require_choice, require_finite, require_within
from tmc_vem.system.cut import cut_points, going_on
from tmc_vem.system.tensors import SCALARS

if TYPE_CHECKING:
    from tmc_vem.problems.base import RegionEnergy

Line = tuple[tuple[float, float], tuple[float, float]]
DISPLACEMENTS = {"ux": 0, "uy": 1}
DENSITY = "energy_density"
SMALLEST, LARGEST, MEAN, INTEGRAL = "smallest", "largest", "mean", "integral"
OF_CUTS = {"x": FORCE, "y": FORCE, "normal": FORCE, "shear": FORCE, "moment": ENERGY}
# Fields of a p-norm: they are nowhere negative. Beyond the largest exponent, it is the largest value to rounding.
OF_P_NORM = ("von_mises", "J", "principal_stretch_1", "principal_stretch_2")
LARGEST_P = 1000.0
OVER_AREA = {STRESS: ENERGY, NONE: AREA, LENGTH: VOLUME}
OVER_LENGTH = {STRESS: FORCE, NONE: LENGTH, LENGTH: AREA}


def kind_of_field(name: str) -> str:
    """Kind of quantity of a field."""
    if name in DISPLACEMENTS:
        return LENGTH
    return STRESS if name == DENSITY else SCALARS[name].kind


def words_of_field(name: str) -> str:
    """What a field is called in a message."""
    return SCALARS[name].what if name in SCALARS else name.replace("_", " ")


@dataclass(frozen=True)
class FieldProbe(Probe):
    """A probe of a field; :mod:`tmc_vem.simulation.field_gauge` reads all of them.

    Attributes:
        field: its name.
    """

    field: str

    def require_across(self, names: Sequence[str], regions: Mapping[str, RegionEnergy]) -> None:
        """Check that regions have the stress across the plane, if the field needs it.

        Raises:
            InputError: one has not; the message says why.
        """
        if self.field not in SCALARS or not SCALARS[self.field].across:
            return
        from codegen.out_of_plane import out_of_plane_stress

        for name in names:
            reason = out_of_plane_stress(regions[name].integrand).reason
            if reason:
                raise InputError(
                    f"{self.field} needs the stress across the plane, which region '{name}' lacks: {reason}"
                )


@dataclass(frozen=True)
class ValueAt(FieldProbe):
    """Recovered value of a field at a point.

    Attributes:
        at: where.
        region: whose value where several meet; by default a solid's before that of a medium.
    """

    at: Place = ""
    region: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("value", self.field, tuple(SCALARS))
        if not isinstance(self.at, str):
            for value in self.at:
                require_finite("coordinate of a point", value)

    @property
    def kind(self) -> str:
        """Kind of quantity."""
        return kind_of_field(self.field)

    @property
    def places(self) -> tuple[Place, ...]:
        """The point."""
        return (self.at,)

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        if self.region is not None:
            known.require_region(self.region)

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check that the field is known in the region, if there is one; else it is once the cell is found."""
        self.require_across([self.region] if self.region else [], regions)

    def __str__(self) -> str:
        place = self.at if isinstance(self.at, str) else f"({self.at[0]:g}, {self.at[1]:g})"
        return f"{words_of_field(self.field)} at {place}"


@dataclass(frozen=True)
class Over(FieldProbe):
    """Smallest or largest value, mean or integral of a field over a region, along named edges or along a line.

    Over regions, means and integrals are those of the discretisation at its quadrature points, smallest and largest
    values those of the recovered field at the nodes. Along lines everything is of the recovered field.

    Attributes:
        what: ``smallest``, ``largest``, ``mean`` or ``integral``.
        region: a region; with edges or a line, which side of them is meant, or which part.
        edges: name of edges.
        line: both ends of a straight line.
    """

    what: str = MEAN
    region: str | None = None
    edges: str | None = None
    line: Line | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("what", self.what, (SMALLEST, LARGEST, MEAN, INTEGRAL))
        require_choice(self.what, self.field, (*SCALARS, DENSITY, *DISPLACEMENTS))
        if self.edges is not None and self.line is not None:
            raise InputError("give edges or a line, not both")
        if self.region is None and self.edges is None and self.line is None:
            raise InputError(f"{self.what} lacks a place: give region, edges or line")
        if self.line is not None:
            check_line(self.line)
        if self.field == DENSITY and (self.line is not None or self.edges is not None):
            raise InputError(f"{DENSITY} is known by cells only: give a region, no edges and no line")

    @property
    def kind(self) -> str:
        """Kind of quantity."""
        kind = kind_of_field(self.field)
        if self.what != INTEGRAL:
            return kind
        return (OVER_AREA if self.is_area else OVER_LENGTH)[kind]

    @property
    def is_area(self) -> bool:
        """Whether it is over a whole region."""
        return self.edges is None and self.line is None

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        if self.region is not None:
            known.require_region(self.region)

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check that edges are there, and that the field is known in the region, if there is one."""
        if self.edges is not None and self.edges not in mesh.named_edges:
            known = ", ".join(mesh.named_edges) or "none"
            raise InputError(f"the mesh has no edges '{self.edges}' (there are: {known})")
        self.require_across([self.region] if self.region else [], regions)

    def __str__(self) -> str:
        parts = [f"over {self.region}"] if self.is_area else []
        if self.edges is not None:
            parts.append(f"along {self.edges}")
        if self.line is not None:
            parts.append(f"along {said_line(self.line)}")
        if not self.is_area and self.region:
            parts.append(f"in {self.region}")
        of = " of" if self.what in (MEAN, INTEGRAL) else ""
        return f"{self.what}{of} {words_of_field(self.field)} {' '.join(parts)}"


@dataclass(frozen=True)
class PNorm(FieldProbe):
    """``(mean over a region of field^p)^(1/p)`` at the quadrature points: nearly the largest value for a large p, but
    with a derivative.

    Attributes:
        region: its name.
        p: the exponent, 1 or more; 6 to 12 in most uses.

    Raises:
        InputError: the field may be negative, or p is below 1.
    """

    region: str = ""
    p: float = 8.0

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("p_norm", self.field, OF_P_NORM, "others may be negative")
        require_within("exponent", self.p, 1.0, LARGEST_P, "6 to 12 in most uses")

    @property
    def kind(self) -> str:
        """Kind of quantity: that of the field."""
        return kind_of_field(self.field)

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        known.require_region(self.region)

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check that the field is known in the region."""
        self.require_across([self.region], regions)

    def __str__(self) -> str:
        return f"{self.p:g}-norm of {words_of_field(self.field)} over {self.region}"


@dataclass(frozen=True)
class EnergyOf(Probe):
    """Energy stored in a region, per unit of thickness."""

    region: str
    kind: ClassVar[str] = ENERGY

    def __post_init__(self) -> None:
        check_fields(self)

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        known.require_region(self.region)

    def __str__(self) -> str:
        return f"energy of {self.region}"


@dataclass(frozen=True)
class CutForce(Probe):
    """Force that the solids transfer through a straight cut: that of what is right of it, on what is left of it.

    Cells belong to the side on which the mean of their corners is. The force is the sum of what the cells on the left
    resist with at the nodes that they share with cells on the right, between both ends of the line: so it is in
    equilibrium with loads, supports and contact forces of either part as well as the equations are solved, on any mesh.

    Attributes:
        component: ``x``, ``y``; ``normal``, positive in tension; ``shear``, along the line; or ``moment``,
            counter-clockwise, about the material point in the middle of the line.
        line: from one end to the other; left and right are those of somebody who walks along it.
        region: what is cut; all solids by default.
    """

    component: str
    line: Line
    region: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("cut_force", self.component, tuple(OF_CUTS))
        check_line(self.line)

    @property
    def kind(self) -> str:
        """Kind of quantity."""
        return OF_CUTS[self.component]

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of the line."""
        (x0, y0), (x1, y1) = self.line
        return (0.5 * (x0 + x1), 0.5 * (y0 + y1))

    @property
    def places(self) -> tuple[Place, ...]:
        """What a moment is about."""
        return (self.middle,) if self.component == "moment" else ()

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        if self.region is not None:
            known.require_region(self.region)

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check that the line cuts something."""
        cut = [self.region] if self.region else [name for name, of in regions.items() if not of.is_medium]
        chosen_c = np.isin(np.array(mesh.region_names)[mesh.region_c], cut)
        cells = mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, chosen_c
        if not len(cut_points(*cells, self.line)[1]):
            raise InputError(f"the cut from {said_line(self.line)} goes through no inner side of {' or '.join(cut)}")
        beyond = going_on(*cells, self.line)
        if len(beyond):
            raise InputError(
                f"the cut from {said_line(self.line)} ends in {' or '.join(cut)}, whose cells it parts up to "
                f"({beyond[0, 0]:g}, {beyond[0, 1]:g}): let the line end outside of it, a cell from its outline"
            )

    def __str__(self) -> str:
        words = {"normal": "normal force", "shear": "shear force", "moment": "moment"}
        what = words.get(self.component, f"{self.component} component of the force")
        return f"{what} through the cut {said_line(self.line)}"


def check_line(line: Line) -> None:
    """Check that a line has two ends.

    Raises:
        InputError: it has no length, or a coordinate is no finite number.
    """
    for point in line:
        for value in point:
            require_finite("coordinate of a line", value)
    if math.dist(*line) == 0.0:
        raise InputError(f"line: both ends are ({line[0][0]:g}, {line[0][1]:g})")


def said_line(line: Line) -> str:
    """A line in words."""
    (x0, y0), (x1, y1) = line
    return f"({x0:g}, {y0:g}) to ({x1:g}, {y1:g})"
