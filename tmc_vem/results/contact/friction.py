"""Friction along the surface of the solids: shear and its bound, what sticks, how far the surfaces have slipped.

The medium's traction is split along and across the contact: the tangent of a station is the mean of its sides, weighted
by the bound of friction beside them, so that at a corner of a block it is that of the side that is in contact. The part
of the shear that friction itself makes is that of the stress tau A in the cells beside the station; the rest is the
medium's own (its parasitic friction) and the regulariser's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.facing import Facing
from tmc_vem.results.contact.traction import Traction

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class SideFriction:
    """Friction in the medium's cells beside the sides of a surface: means over their deformed areas.

    Attributes:
        stress_sij: (n_sides, 2, 2) Cauchy stress of friction alone.
        bound_s: (n_sides,) largest shear, 0 where there is no contact.
        sticking_s: (n_sides,) what of it is at points that stick.
    """

    stress_sij: Float
    bound_s: Float
    sticking_s: Float


@dataclass(frozen=True)
class SurfaceFriction:
    """Friction at the stations of a surface; stresses are true ones.

    Attributes:
        tangent_ni: (n, 2) unit vectors along the contact, in the direction of the line.
        shear_n: (n,) shear of friction alone, positive in the direction of the line.
        bound_n: (n,) largest shear that friction can have; 0 where there is no contact.
        sticking_n: (n,) part of the bound beside the station that sticks: 1 stick, 0 slip; not a number where there is
            no contact.
    """

    tangent_ni: Float
    shear_n: Float
    bound_n: Float
    sticking_n: Float

    @property
    def touches_n(self) -> Bool:
        """(n,) where there is contact."""
        touches: Bool = self.bound_n > 0.0
        return touches

    @staticmethod
    def of(traction: Traction, sides: SideFriction) -> SurfaceFriction:
        """At the stations of a state, from what is beside its sides."""
        surface = traction.surface
        tangent_sai = traction.tangents_sai
        stretch_sa = np.hypot(*np.moveaxis(tangent_sai, -1, 0))
        weight_sa = surface.length_s[:, None] * surface.trace.mean_a * stretch_sa
        unit_sai = tangent_sai / np.where(stretch_sa > 0.0, stretch_sa, 1.0)[..., None]
        normal_sai = np.stack([unit_sai[..., 1], -unit_sai[..., 0]], axis=-1)
        shear_sa = np.einsum("sai,sij,saj->sa", unit_sai, sides.stress_sij, normal_sai)
        bound_sa = weight_sa * sides.bound_s[:, None]
        mean_ni = np.column_stack([surface.summed(bound_sa * unit_sai[..., i]) for i in (0, 1)])
        length_n = np.hypot(*mean_ni.T)
        bound_n = surface.summed(bound_sa)
        with np.errstate(invalid="ignore"):
            sticking_n = surface.summed(weight_sa * sides.sticking_s[:, None]) / bound_n
            tangent_ni = np.where((length_n > 0.0)[:, None], mean_ni / length_n[:, None], traction.tangent_ni)
        return SurfaceFriction(
            tangent_ni,
            surface.summed(weight_sa * shear_sa) / traction.weight_n,
            bound_n / traction.weight_n,
            sticking_n,
        )


@dataclass
class Slip:
    """How far stations have slipped along what they face, from the reference state on.

    Attributes:
        slip_n: (n,) sum of the slips of the steps, positive in the direction of the line.
        path_n: (n,) sum of their magnitudes.
        missed_n: (n,) in how many steps they were in contact and faced nothing, so that their slip was not seen.
    """

    slip_n: Float
    path_n: Float
    missed_n: Float

    @property
    def largest_of_n(self) -> Float:
        """(n,) magnitudes of the slips, of those that were seen all the way; not a number of others."""
        return np.where(self.missed_n == 0.0, np.abs(self.slip_n), np.nan)

    @staticmethod
    def none(n: int) -> Slip:
        """Before anything moves."""
        return Slip(np.zeros(n), np.zeros(n), np.zeros(n))

    def add(self, before: Traction, now: Traction, seen: Facing, touches_n: Bool) -> None:
        """A step: how much farther stations have come along the pieces that they face, from the places there that they
        face in the end.

        So bodies that move or turn together do not slip. Where none of a line's stations in contact faces an outline,
        they are taken to face ground at rest; others that face none are taken not to slip, and it is counted.

        Args:
            before, now: states at the beginning and at the end of the step.
            seen: what stations face at its end.
            touches_n: (n,) which are in contact; others do not slip.
        """
        faces_n, on_ground_n = _sliding(now.surface.line_n, touches_n, seen)
        along_n = _along(now.points_nx, seen) - _along(before.points_nx, seen)
        moved_n = ((now.points_nx - before.points_nx) * _unit(before.tangent_ni + now.tangent_ni)).sum(axis=1)
        slip_n = np.where(faces_n, along_n, np.where(on_ground_n, moved_n, 0.0))
        self.missed_n += touches_n & ~faces_n & ~on_ground_n
        self.slip_n += slip_n
        self.path_n += np.abs(slip_n)


def _sliding(line_n: Int, touches_n: Bool, seen: Facing) -> tuple[Bool, Bool]:
    """(n,) which stations slip along what they face, and which along ground."""
    faces = touches_n & (seen.station_n >= 0)
    on_ground = touches_n & ~np.isin(line_n, line_n[faces])
    return faces, on_ground


def _along(points_nx: Float, seen: Facing) -> Float:
    """(n,) how far stations are from what they face, against the direction of the piece there: lines that face each
    other run in opposite directions."""
    start, end = np.moveaxis(points_nx[seen.ends_ne], 1, 0)
    along: Float = ((seen.at(points_nx) - points_nx) * _unit(end - start)).sum(axis=1)
    return along


def _unit(vector_nx: Float) -> Float:
    length = np.hypot(*vector_nx.T)[:, None]
    unit: Float = vector_nx / np.where(length > 0.0, length, 1.0)
    return unit


def measure(traction: Traction, found: SurfaceFriction, slip: Slip | None, chosen: Bool) -> dict[str, float]:
    """Friction on some stations, see ``OF_FRICTION`` of :mod:`tmc_vem.problems.contact_quantities`.

    Coefficients, what sticks and the slip are left out where there is no contact, the slip also where it is not known.
    """
    mine = chosen & found.touches_n
    weight, tangent, force = traction.weight_n[mine], found.tangent_ni[mine], traction.force_ni[mine]
    shear = (force * tangent).sum(axis=1)
    pressing = float((force[:, 1] * tangent[:, 0] - force[:, 0] * tangent[:, 1]).sum())  # against the normal outwards
    x, y = (shear[:, None] * tangent).sum(axis=0).tolist()
    values = {"friction": math.hypot(x, y), "friction_x": x, "friction_y": y}
    if not pressing > 0.0:
        return values
    bound = found.bound_n[mine] * weight
    values |= {
        "apparent_coefficient": float(np.abs(shear).sum()) / pressing,
        "friction_coefficient": float(np.abs(found.shear_n[mine]) @ weight) / pressing,
        "sticking": float(found.sticking_n[mine] @ bound) / float(bound.sum()),
    }
    slips = slip.largest_of_n[mine] if slip is not None else np.empty(0)
    known = slips[np.isfinite(slips)]
    return values | {"slip_max": float(known.max())} if len(known) else values
