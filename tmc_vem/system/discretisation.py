"""What a discretisation is to everything above it: VEM and FEM look the same from here.

A check by mypy and ``tests/unit/test_discretisation.py`` hold both to it, and what is above to what is in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Comm, Mat, Vec
from tmc_vem.system.constraints import Condition, Pair
from tmc_vem.system.control import Control
from tmc_vem.system.fields import Polygons
from tmc_vem.system.friction import FrictionStates
from tmc_vem.system.places import PointSource
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.sensitivity import CellDerivatives, PointForces
from tmc_vem.system.sides import Sides
from tmc_vem.system.turned import Turned

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class RegionValues:
    """Integral and extreme values of one region."""

    energy: float
    min_j: float


@dataclass(frozen=True)
class Evaluation:
    """Result of evaluating the potential at a state; equal on all ranks.

    Attributes:
        energy: potential: the energy of all regions and springs less the work of forces.
        regions: values by region name.
        worst: the smallest J and where it is, in words, for messages.
        springs: energies of springs by name.
        forces: what forces and springs contribute to the residual's norm, the larger of both.
    """

    energy: float
    regions: Mapping[str, RegionValues]
    worst: str = ""
    springs: Mapping[str, float] = field(default_factory=dict)
    forces: float = 0.0

    @property
    def min_j(self) -> float:
        """Smallest J at any quadrature point."""
        return min(values.min_j for values in self.regions.values())

    @property
    def magnitude(self) -> float:
        """How large the terms are that the potential is the difference of; what is far below is rounding."""
        return max(abs(self.energy), abs(sum(values.energy for values in self.regions.values())))

    @property
    def admissible(self) -> bool:
        """Whether J > 0 at every quadrature point (False also for a value that is not a number)."""
        return all(values.min_j > 0.0 for values in self.regions.values())


class Refused(Protocol):
    """What is said about a converged state that is no state of the problem that was posed."""

    def sentence(self) -> str:
        """What is wrong with it."""

    def advice(self) -> str:
        """What to do about it; called by all ranks together."""


class Admission(Protocol):
    """Says of converged states whether they are states of the problem that was posed; called by all ranks together."""

    def refusal(self, u: Vec, evaluation: Evaluation) -> Refused | None:
        """Why a converged state is none; None if it is one."""

    def refusal_of_jump(self, before: Vec, after: Vec) -> Refused | None:
        """Why a converged state on another branch cannot be reached from the state before; None if it can."""


class NonlinearSystem(Protocol):
    """A discretised potential with prescribed displacements: what the solver needs.

    Vectors and matrices are distributed over the ranks of ``comm``. ``residual`` is the full gradient of the potential,
    so its entries at constrained degrees of freedom are the reactions. Where a displacement across an inclined edge is
    prescribed, the entries of vectors are across and along it (:mod:`tmc_vem.system.inclined`).

    Attributes:
        comm: the ranks.
        size: larger side of the mesh's bounding box.
    """

    comm: Comm
    size: float

    def create_vector(self) -> Vec:
        """A new global vector of displacement degrees of freedom, zero."""

    def create_matrix(self) -> Mat:
        """A new preallocated matrix for the tangent."""

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What is prescribed, with the axes that it has on the mesh."""

    def constrained(self) -> NDArray[np.int32]:
        """Constrained degrees of freedom that this rank owns, as positions in the rank's part of a vector."""

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name, in every energy that has them, or as ``<region>.<name>`` in that of one region.

        See :func:`tmc_vem.system.control.parameter_of`.
        """

    def set_position(self, position: Control) -> None:
        """From now on, the potential is that at a position on the path, where forces depend on it."""

    def prescribed(self, position: Control) -> Float:
        """Displacements at a position on the path, parallel to :meth:`constrained`."""

    def prescribed_per_load(self, position: Control) -> Float:
        """Their derivatives with respect to the load factor."""

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Gradient of the potential at ``u`` into ``out``, constrained entries included."""

    def add_residual_per_load(self, u: Vec, position: Control, out: Vec) -> None:
        """Add to ``out`` the derivative of the residual at ``u`` with respect to the load factor, at a position on the
        path: that of forces which change along it."""

    def accept(self, u: Vec, residual: Vec, position: Control) -> None:
        """A step has converged to ``u``, at a position on the path: a stage may begin, in which other supports hold,
        and the residual becomes that of it."""

    def advance(self, u: Vec) -> None:
        """The step that has converged to ``u`` is recorded, and another begins: friction depends on where it begins.
        Until then all is still that of the step, so that forces are in equilibrium; a failed step leaves nothing."""

    def damp_slip(self, fraction: float) -> bool:
        """From now on, tangents have a fraction of the stiffness of sticking points where points slip, 0 for the second
        derivative itself; whether there is any friction."""

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u`` alone."""

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent at ``u`` into a matrix of :meth:`create_matrix`; constrained rows and columns are those of the
        identity."""

    def tangent_action(self, du: Vec, out: Vec) -> None:
        """Product of the last tangent, constrained rows and columns included, with ``du``."""

    def max_step(self, u: Vec, du: Vec) -> float:
        """Largest s with J(u + t du) > 0 at every quadrature point for all t < s; exact in two dimensions."""


