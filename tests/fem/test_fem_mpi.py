"""Two and three ranks find what one finds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from helpers_process import process

pytest.importorskip("dolfinx", reason="dolfinx is not installed")

PROGRAM = """
import json, sys
from dataclasses import replace
import numpy as np
from mpi4py import MPI
sys.path.insert(0, "..")
from helpers_forces import KINDS, ROLLERS, cavity_plate
from helpers_fem import CLAMPED, SOLID, grid, make_system, medium, problem_system, wavy
from helpers_friction import bent
from tmc_vem.mesh import PolygonMesh
from tmc_vem.results.output import gather_fields
from tmc_vem.problems import Box, Medium
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.system.control import Control
from tmc_vem.system.friction_settings import Friction
from tmc_vem.system.loaded import with_forces

comm = MPI.COMM_WORLD
system = problem_system(Box(cells=(20, 5), medium=Medium(gamma=1e-3)), comm, interior_penalty=sys.argv[1],
                        triangles=sys.argv[2] == "1")
w = system.interpolate(lambda x: 0.2 * wavy(x))
gradient = system.create_vector()
evaluation = system.residual(w, gradient)
solver = NewtonSolver(system)
u, start = system.create_vector(), system.create_vector()
assert solver.predict(start, Control(0.05), u)
result = solver.solve(u)
assert result.converged, result.reason
fields = gather_fields(system, u, ("medium",))
if comm.rank == 0:
    print(json.dumps({
        "ranks": comm.size, "dofs": system.n_dofs, "energy": evaluation.energy, "cells": fields.polygons.n_cells,
        "regions": {name: [v.energy, v.min_j] for name, v in evaluation.regions.items()}, "worst": evaluation.worst,
        "iterations": len(result.iterations), "stored": result.evaluation.energy,
    }), flush=True)
mesh = grid(6, 6)
inside = PolygonMesh(
    mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names, {},
    {"boundary": mesh.edges.vertices_ev[::9]},  # single edges here and there
)
scattered = make_system(inside, SOLID, CLAMPED, triangles=sys.argv[2] == "1")
n_constrained = comm.allreduce(len(scattered.constrained()))
values = [n_constrained, gradient.norm(), system.reaction(result.residual, "load", 1), system.max_step(w, w),
          *system.point_displacements(u, ["flange_top", "support_right"]).ravel().tolist()]
loaded = with_forces(make_system(cavity_plate(), SOLID, ROLLERS), [replace(f, name=k) for k, f in KINDS.items()])
moved = loaded.interpolate(wavy)
values += [value for of in loaded.measures(moved, Control(0.8)).values() for value in of.values()]
rough = make_system(grid(4, 4), replace(medium(), friction=Friction(0.4, 0.3)), triangles=sys.argv[2] == "1")
out = rough.create_vector()
for slip in (0.0, 0.05, 0.2):
    state = rough.interpolate(bent(0.1, slip))
    values += [rough.residual(state, out).energy, out.norm()]
    rough.advance(state)
values.append(comm.allreduce(float(np.abs(rough.shear(state)[1]).sum())))
if comm.rank == 0:
    print(json.dumps(values), flush=True)
"""


def solve(ranks: int, mode: str, triangles: bool) -> tuple[dict[str, Any], list[float]]:
    """Output of the program above."""
    done = process(["-c", PROGRAM, mode, str(int(triangles))], ranks=ranks, cwd=Path(__file__).parent, timeout=300)
    assert done.returncode == 0, done.stderr
    first, second = (json.loads(line) for line in done.stdout.splitlines() if line[:1] in "[{")
    return first, second


@pytest.mark.parametrize(("mode", "triangles", "ranks"), [("none", True, 3), ("penalty", False, 2)])
def test_one_rank_and_several(mode: str, triangles: bool, ranks: int) -> None:
    (one, one_values), (two, two_values) = (solve(n, mode, triangles) for n in (1, ranks))
    assert (one["ranks"], two["ranks"]) == (1, ranks)
    for key in ("dofs", "iterations", "cells", "worst"):
        assert two[key] == one[key]
    for key in ("energy", "stored"):
        assert two[key] == pytest.approx(one[key], rel=1e-10)
    for region, values in one["regions"].items():
        assert two["regions"][region] == pytest.approx(values, rel=1e-12)
    assert two_values == pytest.approx(one_values, rel=1e-7)
