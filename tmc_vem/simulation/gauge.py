"""Reads the probes of a problem off converged states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.problems.contact_probe import Contact
from tmc_vem.problems.field_probes import CutForce, EnergyOf, FieldProbe
from tmc_vem.problems.probes import AXES, Displacement, Gap, MeanJ, Place, Position, Reaction, check_probes
from tmc_vem.simulation.contact_probe import contact_reader
from tmc_vem.simulation.cut_gauge import make_cut_reader, make_energy_reader
from tmc_vem.simulation.field_gauge import make_field_reader
from tmc_vem.simulation.reading import Behind, MakeReader, Reader, State
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import COMPONENTS
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.places import Places

Float = NDArray[np.float64]
# How the probes of a kind are read, by their class; what a mapping makes is asked once for each state.
READERS: Mapping[type, MakeReader] = {
    FieldProbe: make_field_reader,
    EnergyOf: make_energy_reader,
    CutForce: make_cut_reader,
    Contact: contact_reader,
}


class Gauge:
    """The probes of a problem on its discretisation; all ranks make and read it together.

    Args:
        problem: whose probes.
        system: its discretisation.

    Raises:
        InputError: a probe has a reserved name, or refers to a point, place or region that is not there.
    """

    def __init__(self, problem: Problem, system: Discretisation) -> None:
        self.probes = dict(problem.probes())
        check_probes(self.probes, problem.prescribed(), tuple(problem.regions()))
        self._system = system
        where = {place: name for name, probe in reversed(self.probes.items()) for place in probe.places}
        self._named = [place for place in where if isinstance(place, str)]
        self._points = [place for place in where if not isinstance(place, str)]
        self._reference: dict[Place, Float] = {place: np.array(place) for place in self._points}
        for name in self._named:
            try:
                self._reference[name] = system.point_coordinates((name,))[0]
            except InputError as error:
                raise InputError(f"probes: {where[name]}: {error}") from None
        labels = [f"probes: {where[place]}: point" for place in self._points]
        self._places = Places(system, np.array(self._points), labels) if self._points else None
        self._region_c, self._area_c = None, None
        if any(isinstance(probe, MeanJ) for probe in self.probes.values()):
            polygons = system.output_polygons()
            self._region_c = np.array(polygons.region_names)[polygons.region_c]
            self._area_c = system.cell_areas()
        self._readers: list[Reader] = []
        for kind, make in READERS.items():
            some = {name: probe for name, probe in self.probes.items() if isinstance(probe, kind)}
            if some:
                self._readers.append(make(some, problem, system))

    def read(
        self,
        u: Vec,
        residual: Vec,
        behind: Behind | None = None,
        contact: Mapping[str, Mapping[str, float]] | None = None,
    ) -> dict[str, float]:
        """Values of the probes at a state with its residual, equal on all ranks.

        Args:
            u: displacements.
            residual: full gradient of the potential at ``u``.
            behind: tells whether the second of two points is behind the surface of the first, where surfaces cross.
            contact: what is reported of contact, by name of body or pair.
        """
        moved: dict[Place, Float] = {}
        if self._named:
            moved |= dict(zip(self._named, self._system.point_displacements(u, self._named), strict=True))
        if self._places is not None:
            moved |= dict(zip(self._points, self._places.displacements(u), strict=True))
        means = self._means(u)
        readers: dict[type, Callable[[Any], float]] = {
            Displacement: lambda p: moved[p.at][COMPONENTS[p.component]],
            Position: lambda p: (self._reference[p.at] + moved[p.at])[AXES[p.axis]],
            Gap: lambda p: self._gap(p, moved, behind),
            Reaction: lambda p: self._system.reaction(residual, p.at, COMPONENTS[p.component]),
            MeanJ: lambda p: means[p.region],
        }
        state = State(u, residual, behind, contact or {})
        found = {name: value for reader in self._readers for name, value in reader(state).items()}
        return {
            name: float(found[name] if name in found else readers[type(probe)](probe))
            for name, probe in self.probes.items()
        }

    def _gap(self, probe: Gap, moved: Mapping[Place, Float], behind: Behind | None) -> float:
        origins = [self._reference[place] for place in probe.places]
        places = [origin + moved[place] for origin, place in zip(origins, probe.places, strict=True)]
        distance = float(np.hypot(*(places[0] - places[1])))
        return -distance if behind and behind(origins, places) else distance

    def _means(self, u: Vec) -> dict[str, float]:
        """Mean of J by region, for the regions that are asked for."""
        if self._region_c is None or self._area_c is None:
            return {}
        mean_c, _ = self._system.cell_jacobians(u)
        asked = [probe.region for probe in self.probes.values() if isinstance(probe, MeanJ)]
        members = [self._region_c == region for region in asked]
        mine = np.array([(self._area_c[c] @ mean_c[c], self._area_c[c].sum()) for c in members])
        sums = np.sum(self._system.comm.allgather(mine), axis=0)
        return dict(zip(asked, (sums[:, 0] / sums[:, 1]).tolist(), strict=True))
