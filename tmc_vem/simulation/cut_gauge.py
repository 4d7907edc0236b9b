"""Reads energies of regions and forces through cuts off states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem, media_of
from tmc_vem.problems.field_probes import CutForce, EnergyOf, said_line
from tmc_vem.simulation.reading import Reader, State, along_x_and_y
from tmc_vem.support.errors import InputError
from tmc_vem.system.cut import cut_points
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.friction_energy import stored_in_regions
from tmc_vem.system.places import Places

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

SAME = 1e-9  # of the mesh's size: points nearer than that are one


def make_energy_reader(probes: Mapping[str, EnergyOf], problem: Problem, system: Discretisation) -> Reader:
    """What reads energies of regions: those of the history's columns, sides between cells included,
    friction not."""

    def read(state: State) -> dict[str, float]:
        energies = stored_in_regions(system, state.u, system.energy(state.u))
        return {name: energies[probe.region] for name, probe in probes.items()}

    return read


class Cut:
    """A cut through the cells of all ranks; they make and read it together.

    Args:
        probe: any probe of the cut.
        problem: whose probe.
        system: its discretisation.

    Raises:
        InputError: it cuts nothing.

    Attributes:
        left_c: (n_cells,) cells of this rank on the left, of those that are cut.
        nodes: (n,) nodes on the cut, as positions in this rank's part of a vector.
        points_nx: (n, 2) where they are in the reference configuration.
        middle: (2,) middle of the line.
    """

    def __init__(self, probe: CutForce, problem: Problem, system: Discretisation) -> None:
        self._system = system
        polygons, media = system.output_polygons(), media_of(problem)
        region_c = np.array(polygons.region_names)[polygons.region_c]
        chosen_c = region_c == probe.region if probe.region else ~np.isin(region_c, media)
        points = polygons.points_nx
        self.left_c, both, _ = cut_points(points, polygons.offsets, polygons.connectivity, chosen_c, probe.line)
        sides = [
            np.unique(polygons.connectivity[np.repeat(members, np.diff(polygons.offsets))])
            for members in (self.left_c, chosen_c & ~self.left_c)
        ]
        near = [points[some[self._is_near(points[some], probe)]] for some in sides]
        parts = system.comm.allgather((points[both], *near))
        together = [np.concatenate([part[n] for part in parts]) for n in range(3)]
        places_nx = np.concatenate([together[0], _common(together[1], together[2], SAME * system.size)])
        if not len(places_nx):
            raise InputError(f"the cut from {said_line(probe.line)} goes through no inner side")
        labels = system.node_labels()
        here = np.flatnonzero(labels[:, 2] == 0.0)
        self.nodes: Int = here[_near(labels[here, :2], places_nx, SAME * system.size)]
        self.points_nx = labels[self.nodes, :2]
        self.middle = np.array(probe.middle)
        self._place: Places | None = None

    def _is_near(self, points_nx: Float, probe: CutForce) -> Bool:
        """Whether points may be on the cut: of one rank, all that are between its ends."""
        start, end = (np.array(point) for point in probe.line)
        along = end - start
        t = (points_nx - start) @ along / (along @ along)
        between: Bool = (t >= -1e-6) & (t <= 1.0 + 1e-6)
        return between if self._system.comm.size > 1 else np.zeros(len(points_nx), dtype=bool)

    def read(self, state: State, *, moment: bool) -> Float:
        """Force (2,) on the left of the cut and, if it is wanted, its moment about the middle."""
        system = self._system
        force_ni = system.internal_forces(state.u, self.left_c)[self.nodes]
        total = [*force_ni.sum(axis=0), 0.0]
        if moment:
            self._place = self._place or Places(system, self.middle[None])
            about = self.middle + self._place.displacements(state.u)[0]
            moved_ni = along_x_and_y(system, state.u)[self.nodes]
            x, y = (self.points_nx + moved_ni - about).T
            total[2] = float(x @ force_ni[:, 1] - y @ force_ni[:, 0])
        found: Float = np.sum(system.comm.allgather(np.array(total)), axis=0)
        return found


def make_cut_reader(probes: Mapping[str, CutForce], problem: Problem, system: Discretisation) -> Reader:
    """What reads forces through cuts; probes of one cut share what is found there."""
    cuts: dict[tuple[object, ...], Cut] = {}
    for name, probe in probes.items():
        if (probe.line, probe.region) not in cuts:
            try:
                cuts[probe.line, probe.region] = Cut(probe, problem, system)
            except InputError as error:
                raise InputError(f"probes: {name}: {error}") from None

    def read(state: State) -> dict[str, float]:
        moment = any(probe.component == "moment" for probe in probes.values())
        forces = {key: cut.read(state, moment=moment) for key, cut in cuts.items()}
        return {name: _component(probe, forces[probe.line, probe.region]) for name, probe in probes.items()}

    return read


def _component(probe: CutForce, force: Float) -> float:
    return float(force[2] if probe.component == "moment" else force[:2] @ direction_of(probe))


def direction_of(probe: CutForce) -> Float:
    """(2,) unit vector along which the force through a cut is taken; no moment has one."""
    (x0, y0), (x1, y1) = probe.line
    along = np.array([x1 - x0, y1 - y0]) / np.hypot(x1 - x0, y1 - y0)
    out = np.array([along[1], -along[0]])  # of the left part
    directions: dict[str, Float] = {"x": np.eye(2)[0], "y": np.eye(2)[1], "normal": out, "shear": along}
    return directions[probe.component]


def _near(points_nx: Float, places_nx: Float, tolerance: float) -> Int:
    """Which points are at one of some places."""
    from scipy.spatial import cKDTree

    if not len(points_nx) or not len(places_nx):
        return np.empty(0, dtype=np.int64)
    distance, _ = cKDTree(places_nx).query(points_nx, distance_upper_bound=tolerance)
    found: Int = np.flatnonzero(np.isfinite(distance))
    return found


def _common(first_nx: Float, second_nx: Float, tolerance: float) -> Float:
    """Points that are in both sets."""
    return first_nx[_near(first_nx, second_nx, tolerance)]
