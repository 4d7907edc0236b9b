"""Reads friction off converged states: energies by region; shear, sticking and slip along the surface of solids.

It is read while the state of friction is still that of the step, so that the shear is the one that is in equilibrium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.curves import FrictionCurves
from tmc_vem.results.contact.facing import facing
from tmc_vem.results.contact.friction import SideFriction, Slip, SurfaceFriction, measure
from tmc_vem.results.contact.traction import Traction
from tmc_vem.results.records import FRICTION, OF, OF_REGION
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation

Float = NDArray[np.float64]
Bool = NDArray[np.bool_]
Values = Mapping[str, float]


@dataclass(frozen=True)
class RegionFriction:
    """Integrals over a region, equal on all ranks.

    Attributes:
        potential: of the step, which is part of what the discretisation calls the region's energy: the work that has
            gone into friction in the step.
        stored: by the elastic slip.
        dissipated: in the step.
        bound: largest Kirchhoff shear that there may be.
        sticking: what of it is at points that stick.
        bound_j: the bound times J.
    """

    potential: float
    stored: float
    dissipated: float
    bound: float
    sticking: float
    bound_j: float

    def reported(self, before: Values | None) -> dict[str, float]:
        """What is recorded of a step, see ``OF_REGION`` of :mod:`tmc_vem.results.records`.

        Args:
            before: what was recorded of the step before; nothing at the beginning, and None for a state beside the load
                path, of which nothing is summed up.
        """
        values = {"slip_energy": self.stored}
        if before is not None:
            values["dissipated"] = before.get("dissipated", 0.0) + self.dissipated
            values["work"] = before.get("work", 0.0) + self.potential
        if self.bound > 0.0:
            values |= {"sticking": self.sticking / self.bound, "contact_j": self.bound_j / self.bound}
        return values


class FrictionGauge:
    """Friction of the media that have it; all ranks make and read it together.

    Args:
        system: the discretisation.
        regions: names of the regions with friction.
    """

    def __init__(self, system: Discretisation, regions: Sequence[str]) -> None:
        self._system, self._regions = system, tuple(regions)
        self._slip: Slip | None = None  # on rank 0, if there is a surface
        self._before: Traction | None = None

    @property
    def is_used(self) -> bool:
        """Whether any medium has friction."""
        return bool(self._regions)

    def kinds(self) -> dict[str, str]:
        """Kinds of the columns of friction."""
        return {FRICTION + name + OF + quantity: kind for name in self._regions for quantity, kind in OF_REGION.items()}

    def of_regions(self, u: Vec) -> dict[str, RegionFriction]:
        """Integrals over the regions with friction at a state."""
        if not self.is_used:
            return {}
        sums = {name: np.zeros(6) for name in self._regions}
        for states in self._system.friction_states(u):
            w_cq, F, c, response = states.points.w_cq, states.points.F_cqij, states.slip.bound, states.response
            parts = (
                response.energy,
                response.stored,
                response.dissipated,
                c,
                c * response.sticks,
                c * np.linalg.det(F),
            )
            sums[states.points.region] += [float((w_cq * part).sum()) for part in parts]
        whole = np.sum(self._system.comm.allgather(np.array([sums[name] for name in self._regions])), axis=0)
        return {name: RegionFriction(*values) for name, values in zip(self._regions, whole.tolist(), strict=True)}

    def on_surface(self, traction: Traction | None, beside_sv: Float | None) -> SurfaceFriction | None:
        """Friction along the surface at a state with its traction, from what :meth:`of_cells` has given beside the
        sides of the surface; on rank 0, None elsewhere."""
        if beside_sv is None or traction is None:
            return None
        stress, bound, sticking = beside_sv[:, :4].reshape(-1, 2, 2), beside_sv[:, 4], beside_sv[:, 5]
        return SurfaceFriction.of(traction, SideFriction(stress, bound, sticking))

    def slide(self, traction: Traction | None, found: SurfaceFriction | None) -> None:
        """A step has converged to a state with its traction: its slip is added."""
        if traction is None or found is None:
            return
        self._slip = self._slip or Slip.none(len(traction.surface))
        before = self._before or Traction(traction.surface, traction.surface.points_nx, traction.force_ni)
        self._slip.add(before, traction, facing(traction), found.touches_n)
        self._before = traction

    def go_on(self, traction: Traction | None, slip: Sequence[Sequence[float]]) -> None:
        """Go on from a state with its traction, and the slip (3, n) there as :meth:`plain_slip` has given it."""
        if traction is not None and slip:
            self._slip, self._before = Slip(*np.array(slip)), traction

    def curves(self, found: SurfaceFriction | None) -> FrictionCurves | None:
        """What is written of the surface; on rank 0, None elsewhere or without any."""
        return None if found is None or self._slip is None else FrictionCurves.of(found, self._slip)

    def measured(
        self, traction: Traction, found: SurfaceFriction, chosen: Bool, *, along_path: bool
    ) -> dict[str, float]:
        """What is reported of some stations; beside the load path without their slip, which is that of the path."""
        return measure(traction, found, self._slip if along_path else None, chosen)

    def plain_slip(self) -> list[list[float]]:
        """The slip (3, n), its path and what was missed of it as plain values for a checkpoint; nothing at first."""
        return [] if self._slip is None else [values.tolist() for values in astuple(self._slip)]

    def of_cells(self, u: Vec) -> Float:
        """(n_cells, 6) means over the deformed areas of this rank's cells: the Cauchy stress of friction, its bound,
        and what of that is at points that stick; 0 where there is no friction."""
        found = np.zeros((len(self._system.cell_numbers()), 6))
        for states in self._system.friction_states(u):
            w_cq, F, slip, response = states.points.w_cq, states.points.F_cqij, states.slip, states.response
            kirchhoff = response.tau[..., None, None] * (slip.A_ij @ np.swapaxes(F, -1, -2))
            each_cqv = np.concatenate(
                [kirchhoff.reshape(*w_cq.shape, 4), np.stack([slip.bound, slip.bound * response.sticks], axis=-1)],
                axis=-1,
            )
            area_c = (w_cq * np.linalg.det(F)).sum(axis=1)
            found[states.points.cells] = (w_cq[..., None] * each_cqv).sum(axis=1) / area_c[:, None]
        return found
