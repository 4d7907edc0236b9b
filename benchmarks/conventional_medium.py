"""The third medium on the solids' meshes of the conventional reference: what docs/guide/verification.md compares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tmc_vem.problems import Box, CBox, Medium, Problem
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.simulation.problem_file import read_problem

HERTZ = Path(__file__).resolve().parents[1] / "demos" / "problems" / "hertz.toml"


def limits(name: str, cells: Sequence[int], gamma: float, loads: Sequence[float]) -> list[dict[str, Any]]:
    """Reactions of box or C-box (of quadrilaterals) at displacements ``-u_y`` of the load, which must increase: ``at``
    three gammas a decade apart, and the limit that the program gives with its ``uncertainty``."""
    size, most = (cells[0], cells[1]), loads[-1]
    problem: Problem
    if name == "box":
        problem = Box(cells=size, medium=Medium(gamma=gamma, alpha_r=1.0), uy=-most)
    else:
        problem = CBox(cells=size, medium=angle_medium(gamma, 1.0), solid_cells="quadrilaterals", uy=-most)
    options = RunOptions(output_loads=tuple(load / most for load in loads), extrapolate_gamma="path")
    result = run(problem, None, options)
    assert result.complete, result.reason
    assert result.limit is not None
    found = {round(abs(point.displacement), 9): point.values["reaction"] for point in result.limit.path}
    wanted = [found[round(load, 9)] for load in loads]
    return [{"at": list(each.at), "limit": each.value, "uncertainty": each.uncertainty} for each in wanted]


def hertz(gamma: float) -> dict[str, float]:
    """Force of the half, half width and peak pressure on the block, of finite elements on triangles: p^2 over x^2 is
    fitted where p is more than half of the largest."""
    problem, options = read_problem(HERTZ, {"mesh.cells": "triangles", "regions.medium.medium.gamma": gamma})
    result = run(problem, None, replace(options, method="fem"))
    assert result.complete, result.reason
    assert result.reaction is not None
    curves = result.traction()
    on_block = curves.body_n == curves.bodies.index("block")
    x, pressure = curves.point_nx[on_block, 0], curves.pressure_n[on_block]
    high = pressure > 0.5 * pressure.max()
    slope, top = np.polyfit(x[high] ** 2, pressure[high] ** 2, 1)
    return {"force": -result.reaction, "half_width": float(np.sqrt(-top / slope)), "peak": float(np.sqrt(top))}
