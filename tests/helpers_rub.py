"""A block on a rigid base, pressed, pulled at its side and let back: eight cells, with friction."""

from __future__ import annotations

from pathlib import Path

RUB = """\
name = "rub"
[shapes]
block = {{ rectangle = [0, 0.05, 1, 0.25] }}
layer = {{ rectangle = [0, 0, 1, 0.05] }}
[regions.block]
shape = "block"
solid = {{ E = 100, nu = 0.3 }}
hold = "medium"
[regions.layer]
shape = "layer"
medium = {{ {medium} }}
[mesh]
cells = "quadrilaterals"
size = 0.5
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
history = [[0, 0], [1, 1]]
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
    """Problem file of the block.

    Args:
        directory: where to write it.
        solve: lines of its [solve] table.
        medium: its entries.
        history: of the pull.
    """
    path = directory / "rub.toml"
    path.write_text(RUB.format(solve=solve, medium=medium, history=history))
    return path
