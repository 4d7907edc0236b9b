"""Start-up: ``tmc-vem --help``, and the time before the first Newton iteration of a cached run.

    python benchmarks/startup.py

Every measurement is a process of its own; kernels are in the cache.
"""

from __future__ import annotations

import subprocess
import sys
import time

from harness import report

# Stops the run when the first Newton iteration begins.
FIRST_ITERATION = """
import sys
from tmc_vem.solve import newton
class Begun(BaseException): pass
def begin(self, *args, **kwargs): raise Begun
newton.NewtonSolver.solve = newton.NewtonSolver.predict = begin
from tmc_vem.cli.main import main
sys.argv = ["tmc-vem", *sys.argv[1:]]
try: main()
except Begun: sys.exit(0)
sys.exit(1)
"""
HELP = "import sys; from tmc_vem.cli.main import main; sys.argv = ['tmc-vem', '--help']; main()"
COMMANDS = {
    "tmc-vem --help": [HELP],
    "import petsc4py, mpi4py, scipy": [
        "import petsc4py; petsc4py.init(); from petsc4py import PETSc; from mpi4py import MPI; import scipy.sparse"
    ],
    "run box --cells 40 10, quadrilaterals": [FIRST_ITERATION, "run", "box", "--cells", "40", "10", "--quiet"],
    "run box --cells 40 10, voronoi": [
        FIRST_ITERATION,
        "run",
        "box",
        "--cells",
        "40",
        "10",
        "--mesh",
        "voronoi",
        "--quiet",
    ],
}


def main() -> None:
    """Print times and write them."""
    results: dict[str, dict[str, float]] = {}
    for label, (code, *arguments) in COMMANDS.items():
        seconds = []
        for _ in range(6):
            started = time.perf_counter()
            subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True)
            seconds.append(time.perf_counter() - started)
        results[label] = {"first": seconds[0], "best": min(seconds[1:]), "median": sorted(seconds[1:])[2]}
    rows = [(label, f"{r['best']:.2f} s", f"{r['median']:.2f} s") for label, r in results.items()]
    report("startup", "Start-up, whole processes", ("command", "best of 5", "median"), rows, {"results": results})


if __name__ == "__main__":
    main()
