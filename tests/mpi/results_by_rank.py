"""Run under mpirun: numbers that must not depend on how many ranks computed them, as JSON from rank 0."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers_forces import KINDS, ROLLERS, cavity_plate, ring
from helpers_mesh import grid, hanging, voronoi
from helpers_penalty import medium, penalised
from helpers_system import CLAMPED, interpolate, make_system, problem_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Box, Medium
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.stepping import LoadStepper, SteppingOptions
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.forces import CavityPressure, Spring
from tmc_vem.system.loaded import with_forces
from tmc_vem.vem.spaces.element_settings import ElementSettings

comm = MPI.COMM_WORLD
MEDIUM = region("medium_huhu_lulu_damped", mu=10.0, gamma=0.1, alpha_r=0.3, beta=2.0)
SOLID = region("solid", K=20.0, mu=10.0)


def wavy(x):
    return 0.05 * np.stack([np.sin(2 * x[:, 0] + x[:, 1]), x[:, 0] * x[:, 1] + np.cos(3 * x[:, 1])], axis=1)


def numbers(system: Any) -> dict[str, float]:
    u, residual, action = interpolate(system, wavy), system.create_vector(), system.create_vector()
    evaluation = system.residual(u, residual)
    matrix = system.create_matrix()
    system.jacobian(u, matrix)
    du = interpolate(system, lambda x: np.cos(x[:, ::-1] * [3.0, 5.0]))
    system.tangent_action(du, action)
    info = matrix.getInfo()
    mallocs = comm.allreduce(float(info["mallocs"]))
    _, smallest = system.cell_jacobians(u)
    return {
        "n_dofs": system.n_dofs,
        "energy": evaluation.energy,
        "min_j": evaluation.min_j,
        "residual": residual.norm(),
        "tangent": matrix.norm(2),  # Frobenius
        "trace": matrix.getDiagonal().sum(),
        "action": action.norm(),
        "slope": residual.dot(du),
        "max_step": system.max_step(u, du),
        "constrained": comm.allreduce(len(system.constrained())),
        "size": system.size,
        "mallocs": mallocs,
        "cell_energies": comm.allreduce(float(system.cell_energies(u).sum())),
        "smallest_j": comm.allreduce(float(smallest.min(initial=np.inf)), op=MPI.MIN),
    }


def corner_fan() -> PolygonMesh:
    """Triangles around one vertex; only one of them has the named edge, but all have its end vertex."""
    angles = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    points = np.vstack([[0.0, 0.0], np.column_stack([np.cos(angles), np.sin(angles)])])
    cells = [[0, 1 + i, 1 + (i + 1) % 12] for i in range(12)]
    return PolygonMesh.from_cells(
        points, cells, named_edges={"spoke": [(0, 3)], "rim": [(5, 6)]}, named_points={"tip": 9}
    )


def two_media() -> PolygonMesh:
    """Voronoi cells of two regions."""
    mesh = voronoi(40)
    cells = [list(cell) for cell in mesh.cells()]
    right = [int(mesh.points_vx[cell][:, 0].mean() > 0.5) for cell in cells]
    return PolygonMesh.from_cells(
        mesh.points_vx, cells, right, ("left", "right"), named_edges={"boundary": mesh.named_edges["boundary"]}
    )


VALUES = {"mu": 10.0, "gamma": 0.1, "alpha_r": 0.3, "beta": 2.0}
ANGLE, HUHU = medium("medium_angle_damped"), medium("medium_huhu_lulu_damped")

report: dict[str, Any] = {
    "sides of two media": numbers(
        make_system(
            two_media(),
            {"left": penalised(ANGLE, VALUES, "full"), "right": penalised(HUHU, {**VALUES, "gamma": 0.2}, "full")},
            [Prescribed("boundary", 0)],
        )
    ),
    "sides of two cells": numbers(
        make_system(grid(2, 1), penalised(HUHU, VALUES, "full"), [Prescribed("boundary", 0)])
    ),
    "sides, order 3": numbers(
        make_system(hanging(3), penalised(ANGLE, VALUES, "penalty"), (), ElementSettings(order=3))
    ),
    "voronoi": numbers(make_system(voronoi(30), SOLID, CLAMPED)),
    "voronoi, order 3": numbers(make_system(voronoi(30), SOLID, CLAMPED, ElementSettings(order=3))),
    "hanging": numbers(make_system(hanging(3), MEDIUM, [Prescribed("boundary", 0)])),
    "box": numbers(problem_system(Box(cells=(20, 5), medium=Medium(gamma=0.1)))),
    "fan": numbers(
        make_system(corner_fan(), SOLID, [Prescribed("spoke", 0), Prescribed("spoke", 1), Prescribed("rim", 1, 0.1)])
    ),
    "one cell": numbers(make_system(PolygonMesh.from_cells([(0, 0), (1, 0), (0, 1)], [[0, 1, 2]]), SOLID)),
}

# every kind of force, at load factor 0.8
forces = [replace(force, name=kind.replace(" ", "_")) for kind, force in KINDS.items()]
loaded = with_forces(make_system(cavity_plate(), SOLID, ROLLERS), forces)
loaded.set_position(Control(0.8))
report["forces"] = numbers(loaded)
per_load = loaded.create_vector()
loaded.add_residual_per_load(interpolate(loaded, wavy), Control(0.8), per_load)
of_forces = loaded.energy(interpolate(loaded, wavy)).forces
measured = loaded.measures(interpolate(loaded, wavy), Control(0.8))
report["measures"] = {f"{name} {key}": value for name, of in measured.items() for key, value in of.items()}
report["measures"] |= {"per load": per_load.norm(), "norm": of_forces, "mallocs": 0.0}

# a ring that opens under pressure, held by springs
pad = Spring("pad", "outer", (1.0, 2.0))
blown = with_forces(make_system(ring(12), SOLID, ()), [CavityPressure("air", "inner", 4.0), pad])
u, opened = blown.create_vector(), blown.create_vector()
assert NewtonSolver(blown).predict(u, Control(1.0), opened)
blown_up = NewtonSolver(blown).solve(opened)
report["solved ring"] = {
    "complete": float(blown_up.converged),
    "area": blown.measures(opened, Control(1.0))["air"]["area"],
    "pad": blown_up.evaluation.springs["pad"],
    "energy": blown_up.evaluation.energy,
}

# a problem with a body force, solved; reactions of an edge set
system = make_system(corner_fan(), SOLID, [Prescribed("spoke", 0), Prescribed("spoke", 1), Prescribed("rim", 1, 0.1)])
system.set_body_force(lambda x: np.stack([1.0 + x[:, 1], -0.5 * x[:, 0]], axis=1))
solver, u = NewtonSolver(system), system.create_vector()
result = LoadStepper(solver, SteppingOptions(steps=2)).run(u)
report["solved fan"] = {
    "complete": float(result.complete),
    "norm": u.norm(),
    "tip x": system.point_displacements(u, ["tip"])[0, 0],
    "tip y": system.point_displacements(u, ["tip"])[0, 1],
    "spoke x": system.reaction(result.last.newton.residual, "spoke", 0),
    "rim y": system.reaction(result.last.newton.residual, "rim", 1),
}

# the box at full load, with equal steps so that all ranks take the same path
system = problem_system(Box(cells=(20, 10), medium=Medium(gamma=1e-4)))
solver, u = NewtonSolver(system), system.create_vector()
last = []
result = LoadStepper(
    solver,
    SteppingOptions(),
    lambda step, *_: last.append((system.reaction(step.newton.residual, "load", 1), len(step.newton.iterations))),
).run(u)
top, bottom = system.point_displacements(u, ["flange_top", "flange_bottom"])
report["solved box"] = {
    "complete": float(result.complete),
    "gap": float(np.hypot(top[0] - bottom[0], 0.3 + top[1] - bottom[1])),
    "reaction": last[-1][0],
    "steps": len(last),
    "iterations": sum(n for _, n in last),
}
if comm.rank == 0:
    print(json.dumps(report))
