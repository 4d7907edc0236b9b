"""The last converged state of a run, small enough to be kept with its result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.checkpoint import Checkpoint
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]


class EndOfRun:
    """What a discretisation made anew needs to stand where a run has ended, on as many ranks.

    Partitioners of meshes draw random numbers, so that a mesh that is spread again can lie on the ranks otherwise. This
    is no dataclass, so that ``asdict`` of a result takes it as a whole.

    Args:
        problem, options: of the run.
        comm: its ranks.
        labels_nz: (n_owned_nodes, 3) labels of this rank's nodes.
        values: (n_owned_dofs,) this rank's part of the displacements.
        position: on the path.
        stage, kept: what stages have kept of the states before, see ``Discretisation.memory``.
    """

    def __init__(
        self, problem: Problem, options: RunOptions, comm: Comm, labels_nz: Float, values: Float, position: Control,
        stage: int, kept: Sequence[Float],
    ) -> None:  # fmt: skip
        self.problem, self.options, self.comm = problem, options, comm
        self.labels_nz, self.values = labels_nz, values
        self.position, self.stage, self.kept = position, stage, kept

    def __deepcopy__(self, memo: object) -> EndOfRun:
        """The same: nothing of it changes, and ranks cannot be copied."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """None: what is sent to other processes, or kept in a file, has no ranks."""
        return _nothing, ()

    @staticmethod
    def of(problem: Problem, options: RunOptions, system: Discretisation, u: Vec, last: StepRecord) -> EndOfRun:
        """That of a run whose last step has led to ``u``."""
        stage, kept = system.memory()
        position = Control(last.load, last.parameters)
        labels_nz, values = system.node_labels(), u.getArray(readonly=True).copy()
        return EndOfRun(problem, options, system.comm, labels_nz, values, position, stage, kept)

    def give(self, system: Discretisation) -> Vec:
        """Displacements of a discretisation of the same problem, which stands there afterwards; called by all ranks.

        Raises:
            InputError: nodes lie on other ranks than before, and two of them are at the same place: a crack.
        """
        values, *kept = self._on(system)
        system.remember(self.stage, kept)
        if self.position.parameters:
            system.set_parameters(self.position.parameters)
        u = system.create_vector()
        u.getArray()[:] = values
        return u

    def _on(self, system: Discretisation) -> list[Float]:
        """Displacements and what is kept, of the nodes that this rank has now."""
        labels_nz, mine = system.node_labels(), [self.values, *self.kept]
        if all(self.comm.allgather(np.array_equal(labels_nz, self.labels_nz))):
            return mine
        nodal_sni = np.array([DISPLACEMENT.nodal(values) for values in mine])
        parts = self.comm.allgather((self.labels_nz, nodal_sni))
        labels, states = (np.concatenate([part[n] for part in parts], axis=n) for n in (0, 1))
        return [state_ni.ravel() for state_ni in Checkpoint({}, labels, states).values_at(labels_nz)]


def _nothing() -> None:
    return None
