"""Run under mpirun with a directory: what ranks send each other while the load is applied, and what the root keeps."""

from __future__ import annotations

import gc
import json
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.solve.stepping import LoadStepper

sizes: list[int] = []
counting = False


def noted(method: str) -> Any:
    """The method of a communicator, with the size of what this rank hands over noted."""
    original = getattr(MPI.Intracomm, method)

    def call(self: Any, thing: Any = None, *arguments: Any, **named: Any) -> Any:
        if counting:
            sizes.append(len(pickle.dumps(thing)))
        return original(self, thing, *arguments, **named)

    return call


METHODS = ("allgather", "allreduce", "alltoall", "bcast", "gather", "reduce", "scatter", "send")
Counting = type("Counting", (MPI.Intracomm,), {name: noted(name) for name in METHODS})
Counting.__module__ = MPI.Intracomm.__module__  # petsc4py knows mpi4py's communicators by it
apply_load = LoadStepper.run


def counted(self: Any, *arguments: Any) -> Any:
    global counting
    counting = True
    try:
        return apply_load(self, *arguments)
    finally:
        counting = False


LoadStepper.run = counted  # type: ignore[method-assign]

comm = Counting(MPI.COMM_WORLD)
report: dict[str, Any] = {"messages": [], "meshes": []}
for cells in ((20, 5), (80, 20)):
    sizes.clear()
    out = Path(sys.argv[1]) / f"{cells[0]}"
    result = run(Box(cells, Medium(gamma=1e-4), uy=-0.1), out, RunOptions(steps=2, snapshots=2), comm=comm)
    assert result.complete
    report["messages"].append({"largest": comm.allreduce(max(sizes), op=MPI.MAX), "calls": len(sizes)})
    report["result"] = result.as_dict()["parallel"]


def halves() -> PolygonMesh:
    lines = np.linspace(0.0, 2.0, 21)
    return structured_quadrilaterals(
        lines, lines, [Rectangle("solid", 0.0, 1.0, 0.0, 2.0), Rectangle("medium", 1.0, 2.0, 0.0, 2.0)]
    )


part = distribute(MPI.COMM_WORLD, halves, {"medium": 9.0})
gc.collect()
alive = [thing.n_cells for thing in gc.get_objects() if isinstance(thing, PolygonMesh)]
report["meshes"] = comm.allgather((alive, part.mesh.n_cells, float(part.cost_c.sum())))
if comm.rank == 0:
    print(json.dumps(report))
