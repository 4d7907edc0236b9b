"""Box, C-box and Hertz's contact without a medium, on the solids' cells of tmc_vem's meshes.

Every study is a function of plain arguments, so that pages keep what it returned:

    PYTHONPATH=benchmarks python -c "from conventional.studies import box; print(box([20, 10], [0.4, 0.7], 1e5))"
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conventional.contact import both_ways
from conventional.faces import Solids, solids
from conventional.solve import System
from tmc_vem.problems import Box, CBox
from tmc_vem.simulation.problem_file import read_problem

Float = NDArray[np.float64]
Where = Callable[[Float], bool]
HERTZ = Path(__file__).resolve().parents[2] / "demos" / "problems" / "hertz.toml"
TOLERANCE = 1e-9  # of places


def level(y: float, left: float, right: float) -> Where:
    """Places at a height, between two ends."""
    return lambda x: bool(abs(x[1] - y) < TOLERANCE and left < x[0] < right)


def box(cells: Sequence[int], loads: Sequence[float], penalty: float, points: str = "gauss 4") -> dict[str, Any]:
    """The box of section 5.1 of the paper, pressed by ``-u_y``: what :func:`_follow` returns."""
    problem = Box(cells=(cells[0], cells[1]))
    mesh = problem.make_mesh()
    part = solids(mesh, {"solid": (problem.material.moduli.K, problem.material.moduli.mu)})
    a, b, t = problem.length, problem.height, problem.wall
    faces = [part.face(level(y, t, a - t)) for y in (b - t, t)]
    node = {name: part.vertex[v] for name, v in mesh.named_points.items()}
    held = {2 * node["support_left"]: 0.0, 2 * node["support_left"] + 1: 0.0, 2 * node["support_right"] + 1: 0.0,
            2 * node["load"] + 1: -1.0}  # fmt: skip
    system = System(part.body, both_ways(part.body.X_ni, faces[0], faces[1], penalty, points, t / 2), held)
    return _follow(system, part, loads, 2 * node["load"] + 1, (node["flange_top"], node["flange_bottom"]))


def cbox(cells: Sequence[int], loads: Sequence[float], penalty: float, points: str = "gauss 4") -> dict[str, Any]:
    """The C-box of section 5.2 with quadrilaterals, its tip pushed down by ``-u_y``."""
    problem = CBox(cells=(cells[0], cells[1]), solid_cells="quadrilaterals")
    mesh = problem.make_mesh()
    part = solids(mesh, {"solid": (problem.material.moduli.K, problem.material.moduli.mu)})
    a, b, t = problem.length, problem.height, problem.wall
    faces = [part.face(level(y, t, a)) for y in (b - t, t)]
    node = {name: part.vertex[v] for name, v in mesh.named_points.items()}
    left = np.flatnonzero(np.abs(part.body.X_ni[:, 0]) < TOLERANCE)
    held = {2 * int(n) + i: 0.0 for n in left for i in (0, 1)} | {2 * node["load"] + 1: -1.0}
    system = System(part.body, both_ways(part.body.X_ni, faces[0], faces[1], penalty, points, t / 2), held)
    return _follow(system, part, loads, 2 * node["load"] + 1, (node["tip_top"], node["tip_bottom"]))


def hertz(uy: float, penalty: float, points: str = "gauss 4") -> dict[str, Any]:
    """Line contact of demos/problems/hertz.toml on triangles, pressed by ``-u_y``: force of the half, and half width
    and peak pressure of a fit of p^2 over x^2 where p is more than half of the largest.
    """
    problem, _ = read_problem(HERTZ, {"mesh.cells": "triangles"})
    mesh = problem.make_mesh()
    regions = problem.regions()
    moduli = {name: (regions[name].values["K"], regions[name].values["mu"]) for name in ("block", "cylinder")}
    part = solids(mesh, moduli)
    X = part.body.X_ni
    flat = part.face(level(0.0, 0.0, 0.6))
    round_ = part.face(lambda x: abs(np.hypot(x[0], x[1] - 1.02) - 1.0) < 2e-3 and TOLERANCE < x[0] < 0.6 - TOLERANCE)
    lines = {name: np.flatnonzero(np.abs(X[:, i] - value) < TOLERANCE)
             for name, i, value in (("axis", 0, 0.0), ("bottom", 1, -1.0), ("top", 1, 1.0))}  # fmt: skip
    held = {2 * int(n): 0.0 for n in lines["axis"]} | {2 * int(n) + 1: 0.0 for n in lines["bottom"]}
    held |= {2 * int(n) + 1: -1.0 for n in lines["top"]}
    system = System(part.body, both_ways(X, round_, flat, penalty, points, 0.1), held)
    u = system.path([uy], lambda load, u: None, largest=0.004)
    place, pressure, _ = system.contacts[1].pressure(u.reshape(-1, 2))
    high = pressure > 0.5 * pressure.max()
    slope, top = np.polyfit(place[high, 0] ** 2, (2.0 * pressure[high]) ** 2, 1)
    force = -float(system.forces(u)[2 * lines["top"] + 1].sum())
    return {"force": force, "half_width": float(np.sqrt(-top / slope)), "peak": float(np.sqrt(top)),
            "touching": len(pressure), "iterations": system.iterations}  # fmt: skip


def _follow(system: System, part: Solids, loads: Sequence[float], driven: int, ends: tuple[int, int]) -> dict[str, Any]:
    """Loads, reactions at the driven degree of freedom, heights between two nodes, numbers of points that touch."""
    found: dict[str, Any] = {"loads": [], "reactions": [], "gaps": [], "touching": []}

    def report(load: float, u: Float) -> None:
        x_ni = part.body.X_ni + u.reshape(-1, 2)
        found["loads"].append(load)
        found["reactions"].append(-float(system.forces(u)[driven]))
        found["gaps"].append(float(x_ni[ends[0], 1] - x_ni[ends[1], 1]))
        found["touching"].append(sum(len(contact.touching(u.reshape(-1, 2)).w_m) for contact in system.contacts))

    system.path(loads, report)
    return found | {"iterations": system.iterations}
