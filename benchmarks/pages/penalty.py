"""Blocks of docs/interior-penalty.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise, takewhile
from typing import Any

import interior_penalty as studies
import penalty_blocks as studies_of_blocks
import penalty_contact as contact

from pages.block import Block
from pages.runs import Measure, percent, table
from tmc_vem.system.interior_penalty import INTERIOR_PENALTIES

SIZES = (8, 16, 32)
PAIR = (10.0, 1e-4)  # alpha_r, gamma: the regulariser counts
ALPHAS = (0.1, 1.0, 10.0)
GAMMAS = (1e-4, 1e-5, 1e-6)
LADDER = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
PRESSED = (1.0,)  # alpha_r of the ladder
PATIENCE = 400  # Newton iterations of a run of the ladder; those that reach full load take up to half as many
N = 2  # squares of 0.05, see contact.BOXES
SIZES_OF = {"squares": "40 x 10", "triangles": "40 x 10, cut in two", "Voronoi": "as many as 40 x 10",
            "bricks": "40 x 10", "hanging nodes": "40 x 10, medium halved"}  # fmt: skip
# in the table of meshes: cells, n, method; the last of each are the finest
COMPARED = (("squares", 2, "vem"), ("squares", 2, "fem"), ("squares", 4, "vem"), ("squares", 4, "fem"),
            ("Voronoi", 2, "vem"), ("Voronoi", 4, "vem"), ("hanging nodes", 2, "vem"))  # fmt: skip
FINEST = (("squares", 4, "vem"), ("squares", 4, "fem"), ("Voronoi", 4, "vem"), ("hanging nodes", 2, "vem"))

Run = Mapping[str, Any]


def linear(measure: Measure) -> str:
    """Amplitude over the exact one."""
    rows = []
    for mesh in studies.MESHES:
        for kind in INTERIOR_PENALTIES:
            found = [measure(studies.amplitude, mesh, n, kind) for n in SIZES]
            rows.append([mesh, kind, *(f"{value:.4f}" for value in found)])
    return table(("cells", "interior penalty", *(f"{n} x {n}" for n in SIZES)), rows)


def box(measure: Measure) -> str:
    """The box where the regulariser counts, on finer meshes, and how far they are apart."""
    rows = []
    found: dict[tuple[Any, ...], Run] = {}
    for mesh, n, method in COMPARED:
        for kind in INTERIOR_PENALTIES:
            run = measure(contact.box, mesh, n, kind, *PAIR, *([method] if method == "fem" else []))
            found[mesh, n, method, kind] = run
            rows.append([f"{mesh}, {20 * n} x {5 * n}", method, kind, f"{run['gap']:.3e}", f"{run['in_cells']:.2e}",
                         f"{run['regulariser']:.2e}", str(run["iterations"])])  # fmt: skip
    head = ("cells", "method", "interior penalty", "gap", "energy of the regulariser in cells", "and between them",
            "Newton iterations")  # fmt: skip
    parts = []
    for kind in ("full", "penalty", "none"):
        finest = [found[*of, kind] for of in FINEST]
        apart = [_spread(run[name] for run in finest) for name in ("gap", "regulariser")]
        parts.append(f"{100 * apart[0]:.1f} and {100 * apart[1]:.1f} % with `{kind}`")
    text = (
        "The finest squares, by both methods, Voronoi cells and hanging nodes have gaps and energies of the "
        f"regulariser within {', '.join(parts)}."
    )
    return f"{table(head, rows)}\n\n{text}"


def _spread(values: Iterable[float]) -> float:
    """Distance of the smallest and the largest, relative to the largest."""
    known = list(values)
    return (max(known) - min(known)) / max(known)


def accuracy(measure: Measure) -> str:
    """The box with three weights of the regulariser on all kinds of cells."""
    rows = []
    found: dict[tuple[str, str], list[Run]] = {}
    for mesh, size in SIZES_OF.items():
        for kind in INTERIOR_PENALTIES:
            runs = [measure(contact.box, mesh, N, kind, alpha_r, 1e-4) for alpha_r in ALPHAS]
            found[mesh, kind] = runs
            rows.append([f"{mesh}, {size}", kind, *_values(runs)])
    for mesh, element in (("squares", "Q2"), ("triangles", "P2")):
        runs = [measure(contact.box, mesh, N, "full", alpha_r, 1e-4, "fem") for alpha_r in ALPHAS]
        rows.append([f"{mesh}, {SIZES_OF[mesh]}: finite elements, {element}", "full", *_values(runs)])
    head = ("cells", "interior penalty", *(f"gap, alpha_r = {alpha_r:g}" for alpha_r in ALPHAS),
            *(f"energy, alpha_r = {alpha_r:g}" for alpha_r in ALPHAS))  # fmt: skip
    lines = []
    for kind in INTERIOR_PENALTIES:
        apart = [[100 * _spread(found[mesh, kind][n][name] for mesh in SIZES_OF) for n in range(len(ALPHAS))]
                 for name in ("gap", "regulariser")]  # fmt: skip
        gaps, energies = (", ".join(f"{value:.0f}" for value in values) for values in apart)
        lines.append(f"with `{kind}` gaps by up to {gaps} %, energies by up to {energies} %")
    text = f"From mesh to mesh, at alpha_r = 0.1, 1, 10: {'; '.join(lines)}."
    return f"{table(head, rows)}\n\n{text}"


def _values(runs: Iterable[Run]) -> list[str]:
    """Gaps, then energies of the regulariser."""
    known = list(runs)
    return [*(_shown(run, "gap", 3) for run in known), *(_shown(run, "regulariser", 2) for run in known)]


def _shown(run: Run, name: str, digits: int) -> str:
    return f"{run[name]:.{digits}e}" if run["complete"] else f"stops at {100 * run['load']:.0f} % of the load"


def weight(measure: Measure) -> str:
    """What the weight of the regulariser does to the gap."""
    rows = []
    for mesh in ("squares", "Voronoi"):
        for kind in ("none", "full"):
            changes = []
            for gamma in GAMMAS:
                runs = [measure(contact.box, mesh, N, kind, alpha_r, gamma) for alpha_r in ALPHAS]
                changes += [percent(b["gap"] / a["gap"] - 1, 1) if a["complete"] and b["complete"] else "stops before"
                            for a, b in pairwise(runs)]  # fmt: skip
            rows.append([f"{mesh}, {SIZES_OF[mesh]}", kind, *changes])
    head = ("cells", "interior penalty", *(f"{a:g} to {b:g} at gamma = {gamma:.0e}" for gamma in GAMMAS
                                           for a, b in pairwise(ALPHAS)))  # fmt: skip
    return table(head, rows)


def effort(measure: Measure) -> str:
    """Iterations, factors, and the smallest gamma that is reached."""
    rows = []
    for mesh in SIZES_OF:
        without = measure(contact.factor, mesh, 2 * N, "none")
        for kind in INTERIOR_PENALTIES:
            counts = [measure(contact.box, mesh, N, kind, alpha_r, 1e-4)["iterations"] for alpha_r in ALPHAS]
            made = measure(contact.factor, mesh, 2 * N, kind)
            ratios = [f"{made[name] / without[name]:.1f}" for name in ("entries", "factor", "operations")]
            reached = [_smallest(measure, mesh, kind, alpha_r) for alpha_r in PRESSED]
            rows.append([mesh, kind, ", ".join(map(str, counts)), *ratios, ", ".join(reached)])
    head = ("cells", "interior penalty", "Newton iterations", "entries of the matrix", "of its factor",
            "operations of the factorisation", "smallest gamma")  # fmt: skip
    return table(head, rows)


def _smallest(measure: Measure, mesh: str, kind: str, alpha_r: float) -> str:
    """The smallest power of ten with which the coarse box reaches full load: down from the middle one, or up."""

    def works(gamma: float) -> bool:
        return bool(measure(contact.box, mesh, 1, kind, alpha_r, gamma, "vem", PATIENCE)["complete"])

    middle = LADDER.index(1e-6)
    if works(LADDER[middle]):
        below = takewhile(works, LADDER[middle + 1 :])
        return f"{[LADDER[middle], *below][-1]:.0e}"
    return next((f"{gamma:.0e}" for gamma in reversed(LADDER[:middle]) if works(gamma)), "none")


def squeezed(measure: Measure) -> str:
    """Flush blocks in the media that keep them apart."""
    rows = []
    for regulariser in ("angle_log", "huhu_log"):
        for cells in ("voronoi", "triangles", "quadrilaterals"):
            runs = [measure(studies_of_blocks.blocks, cells, kind, regulariser, gamma) for gamma in (1e-4, 1e-5)
                    for kind in INTERIOR_PENALTIES]  # fmt: skip
            rows.append([regulariser, cells, *(_effort(run) for run in runs)])
    head = ("regulariser", "cells", *(f"{kind}, gamma = {gamma}" for gamma in ("1e-4", "1e-5")
                                      for kind in INTERIOR_PENALTIES))  # fmt: skip
    return table(head, rows)


def _effort(run: Run) -> str:
    return f"{run['iterations']} iterations" if run["complete"] else f"stops at {100 * run['load']:.0f} % of the load"


def limits(measure: Measure) -> str:
    """What squares converge to, with and without the interior penalty."""
    rows = []
    for alpha_r in reversed(ALPHAS):
        for kind in ("none", "full"):
            runs = [measure(contact.box, "squares", n, kind, alpha_r, 1e-4) for n in (1, 2, 4)]
            rows.append([f"{alpha_r:g}", kind, *(f"{run['gap']:.3e} / {run['regulariser']:.2e}" for run in runs)])
    return table(("alpha_r", "interior penalty", *(f"{20 * n} x {5 * n}" for n in (1, 2, 4))), rows)


def eta(measure: Measure) -> str:
    """Smallest coercive factor."""
    rows = []
    for mesh in studies.MESHES:
        found = [measure(studies.smallest_eta, mesh, 4, order) for order in (2, 3)]
        rows.append([mesh, *(f"{value:.1f}" for value in found)])
    return table(("4 x 4 cells", "k = 2", "k = 3"), rows)


BLOCKS = (
    Block("penalty-eta", "minutes", eta),
    Block("penalty-linear", "minutes", linear),
    Block("penalty-box", "minutes", box),
    Block("penalty-alpha", "minutes", accuracy),
    Block("penalty-weight", "minutes", weight),
    Block("penalty-effort", "minutes", effort),
    Block("penalty-blocks", "minutes", squeezed),
    Block("penalty-limits", "minutes", limits),
)
