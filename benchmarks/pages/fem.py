"""Blocks of docs/fem.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import box_runs
import fem_studies as studies
import numpy as np

from pages.block import Block
from pages.runs import Measure, percent, table
from tmc_vem.report.richardson import Extrapolation, extrapolate
from tmc_vem.study.paper.values import Printed, table2

MODES = ("none", "penalty", "full")
ELEMENTS = {"Q2": False, "P2": True}
LINEAR_CELLS = (4, 8, 16, 32)
ETAS = (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)
CONVERGENCE_PAIRS = ((1.0, 1e-4), (1.0, 1e-5), (10.0, 1e-4))
CONVERGENCE_MESHES = (2, 4, 8)


def shown(run: Mapping[str, Any]) -> str:
    """Gap for a table, or where the load stopped."""
    if "error" in run:
        return str(run["error"])
    return f"{run['gap']:.4e}" if run["load"] == 1.0 else f"stops at {100 * run['load']:.0f} % of the load"


def linear(measure: Measure) -> str:
    """Errors on a problem with a known solution."""
    rows = []
    for mode in MODES:
        for element, triangles in ELEMENTS.items():
            errors = np.array([measure(studies.linear_errors, n, mode, triangles) for n in LINEAR_CELLS])
            rates = np.log2(errors[-2] / errors[-1]) + 0.0
            cells = [f"{natural:#.3g} / {gradient:#.3g}" for natural, gradient in errors]
            rows.append([mode, element, *cells, " / ".join(f"{round(rate, 2) + 0.0:.2f}" for rate in rates)])
    return table(("second gradient", "element", *(f"{n} x {n}" for n in LINEAR_CELLS), "last rate"), rows)


def coercivity(measure: Measure) -> str:
    """Negative eigenvalues against eta."""
    rows = [
        [f"{eta:g}", *(str(measure(studies.negative_eigenvalues, eta, triangles)) for triangles in ELEMENTS.values())]
        for eta in (0.5, 1.0, 1.5, 2.0, 10.0)
    ]
    return table(("eta", *ELEMENTS), rows)


def eta(measure: Measure) -> str:
    """Gap against eta, and how far it moves."""
    columns = [(mode, triangles) for mode in ("penalty", "full") for triangles in (False, True)]
    runs = {
        (factor, *column): measure(
            studies.fem, (20, 10), 1.0, 1e-5, interior_penalty=column[0], triangles=column[1], eta=factor
        )
        for factor in ETAS
        for column in columns
    }
    rows = [[f"{factor:g}", *(shown(runs[factor, *column]) for column in columns)] for factor in ETAS]

    def moves(triangles: bool, low: float, high: float) -> float:
        """Spread of the gap relative to that at eta = 10, both modes."""
        spreads = []
        for mode in ("penalty", "full"):
            found = {e: runs[e, mode, triangles] for e in ETAS if low <= e <= high}
            gaps = [run["gap"] for run in found.values() if run.get("load") == 1.0]
            spreads.append((max(gaps) - min(gaps)) / found[10.0]["gap"])
        return max(spreads)

    head = ("eta", *(f"{mode}, {'P2' if triangles else 'Q2'}" for mode, triangles in columns))
    text = (
        f"Where the full load is reached, the gap moves on Q2 by {100 * moves(False, 1, 1000):.1f} % over all these "
        f"values and by {100 * moves(False, 3, 100):.1f} % from 3 to 100; on P2, which is far from converged on "
        f"this mesh, by {100 * moves(True, 3, 100):.0f} % from 3 to 100 and by "
        f"{100 * moves(True, 3, 1000):.0f} % up to 1000."
    )
    return f"{table(head, rows)}\n\n{text}"


def regulariser(measure: Measure) -> str:
    """Energy of the regulariser under refinement."""
    meshes = ((20, 5), (40, 10), (80, 20))
    found = {
        (mode, element): [measure(studies.regulariser_energy, cells, mode, triangles) for cells in meshes]
        for mode in MODES
        for element, triangles in ELEMENTS.items()
    }
    rows = [[*labels, *(f"{energy:.3e}" for energy in energies)] for labels, energies in found.items()]
    finest = {labels: energies[-1] for labels, energies in found.items()}
    limit = finest["full", "Q2"]
    off = {labels: percent(energy / limit - 1, 1) for labels, energy in finest.items()}
    text = (
        f"On the finest mesh, relative to `full` with Q2: `full` with P2 {off['full', 'P2']}, `penalty` "
        f"{off['penalty', 'Q2']} (Q2) and {off['penalty', 'P2']} (P2), `none` {off['none', 'Q2']} and "
        f"{off['none', 'P2']}."
    )
    return table(("second gradient", "element", *(f"{x} x {y}" for x, y in meshes)), rows) + f"\n\n{text}"


def quadrature(measure: Measure) -> str:
    """Gap against the degree of the quadrature."""
    degrees = (2, 3, 4, 5, 6, 8)
    found = {
        (degree, element): measure(studies.fem, (40, 10), 1.0, 1e-5, quadrature=degree, triangles=triangles)
        for degree in degrees
        for element, triangles in ELEMENTS.items()
    }

    def entry(run: Mapping[str, Any]) -> str:
        return f"{shown(run)} ({run['iterations']} iterations)" if run.get("load") == 1.0 else shown(run)

    rows = [[str(degree), *(entry(found[degree, element]) for element in ELEMENTS)] for degree in degrees]
    moves = []
    for element in ELEMENTS:
        gaps = [found[degree, element]["gap"] for degree in degrees if degree >= 4]
        moves.append(100 * (max(gaps) - min(gaps)) / gaps[-1])
    text = f"From degree 4 on, the gap moves by {moves[0]:.2f} % on Q2 and {moves[1]:.2f} % on P2."
    return table(("degree", *ELEMENTS), rows) + f"\n\n{text}"


def table_2(measure: Measure) -> str:
    """The nine pairs of Table 2 on a fine mesh of Q2."""
    cells, rows, off = (80, 20), [], []
    for (alpha_r, gamma), printed in table2().items():
        run = measure(studies.fem, cells, alpha_r, gamma)
        paper = printed["fem_fine"]
        deviation = None
        if paper.usable and paper.value:
            deviation = run["gap"] / paper.value - 1
            off.append(abs(deviation))
        rows.append([f"{alpha_r:g}", f"{gamma:.0e}", shown(run), _paper(paper), "–" if deviation is None else
                     percent(deviation), f"{run['regulariser']:.2e}", str(run["steps"]),
                     str(run["iterations"])])  # fmt: skip
    head = ("alpha_r", "gamma", "gap", "paper's FEM", "difference", "energy of the regulariser", "steps",
            "Newton iterations")  # fmt: skip
    text = f"The largest difference is {100 * max(off):.1f} %."
    return f"{table(head, rows)}\n\n{text}"


def _paper(cell: Printed) -> str:
    return "suspect" if cell.suspect else "no convergence" if cell.value is None else f"{cell.value:.4e}"


def both_methods(measure: Measure, n: int, pair: tuple[float, float]) -> list[tuple[float, float]]:
    """Gap and energy of the regulariser of finite and of virtual elements on 20 n x 5 n squares."""
    cells = (20 * n, 5 * n)
    fem, vem = measure(studies.fem, cells, *pair), measure(box_runs.box, cells, *pair)
    return [(fem["gap"], fem["regulariser"]), (vem["gap"], vem["checks"]["regulariser_energy"])]


def convergence(measure: Measure) -> str:
    """Mesh-converged gaps of both methods, with uncertainty."""
    rows, apart, moved = [], [], []
    for pair in CONVERGENCE_PAIRS:
        found = np.array([both_methods(measure, n, pair) for n in CONVERGENCE_MESHES])
        gaps = found[:, :, 0]
        apart.append(np.abs(gaps[:, 1] / gaps[:, 0] - 1))
        moved.append(np.abs(gaps[-1] / gaps[-2] - 1))
        for method, values in zip(("FEM", "VEM"), found.swapaxes(0, 1).tolist(), strict=True):
            limit: Extrapolation = extrapolate([1.0 / n for n in CONVERGENCE_MESHES], [gap for gap, _ in values])
            entries = [f"{gap:.4e} / {energy:.2e}" for gap, energy in values]
            rows.append([f"{pair[0]:g}", f"{pair[1]:.0e}", method, *entries, str(limit)])
    text = (
        f"On the same squares the two methods differ by up to {100 * np.max(apart):.2f} %, on the finest by up to "
        f"{100 * np.max(np.array(apart)[:, -1]):.2f} %. From the second mesh to the finest the gaps still move by "
        f"{100 * np.min(moved):.1f} to {100 * np.max(moved):.1f} %."
    )
    head = ("alpha_r", "gamma", "method", *(f"{20 * n} x {5 * n}" for n in CONVERGENCE_MESHES), "extrapolated")
    return f"{table(head, rows)}\n\n{text}"


BLOCKS = (
    Block("fem-linear", "minutes", linear),
    Block("fem-coercivity", "minutes", coercivity),
    Block("fem-eta", "minutes", eta),
    Block("fem-regulariser", "minutes", regulariser),
    Block("fem-quadrature", "minutes", quadrature),
    Block("fem-table2", "minutes", table_2),
    Block("fem-convergence", "minutes", convergence),
)
