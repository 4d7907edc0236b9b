#!/usr/bin/env python3
"""Processor time and memory to generate, check, write and read Voronoi meshes of two regions.

python benchmarks/mesh_generation.py            # up to 100 000 cells
python benchmarks/mesh_generation.py --quick    # up to 10 000
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.voronoi import voronoi_mesh

LOWER = Region("lower", [(0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.0, 0.5)])
UPPER = Region("upper", [(0.0, 0.5), (1.0, 0.5), (1.0, 1.0), (0.0, 1.0)])


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Result and processor time: a busy machine does not change it."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def main() -> None:
    """Print a line a size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 10 000 cells")
    sizes = (1_000, 10_000) if parser.parse_args().quick else (1_000, 10_000, 100_000)
    print(f"{'cells':>8} {'generate':>9} {'check':>7} {'write':>7} {'read':>7}  processor s; largest memory so far")
    for wanted in sizes:
        mesh, generate = timed(lambda n=wanted: voronoi_mesh([LOWER, UPPER], n**-0.5))  # type: ignore[misc]
        faults, check = timed(lambda m=mesh: find_faults(m))  # type: ignore[misc]
        assert not faults, faults[0].message
        with tempfile.TemporaryDirectory() as directory:
            path = Path(directory) / "mesh.vtu"
            _, write = timed(lambda m=mesh, p=path: write_mesh(m, p))  # type: ignore[misc]
            _, read = timed(lambda p=path: read_mesh(p))  # type: ignore[misc]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(f"{mesh.n_cells:8d} {generate:9.2f} {check:7.2f} {write:7.2f} {read:7.2f}  {memory:.2f} GB")


if __name__ == "__main__":
    main()
