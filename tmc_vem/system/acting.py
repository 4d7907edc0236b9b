"""Forces on a discretisation: each as the work that it does at amplitude 1, from named points, sides and regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.enclosed import against_cells, around_cavity
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.pressure import end_terms, swept
from tmc_vem.system.sides import AllSides, Sides
from tmc_vem.system.work_form import WorkForm, WorkTerms

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Load factors at which a displacement that is prescribed and never moves is 0; what moves is not 0 at all of them, even
# if it moves late or for a while.
ON_THE_WAY = (*np.linspace(0.05, 10.0, 200).tolist(), *np.geomspace(10.1, 1000.0, 40).tolist())


@dataclass(frozen=True)
class Acting:
    """A force on a discretisation.

    Attributes:
        force: what it is.
        work: what it does at amplitude 1, from the reference state on; a pressure at pressure 1.
        factor: what the work is multiplied with, besides the amplitude: the pressure, 1 for other forces.
        area: that of a cavity in the reference state, 0 for other forces.
    """

    force: Force
    work: WorkForm
    factor: float = 1.0
    area: float = 0.0

    @property
    def is_spring(self) -> bool:
        """Whether what it does is stored."""
        return isinstance(self.force, Spring)


class Act:
    """Makes forces act on a discretisation; all ranks do it together, in the same order.

    Args:
        system: the discretisation.
        media: names of regions that are third medium.
    """

    def __init__(self, system: Discretisation, media: Sequence[str] = ()) -> None:
        self._system, self._media = system, media
        self.turned = system.turned()
        self._own = len(system.create_vector().getArray(readonly=True))
        sizes = system.comm.allgather(self._own)
        self._first = sum(sizes[: system.comm.rank])  # degree of freedom of this rank

    def on(self, force: Force) -> Acting:
        """The force on the discretisation.

        Raises:
            InputError: what it acts on is not there, or is no cavity or chain that has a potential.
        """
        if isinstance(force, PointForce):
            return Acting(force, self._at_points(force))
        if isinstance(force, Traction):
            return Acting(force, self._along_edges(force))
        if isinstance(force, BodyForce):
            return Acting(force, self._in_regions(force))
        if isinstance(force, Spring):
            return Acting(force, self._of_springs(force))
        if isinstance(force, CavityPressure):
            return self._in_cavity(force)
        return self._following(force)

    def axes(self) -> Float:
        """Axes (n_owned_nodes, 2, 2) of the nodes of this rank's part of a vector."""
        first, last = (DISPLACEMENT.n_nodes(bound) for bound in (self._first, self._first + self._own))
        return self.turned.of(np.arange(first, last))

    def constrained(self) -> Int:
        """Constrained degrees of freedom of all ranks."""
        return self._everywhere(self._system.constrained())

    # -- kinds -----------------------------------------------------------------------------------------------------

    def _at_points(self, force: PointForce) -> WorkForm:
        if self._edges(force) is not None:
            raise InputError(
                f"{force.name}: '{force.where}' are edges, and a point force acts at points: use a traction"
            )
        dofs = DISPLACEMENT.dofs(self._nodes(force))
        return self._form([WorkTerms(dofs, np.broadcast_to(np.array(force.force), dofs.shape))])

    def _along_edges(self, force: Traction) -> WorkForm:
        sides = self._once(force)
        linear = np.einsum("s,a,i->sai", sides.length_s, sides.trace.mean_a, np.array(force.traction))
        dofs = sides.dofs_sm
        return self._form([WorkTerms(dofs, linear.reshape(dofs.shape))])

    def _in_regions(self, force: BodyForce) -> WorkForm:
        try:
            weight_n = self._system.area_weights(force.regions)
        except InputError as error:
            raise InputError(f"{force.name}: {error}") from None
        dofs = self._first + DISPLACEMENT.dofs(np.arange(len(weight_n)))
        return self._form([WorkTerms(dofs, np.outer(weight_n, force.force))])

    def _of_springs(self, force: Spring) -> WorkForm:
        stiffness = np.diag(force.stiffness)
        if self._edges(force) is None:
            dofs = DISPLACEMENT.dofs(self._nodes(force))
            hessian = np.broadcast_to(-stiffness, (len(dofs), 2, 2))
            return self._form([WorkTerms(dofs, np.zeros(dofs.shape), hessian)])
        sides = self._once(force)
        dofs = sides.dofs_sm
        hessian = -np.einsum("s,ab,ij->saibj", sides.length_s, sides.trace.mass_ab, stiffness)
        return self._form([WorkTerms(dofs, np.zeros(dofs.shape), hessian.reshape(*dofs.shape, dofs.shape[1]))])

    def _in_cavity(self, force: CavityPressure) -> Acting:
        sides, every = self._sides(force)
        turns = around_cavity(force.name, force.where, every)[every.mine]
        terms, area = swept(sides.take(turns != 0), turns[turns != 0], every.origin)
        return Acting(force, self._form([terms]), force.pressure, sum(self._system.comm.allgather(area)))

    def _following(self, force: FollowerPressure) -> Acting:
        sides, every = self._sides(force)
        chosen = against_cells(force.name, force.where, every, self._media)
        sides = sides.take(chosen[every.mine])
        terms, _ = swept(sides, np.full(len(sides), -1), every.origin)
        ends = every.ends_se[chosen], every.nodes_se[chosen], every.corners_sex[chosen]
        at_ends = list(end_terms(force.name, force.where, *ends, self._fixed(), self.turned, every.origin))
        return Acting(force, self._form([terms, *(at_ends if self._system.comm.rank == 0 else [])]), force.pressure)

    # -- parts -----------------------------------------------------------------------------------------------------

    def _form(self, terms: Sequence[WorkTerms]) -> WorkForm:
        terms = [each.along(self.turned) for each in terms]
        return WorkForm(self._system.comm, self._system.create_vector(), terms)

    def _nodes(self, force: PointForce | Spring) -> Int:
        """Nodes of named points that this rank owns, numbered over all ranks."""
        try:
            return DISPLACEMENT.n_nodes(self._first) + self._system.owned_nodes(force.where)
        except InputError as error:
            raise InputError(f"{force.name}: {error}") from None

    def _edges(self, force: Force) -> tuple[Sides, AllSides] | None:
        """Sides along the edges of the name that a force acts on; None if the mesh has no edges of that name."""
        assert not isinstance(force, BodyForce)
        sides = self._system.sides(force.where)
        every = AllSides.gather(self._system.comm, sides)
        return (sides, every) if len(every) else None

    def _sides(self, force: Force) -> tuple[Sides, AllSides]:
        found = self._edges(force)
        if found is None:
            assert not isinstance(force, BodyForce)
            raise InputError(f"{force.name}: the mesh has no edges named '{force.where}'")
        return found

    def _once(self, force: Traction | Spring) -> Sides:
        """Sides of this rank that together with those of the others are every edge once."""
        sides, every = self._sides(force)
        return sides.take(every.first_s[every.mine])

    def _fixed(self) -> Int:
        """Degrees of freedom of all ranks that supports hold at 0, wherever on the path."""
        system = self._system
        values = [system.prescribed(Control(load)) for load in ON_THE_WAY]
        still = ~np.any(values, axis=0)
        return self._everywhere(system.constrained()[still])

    def _everywhere(self, dofs: NDArray[np.int32]) -> Int:
        """Degrees of freedom of this rank's part and those of the others, numbered over all ranks."""
        return np.concatenate(self._system.comm.allgather(dofs.astype(np.int64) + self._first))
