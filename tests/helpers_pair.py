"""What all systems of two unknowns have in common, the first of them free and the second prescribed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.support.petsc import PETSc
from tmc_vem.system.control import Control
from tmc_vem.system.unloaded import Unloaded

Float = NDArray[np.float64]


class Pair(Unloaded):
    """Vectors, matrix and condition; what stays is energy, residual, Jacobian and the action of the whole tangent."""

    comm, size, depth, reach = MPI.COMM_SELF, 1.0, 1.0, math.inf

    def create_vector(self) -> Any:
        vector = PETSc.Vec().createSeq(2, comm=self.comm)
        vector.set(0.0)
        return vector

    def create_matrix(self) -> Any:
        matrix = PETSc.Mat().createAIJ([2, 2], nnz=2, comm=self.comm)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return matrix

    def constrained(self) -> NDArray[np.int32]:
        return np.array([1], dtype=np.int32)

    def prescribed(self, position: Control) -> Float:
        return np.array([self.depth * position.load])

    def prescribed_per_load(self, position: Control) -> Float:
        return np.array([self.depth])

    def set_parameters(self, values: Mapping[str, float]) -> None:
        pass

    def max_step(self, u: Any, du: Any) -> float:
        return self.reach

    def point_displacements(self, u: Any, names: Sequence[str]) -> Float:
        return np.zeros((len(names), 2))
