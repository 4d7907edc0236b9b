"""A small problem file: a plug above a base, with medium between them."""

from __future__ import annotations

from pathlib import Path

PLUG = """\
name = "plug"
gap = ["tip", "ground"]

[shapes]
frame = { rectangle = [0, 0, 1, 1] }
base = { rectangle = [0, 0, 1, 0.3] }
plug = { rectangle = [0.3, 0.5, 0.7, 1.0] }

[regions.base]
shape = "base"
solid = { K = 20, mu = 10 }

[regions.plug]
shape = "plug"
solid = { E = 25, nu = 0.3 }

[regions.medium]
shape = "frame - base - plug"
medium = { mu = 10, gamma = 1e-4, alpha_r = 1, regulariser = "huhu_lulu" }

[mesh]
cells = "triangles"
size = 0.25
refine = [{ near = [0.5, 0.5], size = 0.2 }]

[points]
tip = [0.5, 0.5]
ground = [0.5, 0.3]

[probes]
side = { displacement = "ux", at = [0.7, 0.75] }
hold = { reaction = "uy", at = "bottom" }

[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { between = ["plug", "outside"] }

[[support]]
at = "bottom"
ux = 0
uy = 0

[[support]]
at = "top"
ux = 0

[load]
at = "top"
uy = -0.02

[solve]
steps = 1
snapshots = 0
"""


def plug(directory: Path, *changes: tuple[str, str]) -> Path:
    """The file in a directory, with some words replaced by others."""
    text = PLUG
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = directory / "plug.toml"
    path.write_text(text)
    return path
