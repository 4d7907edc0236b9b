"""Vectors of a discretisation from values along x and y: at the nodes of a rank, and at any points."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.probes import Place
from tmc_vem.support.distributed import Vec
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.places import Places

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SAME = 1e-9  # of the mesh's size: points nearer than that are one


class Nodes:
    """The nodes of a discretisation; all ranks make and use it together.

    Args:
        system: the discretisation.

    Attributes:
        system: the discretisation.
        n_owned: nodes of this rank's part of a vector.
    """

    def __init__(self, system: Discretisation) -> None:
        self.system = system
        size = len(system.create_vector().getArray(readonly=True))
        self.n_owned = DISPLACEMENT.n_nodes(size)
        self._first = sum(system.comm.allgather(self.n_owned)[: system.comm.rank])
        self._turned = system.turned()
        self._axes_nij = self._turned.of(self._first + np.arange(self.n_owned))

    @cached_property
    def points_nx(self) -> Float:
        """(n_owned, 2) places of the nodes in the reference configuration; of moments, those of their cells."""
        return self.system.node_labels()[:, :2]

    def along(self, vector: Vec) -> Float:
        """(n_owned, 2) components along x and y of this rank's part of a vector."""
        along_ni: Float = np.einsum("nij,nj->ni", self._axes_nij, DISPLACEMENT.nodal(vector.getArray(readonly=True)))
        return along_ni

    def vector(self, values_ni: Float | None = None) -> Vec:
        """A vector of the system with components (n_owned, 2) along x and y at this rank's nodes; zero without."""
        vector = self.system.create_vector()
        if values_ni is not None:
            DISPLACEMENT.nodal(vector.getArray())[:] = np.einsum("nji,nj->ni", self._axes_nij, values_ni)
        return vector

    def only_constrained(self, vector: Vec) -> Vec:
        """The same vector, with zeros at degrees of freedom that nothing holds."""
        array, held = vector.getArray(), self.system.constrained()
        kept = array[held].copy()
        array[:] = 0.0
        array[held] = kept
        return vector

    def at_named(self, name: str) -> Float:
        """(n_owned,) weights of the displacements of this rank's nodes in that of a named point.

        Raises:
            InputError: there is no point of that name.
        """
        point = self.system.point_coordinates((name,))[0]
        weight_n = np.zeros(self.n_owned)
        nodes = self.system.owned_nodes(name)  # with those of edges and groups of the same name
        labels = self.system.node_labels()[nodes]
        here = nodes[(labels[:, 2] == 0.0) & (np.hypot(*(labels[:, :2] - point).T) <= SAME * self.system.size)]
        weight_n[here] = 1.0
        total = sum(self.system.comm.allgather(len(here)))
        return weight_n / total

    def from_points(self, places: Places, force_ni: Float) -> Vec:
        """A vector of the system whose product with u is that of forces (n, 2) with the displacements of points; the
        forces are the same on all ranks."""
        spread_ni = places.spread(force_ni)
        nodes = np.flatnonzero(spread_ni.any(axis=1))
        numbers = self._number_n[nodes]
        values_ni = np.einsum("nji,nj->ni", self._turned.of(numbers), spread_ni[nodes])
        vector = self.system.create_vector()
        dofs = DISPLACEMENT.dofs(numbers).astype(PETSc.IntType)
        vector.setValues(dofs.ravel(), values_ni.ravel(), addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return vector

    @cached_property
    def _number_n(self) -> Int:
        """(n_nodes,) numbers over all ranks of this rank's nodes, ghosts included: a displacement says them."""
        own = (self._first + np.arange(self.n_owned)).astype(np.float64)
        numbers = self.system.nodal_values(self.vector(np.column_stack([own, np.zeros(self.n_owned)])))
        found: Int = np.rint(numbers[:, 0]).astype(np.int64)
        return found


class Point:
    """A point whose displacement is a function of u; all ranks make and use it together.

    Args:
        nodes: of the discretisation.
        place: the name of a point, or coordinates.

    Raises:
        InputError: there is no such point, or it lies outside of the mesh.

    Attributes:
        reference: (2,) where it is in the reference configuration.
    """

    def __init__(self, nodes: Nodes, place: Place) -> None:
        self._nodes = nodes
        self._weight_n: Float | None = None
        if isinstance(place, str):
            self._name = place
            self.reference: Float = nodes.system.point_coordinates((place,))[0]
            self._weight_n = nodes.at_named(place)
        else:
            self.reference = np.array(place, dtype=np.float64)
            self._places = Places(nodes.system, self.reference[None], ["point"])

    def displacement(self, u: Vec) -> Float:
        """(2,) its displacement, equal on all ranks."""
        moved: Float
        if self._weight_n is not None:
            moved = self._nodes.system.point_displacements(u, (self._name,))[0]
            return moved
        moved = self._places.displacements(u)[0]
        return moved

    def vector(self, force: Float) -> Vec:
        """A vector whose product with u is that of a force (2,) with the displacement."""
        if self._weight_n is not None:
            return self._nodes.vector(np.outer(self._weight_n, force))
        return self._nodes.from_points(self._places, np.asarray(force, dtype=np.float64)[None])
