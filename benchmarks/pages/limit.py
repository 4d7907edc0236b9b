"""Blocks of docs/howto/limit.md."""

from __future__ import annotations

import gamma_limit
import numpy as np

from pages.block import Block
from pages.runs import Measure, table


def _percent(share: float, digits: int = 1) -> str:
    return f"{100.0 * share:.{digits}f} %"


def calibration(measure: Measure) -> str:
    """How many limits hold."""
    rows, total = [], [0, 0]
    for name in gamma_limit.PROBLEMS:
        found = list(gamma_limit.cases(measure(gamma_limit.values_by_gamma, name)))
        given = [case for case in found if case.made.value is not None]
        covered = sum(case.covered for case in given)
        total = [total[0] + covered, total[1] + len(given)]
        widths = np.array([case.width for case in given])
        rows.append(
            [name, str(len({case.load for case in found})), str(len(given)), str(len(found) - len(given)),
             _percent(covered / len(given), 0), _percent(sum(case.covered_by_plain for case in given) / len(given), 0),
             _percent(np.median(widths)), _percent(np.quantile(widths, 0.9))]
        )  # fmt: skip
    head = ("problem", "loads", "limits", "withheld", "covered", "covered by the distance of two plain limits",
            "uncertainty, median", "nine of ten below")  # fmt: skip
    return f"{table(head, rows)}\n\nOf {total[1]} limits {total[0]} hold."


BLOCKS = (Block("limit-calibration", "minutes", calibration),)
