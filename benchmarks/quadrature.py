"""How much the quadrature rule changes the gap of the box: the evidence for the default.

    python benchmarks/quadrature.py [--cells 40 10]

The reference is degree 10 on all sub-triangles. Two minutes on one core.
"""

from __future__ import annotations

import argparse

from harness import report

from tmc_vem.problems import Box, Medium
from tmc_vem.simulation import RunOptions, run
from tmc_vem.vem.spaces.element_settings import RULES, ElementSettings

CASES = [  # cells, regulariser, beta, alpha_r, gamma
    ("quadrilaterals", "huhu_lulu", 5.0, 1.0, 1e-5),
    ("quadrilaterals", "huhu_lulu", 5.0, 0.1, 1e-6),
    ("quadrilaterals", "huhu_lulu", 5.0, 10.0, 1e-4),
    ("quadrilaterals", "angle", 0.0, 1.0, 1e-5),
    ("voronoi", "huhu_lulu", 5.0, 1.0, 1e-5),
    ("voronoi", "huhu_lulu", 5.0, 10.0, 1e-4),
]
SETTINGS = {rule: ElementSettings(rule=rule) for rule in RULES}
SETTINGS["degree 10"] = ElementSettings(quadrature=10, rule="triangles")


def main() -> None:
    """Print gaps and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs=2, default=[40, 10])
    cells = tuple(parser.parse_args().cells)
    rows, results = [], []
    for kind, regulariser, beta, alpha_r, gamma in CASES:
        medium = Medium(gamma=gamma, alpha_r=alpha_r, beta=beta, regulariser=regulariser)
        found = {}
        for name, element in SETTINGS.items():
            result = run(Box(cells=cells, cell_kind=kind, medium=medium), None, RunOptions(element=element))
            found[name] = {"gap": result.gap, "iterations": result.newton_iterations, "complete": result.complete}
        case = {"cells": kind, "regulariser": regulariser, "alpha_r": alpha_r, "gamma": gamma}
        results.append({**case, "rules": found})
        reference = found["triangles"]["gap"]
        cell = f"{kind}, {regulariser}, {alpha_r:g}, {gamma:g}"
        changes = [f"{100 * (found[name]['gap'] / reference - 1):+.3f} %" for name in SETTINGS if name != "triangles"]
        rows.append((cell, f"{reference:.6e}", *changes, " ".join(str(found[name]["iterations"]) for name in SETTINGS)))
    columns = ("cells, regulariser, alpha_r, gamma", "gap, triangles")
    changed = tuple(name for name in SETTINGS if name != "triangles")
    title = f"Gap of the box on {cells[0]} x {cells[1]} cells, change against the rule on all sub-triangles"
    report("quadrature", title, (*columns, *changed, "iterations"), rows, {"results": results})


if __name__ == "__main__":
    main()
