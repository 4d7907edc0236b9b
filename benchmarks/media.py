"""Blocks that are pressed together in several media: the measurements behind docs/guide/media.md.

The table is made by ``scripts/refresh-numbers docs/guide/media.md``, from the functions of this file.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import helpers_blocks

from tmc_vem.simulation import run
from tmc_vem.simulation.problem_file import read_problem

WIDTH = 0.2  # of the gap, t
# Where the upper block begins and ends, and the frame that is medium where there is no block; the lower block is
# [0, 1] x [0, 0.4], the gap 0.2 wide.
PROBLEMS = {
    "flush": (0, 1, [0, 0.4, 1, 0.6]),
    "flush, margin t": (0, 1, [-0.2, 0, 1.2, 1]),
    "overhang": (0.2, 0.8, [0.2, 0.4, 0.8, 0.6]),
    "overhang, margin t": (0.2, 0.8, [0, 0.4, 1, 1]),
}
PUNCH = "overhang, margin t"  # a square punch in a wide medium
MEDIA = {
    "the paper's": 'regulariser = "angle"',
    "balanced": 'energy = "balanced", regulariser = "angle_log"',
}
MOST_ITERATIONS = 200


def pressed(problem: str, medium: str, alpha: float, gamma: float, cells: str, size: float) -> dict[str, Any]:
    """How far two blocks get that are pressed together by 1.25 gap widths, and what the last state is like.

    Args:
        problem, medium: names in ``PROBLEMS`` and ``MEDIA``.
        alpha: alpha_r / (mu t^2).
        gamma: stiffness of the medium.
        cells, size: of the mesh.
    """
    left, right, frame = PROBLEMS[problem]
    entries = f"{MEDIA[medium]}, alpha = {alpha}, gamma = {gamma}"
    with TemporaryDirectory() as directory:
        path = helpers_blocks.blocks(
            Path(directory), f"max_iterations = {MOST_ITERATIONS}", left=left, right=right, frame=frame,
            medium=entries, cells=cells, size=size,
        )  # fmt: skip
        own, options = read_problem(path)
        result = run(own, None, options)
    return {
        "load": result.load,
        "reason": result.reason,
        "gap": result.gap,
        "depth": result.checks["penetration_depth"],
        "jumps": sum(record.jumped for record in result.history),
        "dense_min_j": result.checks["dense_min_j"]["medium"],
        "inverted": sum(result.checks["inverted_cells"].values()),
        "iterations": result.newton_iterations,
    }
