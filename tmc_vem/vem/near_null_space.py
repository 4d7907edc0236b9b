"""The rigid motions as vectors, which multigrid has to keep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.petsc import PETSc


def rigid_motions(comm: Comm, label_nz: NDArray[np.float64], create_vector: Callable[[], Vec]) -> object:
    """PETSc's null space of two translations and the rotation, orthonormal.

    Args:
        comm: the ranks; all of them call this.
        label_nz: (n_owned_nodes, 3) x, y, and 0 for values, else the number of the moment: of moments the mean moves,
            which is exact for the one of k = 2.
        create_vector: makes a displacement vector.
    """
    x, y, is_mean = label_nz[:, 0], label_nz[:, 1], label_nz[:, 2] <= 1.0
    motions: list[Vec] = []
    for motion in ((is_mean, 0.0 * x), (0.0 * x, is_mean), (-y * is_mean, x * is_mean)):
        vector = create_vector()
        vector.getArray()[:] = np.column_stack(motion).ravel()
        for other in motions:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        motions.append(vector)
    return PETSc.NullSpace().create(vectors=motions, comm=comm)
