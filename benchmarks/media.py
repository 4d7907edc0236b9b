"""Blocks that are pressed together in several media: the measurements behind docs/guide/media.md.

The table is made by ``scripts/refresh-numbers docs/guide/media.md``, from the functions of this file.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tmc_vem.simulation import run
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import ConvergenceError

WIDTH = 0.2  # of the gap, t
# Shapes of the upper block and of the medium; the lower block is [0, 1] x [0, 0.4], the gap 0.2 wide.
PROBLEMS = {
    "flush": ("[0, 0.6, 1, 1]", "[0, 0.4, 1, 0.6]"),
    "flush, margin t": ("[0, 0.6, 1, 1]", "[-0.2, 0, 1.2, 1]"),
    "overhang": ("[0.2, 0.6, 0.8, 1]", "[0.2, 0.4, 0.8, 0.6]"),
    "overhang, margin t": ("[0.2, 0.6, 0.8, 1]", "[0, 0.4, 1, 1]"),
}
PUNCH = "overhang, margin t"  # a square punch in a wide medium
MEDIA = {
    "the paper's": 'regulariser = "angle"',
    "balanced": 'energy = "balanced", regulariser = "angle_log"',
}
MOST_ITERATIONS = 200
TEXT = """\
name = "blocks"
gap = ["tip", "ground"]
[shapes]
low = {{ rectangle = [0, 0, 1, 0.4] }}
up = {{ rectangle = {up} }}
frame = {{ rectangle = {frame} }}
[regions.low]
shape = "low"
solid = {{ K = 20, mu = 10 }}
[regions.up]
shape = "up"
solid = {{ K = 20, mu = 10 }}
[regions.medium]
shape = "frame - low - up"
medium = {{ {medium}, alpha = {alpha}, gamma = {gamma} }}
[mesh]
cells = "{cells}"
size = {size}
[points]
tip = [0.5, 0.6]
ground = [0.5, 0.4]
[edges]
bottom = {{ line = [[0, 0], [1, 0]] }}
top = {{ between = ["up", "outside"], box = [0, 0.99, 1, 1.01] }}
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.25
[solve]
max_iterations = {most}
"""


def pressed(problem: str, medium: str, alpha: float, gamma: float, cells: str, size: float) -> dict[str, Any]:
    """How far two blocks get that are pressed together by 1.25 gap widths, and what the last state is like.

    Args:
        problem, medium: names in ``PROBLEMS`` and ``MEDIA``.
        alpha: alpha_r / (mu t^2).
        gamma: stiffness of the medium.
        cells, size: of the mesh.
    """
    up, frame = PROBLEMS[problem]
    text = TEXT.format(
        up=up, frame=frame, medium=MEDIA[medium], alpha=alpha, gamma=gamma, cells=cells, size=size, most=MOST_ITERATIONS
    )
    with TemporaryDirectory() as directory:
        path = Path(directory) / "blocks.toml"
        path.write_text(text)
        own, options = read_problem(path)
        try:
            result = run(own, None, options)
        except ConvergenceError as error:
            return {"load": 0.0, "reason": str(error)}
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
