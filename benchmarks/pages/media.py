"""Blocks of docs/guide/media.md."""

from __future__ import annotations

import re
from typing import Any

import box_runs
import media as studies

from pages import guide
from pages.block import Block
from pages.runs import ROOT, Measure, table

Values = dict[str, Any]
MEDIA = [("the paper's", 2.5), ("balanced", 0.25), ("balanced", 2.5)]  # with alpha
CASES = [(problem, *medium) for problem in studies.PROBLEMS for medium in MEDIA]
MESHES = [("voronoi", 0.1), ("voronoi", 0.05), ("quadrilaterals", 0.1), ("triangles", 0.1)]
GAMMAS = (1e-4, 1e-6)


def _runs(measure: Measure, problem: str, medium: str, alpha: float, gamma: float) -> list[Values]:
    """By mesh."""
    return [measure(studies.pressed, problem, medium, alpha, gamma, *mesh) for mesh in MESHES]


def _good(run: Values) -> bool:
    """Whether a run is what it should be."""
    return run["load"] == 1.0 and not run["jumps"] and run["dense_min_j"] > 0.0


def summary(measure: Measure) -> str:
    """How many of the runs of a problem in a medium are what they should be."""
    rows = []
    for problem, medium, alpha in CASES:
        runs = [run for gamma in GAMMAS for run in _runs(measure, problem, medium, alpha, gamma)]
        full = [run for run in runs if run["load"] == 1.0]
        effort = sorted(run["iterations"] for run in full)
        deepest = max(run["depth"] for run in runs)
        rows.append(
            [problem, f"{medium}, {alpha:g}", f"{sum(map(_good, runs))} of {len(runs)}", str(len(full)),
             str(sum(run["jumps"] > 0 for run in full)), str(sum(run["dense_min_j"] <= 0.0 for run in full)),
             f"{deepest:.0e}" if deepest else "none", f"{effort[0]} to {effort[-1]}" if effort else ""]
        )  # fmt: skip
    head = ("problem", "medium, alpha", "good", "full load", "with a jump", "with J < 0 inside", "deepest overlap",
            "Newton iterations to full load")  # fmt: skip
    return table(head, rows)


def _entry(run: Values) -> str:
    """A run in few words: iterations and smallest J, or where it stops and why."""
    jumps = f", {run['jumps']} jump{'s' * (run['jumps'] > 1)}" if run["jumps"] else ""
    j = f"J = {run['dense_min_j']:.0e}"
    if run["load"] == 1.0:
        return f"{run['iterations']}{jumps}, {j}"
    why = ", would overlap" if run["reason"].startswith("solids would") else ""
    return f"stops at {100 * run['load']:.0f} %{why}{jumps}, {j}"


def blocks(measure: Measure) -> str:
    """Every run."""
    rows = [
        [problem, f"{medium}, {alpha:g}", f"{gamma:.0e}", *map(_entry, _runs(measure, problem, medium, alpha, gamma))]
        for problem, medium, alpha in CASES
        for gamma in GAMMAS
    ]
    return table(("problem", "medium, alpha", "gamma", *(f"{cells}, h = {h:g}" for cells, h in MESHES)), rows)


def demos(measure: Measure) -> str:
    """The problems of the guide, each in its own medium and in the other one; alpha is that of the file."""
    texts = {name: (ROOT / path).read_text() for name, path in guide.EXAMPLES.items()} | {"plug": guide.plug()}
    rows, choices = [], []
    for name, text in texts.items():
        inverted = {}
        for medium, entries in studies.MEDIA.items():
            run = measure(box_runs.problem, _in_medium(text, entries))
            reached = "full load" if run["load"] == 1.0 else f"{100 * run['load']:.0f} % of the load"
            own = " (the file's)" if entries in text else ""
            numbers = (str(run["iterations"]), str(run["jumps"]), f"{run['gap']:.2e}", f"{run['reaction']:.4e}")
            rows.append([name, f"{medium}{own}", reached, *numbers, str(run["inverted"])])
            inverted[entries in text] = run["inverted"]
        choices.append(inverted[True] < inverted[False])
    head = ("problem", "medium", "reached", "Newton iterations", "jumps", "gap", "reaction", "cells with J < 0 inside")
    fewer = "each file takes" if all(choices) else "not every file takes"
    return f"{table(head, rows)}\n\nOf the two media {fewer} the one with fewer cells that are inverted inside."


def _in_medium(text: str, entries: str) -> str:
    """A problem file with another energy and regulariser of its medium."""
    found, n = re.subn(r'(\nmedium = \{)( energy = "\w+",)?( .*)?regulariser = "\w+"', rf"\1\3{entries}", text)
    assert n == 1, text
    return found


BLOCKS = (
    Block("media-demos", "minutes", demos),
    Block("media-summary", "minutes", summary),
    Block("media-blocks", "minutes", blocks),
)
