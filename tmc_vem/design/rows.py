"""Rows of history.csv: what an evaluation of a design gave."""

from __future__ import annotations

import math
from typing import Any

from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.optimise import DesignStep

# What the columns of limits begin with: value / limit - 1, in the sense in which it is satisfied where not positive.
LIMIT = "limit "


def row_of(step: DesignStep, evaluator: Evaluator) -> dict[str, Any]:
    """Columns and values of an evaluation, with the same columns for all of a search.

    The objective is in the sense of the problem: what is to be made large is large. Without an equilibrium it is
    empty, as are results and limits.
    """
    iterate, worth = step.iterate, step.worth
    evaluation, sign = iterate.evaluation, evaluator.table.sign
    known = math.isfinite(evaluation.objective)
    limits = zip(evaluator.constraints, evaluation.constraints.tolist(), strict=True)
    return {
        "evaluation": step.number,
        "better": int(iterate.better),
        "objective": sign * evaluation.objective if known else "",
        "volume": worth.volume,
        "change": iterate.change,
        **{f"{LIMIT}{name}": value if known else "" for name, value in limits},
        **{name: worth.values.get(name, "") for name in evaluator.names},
        "level": step.level,
        "beta": "" if step.projection is None else step.projection.beta,
        "newton_iterations": worth.iterations,
        "seconds": round(worth.seconds, 4),
        "note": "; ".join(worth.notes),
    }
