"""Runs of the box for the tables and figures of section 5.1."""

from __future__ import annotations

from typing import Any

from tmc_vem.problems import Box, Medium
from tmc_vem.simulation.options import RunOptions
from tmc_vem.study.batch import Job

Cells = tuple[int, int]
COST = {"vem": 1.0, "fem": 1.2}  # time of a run relative to virtual elements on the same mesh


def box_job(method: str, cells: Cells, medium: Medium, refinement: int = 1, **options: Any) -> Job:
    """A run of the box up to u_y = -1.

    Args:
        method: 'vem' or 'fem'.
        cells: squares in x and y over the whole box.
        medium: third medium.
        refinement: into how many parts the medium's cells divide the sides of the solid's.
        options: of :class:`tmc_vem.simulation.options.RunOptions`.
    """
    n_cells = cells[0] * cells[1] * (0.46 + 0.54 * refinement**2)  # the cavity has 54 % of the area
    cost = COST[method] * (n_cells / 400.0 + 0.5) ** 1.2 * (2.0 if medium.gamma < 1e-5 else 1.0)
    damping = "" if medium.beta else "-undamped"
    finer = f"-r{refinement}" if refinement > 1 else ""
    label = (
        f"box-{method}-{cells[0]}x{cells[1]}{finer}-{medium.regulariser}{damping}-a{medium.alpha_r:g}-g{medium.gamma:g}"
    )
    problem = Box(cells=cells, medium=medium, medium_refinement=refinement)
    return Job(label, problem, RunOptions(method=method, **options), cost)
