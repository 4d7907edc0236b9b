"""Run under mpirun: an error that happens on one rank is raised on all, so that nobody waits for ever."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_mesh import grid, subdivide
from helpers_system import make_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.system.constraints import Prescribed
from tmc_vem.vem.spaces.element_settings import ElementSettings

comm = MPI.COMM_WORLD
SOLID = region("solid", K=20.0, mu=10.0)


def clockwise():
    return PolygonMesh.from_cells([(0, 0), (1, 0), (0, 1)], [[0, 2, 1]])


def not_our_error():
    raise RuntimeError("mesh file lost")


def one_cell_with_many_nodes():
    """A row of squares whose first one has three nodes on its left side, where no neighbour needs them."""
    first = subdivide([(0, 0), (1, 0), (1, 1), (0, 1)], [1, 1, 1, 4])
    points, cells = first.tolist(), [list(range(len(first)))]
    lower, upper = 1, 2
    for x in range(2, 13):
        points += [[float(x), 0.0], [float(x), 1.0]]
        cells.append([lower, len(points) - 2, len(points) - 1, upper])
        lower, upper = len(points) - 2, len(points) - 1
    return PolygonMesh.from_cells(points, cells)


attempts = {
    "bad mesh": lambda: make_system(clockwise, SOLID),
    "unexpected error while meshing": lambda: make_system(not_our_error, SOLID),
    "forced degree": lambda: make_system(grid(4, 3), SOLID, (), ElementSettings(degree=2)),
    "no degree for one cell": lambda: make_system(
        one_cell_with_many_nodes, SOLID, (), ElementSettings(order=3, projection="full")
    ),
    "unknown name": lambda: make_system(grid(4, 3), SOLID, [Prescribed("nowhere", 0)]),
    "unknown probe": lambda: (s := make_system(grid(4, 3), SOLID)).point_displacements(s.create_vector(), ["nowhere"]),
    "reaction of an unknown name": lambda: (s := make_system(grid(4, 3), SOLID)).reaction(s.create_vector(), "no", 0),
}
report = {}
for name, attempt in attempts.items():
    try:
        attempt()
        outcome = "nothing"
    except Exception as error:
        outcome = f"{type(error).__name__}: {error}"
    report[name] = comm.allgather(outcome)
assert np.isfinite(comm.allreduce(1.0))  # ranks are still in step
if comm.rank == 0:
    print(json.dumps(report))
