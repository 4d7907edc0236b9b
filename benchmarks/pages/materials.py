"""Blocks of docs/materials.md."""

from __future__ import annotations

import re

import box_runs
import incompressible as studies

from pages import guide
from pages.block import Block
from pages.runs import ROOT, Measure, percent, table
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


def graded(measure: Measure) -> str:
    """The finger with its graded medium, and with one gamma everywhere."""
    text = (ROOT / "demos/problems/finger.toml").read_text()
    plain, n = re.subn(r"^graded = \{ gamma.*\n", "", text, flags=re.MULTILINE)
    assert n == 1
    soft, uniform = (measure(box_runs.problem, of) for of in (text, plain))
    assert soft["load"] == uniform["load"] == 1.0
    return (
        f"With one gamma everywhere {guide.squeezed(uniform)} % of the final reaction squeezes the medium and not the "
        f"bodies, and the reaction is {uniform['reaction']:.4f}; with the graded one it is {soft['reaction']:.4f}, "
        f"and the part is {guide.squeezed(soft) or 'below 5'} %."
    )


BLOCKS = (Block("materials-incompressible", "seconds", incompressible), Block("graded", "seconds", graded))
