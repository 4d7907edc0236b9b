"""Reads contact off converged states: what the medium does to the solids, node by node of their surface.

At a node of the surface the solid's cells resist with what acts on them: forces and springs on the node, what holds it
where it is supported, and the medium. So the medium's force is what the cells of the solids alone resist with, less all
that is known to act there; whatever the medium is made of, its regulariser and the sides between its cells are in it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from tmc_vem.problems.contact_quantities import pair_name, quantities_of
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact.facing import facing
from tmc_vem.results.contact.friction import SurfaceFriction
from tmc_vem.results.contact.pairs import measure, pairs_of
from tmc_vem.results.contact.solids import same_points
from tmc_vem.results.contact.surface import Surface
from tmc_vem.results.contact.traction import Traction
from tmc_vem.results.output import polygons_of
from tmc_vem.results.records import CONTACT, OF
from tmc_vem.simulation.friction_gauge import FrictionGauge
from tmc_vem.simulation.medium_pressure import MediumPressure
from tmc_vem.support.distributed import Vec
from tmc_vem.support.parallel import from_root, on_root
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fields import Polygons
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
Contact = dict[str, dict[str, float]]


class ContactGauge:
    """The surface of the solids on rank 0, and which of its nodes each rank has; all ranks make and read it together.

    Args:
        system: the discretisation.
        media: energies of the regions that are third medium, by their names.
        order: polynomial degree along the sides.
        frictional: names of the media with friction.

    Attributes:
        nodes: (n,) nodes on the surface, as positions in this rank's part of a vector.
        chosen_c: (n_cells,) cells of solids of this rank that have such nodes.
        is_used: whether any solid is in medium.
        friction: what friction does there.
    """

    def __init__(
        self, system: Discretisation, media: Mapping[str, Integrand], order: int, frictional: Sequence[str] = ()
    ) -> None:
        self._system, self._medium = system, MediumPressure(system, media)
        self.friction = FrictionGauge(system, frictional)
        comm = system.comm
        labels = system.node_labels()
        on_cells = np.flatnonzero(labels[:, 2] == 0.0)  # the others are moments
        parts = comm.gather((polygons_of(system, tuple(media)), system.cell_numbers(), labels[on_cells, :2]))
        self._surface: Surface | None = None
        nodes, cells, self._medium_cells = comm.scatter(on_root(comm, lambda: self._find(parts or (), order)) or ())
        self.nodes = on_cells[nodes]
        self.chosen_c = np.zeros(len(system.cell_numbers()), dtype=np.bool_)
        self.chosen_c[cells] = True
        first = sum(comm.allgather(len(labels))[: comm.rank])
        self._axes_nij = system.turned().of(first + self.nodes)
        self.is_used: bool = from_root(comm, lambda: self._surface is not None)

    def traction(self, u: Vec, residual: Vec) -> Traction | None:
        """What acts on the surface at a state with its residual; on rank 0, None on others and without a surface."""
        if not self.is_used:
            return None
        system, nodes = self._system, self.nodes
        resisted = system.internal_forces(u, self.chosen_c)[nodes] - system.external_forces(u)[nodes]
        u_ni = DISPLACEMENT.nodal(u.getArray(readonly=True))[nodes]
        held_ni = DISPLACEMENT.nodal(system.holding_forces(residual))[nodes]
        u_ni, held_ni = (np.einsum("nij,nj->ni", self._axes_nij, values) for values in (u_ni, held_ni))
        parts = system.comm.gather((u_ni, resisted - held_ni))
        if parts is None or self._surface is None:
            return None
        surface = self._surface
        u_ni, force_ni = (np.concatenate(values)[self._station] for values in zip(*parts, strict=True))
        return Traction(surface, surface.points_nx + u_ni, surface.share_n[:, None] * force_ni)

    def read(self, u: Vec, residual: Vec, *, along_path: bool = True) -> Contact:
        """What is reported of a converged state, by name of body and of pair, equal on all ranks; see
        :func:`tmc_vem.results.contact.pairs.measure`.

        Args:
            u, residual: the state.
            along_path: it is the next load step, whose slip is added.
        """
        traction = self.traction(u, residual)
        found = self._friction_at(u, traction)
        if along_path and self.friction.is_used:
            self.friction.slide(traction, found)

        def make() -> Contact:
            if traction is None:
                return {}
            if found is None:
                return measure(traction)
            return measure(traction, functools.partial(self.friction.measured, traction, found, along_path=along_path))

        return from_root(self._system.comm, make)

    def names(self) -> tuple[str, ...]:
        """Names of the bodies with a surface, equal on all ranks."""
        return from_root(self._system.comm, lambda: self._surface.bodies if self._surface is not None else ())

    def shares(self, of: str, u: Vec, residual: Vec) -> Float | None:
        """(n,) part of the medium's force on each of :attr:`nodes` that is that on a body, or on the first one of a
        pair that face each other in a state; None if there is no such body, and no such pair in the state. All ranks
        call this.

        Args:
            of: name of the body, or of the pair.
            u, residual: the state.
        """
        traction = None if of in self.names() else self.traction(u, residual)
        counts = self._system.comm.gather(len(self.nodes))

        def make() -> list[Float] | None:
            if counts is None or self._surface is None:
                return None
            chosen = self._stations_of(of, traction)
            if chosen is None:
                return None
            surface = self._surface
            share_n = np.bincount(self._station, surface.share_n * chosen, int(np.sum(counts))).astype(np.float64)
            return np.split(share_n, np.cumsum(counts)[:-1])

        parts = on_root(self._system.comm, make)
        if from_root(self._system.comm, lambda: parts is None):
            return None
        found: Float = self._system.comm.scatter(parts or ())
        return found

    def _stations_of(self, of: str, traction: Traction | None) -> Bool | None:
        """(n_stations,) which stations a body has, or the first one of a pair in a state."""
        assert self._surface is not None
        surface = self._surface
        if of in surface.bodies:
            chosen: Bool = surface.body_n == surface.bodies.index(of)
            return chosen
        for pair in pairs_of(traction, facing(traction)) if traction is not None else ():
            if pair_name(surface.bodies, pair.bodies, surface.joint) == of:
                return pair.first_n
        return None

    def go_on(self, u: Vec, slip: Sequence[Sequence[float]]) -> None:
        """Go on from a state, and the slip there as :meth:`FrictionGauge.plain_slip` has given it."""
        if self.friction.is_used:
            self.friction.go_on(self.traction(u, self._system.create_vector()), slip)

    def _friction_at(self, u: Vec, traction: Traction | None) -> SurfaceFriction | None:
        """Friction along the surface; on rank 0, None elsewhere or without any."""
        if not (self.is_used and self.friction.is_used):
            return None
        return self.friction.on_surface(traction, self._beside(self.friction.of_cells(u)))

    def _beside(self, values_c: Float) -> Float | None:
        """Values (n_sides, ...) beside the sides of the surface, of those (n_cells, ...) of this rank's media; on rank
        0, None elsewhere or without a surface. All ranks call this."""
        parts = self._system.comm.gather(values_c[self._medium_cells])
        if parts is None or self._surface is None:
            return None
        found: Float = np.concatenate(parts)[np.unique(self._surface.medium_s, return_inverse=True)[1]]
        return found

    def curves(self, u: Vec, residual: Vec) -> ContactCurves | None:
        """Everything along the surface at the last load step with its residual; on rank 0, None elsewhere or without
        one."""
        traction = self.traction(u, residual)
        if not self.is_used:
            return None
        of_side = self._beside(self._medium.of_cells(u))
        friction = self._friction_at(u, traction)

        def make() -> ContactCurves | None:
            if traction is None or of_side is None:
                return None
            surface = traction.surface
            weight_sa = surface.length_s[:, None] * surface.trace.mean_a
            pressure = surface.summed(weight_sa * of_side[:, None]) / surface.weight_n
            return ContactCurves.of(traction, pressure, self.friction.curves(friction))

        return on_root(self._system.comm, make)

    @staticmethod
    def kinds(contact: Mapping[str, Mapping[str, float]]) -> dict[str, str]:
        """Kinds of the columns of contact."""
        return {
            CONTACT + name + OF + quantity: kind
            for name, values in contact.items()
            for quantity, kind in quantities_of(values).items()
        }

    def _find(self, parts: Sequence[tuple[Polygons, Int, Float]], order: int) -> list[tuple[Int, Int, Int]]:
        """Nodes that each rank owns, and cells of solids and of media that it has, at the surface; to rank 0, which
        stations they are.

        Args:
            parts: of every rank its cells, their numbers in the mesh, and the places (n, 2) of its own nodes.
            order: polynomial degree along the sides.
        """
        polygons = Polygons.merge([part for part, _, _ in parts])
        points = [places for _, _, places in parts]
        surface = Surface.of(polygons, np.concatenate([numbers for _, numbers, _ in parts]), order)
        if not len(surface):
            none = np.empty(0, dtype=np.int64)
            return [(none, none, none) for _ in parts]
        self._surface, n = surface, len(surface)
        places = same_points(np.concatenate([surface.points_nx, polygons.points_nx, *points]))
        of_station, of_point, of_node = np.split(places, [n, n + len(polygons.points_nx)])
        at_surface = np.isin(of_point, of_station)[polygons.connectivity]
        touches = np.logical_or.reduceat(at_surface, polygons.offsets[:-1]) & polygons.is_solid_c
        owned = np.isin(of_node, of_station)
        kept = np.flatnonzero(owned)
        order_of = np.argsort(of_node[kept], kind="stable")
        self._station = order_of[np.searchsorted(of_node[kept], of_station, sorter=order_of)]
        nodes = np.split(owned, np.cumsum([len(part) for part in points])[:-1])
        beside = np.isin(np.arange(polygons.n_cells), surface.medium_s)
        ends = np.cumsum([part.n_cells for part, _, _ in parts])[:-1]
        here = zip(nodes, np.split(touches, ends), np.split(beside, ends), strict=True)
        return [(np.flatnonzero(a), np.flatnonzero(b), np.flatnonzero(c)) for a, b, c in here]
