"""The last converged state of a run, small enough to be kept with its result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.results.records import StepRecord
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation

Float = NDArray[np.float64]


@dataclass(frozen=True)
class EndOfRun:
    """What a discretisation made anew needs to stand where a run has ended, on the same ranks.

    Attributes:
        problem, options: of the run.
        comm: its ranks.
        values: (n_owned_dofs,) this rank's part of the displacements.
        position: on the path.
        stage, kept: what stages have kept of the states before, see ``Discretisation.memory``.
    """

    problem: Problem
    options: RunOptions
    comm: Comm
    values: Float
    position: Control
    stage: int
    kept: Sequence[Float]

    @staticmethod
    def of(problem: Problem, options: RunOptions, system: Discretisation, u: Vec, last: StepRecord) -> EndOfRun:
        """That of a run whose last step has led to ``u``."""
        stage, kept = system.memory()
        position = Control(last.load, last.parameters)
        return EndOfRun(problem, options, system.comm, u.getArray(readonly=True).copy(), position, stage, kept)

    def give(self, system: Discretisation) -> Vec:
        """Displacements of a discretisation of the same problem, which stands there afterwards."""
        system.remember(self.stage, self.kept)
        if self.position.parameters:
            system.set_parameters(self.position.parameters)
        u = system.create_vector()
        u.getArray()[:] = self.values
        return u
