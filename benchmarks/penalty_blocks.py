"""Two blocks with medium flush between them: what the interior penalty does where a medium is squeezed hard.

``scripts/refresh-numbers penalty-blocks`` measures, keeps, and writes into docs/interior-penalty.md.
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

MEDIUM = 'energy = "balanced", regulariser = "{regulariser}", alpha = 0.25, gamma = {gamma}'
MOST_ITERATIONS = 250  # of a run that gets nowhere


def blocks(cells: str, kind: str, regulariser: str, gamma: float) -> dict[str, Any]:
    """Whether the blocks are pressed together in full, and the effort.

    Args:
        cells: 'voronoi', 'triangles' or 'quadrilaterals'.
        kind: of the interior penalty.
        regulariser: of the medium that pulls nothing in.
        gamma: its stiffness.
    """
    solve = f'max_iterations = {MOST_ITERATIONS}\nelement = {{ interior_penalty = "{kind}" }}'
    medium = MEDIUM.format(regulariser=regulariser, gamma=gamma)
    with TemporaryDirectory() as directory:
        problem, options = read_problem(helpers_blocks.blocks(Path(directory), solve, medium=medium, cells=cells))
        result = run(problem, options=options)
    return {"complete": result.complete, "load": result.load, "gap": result.gap, "iterations": result.newton_iterations}
