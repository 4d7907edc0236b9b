"""Blocks of docs/solver.md, and of docs/performance.md on reuse and quadrature."""

from __future__ import annotations

from typing import Any

import box_runs
import solver_strategies as studies

from pages.block import Block
from pages.runs import Measure, percent, table

PAIRS = [(alpha_r, gamma) for alpha_r in (10.0, 1.0, 0.1) for gamma in (1e-4, 1e-5, 1e-6)]
# beyond table 2: rule of the virtual elements, pairs of method and strategy
SMALL = ((1e-7, "auto", ("default",)), (1e-7, "triangles", ("linear", "default", "continuation")),
         (1e-8, "triangles", ("continuation",)))  # fmt: skip
QUADRATURE = [  # cells, regulariser, beta, alpha_r, gamma
    ("quadrilaterals", "huhu_lulu", 5.0, 1.0, 1e-5),
    ("quadrilaterals", "huhu_lulu", 5.0, 0.1, 1e-6),
    ("quadrilaterals", "huhu_lulu", 5.0, 10.0, 1e-4),
    ("quadrilaterals", "angle", 0.0, 1.0, 1e-5),
    ("voronoi", "huhu_lulu", 5.0, 1.0, 1e-5),
    ("voronoi", "huhu_lulu", 5.0, 10.0, 1e-4),
]
RULES: dict[str, dict[str, Any]] = {
    "triangles": {"rule": "triangles"}, "auto": {"rule": "auto"}, "compressed": {"rule": "compressed"},
    "degree 10": {"rule": "triangles", "quadrature": 10},
}  # fmt: skip


def _entry(run: dict[str, Any]) -> str:
    reached = "" if run["load"] == 1.0 else f", stops at {100 * run['load']:.0f} % of the load"
    jumped = f", {run['jumps']} jump{'s' * (run['jumps'] > 1)}" if run["jumps"] else ""
    return f"{run['iterations']} in {run['steps']}{reached}{jumped}{', stiffened' if run['stiffened'] else ''}"


def strategies(measure: Measure) -> str:
    """Iterations and steps by strategy."""
    columns = [("vem", name) for name in ("linear", "default", "continuation")]
    columns += [("fem", name) for name in ("default", "continuation")]
    rows = []
    for alpha_r, gamma in PAIRS:
        row = [f"{alpha_r:g}, {gamma:.0e}"]
        for method, name in columns:
            idle = name == "continuation" and gamma >= 1e-4
            row.append("" if idle else _entry(measure(studies.effort, alpha_r, gamma, name, method=method)))
        rows.append(row)
    for gamma, rule, names in SMALL:
        found = {name: _entry(measure(studies.effort, 0.1, gamma, name, rule=rule)) for name in names}
        cells = [found.get(name, "") if method == "vem" else "" for method, name in columns]
        rows.append([f"0.1, {gamma:.0e}, `--rule {rule}`", *cells])
    penalised = measure(studies.effort, 0.1, 1e-7, "continuation", method="fem", penalty="penalty")
    rows.append(["0.1, 1e-07, `--interior-penalty penalty`", "", "", "", "", _entry(penalised)])
    equal = []
    for alpha_r, gamma in ((1.0, 1e-5), (0.1, 1e-6)):
        runs = [measure(studies.effort, alpha_r, gamma, name)["iterations"] for name in ("equal", "cubic")]
        equal.append(f"{runs[0]} iterations and {runs[1]} iterations at ({alpha_r:g}, {gamma:.0e})")
    head = ("alpha_r, gamma", *(f"{method.upper()} {name}" for method, name in columns))
    text = (
        "A hundred equal steps with linear extrapolation, and automatic ones with `cubic`, take "
        f"{', and '.join(equal)}."
    )
    return f"{table(head, rows)}\n\n{text}"


def hard(measure: Measure) -> str:
    """C-box, stiff punch and several bodies."""
    labels = {"cbox": "C-box to u_y = -1, gamma = 1e-5, alpha_r = 1", "punch": "punch of stiffness 100, gamma = 1e-5",
              "bodies 1": "several bodies, case 1", "bodies 2": "several bodies, case 2"}  # fmt: skip
    rows = []
    for name, label in labels.items():
        run = measure(box_runs.figure_problem, name)
        checks = run["checks"]
        fold = f"{checks['fold_depth']:.0e}, {checks['overlap_area']:.0e}" if checks.get("fold_depth") else "none"
        reached = "full load" if run["load"] == 1.0 else f"{100 * run['load']:.0f} % of the load"
        rows.append([label, reached, str(run["steps"]), str(run["iterations"]), str(run["jumps"]), fold,
                     str(run["inverted"])])  # fmt: skip
    head = ("problem", "reached", "steps", "Newton iterations", "jumps", "fold: depth, area", "cells with J < 0")
    return table(head, rows)


def reuse(measure: Measure) -> str:
    """Factorisations with and without reuse of a tangent."""
    rows = []
    for cells in ((40, 10), (80, 20)):
        runs = [measure(studies.reused, cells, reuse) for reuse in (False, True)]
        change = abs(runs[1]["gap"] / runs[0]["gap"] - 1)
        rows.append([f"{cells[0]} x {cells[1]}", *(f"{run['factorisations']} in {run['iterations']}" for run in runs),
                     "below 1e-8" if change < 1e-8 else f"{change:.0e}"])  # fmt: skip
    return table(("cells", "without: factorisations in iterations", "with", "change of the gap"), rows)


def quadrature(measure: Measure) -> str:
    """Gap against the quadrature rule."""
    rows = []
    for kind, regulariser, beta, alpha_r, gamma in QUADRATURE:
        settings = {"box": {"cell_kind": kind}, "medium": {"regulariser": regulariser, "beta": beta}}
        runs = {name: measure(box_runs.box, (40, 10), alpha_r, gamma, element=rule, **settings)
                for name, rule in RULES.items()}  # fmt: skip
        base = runs["triangles"]["gap"]
        changes = [percent(runs[name]["gap"] / base - 1, 3) for name in RULES if name != "triangles"]
        counts = " / ".join(str(run["iterations"]) for run in runs.values())
        rows.append([f"{kind}, {regulariser}, {alpha_r:g}, {gamma:.0e}", f"{base:.5e}", *changes, counts])
    head = (
        "cells, regulariser, alpha_r, gamma",
        "gap, `triangles`",
        "`auto`",
        "`compressed`",
        "degree 10",
        "iterations",
    )
    return table(head, rows)


BLOCKS = (
    Block("solver-strategies", "minutes", strategies),
    Block("solver-hard", "minutes", hard),
    Block("solver-reuse", "minutes", reuse),
    Block("quadrature", "minutes", quadrature),
)
