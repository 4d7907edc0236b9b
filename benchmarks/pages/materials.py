"""Block of docs/materials.md."""

from __future__ import annotations

import incompressible as studies

from pages.block import Block
from pages.runs import Measure, percent, table
from tmc_vem.problems.moduli import Moduli


def incompressible(measure: Measure) -> str:
    """How much the reaction of a bonded block falls with cells half as large, by K / mu."""
    rows = []
    for ratio in studies.RATIOS:
        row = [f"{ratio:g}", f"{Moduli(ratio, 1.0).nu:.6f}"]
        for cells, order in studies.ELEMENTS:
            coarse, fine = (measure(studies.press, ratio, cells, order, across) for across in studies.ACROSS)
            row += [percent(fine["reaction"] / coarse["reaction"] - 1.0, 1), f"{fine['iterations']:.0f}"]
        rows.append(row)
    names = [f"{cells}, order {order}" for cells, order in studies.ELEMENTS]
    columns = [heading for name in names for heading in (name, "iterations")]
    return table(("K / mu", "nu", *columns), rows)


BLOCKS = (Block("materials-incompressible", "seconds", incompressible),)
