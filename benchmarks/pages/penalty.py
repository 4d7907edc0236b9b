"""Blocks of docs/interior-penalty.md."""

from __future__ import annotations

import interior_penalty as studies

from pages.block import Block
from pages.runs import Measure, table
from tmc_vem.system.interior_penalty import INTERIOR_PENALTIES

SIZES = (8, 16, 32)
PAIR = (10.0, 1e-4)  # alpha_r, gamma: the regulariser counts


def linear(measure: Measure) -> str:
    """Amplitude over the exact one."""
    rows = []
    for mesh in studies.MESHES:
        for kind in INTERIOR_PENALTIES:
            found = [measure(studies.amplitude, mesh, n, kind) for n in SIZES]
            rows.append([mesh, kind, *(f"{value:.4f}" for value in found)])
    return table(("cells", "interior penalty", *(f"{n} x {n}" for n in SIZES)), rows)


def box(measure: Measure) -> str:
    """The box at full load."""
    rows = []
    for mesh in studies.BOXES:
        methods = ("vem", "fem") if mesh.startswith("squares") else ("vem",)
        for method in methods:
            for kind in INTERIOR_PENALTIES:
                found = measure(studies.box, mesh, kind, *PAIR, method)
                rows.append(
                    [mesh, method, kind, f"{found['gap']:.3e}", f"{found['regulariser']:.2e}",
                     str(found["iterations"])]
                )  # fmt: skip
    head = ("cells", "method", "interior penalty", "gap", "energy of the regulariser in cells", "Newton iterations")
    return table(head, rows)


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
)
