"""Stages of a run: times from which on other supports hold, and a discretisation whose supports change at them.

A support that ends leaves its force on the body, and takes it away over the stage that begins: in proportion to the
time, as static steps of common finite element programs do. A support that begins holds the displacement reached by
then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Condition
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.stage import CLOSE, Stage

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def with_stages(
    system: Discretisation, prescribed: Sequence[Condition], stages: Sequence[Stage], end: float
) -> Discretisation:
    """A discretisation with supports that do not hold in all stages; itself if there are none. All ranks call this
    together.

    Args:
        system: the discretisation, with all conditions that hold always.
        prescribed: all conditions.
        stages: in their order.
        end: of the last one.

    Raises:
        InputError: a support of some stages meets one across an inclined edge.
    """
    some = [condition for condition in prescribed if condition.stages]
    # whatever StagedSystem does not have itself it asks the other one for, which mypy cannot see
    return cast("Discretisation", StagedSystem(system, some, stages, end)) if some else system


@dataclass
class _Now:
    """Where a run stands.

    Attributes:
        stage: number of the stage, from 0.
        force_d: (n,) forces that supports have left at the beginning of the stage.
        held_d: (n,) displacements that supports hold.
    """

    stage: int
    force_d: Float
    held_d: Float


class StagedSystem:
    """Implements ``Discretisation``; arguments are those of :func:`with_stages`."""

    def __init__(self, system: Discretisation, some: Sequence[Condition], stages: Sequence[Stage], end: float) -> None:
        self._system = system
        self._begins = [stage.begins for stage in stages]
        self._ends = [*self._begins[1:], end]
        holding = [
            Constrained.of([each for each in some if stage.name in each.stages], system.owned_nodes).dofs
            for stage in stages
        ]
        always = system.constrained().astype(np.int64)
        self._dofs = np.setdiff1d(np.concatenate(holding), always)
        self._holds_sd: Bool = np.array([np.isin(self._dofs, dofs) for dofs in holding])
        self._require_x_and_y()
        n = len(self._dofs)
        self._now, self._position = _Now(0, np.zeros(n), np.zeros(n)), Control(0.0)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """What has nothing to do with stages."""
            if name == "_system":  # while there is none, as in a copy that is being made
                raise AttributeError(name)
            return getattr(self._system, name)

    # -- Discretisation ------------------------------------------------------------------------------------------

    def constrained(self) -> NDArray[np.int32]:
        """Constrained entries owned by this rank, as positions in its part of a vector; those of this stage at the
        end."""
        return np.concatenate([self._system.constrained(), self._dofs[self._holds].astype(np.int32)])

    def prescribed(self, position: Control) -> Float:
        """Displacements of :meth:`constrained` at a position on the path."""
        return np.concatenate([self._system.prescribed(position), self._now.held_d[self._holds]])

    def prescribed_per_load(self, position: Control) -> Float:
        """Their derivatives with respect to the load factor."""
        return np.concatenate([self._system.prescribed_per_load(position), np.zeros(int(self._holds.sum()))])

    def set_position(self, position: Control) -> None:
        """Forces that supports have left are those at a position on the path from now on."""
        self._system.set_position(position)
        self._position = position

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Gradient of the potential at ``u`` into ``out``; its constrained entries are the reactions."""
        evaluation = self._with_left(u, self._system.residual(u, out))
        out.getArray()[self._dofs] -= self._left(self._position)
        return evaluation

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u``."""
        return self._with_left(u, self._system.energy(u))

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent at ``u`` with rows and columns of the identity at constrained degrees of freedom."""
        self._system.jacobian(u, out)
        first, _ = out.getOwnershipRange()
        out.zeroRowsColumns((self._dofs[self._holds] + first).astype(PETSc.IntType), diag=1.0)

    def reaction(self, residual: Vec, where: str, component: int) -> float:
        """Force that holds a named point or edge set, what supports have left there included."""
        return self._system.reaction(self._whole(residual), where, component)

    def held_forces(self, residual: Vec) -> Float:
        """(n, 2) forces that hold this rank's nodes at which something is prescribed, now or in another stage."""
        array = residual.getArray(readonly=True)
        of_some = np.zeros(len(array))
        of_some[self._dofs] = array[self._dofs] + self._left(self._position)
        nodes = np.unique(DISPLACEMENT.node(self._dofs))
        return np.concatenate([self._system.held_forces(residual), DISPLACEMENT.nodal(of_some)[nodes]])

    def resultant(self, u: Vec, residual: Vec, where: str, about: tuple[float, float]) -> Float:
        """Force and moment (3,) that hold a named point or edge set, what supports have left there included."""
        return self._system.resultant(u, self._whole(residual), where, about)

    def holding_forces(self, residual: Vec) -> Float:
        """This rank's part of the residual with the forces that supports have left."""
        return self._whole(residual).getArray(readonly=True).copy()

    def accept(self, u: Vec, residual: Vec, position: Control) -> None:
        """A step has converged: the next stage begins if it leads there; the residual becomes that of it."""
        following = self._now.stage + 1
        if following == len(self._begins) or position.load < self._begins[following] - CLOSE:
            return
        ends, begins = (a & ~b for a, b in ((self._holds, self._holds_sd[following]),
                                            (self._holds_sd[following], self._holds)))  # fmt: skip
        reaction_d, u_d = (vector.getArray(readonly=True)[self._dofs] for vector in (residual, u))
        held_d = np.where(begins, u_d, self._now.held_d)
        self._now = _Now(following, np.where(ends, reaction_d, 0.0), held_d)
        residual.getArray()[self._dofs] -= self._now.force_d

    def memory(self) -> tuple[int, list[Float]]:
        """The stage, and what it has kept of the states before it: values of this rank's part of a vector."""
        kept = []
        for value_d in (self._now.force_d, self._now.held_d):
            values = np.zeros(len(self._system.create_vector().getArray(readonly=True)))
            values[self._dofs] = value_d
            kept.append(values)
        return self._now.stage, kept

    def remember(self, stage: int, kept: Sequence[Float]) -> None:
        """Go on in a stage with what :meth:`memory` has given."""
        force_d, held_d = (values[self._dofs] for values in kept)
        self._now = _Now(stage, force_d, held_d)

    # -- internals -----------------------------------------------------------------------------------------------

    @property
    def _holds(self) -> Bool:
        holds: Bool = self._holds_sd[self._now.stage]
        return holds

    def _left(self, position: Control) -> Float:
        """Forces (n,) that supports have left, at a position on the path."""
        begins, ends = self._begins[self._now.stage], self._ends[self._now.stage]
        share: Float = self._now.force_d * min(max((ends - position.load) / (ends - begins), 0.0), 1.0)
        return share

    def _with_left(self, u: Vec, evaluation: Evaluation) -> Evaluation:
        """An evaluation with the work of these forces."""
        left = self._left(self._position)
        mine = np.array([left @ u.getArray(readonly=True)[self._dofs], left @ left])
        work, squared = np.sum(self._system.comm.allgather(mine), axis=0)
        forces = max(evaluation.forces, float(np.sqrt(squared)))
        return replace(evaluation, energy=evaluation.energy - float(work), forces=forces)

    def _whole(self, residual: Vec) -> Vec:
        whole = residual.copy()
        whole.getArray()[self._dofs] += self._left(self._position)
        return whole

    def _require_x_and_y(self) -> None:
        """Check that the supports' nodes have no axes of their own."""
        sizes = self._system.comm.allgather(len(self._system.create_vector().getArray(readonly=True)))
        first = DISPLACEMENT.n_nodes(sum(sizes[: self._system.comm.rank]))
        inclined = np.isin(DISPLACEMENT.node(self._dofs) + first, self._system.turned().nodes).any()
        if self._system.comm.allreduce(bool(inclined), op=MPI.LOR):
            raise InputError(
                "a [[support]] with a stage meets one across an inclined edge: let one end before that node, or give "
                "both no stage"
            )
