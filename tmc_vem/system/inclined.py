"""A discretisation some of whose nodes have axes of their own, so that displacements across inclined edges are degrees
of freedom like others.

With the rotations R of all nodes, u = R q. The potential is that of u, its gradient with respect to q is R^T r and its
tangent R^T K R: exact, symmetric and without a penalty. What is not a vector of q is along x and y.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation, Evaluation, FromNodes
from tmc_vem.system.friction import FrictionStates
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.sensitivity import CellDerivatives, PointForces
from tmc_vem.system.turned import Turned

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def with_axes(system: Discretisation) -> Discretisation:
    """A discretisation with the axes that its conditions ask for; itself where these are x and y. All ranks call this
    together."""
    inclined = any(0.0 not in axis for condition in system.conditions for axis in condition.axes)
    if not inclined:  # so that nothing is looked for
        return system
    held = Constrained.of(system.conditions, system.owned_nodes, system.node_labels()[:, :2])
    if not system.comm.allreduce(len(held.frames.nodes) > 0, op=MPI.LOR):
        return system
    # whatever TurnedSystem does not have itself it asks the other one for, which mypy cannot see
    return cast("Discretisation", TurnedSystem(system, held))


class TurnedSystem:
    """Implements ``Discretisation``.

    Args:
        system: the discretisation, whose vectors are along x and y.
        held: what is prescribed at this rank's nodes, with their axes.
    """

    def __init__(self, system: Discretisation, held: Constrained) -> None:
        self._system, self._held = system, held
        self._frames = held.frames
        self._u, self._du = (system.create_vector() for _ in range(2))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """What has nothing to do with axes."""
            if name == "_system":  # while there is none, as in a copy that is being made
                raise AttributeError(name)
            return getattr(self._system, name)

    # -- Discretisation ------------------------------------------------------------------------------------------

    def constrained(self) -> NDArray[np.int32]:
        """Constrained entries owned by this rank, as positions in its part of a global vector."""
        return self._held.dofs.astype(np.int32)

    def prescribed(self, position: Control) -> Float:
        """Displacements of :meth:`constrained` at a position on the path, along the axes of the nodes."""
        return self._held.at(position)

    def prescribed_per_load(self, position: Control) -> Float:
        """Their derivatives with respect to the load factor."""
        return self._held.per_load(position)

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Gradient of the potential at ``u`` into ``out``; its constrained entries are the reactions."""
        evaluation = self._system.residual(self._plain(u), out)
        self._turn_back(out)
        return evaluation

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u``."""
        return self._system.energy(self._plain(u))

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent at ``u`` with rows and columns of the identity at constrained degrees of freedom."""
        self._system.jacobian(self._plain(u), out)
        turned = out.ptap(self._rotation)
        turned.copy(out, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        turned.destroy()
        first, _ = out.getOwnershipRange()
        out.zeroRowsColumns((self._held.dofs + first).astype(PETSc.IntType), diag=1.0)

    def tangent_action(self, du: Vec, out: Vec) -> None:
        """Product of the last tangent, without boundary conditions, and ``du``."""
        self._system.tangent_action(self._plain(du), out)
        self._turn_back(out)

    def max_step(self, u: Vec, du: Vec) -> float:
        """Largest s with J > 0 at every quadrature point along u + t du, t < s."""
        self._turn(du, self._du)
        return self._system.max_step(self._plain(u), self._du)

    def point_displacements(self, u: Vec, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points."""
        return self._system.point_displacements(self._plain(u), names)

    def reaction(self, residual: Vec, where: str, component: int) -> float:
        """Force that holds a named point or edge set, along x or y."""
        return self._system.reaction(self._plain(residual), where, component)

    def held_forces(self, residual: Vec) -> Float:
        """(n, 2) forces that hold this rank's nodes at which something is prescribed."""
        return self._held.forces(DISPLACEMENT.nodal(residual.getArray(readonly=True)))

    def resultant(self, u: Vec, residual: Vec, where: str, about: tuple[float, float]) -> Float:
        """Force and moment (3,) that hold a named point or edge set."""
        self._turn(residual, self._du)
        return self._system.resultant(self._plain(u), self._du, where, about)

    def internal_forces(self, u: Vec, chosen_c: Bool) -> Float:
        """(n_owned_nodes, 2) forces along x and y with which some cells resist."""
        return self._system.internal_forces(self._plain(u), chosen_c)

    def point_states(self, u: Vec) -> Iterator[PointStates]:
        """This rank's cells at their quadrature points."""
        return self._system.point_states(self._plain(u))

    def friction_states(self, u: Vec) -> Iterator[FrictionStates]:
        """This rank's cells with friction at their quadrature points."""
        return self._system.friction_states(self._plain(u))

    def advance(self, u: Vec) -> None:
        """Friction of the step that begins at ``u``."""
        self._system.advance(self._plain(u))

    def shear(self, u: Vec) -> tuple[Float, Float]:
        """Points (n, 2) with friction of this rank, and the shear (n,) there."""
        return self._system.shear(self._plain(u))

    def remember_shear(self, u: Vec, shear_at: Callable[[Float], Float]) -> None:
        """Begin a step at ``u`` with the shear that a function gives at points."""
        self._system.remember_shear(self._plain(u), shear_at)

    def parameter_derivatives(self, u: Vec, adjoint: Vec | None = None) -> Iterator[CellDerivatives]:
        """Derivatives of this rank's cells with respect to their parameters."""
        if adjoint is not None:
            self._turn(adjoint, self._du)
        return self._system.parameter_derivatives(self._plain(u), None if adjoint is None else self._du)

    def add_point_forces(self, u: Vec, forces: PointForces, out: Vec) -> None:
        """Add what given stresses at the points of this rank's cells do on every basis function."""
        self._du.set(0.0)
        self._system.add_point_forces(self._plain(u), forces, self._du)
        self._turn_back(self._du)
        out.axpy(1.0, self._du)

    def cell_tangent_action(self, u: Vec, du: Vec, chosen_c: Bool, out: Vec) -> None:
        """Add the product of the tangent of some cells alone, and ``du``."""
        self._turn(du, self._du)
        product = self._system.create_vector()
        self._system.cell_tangent_action(self._plain(u), self._du, chosen_c, product)
        self._turn_back(product)
        out.axpy(1.0, product)
        product.destroy()

    def nodal_values(self, u: Vec) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, ghosts included."""
        return self._system.nodal_values(self._plain(u))

    def nodal_vector(self, values_ni: Float) -> Vec:
        """A new vector with values (n_nodes, 2) along x and y of this rank's nodes, of virtual elements."""
        vector = cast("FromNodes", self._system).nodal_vector(values_ni)
        self._turn_back(vector)
        return vector

    def cell_energies(self, u: Vec, without: str = "") -> Float:
        """Energy (n_cells,) of each local cell."""
        return self._system.cell_energies(self._plain(u), without)

    def cell_jacobians(self, u: Vec) -> tuple[Float, Float]:
        """Mean and smallest J (n_cells,) of each local cell."""
        return self._system.cell_jacobians(self._plain(u))

    def dense_jacobians(self, u: Vec) -> Float:
        """Smallest J (n_cells,) of each local cell on a grid much finer than the quadrature's."""
        return self._system.dense_jacobians(self._plain(u))

    def output_displacements(self, u: Vec) -> Float:
        """(n_points, 2) displacements of the polygons' points."""
        return self._system.output_displacements(self._plain(u))

    def turned(self) -> Turned:
        """Nodes of all ranks whose degrees of freedom are displacements along axes of their own."""
        first = sum(self._system.comm.allgather(len(self._u.getArray(readonly=True)))[: self._system.comm.rank])
        mine = DISPLACEMENT.n_nodes(first) + self._frames.nodes, self._frames.turn_nij
        nodes, axes_nij = (np.concatenate(part) for part in zip(*self._system.comm.allgather(mine), strict=True))
        return Turned(nodes, axes_nij)

    # -- internals -----------------------------------------------------------------------------------------------

    def _plain(self, u: Vec) -> Vec:
        """``u`` along x and y; the same vector at every call."""
        self._turn(u, self._u)
        return self._u

    def _turn(self, vector: Vec, out: Vec) -> None:
        """From the nodes' axes to x and y."""
        values = DISPLACEMENT.nodal(vector.getArray(readonly=True))
        DISPLACEMENT.nodal(out.getArray())[:] = self._frames.displacements(values)

    def _turn_back(self, vector: Vec) -> None:
        """Forces from x and y to the nodes' axes, in place."""
        array = DISPLACEMENT.nodal(vector.getArray())
        array[:] = self._frames.forces(array)

    @cached_property
    def _rotation(self) -> Mat:
        """R as a matrix: blocks of 2 x 2, the identity at most nodes."""
        size = len(self._u.getArray(readonly=True))
        shape = (size, PETSc.DECIDE)
        matrix = PETSc.Mat().createAIJ((shape, shape), nnz=(DISPLACEMENT.components, 0), comm=self._system.comm)
        first, _ = matrix.getOwnershipRange()
        n_nodes = DISPLACEMENT.n_nodes(size)
        dofs = (first + DISPLACEMENT.dofs(np.arange(n_nodes))).astype(PETSc.IntType)
        matrix.setValuesRCV(dofs, dofs, self._frames.everywhere(n_nodes))
        matrix.assemble()
        rotation: Mat = matrix
        return rotation
