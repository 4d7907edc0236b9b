"""Run under mpirun: what the presets say of the tangent of a body that nothing holds, as JSON from rank 0."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_mesh import grid
from helpers_system import make_system, region

from tmc_vem.solve.linear import LinearSolver

report = {}
for preset in ("direct", "reproducible"):
    for cells in (4, 16):
        system = make_system(grid(cells, cells), region("solid", K=50.0, mu=10.0))
        u, rhs, out = (system.create_vector() for _ in range(3))
        tangent = system.create_matrix()
        system.jacobian(u, tangent)
        rhs.set(1.0)
        solver = LinearSolver(tangent, system.comm, preset)
        report[f"{preset} {cells}"] = [solver.solve(rhs, out), solver.negative_pivots()]
        solver.destroy()

if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(report))
