"""Tractions along the surface of the solids as arrays: what is written, read and drawn of a state's contact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.contact_quantities import pair_name
from tmc_vem.results.contact.facing import facing
from tmc_vem.results.contact.friction import Slip, SurfaceFriction
from tmc_vem.results.contact.traction import Traction
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import FORCE, LENGTH, NONE, STRESS

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

AXES = ("x", "y")
HALF = 0.5


@dataclass(frozen=True)
class FrictionCurves:
    """Friction at the same stations; stresses are true ones.

    Attributes:
        shear_n: (n,) shear that friction alone makes, positive in the direction of the line.
        bound_n: (n,) largest shear that it can have, 0 where there is no contact.
        sticking_n: (n,) part of the bound beside the station that sticks: 1 stick, 0 slip; not a number where there is
            no contact.
        slip_n: (n,) how far it has slipped along what it faces, positive in the direction of the line.
        path_n: (n,) the same, back and forth added up.
    """

    shear_n: Float
    bound_n: Float
    sticking_n: Float
    slip_n: Float
    path_n: Float

    @staticmethod
    def of(found: SurfaceFriction, slip: Slip) -> FrictionCurves:
        """Those of a state."""
        return FrictionCurves(found.shear_n, found.bound_n, found.sticking_n, slip.slip_n.copy(), slip.path_n.copy())


@dataclass(frozen=True)
class ContactCurves:
    """What the medium does to the solids in a state, station by station along lines: the outlines of the solids as far
    as they are in medium, each with its solid on the left. Forces are those on the solid.

    Integrals are sums over stations: the force on a body is the sum of ``force_ni``, and that of ``pressure_n *
    deformed_weight_n`` the integral of the true pressure.

    Attributes:
        bodies: names of the bodies.
        closed_l: (n_lines,) which lines are closed, so that their last station goes on to their first.
        body_n: (n,) body of each station, a position in ``bodies``.
        line_n: (n,) line of each; stations of a line follow each other.
        faces_n: (n,) body that it faces across the medium, -1 where there is none.
        arc_length_n: (n,) reference length along the line from its first station.
        deformed_arc_length_n: (n,) the same in the deformed state.
        reference_nx: (n, 2) reference coordinates.
        point_nx: (n, 2) deformed coordinates.
        normal_nx: (n, 2) unit normal of the deformed solid, into the medium.
        force_ni: (n, 2) force (per thickness).
        traction_ni: (n, 2) nominal traction, per reference area.
        pressure_n: (n,) true pressure, positive in compression.
        shear_n: (n,) true shear, positive in the direction of the line.
        medium_pressure_n: (n,) pressure -n . sigma n that the medium's own stress shows in the cells at the station,
            without the regulariser; not a number where it is not known.
        gap_n: (n,) distance to what it faces, not a number where there is nothing.
        weight_n: (n,) reference length that a station stands for.
        deformed_weight_n: (n,) the same in the deformed state.
        joint: what stands between the names of two bodies in that of their pair.
        friction: where the medium has friction.
    """

    bodies: tuple[str, ...]
    closed_l: Bool
    body_n: Int
    line_n: Int
    faces_n: Int
    arc_length_n: Float
    deformed_arc_length_n: Float
    reference_nx: Float
    point_nx: Float
    normal_nx: Float
    force_ni: Float
    traction_ni: Float
    pressure_n: Float
    shear_n: Float
    medium_pressure_n: Float
    gap_n: Float
    weight_n: Float
    deformed_weight_n: Float
    joint: str
    friction: FrictionCurves | None = None

    def __len__(self) -> int:
        return len(self.line_n)

    @staticmethod
    def of(
        traction: Traction, medium_pressure_n: Float | None = None, friction: FrictionCurves | None = None
    ) -> ContactCurves:
        """Those of a state, with the pressure (n,) that the medium's own stress shows, and friction."""
        surface, seen = traction.surface, facing(traction)
        return ContactCurves(
            bodies=surface.bodies,
            closed_l=surface.closed_l,
            body_n=surface.body_n,
            line_n=surface.line_n,
            faces_n=np.where(seen.station_n >= 0, surface.body_n[seen.station_n], -1),
            arc_length_n=traction.arc_length_n(),
            deformed_arc_length_n=traction.arc_length_n(deformed=True),
            reference_nx=surface.points_nx,
            point_nx=traction.points_nx,
            normal_nx=traction.normal_ni,
            force_ni=traction.force_ni,
            traction_ni=traction.nominal_ni,
            pressure_n=traction.pressure_n,
            shear_n=traction.shear_n,
            medium_pressure_n=np.full(len(surface), np.nan) if medium_pressure_n is None else medium_pressure_n,
            gap_n=seen.gap_n,
            weight_n=surface.weight_n,
            deformed_weight_n=traction.weight_n,
            joint=surface.joint,
            friction=friction,
        )

    def between(self, body: str, other: str | None = None) -> Bool:
        """(n,) which stations are those of a body that face another one, or anything.

        Raises:
            InputError: there is no body of a name.
        """
        numbers = [self._number(name) for name in (body, other) if name is not None]
        chosen: Bool = self.body_n == numbers[0]
        return chosen if other is None else chosen & (self.faces_n == numbers[1])

    def regulariser_share(self) -> dict[str, float]:
        """Part of the pressure that is not the medium's own stress but its regulariser's, by pair of bodies that face
        each other: over the stations with more than half of the largest pressure of the pair."""
        low, high = np.minimum(self.body_n, self.faces_n), np.maximum(self.body_n, self.faces_n)
        shares = {}
        for pair in sorted(set(zip(low.tolist(), high.tolist(), strict=True))):
            mine = (low == pair[0]) & (high == pair[1])
            most = float(self.pressure_n[mine].max())
            mine &= self.pressure_n > HALF * most
            if pair[0] < 0 or not most > 0.0:
                continue
            weight = self.deformed_weight_n[mine]
            own = float(weight @ self.medium_pressure_n[mine]) / float(weight @ self.pressure_n[mine])
            shares[pair_name(self.bodies, pair, self.joint)] = 1.0 - own
        return shares

    def lines(self, *, closing: bool = False) -> Iterator[Int]:
        """Stations of each line.

        Args:
            closing: with the first one of a closed line once more at its end.
        """
        for line, closed in enumerate(self.closed_l.tolist()):
            stations = np.flatnonzero(self.line_n == line)
            yield np.append(stations, stations[:1]) if closing and closed else stations

    def _number(self, name: str) -> int:
        if name not in self.bodies:
            raise InputError(f"no body '{name}' is in medium (there is: {', '.join(self.bodies)})")
        return self.bodies.index(name)


