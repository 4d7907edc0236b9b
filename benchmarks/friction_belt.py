"""The belt of demos/demo_belt.py, with nodes of the drum where those of the belt arrive, or below their first places.

python benchmarks/friction_belt.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "demos"))

import demo_belt as belt

CASES = ((0.1, 120, True), (0.3, 60, True), (0.3, 120, True), (0.3, 120, False))  # friction, cells, nodes that meet


def slide(friction: float, cells: int, meet: bool) -> dict[str, float]:
    """Force at the head over that at the tail and growth of the logarithm of the pressure per angle, with their
    analytic values."""
    with tempfile.TemporaryDirectory() as directory:
        result = belt.solve(friction, Path(directory), belt.belt_mesh(cells, belt.GAP / belt.RADIUS if meet else 0.0))
        found = belt.Found.of(result)
    return {"ratio": found.ratio, "thin": belt.ratio(friction), "thick": belt.ratio(belt.exponent(friction)),
            "growth": found.growth, "exponent": belt.exponent(friction),
            "stretch": result.history[-1].friction["layer"]["contact_j"]}  # fmt: skip


if __name__ == "__main__":
    for case in CASES:
        print(case, slide(*case))
