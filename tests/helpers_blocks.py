"""Two blocks with medium between them: own problems that go wrong in ways that are known."""

from __future__ import annotations

from pathlib import Path

BLOCKS = """\
name = "blocks"
gap = ["tip", "ground"]
[shapes]
low = {{ rectangle = [0, 0, 1, 0.4] }}
up = {{ rectangle = [{left}, 0.6, {right}, 1] }}
between = {{ rectangle = {frame} }}
[regions.low]
shape = "low"
solid = {{ K = 20, mu = 10 }}
[regions.up]
shape = "up"
solid = {{ K = 20, mu = 10 }}
[regions.medium]
shape = "between - low - up"
medium = {{ {medium} }}
[mesh]
cells = "{cells}"
size = {size}
[points]
tip = [0.5, 0.6]
ground = [0.5, 0.4]
[edges]
bottom = {{ line = [[0, 0], [1, 0]] }}
top = {{ line = [[{left}, 1], [{right}, 1]] }}
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = {uy}
[solve]
{solve}
"""


def blocks(directory: Path, solve: str = "", **values: object) -> Path:
    """Problem file of an upper block over a lower one, with medium of the same width between them.

    Args:
        directory: where to write it.
        solve: lines of its [solve] table.
        values: left, right, top, medium, cells, size and uy, where they are not the usual ones; of the usual medium
            also gamma and alpha_r; frame, a rectangle, for medium wherever it has no block, instead of top.
    """
    usual = {"left": 0, "right": 1, "top": 0.6, "gamma": 1e-4, "alpha_r": 0.01, "cells": "voronoi", "size": 0.1}
    chosen = {**usual, "uy": -0.25, "solve": solve, **values}
    chosen.setdefault("medium", f"gamma = {chosen['gamma']}, alpha_r = {chosen['alpha_r']}")
    chosen.setdefault("frame", [0, 0.4, 1, chosen["top"]])
    path = directory / "blocks.toml"
    path.write_text(BLOCKS.format(**chosen))
    return path
