"""Blocks of docs/howto/adaptive-meshes.md."""

from __future__ import annotations

from typing import Any

import adaptivity

from pages.block import Block
from pages.runs import Measure, table

TITLES = {"hertz": "Hertz", "cbox": "C-box, pad", "box": "box, pad"}


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %"


def effectivity(measure: Measure) -> str:
    """Estimated and true errors of all rounds."""
    rows = []
    for name, case in adaptivity.CASES.items():
        for of in case.of:
            runs = measure(adaptivity.adaptive, name, of)
            exact = adaptivity.reference(runs, of)
            rounds = [each for each in runs[-1]["rounds"] if of in each["errors"]]
            ratios = []
            for each in rounds[:-1]:  # the last one made the reference
                ratios.append(f"{each['errors'][of] / (exact - each['values'][of]):.2f}")
            errors = [_percent(abs(1.0 - each["values"][of] / exact)) for each in (rounds[0], rounds[-1])]
            rows.append([TITLES[name], of, *errors, ", ".join(ratios) or "-", rounds[-1]["estimate"]])
    head = (
        "problem",
        "result",
        "true error, first mesh",
        "last mesh",
        "estimated over true, round by round",
        "last one",
    )
    return table(head, rows)


def against_uniform(measure: Measure) -> str:
    """Unknowns and errors of adaptive and uniform meshes."""
    rows = []
    for name in adaptivity.CASES:
        runs = measure(adaptivity.adaptive, name, "reaction")
        exact = adaptivity.reference(runs, "reaction")
        both = [("adaptive", each) for each in runs] + [("uniform", each) for each in _uniform(measure, name)]
        for kind, each in both:
            what = f"{kind}, {each['tolerance']}" if kind == "adaptive" else f"{kind}, {each['size']:g}"
            error = _percent(abs(each["values"]["reaction"] / exact - 1.0))
            rows.append([TITLES[name], what, str(each["n_dofs"]), error])
    return table(("problem", "mesh, tolerance or size", "degrees of freedom", "error of the reaction"), rows)


def carried_over(measure: Measure) -> str:
    """States that go on on a mesh with all cells cut."""
    rows = []
    for name in adaptivity.CASES:
        found: dict[str, Any] = measure(adaptivity.carried_over, name)
        rows.append(
            [TITLES[name], str(found["n_dofs"]), found["found"], str(found["iterations"]), str(found["from_start"])]
        )
    return table(("problem", "degrees of freedom", "how", "iterations", "from the beginning"), rows)


def _uniform(measure: Measure, name: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = measure(adaptivity.uniform, name)
    return found


BLOCKS = (
    Block("adaptive-effectivity", "minutes", effectivity),
    Block("adaptive-uniform", "minutes", against_uniform),
    Block("adaptive-carried", "minutes", carried_over),
)
