"""Blocks of docs/projection.md that need no contact."""

from __future__ import annotations

import numpy as np
import projection_space as studies

from pages.block import Block
from pages.runs import Measure, percent, table
from tmc_vem.vem.spaces.element_settings import PROJECTIONS

SLIVER = "sliver 1 : 10"


def extension(measure: Measure) -> str:
    """Energy of modes relative to the best extension."""
    rows = []
    for n in (0, 1, 3, 7):
        found = [measure(studies.extension, n, name) for name in studies.SPACES]
        rows.append([str(n), *(", ".join(f"{ratio:.2f}" for ratio in ratios) for ratios in found)])
    return table(("hanging nodes", *studies.SPACES), rows)


def zoo(measure: Measure) -> str:
    """Rank and conditioning."""

    def entry(found: tuple[float, str] | None) -> str:
        return "–" if found is None else f"{found[0]:.1e} {found[1]}"

    rows = [[name, *(entry(measure(studies.conditioning, name, p)) for p in PROJECTIONS)] for name in studies.zoo()]
    bound = measure(studies.bound_by_quadratics, SLIVER)
    text = f"With the largest eigenvalue of `composite`, displacements in P_2 allow at most {bound:.1e} on the sliver."
    return f"{table(('polygon', *PROJECTIONS), rows)}\n\n{text}"


def rates(measure: Measure) -> str:
    """Errors on an interface with hanging nodes."""
    rows = []
    for projection in PROJECTIONS:
        last = None
        for n in (4, 8, 16):
            found = measure(studies.interface_errors, projection, n)
            if found is None:
                rows.append([projection, str(n), *["–"] * 6])
                continue
            orders = ["–"] * 3 if last is None else [f"{x:.2f}" for x in np.log2(np.array(last) / found)]
            rows.append([projection, str(n), *(x for pair in zip((f"{e:.3e}" for e in found), orders, strict=True)
                                                for x in pair)])  # fmt: skip
            last = found
    head = ("projection", "n", "displacement", "rate", "gradient", "rate", "second gradient, hanging", "rate")
    return table(head, rows)


def beam(measure: Measure) -> str:
    """Force at the end of a beam."""
    exact = measure(studies.beam_force, 80, 8, 1, "full")
    rows = []
    for cells, layers in ((10, 1), (20, 2)):
        for r in (1, 2, 4, 8):
            forces = [measure(studies.beam_force, cells, layers, r, projection) for projection in PROJECTIONS]
            entries = ["–" if force is None else percent(force / exact - 1) for force in forces]
            rows.append([f"{cells} x {layers}", str(r - 1), *entries])
    return table(("cells", "hanging nodes", *PROJECTIONS), rows)


BLOCKS = (
    Block("projection-extension", "seconds", extension),
    Block("projection-zoo", "seconds", zoo),
    Block("projection-rates", "seconds", rates),
    Block("projection-beam", "seconds", beam),
)
