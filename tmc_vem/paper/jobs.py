"""Runs of the box for the tables and figures of section 5.1."""

from __future__ import annotations

from typing import Any

from tmc_vem.batch import Job
from tmc_vem.problems import Box, Medium
from tmc_vem.simulation import RunOptions

Cells = tuple[int, int]
COST = {"vem": 1.0, "fem": 2.0}  # time of a run relative to virtual elements on the same mesh


def box_job(method: str, cells: Cells, medium: Medium, **options: Any) -> Job:
    """A run of the box up to u_y = -1."""
    cost = COST[method] * (cells[0] * cells[1] / 400.0 + 0.5) * (2.0 if medium.gamma < 1e-5 else 1.0)
    damping = "" if medium.beta else "-undamped"
    label = f"box-{method}-{cells[0]}x{cells[1]}-{medium.regulariser}{damping}-a{medium.alpha_r:g}-g{medium.gamma:g}"
    return Job(label, Box(cells=cells, medium=medium), RunOptions(method=method, **options), cost)
