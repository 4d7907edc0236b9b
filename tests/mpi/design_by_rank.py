"""Search for a design on the ranks of mpirun, with two load cases and two methods; the directory is the argument."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers_design import cantilever

from tmc_vem import optimise

CASES = [{"name": "down"}, {"name": "up", "set": {"load.force": [0, 0.002]}}]

if __name__ == "__main__":
    there = Path(sys.argv[1])
    for method in ("oc", "mma"):
        problem, options = cantilever(there, {"design.cases": CASES, "design.method": method})
        optimise(problem, there / method, options, final=False, animation=False)
