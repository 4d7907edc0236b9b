"""The block of demos/demo_sliding_block.py on an elastic base: its drag, and the coefficient that friction alone shows.

python benchmarks/friction_base.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from tmc_vem import run
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.simulation.problem_file import read_problem

FORCE, BLOCK = 0.1, 200.0
MODULI = (2000.0, 200.0, 20.0, 4.0)  # of the base
X = np.linspace(-0.4, 1.4, 37)
Y = (-0.3, -0.2, -0.1, -0.05, 0.0, 0.025, 0.05, 0.1, 0.15)
PROBLEM = f"""
name = "block on an elastic base"
[mesh]
file = "base.vtu"
[regions.base]
solid = {{ E = {BLOCK}, nu = 0.3 }}
[regions.block]
solid = {{ E = {BLOCK}, nu = 0.3 }}
hold = "medium"
[regions.medium.medium]
energy = "balanced"
regulariser = "angle_log"
alpha = 2.5
h = 0.05
mu = 10
gamma = 1e-5
friction = 0.3
[edges]
bottom = {{ line = [[-0.4, -0.3], [1.4, -0.3]] }}
back = {{ line = [[0, 0.15], [1, 0.15]] }}
side = {{ line = [[1, 0.05], [1, 0.15]] }}
[[support]]
at = "bottom"
ux = 0
uy = 0
[[load]]
name = "press"
at = "back"
traction = [0, {-FORCE}]
history = [[0, 0], [1, 1]]
[[load]]
name = "slide"
at = "side"
ux = 0.01
history = [[1, 0], [2, 1]]
[solve]
largest_step = 0.25
"""


def slide(young: float) -> dict[str, float]:
    """Pulling force over the normal force at the end of the pull, and what the block's contact shows."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory)
        rectangles = [
            Rectangle("base", X[0], X[-1], Y[0], 0.0),
            Rectangle("medium", X[0], X[-1], 0.0, Y[-1]),
            Rectangle("block", 0.0, 1.0, 0.05, Y[-1]),
        ]
        write_mesh(structured_quadrilaterals(X, Y, rectangles), path / "base.vtu")
        (path / "block.toml").write_text(PROBLEM)
        problem, options = read_problem(path / "block.toml", {"regions.base.solid.E": young})
        result = run(problem, path / "run", options)
    assert result.complete, result.reason
    last = result.history[-1]
    return {"ratio": last.forces["slide"]["reaction"] / FORCE, "sticking": last.contact["block"]["sticking"],
            "coefficient": last.contact["block"]["friction_coefficient"],
            "stretch": last.friction["medium"]["contact_j"]}  # fmt: skip


if __name__ == "__main__":
    for young in MODULI:
        print(young, slide(young))
