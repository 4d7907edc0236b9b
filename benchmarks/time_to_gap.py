"""Time to a gap within one percent of the converged one: virtual elements against the finite element path.

    python benchmarks/time_to_gap.py

Box at alpha_r = 1, gamma = 1e-5. Each method goes through its meshes from coarse to fine; the converged gap is the mean
of VEM on quadrilaterals and FEM Q2 on the finest. Kernels and forms are compiled before anything is timed.
"""

from __future__ import annotations

import time
from typing import Any

from harness import report

from tmc_vem.problems import Box, Medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.system.fem_settings import FemSettings

MESHES = [(20, 5), (20, 10), (40, 10), (40, 20), (80, 20)]
METHODS = {
    "vem, quadrilaterals": ("quadrilaterals", RunOptions()),
    "vem, voronoi": ("voronoi", RunOptions()),
    "fem Q2": ("quadrilaterals", RunOptions(method="fem")),
    "fem P2": ("quadrilaterals", RunOptions(method="fem", fem=FemSettings(triangles=True))),
}
WITHIN, REPETITIONS = 0.01, 3


def solve(method: str, cells: tuple[int, int], **more: Any) -> tuple[float, Any]:
    """Processor seconds and result of a run, nothing written."""
    kind, options = METHODS[method]
    started = time.process_time()
    result = run(Box(cells=cells, cell_kind=kind, medium=Medium(gamma=1e-5, alpha_r=1.0), **more), None, options)
    return time.process_time() - started, result


def main() -> None:
    """Print times and write them."""
    for method in METHODS:
        solve(method, MESHES[0], uy=-0.02)  # compiles
    found: dict[str, list[dict[str, Any]]] = {method: [] for method in METHODS}
    for cells in MESHES:
        # in turn, so that a busy moment of the machine falls on all methods
        repetitions = range(REPETITIONS if cells[0] < 80 else 1)
        results = [{method: solve(method, cells) for method in METHODS} for _ in repetitions]
        for method, entries in found.items():
            seconds, best = min((r[method] for r in results), key=lambda pair: pair[0])
            entries.append({
                "cells": cells, "n_dofs": best.n_dofs, "gap": best.gap, "seconds": seconds,
                "complete": best.complete, "iterations": best.newton_iterations,
            })  # fmt: skip
    finest = [found[m][-1]["gap"] for m in ("vem, quadrilaterals", "fem Q2")]
    converged = sum(finest) / 2
    rows, first = [], {}
    for method, runs in found.items():
        for entry in runs:
            error = entry["gap"] / converged - 1
            good = entry["complete"] and abs(error) <= WITHIN
            if good and method not in first:
                first[method] = entry
            rows.append((
                f"{method}, {entry['cells'][0]} x {entry['cells'][1]}", str(entry["n_dofs"]), f"{entry['gap']:.4e}",
                f"{100 * error:+.2f} %", str(entry["iterations"]), f"{entry['seconds']:.2f}",
                "first within 1 %" if first.get(method) is entry else "",
            ))  # fmt: skip
    reference = first.get("vem, quadrilaterals")
    ratios = {m: e["seconds"] / reference["seconds"] for m, e in first.items()} if reference else {}
    rows.append(
        ("seconds against vem on quadrilaterals", *[""] * 5, ", ".join(f"{m} {r:.1f}" for m, r in ratios.items()))
    )
    columns = ("method, cells", "dofs", "gap", "error", "iterations", "seconds", "")
    data = {"converged": converged, "finest": finest, "runs": found, "ratios": ratios}
    report("time_to_gap", f"Box, alpha_r = 1, gamma = 1e-5; converged gap {converged:.4e}", columns, rows, data)


if __name__ == "__main__":
    main()