@dataclass(frozen=True)
class Column:
    """A column of a table of stations: a field of the curves, and which of its components."""

    name: str
    kind: str
    field: str
    component: int | None = None


def _pair(name: str, kind: str, field: str) -> list[Column]:
    return [Column(f"{name}{axis}", kind, field, i) for i, axis in enumerate(AXES)]


# in their order; before them stand the names of the body and of what it faces
COLUMNS: Sequence[Column] = (
    Column("line", NONE, "line_n"),
    Column("arc_length", LENGTH, "arc_length_n"),
    Column("deformed_arc_length", LENGTH, "deformed_arc_length_n"),
    *_pair("reference_", LENGTH, "reference_nx"),
    *_pair("", LENGTH, "point_nx"),
    *_pair("normal_", NONE, "normal_nx"),
    *_pair("force_", FORCE, "force_ni"),
    *_pair("traction_", STRESS, "traction_ni"),
    Column("pressure", STRESS, "pressure_n"),
    Column("shear", STRESS, "shear_n"),
    Column("medium_pressure", STRESS, "medium_pressure_n"),
    Column("gap", LENGTH, "gap_n"),
    Column("weight", LENGTH, "weight_n"),
    Column("deformed_weight", LENGTH, "deformed_weight_n"),
)
# behind them, where the medium has friction
FRICTION_COLUMNS: Sequence[Column] = (
    Column("friction_shear", STRESS, "shear_n"),
    Column("friction_bound", STRESS, "bound_n"),
    Column("sticking", NONE, "sticking_n"),
    Column("slip", LENGTH, "slip_n"),
    Column("slip_path", LENGTH, "path_n"),
)
assert {column.field for column in COLUMNS} <= {entry.name for entry in fields(ContactCurves)}
assert [column.field for column in FRICTION_COLUMNS] == [entry.name for entry in fields(FrictionCurves)]