class Discretisation(NonlinearSystem, PointSource, Protocol):
    """A problem on cells and nodes. What has an axis ``c`` or ``n`` is about the cells and nodes of this rank."""

    @property
    def order(self) -> int:
        """Order k of the elements: nodes on a side of a cell, one of its ends included."""

    @property
    def n_cells_global(self) -> int:
        """Cells of the whole mesh."""

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom of the whole system, constrained ones included."""

    def projection_degrees(self) -> dict[str, int]:
        """How many cells of the whole mesh project gradients on polynomials of which degree l, or on which space of
        another name; nothing where there is no projection."""

    def work(self) -> dict[str, float]:
        """This rank's share of the work, in several measures; ``cells`` is one."""

    # -- names

    def point_coordinates(self, names: Sequence[str]) -> Float:
        """Reference coordinates (n, 2) of named points, equal on all ranks.

        Raises:
            InputError: there is no point of that name.
        """

    def point_displacements(self, u: Vec, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points, equal on all ranks."""

    def reaction(self, residual: Vec, where: str, component: int) -> float:
        """Force that holds a named point or edge set, summed over its nodes, equal on all ranks."""

    def holding_forces(self, residual: Vec) -> Float:
        """(n_owned_dofs,) forces of all that holds this rank's nodes: the residual, and what supports that have ended
        have left there."""

    def memory(self) -> tuple[int, list[Float]]:
        """Number of the stage of the run, and what it has kept of the states before it: values of this rank's part of a
        vector; nothing where there are no stages."""

    def remember(self, stage: int, kept: Sequence[Float]) -> None:
        """Go on in a stage with what :meth:`memory` has given."""

    def held_forces(self, residual: Vec) -> Float:
        """(n, 2) forces that hold this rank's nodes at which something is prescribed."""

    def resultant(self, u: Vec, residual: Vec, where: str, about: Pair) -> Float:
        """Resultant (3,) of what holds a named point or edge set: the force's components, and its moment about a point
        in the deformed state; equal on all ranks."""

    def internal_forces(self, u: Vec, chosen_c: Bool) -> Float:
        """(n_owned_nodes, 2) forces along x and y with which some cells (n_cells,) of this rank, and those of the
        others, resist at the nodes of this rank's part of a vector: the gradient of their energies, what is on the
        sides between cells left out."""

    def external_forces(self, u: Vec) -> Float:
        """(n_owned_nodes, 2) forces along x and y with which forces and springs act on the same nodes."""

    def measures(self, u: Vec, position: Control) -> dict[str, dict[str, float]]:
        """What there is to say about every force and spring at a state and a position on the path, by its name; see
        :mod:`tmc_vem.system.loaded`."""

    # -- what forces act on

    def sides(self, where: str) -> Sides:
        """Sides of this rank's cells along named edges; none if the mesh has no edges of that name."""

    def owned_nodes(self, where: str) -> Int:
        """Nodes (n,) at a named point or edge set that this rank owns, as positions in its part of a vector.

        Raises:
            InputError: the mesh has nothing of that name.
        """

    def turned(self) -> Turned:
        """Nodes whose degrees of freedom are displacements along axes of their own."""

    def area_weights(self, regions: Sequence[str]) -> Float:
        """(n_owned_nodes,) integrals over regions of what the displacement of each node of this rank's part of a vector
        is multiplied with.

        Raises:
            InputError: the mesh has no region of a name.
        """

    # -- nodes

    def node_labels(self) -> Float:
        """Labels (n_nodes, 3) of the nodes of this rank's part of a vector, which do not depend on the distribution:
        coordinates and 0, or a cell's centroid and 1, 2, ... for its moments."""

    # -- cells

    def point_states(self, u: Vec) -> Iterator[PointStates]:
        """This rank's cells at their quadrature points, some at a time, always in the same order."""

    def friction_states(self, u: Vec) -> Iterator[FrictionStates]:
        """This rank's cells with friction at their quadrature points, some at a time, always in the same order, at a
        state on the way from the beginning of the step."""

    def shear(self, u: Vec) -> tuple[Float, Float]:
        """Points (n, 2) of the reference configuration of this rank's cells with friction, and the Kirchhoff shear (n,)
        there: what a run needs of friction, besides the displacements, to go on."""

    def remember_shear(self, u: Vec, shear_at: Callable[[Float], Float]) -> None:
        """Begin a step at ``u`` with a shear: a function gives it (n,) at points (n, 2)."""

    def cell_numbers(self) -> Int:
        """(n_cells,) numbers of the cells in the whole mesh."""

    def cell_areas(self) -> Float:
        """(n_cells,) reference areas."""

    def cell_energies(self, u: Vec, without: str = "") -> Float:
        """(n_cells,) energies in the cells, what is on the sides between them left out; the parameter ``without``,
        where an energy has it, is set to 0."""

    def parameter_derivatives(self, u: Vec, adjoint: Vec | None = None) -> Iterator[CellDerivatives]:
        """Derivatives of energies and of residuals along an adjoint field with respect to the value that each parameter
        has in each of this rank's cells, friction left out; all ranks together.

        Raises:
            InputError: there is an interior penalty.
        """

    def set_factors(self, region: str, factor_ck: Float) -> None:
        """From now on, the parameters of a region that vary from cell to cell are the region's times these factors
        (n_cells, n_varying); rows of cells of other regions are not read.

        Raises:
            InputError: nothing varies there, or there is an interior penalty.
        """

    def add_point_forces(self, u: Vec, forces: PointForces, out: Vec) -> None:
        """Add to ``out`` the sum over quadrature points of ``w (P : grad v + T :. grad grad v)`` for every basis
        function v; ``forces`` gives P and T at the points of some cells at ``u``. All ranks together."""

    def cell_tangent_action(self, u: Vec, du: Vec, chosen_c: Bool, out: Vec) -> None:
        """Add to ``out`` the product of ``du`` and the tangent at ``u`` of some cells (n_cells,) of this rank and those
        of the others alone, constrained rows and columns included. All ranks together."""

    def cell_jacobians(self, u: Vec) -> tuple[Float, Float]:
        """(n_cells,) mean and smallest J."""

    def dense_jacobians(self, u: Vec) -> Float:
        """(n_cells,) smallest J on a grid much finer than the quadrature's."""

    def output_polygons(self) -> Polygons:
        """The cells as polygons through all nodes of their boundary."""

    def output_displacements(self, u: Vec) -> Float:
        """(n_points, 2) displacements of the polygons' points."""


class FromNodes(Discretisation, Protocol):
    """A discretisation whose vectors can be made of values of its nodes: one with virtual elements."""

    def nodal_vector(self, values_ni: Float) -> Vec:
        """A new vector with values (n_nodes, 2) along x and y of this rank's nodes."""
