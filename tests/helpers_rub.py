"""A block on a rigid base, pressed, pulled at its side and let back: twelve cells, four with friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals

RUB = """\
name = "rub"
[regions.block]
solid = {{ E = 100, nu = 0.3 }}
hold = "medium"
[regions.layer]
medium = {{ {medium} }}
[mesh]
file = "rub.vtu"
[edges]
base = {{ line = [[0, 0], [1, 0]] }}
back = {{ line = [[0, 0.25], [1, 0.25]] }}
side = {{ line = [[1, 0.05], [1, 0.25]] }}
[[support]]
at = "base"
ux = 0
uy = 0
[[load]]
name = "press"
at = "back"
traction = [0, -0.1]
history = [[0, 0], [0.2, 2e-4], [0.4, 2e-3], [0.6, 0.02], [0.8, 0.2], [1, 1]]
[[load]]
name = "slide"
at = "side"
ux = 0.001
history = {history}
[solve]
{solve}
"""
MEDIUM = 'energy = "balanced", regulariser = "angle_log", alpha = 2.5, h = 0.05, mu = 10, gamma = 1e-5, friction = 0.3'
HISTORY = "[[1, 0], [2, 1], [3, 0.5]]"


def rub(directory: Path, solve: str = "", medium: str = MEDIUM, history: str = HISTORY) -> Path:
    """Problem file of the block, beside its mesh.

    Args:
        directory: where to write it.
        solve: lines of its [solve] table.
        medium: its entries.
        history: of the pull.
    """
    layers = [Rectangle("layer", 0.0, 1.0, 0.0, 0.05), Rectangle("block", 0.0, 1.0, 0.05, 0.25)]
    write_mesh(
        structured_quadrilaterals(np.linspace(0.0, 1.0, 5), [0.0, 0.05, 0.15, 0.25], layers), directory / "rub.vtu"
    )
    path = directory / "rub.toml"
    path.write_text(RUB.format(solve=solve, medium=medium, history=history))
    return path
