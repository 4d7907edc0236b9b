"""Would it pay to condense the internal moments of every cell before the matrix is factorised?

    python benchmarks/condensation.py

MUMPS on the whole tangent against MUMPS on its Schur complement without the moments, a quarter of the unknowns of
quadrilaterals. Making the complement is not counted, so the ratio is an upper bound of what condensation can gain.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from harness import interleaved, report
from meshes import DOFS_PER_CELL, region, square
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import spsolve

from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constraints import Prescribed
from tmc_vem.vem.system import VemSystem


def tangent(kind: str, n_dofs: float) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Tangent at rest of a body held at a corner, and which unknowns are moments."""
    mesh = with_names(square(kind, n_dofs), {"corner": (0.0, 0.0), "other": (1.0, 0.0)})
    held = (Prescribed("corner", 0), Prescribed("corner", 1), Prescribed("other", 1))
    system = VemSystem(distribute(MPI.COMM_WORLD, lambda: mesh), {"body": region("huhu_lulu")}, held)
    matrix = system.create_matrix()
    system.jacobian(system.create_vector(), matrix)
    starts, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values, columns, starts)), np.repeat(system.node_labels()[:, 2] > 0.0, 2)


def without(whole: sparse.csr_matrix, inside: np.ndarray) -> sparse.csr_matrix:
    """Schur complement on the other unknowns."""
    i, b = np.flatnonzero(inside), np.flatnonzero(~inside)
    coupling = whole[i][:, b].tocsc()
    complement = whole[b][:, b] - coupling.T @ sparse.csr_matrix(spsolve(whole[i][:, i].tocsc(), coupling))
    return sparse.csr_matrix(complement)


class Solve:
    """A matrix with its solver; every call of :meth:`again` factorises new values, with one ordering."""

    def __init__(self, a: sparse.csr_matrix) -> None:
        a.sort_indices()
        csr: Any = (a.indptr.astype(PETSc.IntType), a.indices.astype(PETSc.IntType), a.data)
        self.matrix = PETSc.Mat().createAIJ(a.shape, csr=csr, comm=PETSc.COMM_SELF)
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.solver = LinearSolver(self.matrix, PETSc.COMM_SELF)
        self.x, self.b = self.matrix.createVecs()
        self.b.set(1.0)

    def again(self) -> None:
        """Factorise and solve."""
        self.matrix.scale(1.5)  # new values
        self.solver.solve(self.b, self.x)


def main() -> None:
    """Print times and write them."""
    rows: list[tuple[str, ...]] = []
    results: dict[str, dict[str, dict[str, float]]] = {}
    for kind in DOFS_PER_CELL:
        whole, inside = tangent(kind, 16e3)
        matrices = {"whole": whole, "condensed": without(whole, inside)}
        solves = {name: Solve(a) for name, a in matrices.items()}
        samples = interleaved({name: solve.again for name, solve in solves.items()}, 15)
        results[kind] = {name: {"unknowns": a.shape[0], "entries": int(a.nnz)} for name, a in matrices.items()}
        for name, found in results[kind].items():
            found["seconds"] = samples[name].best
            counts = (str(found["unknowns"]), str(found["entries"]))
            rows.append((f"{kind}, {name}", *counts, f"{1e3 * found['seconds']:.0f} ms"))
    columns = ("matrix", "unknowns", "entries", "factorisation and solve")
    report("condensation", "MUMPS with and without internal moments", columns, rows, {"results": results})


if __name__ == "__main__":
    main()
