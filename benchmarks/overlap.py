"""What it costs to look whether solids overlap, beside a tangent and a residual of the same state.

    python benchmarks/overlap.py [--cells 40 10 80 20 640 160] [--method vem]

The state is the undeformed box: outlines that are simple, as nearly always. "cell by cell" is what follows where they
are not; "dense J" counts inverted cells, at the end of a run and when a step fails. A minute on one core.
"""

from __future__ import annotations

import argparse

from harness import interleaved, report
from mpi4py import MPI

from tmc_vem.problems import Box
from tmc_vem.simulation import METHODS, RunOptions, discretise
from tmc_vem.simulation.overlap import OverlapWatch
from tmc_vem.system.discretisation import Evaluation, RegionValues

SQUEEZED = Evaluation(0.0, {"medium": RegionValues(0.0, 0.05)})


def main() -> None:
    """Print seconds and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[40, 10, 80, 20, 640, 160], help="pairs")
    parser.add_argument("--method", choices=METHODS, default="vem")
    options = parser.parse_args()
    rows, results = [], []
    for nx, ny in zip(options.cells[::2], options.cells[1::2], strict=True):
        system = discretise(Box(cells=(nx, ny)), RunOptions(options.method), MPI.COMM_WORLD)
        watch = OverlapWatch(system, ["medium"], 2)
        u, residual, matrix = system.create_vector(), system.create_vector(), system.create_matrix()
        work = {
            "outline": lambda watch=watch, u=u: watch.refusal(u, SQUEEZED),
            "cell by cell": lambda watch=watch, u=u: watch.closely(u),
            "dense J": lambda system=system, u=u: system.dense_jacobians(u),
            "residual": lambda system=system, u=u, residual=residual: system.residual(u, residual),
            "tangent": lambda system=system, u=u, matrix=matrix: system.jacobian(u, matrix),
        }
        samples = interleaved(work, 5)
        values = {name: sample.median for name, sample in samples.items()}
        rows.append([f"{nx} x {ny}", str(system.n_dofs), *(f"{1e3 * value:.2f}" for value in values.values())])
        results.append({"cells": [nx, ny], "dofs": system.n_dofs, **values})
    report("overlap", "Milliseconds, median of 5.", ["cells", "dofs", *values], rows, {"rows": results})


if __name__ == "__main__":
    main()
