"""Tractions on the surface of the solids: what the medium does to them, node by node.

The force of a node divided by the length that it stands for is the nominal traction. Divided by the deformed length it
is the true one, which has a pressure, positive in compression, and a shear along the line. In the plane the length is
stretched by ``|cof F N|``, which is ``|F T|``: the surface itself says what it is. So sums over nodes are the integrals
of these curves, exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.surface import Surface

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Traction:
    """What acts on the surface in a state; all arrays are by station ``n`` of the surface.

    Attributes:
        surface: the stations.
        points_nx: (n, 2) where they are in the deformed state (length).
        force_ni: (n, 2) force of the medium on the solid (force per thickness).
    """

    surface: Surface
    points_nx: Float
    force_ni: Float

    @property
    def nominal_ni(self) -> Float:
        """(n, 2) traction per reference area."""
        nominal: Float = self.force_ni / self.surface.weight_n[:, None]
        return nominal

    @cached_property
    def tangents_sai(self) -> Float:
        """(n_sides, k + 1, 2) derivatives of the deformed sides by their reference length, at their nodes."""
        return self.surface.tangents(self.points_nx)

    @cached_property
    def weight_n(self) -> Float:
        """(n,) deformed length that each station stands for."""
        surface = self.surface
        stretch_sa = np.hypot(*np.moveaxis(self.tangents_sai, -1, 0))
        return surface.summed(surface.length_s[:, None] * surface.trace.mean_a * stretch_sa)

    @property
    def stretch_n(self) -> Float:
        """(n,) stretch of the surface, ``|cof F N|``."""
        stretch: Float = self.weight_n / self.surface.weight_n
        return stretch

    @cached_property
    def tangent_ni(self) -> Float:
        """(n, 2) unit vectors along the deformed lines; at a corner the mean of both sides."""
        surface = self.surface
        weight_sa = surface.length_s[:, None] * surface.trace.mean_a
        mean = np.column_stack([surface.summed(weight_sa * self.tangents_sai[..., i]) for i in (0, 1)])
        length = np.hypot(*mean.T)
        unit: Float = mean / np.where(length > 0.0, length, 1.0)[:, None]
        return unit

    @property
    def normal_ni(self) -> Float:
        """(n, 2) unit normals of the deformed solids, into the medium."""
        return np.column_stack([self.tangent_ni[:, 1], -self.tangent_ni[:, 0]])

    @property
    def true_ni(self) -> Float:
        """(n, 2) traction per deformed area."""
        true: Float = self.force_ni / self.weight_n[:, None]
        return true

    @cached_property
    def pressure_n(self) -> Float:
        """(n,) true pressure, positive in compression."""
        pressure: Float = -(self.true_ni * self.normal_ni).sum(axis=1)
        return pressure

    @cached_property
    def shear_n(self) -> Float:
        """(n,) true shear along the line."""
        shear: Float = (self.true_ni * self.tangent_ni).sum(axis=1)
        return shear

    def arc_length_n(self, *, deformed: bool = False) -> Float:
        """(n,) length along each line from its first station, in the reference or in the deformed state."""
        return self.surface.arc_length(self.points_nx if deformed else self.surface.points_nx)

    def resultant(self, chosen: NDArray[np.bool_]) -> dict[str, float]:
        """Force of some stations, and its moment about the origin in the deformed state."""
        (x, y), (fx, fy) = self.points_nx[chosen].T, self.force_ni[chosen].T
        force = float(fx.sum()), float(fy.sum())
        return {
            "force": math.hypot(*force),
            "force_x": force[0],
            "force_y": force[1],
            "moment": float(x @ fy - y @ fx),
        }
