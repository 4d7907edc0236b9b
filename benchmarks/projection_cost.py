"""What a tangent costs by the space that gradients are projected on, with and without hanging nodes.

    python benchmarks/projection_cost.py

Processor time of the element tangents of 4000 cells of solid, which share one shape. Seconds on one core.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from harness import interleaved, report

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from helpers_mesh import subdivide
from helpers_system import make_system, region

from tmc_vem.mesh import PolygonMesh
from tmc_vem.support.errors import TmcError
from tmc_vem.vem.kernel.batch import Tangents
from tmc_vem.vem.spaces.element_settings import PROJECTIONS, ElementSettings

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
CELLS = {"square": subdivide(SQUARE, [1, 1, 1, 1]), "3 hanging nodes": subdivide(SQUARE, [4, 1, 1, 1])}
N = 4000
COLUMNS = ("cell", "projection", "points", "dofs", "microseconds a tangent")


def main() -> None:
    """Print a table and write it."""
    work, sizes = {}, {}
    for name, polygon in CELLS.items():
        for projection in PROJECTIONS:
            mesh = PolygonMesh.from_cells(polygon, [list(range(len(polygon)))])
            try:
                system = make_system(mesh, region("solid", K=1.0, mu=1.0), (), ElementSettings(projection=projection))
            except TmcError:
                continue
            (block,) = system.blocks
            n_basis = block.batch.n_basis
            nodes_ca = np.tile(block.batch.nodes_ca, (N, 1))
            batch = replace(block.batch, shape_c=np.zeros(N, dtype=np.int32), nodes_ca=nodes_ca)
            u, tangents = np.zeros((n_basis, 2)), Tangents(np.empty((N, 2 * n_basis, 2 * n_basis)))
            key = (name, f"{projection} ({block.projection})")
            work[key] = partial(block.kernel.cells, batch, u, block.parameters, None, tangents)
            sizes[key] = (block.batch.n_points, 2 * n_basis)
    seconds = {key: samples.best / N for key, samples in interleaved(work).items()}
    rows = [(*key, *map(str, sizes[key]), f"{1e6 * best:.2f}") for key, best in seconds.items()]
    report("projection_cost", "Element tangents of a solid", COLUMNS, rows, {"columns": COLUMNS, "rows": rows})


if __name__ == "__main__":
    main()
