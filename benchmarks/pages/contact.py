"""Blocks of docs/projection.md on contact."""

from __future__ import annotations

from typing import Any

import projection_contact as studies

from pages.block import Block
from pages.runs import Measure, percent, table

Values = dict[str, Any]
ENERGY = "energy of the regulariser"


def _box(measure: Measure, gamma: float, projection: str, mesh: str, *numbers: int) -> Values:
    found: Values = measure(studies.tiled, mesh, list(numbers), gamma, projection)
    return found


def _entries(run: Values, base: Values | None = None) -> list[str]:
    """Gap, mean gap, energy of the regulariser, reaction, and mean gap and reaction relative to another run."""
    found = [f"{run['gap']:.3e}", f"{run['mean']:.3e}", f"{run['regulariser']:.2e}", f"{run['reaction']:.4e}"]
    if base is not None:
        found += ["" if run is base else percent(run[name] / base[name] - 1, 1) for name in ("mean", "reaction")]
    if run["load"] < 1.0:
        found[0] += f", stops at {100 * run['load']:.0f} % of the load"
    return found


def points(measure: Measure) -> str:
    """Only the cells at the loaded nodes are refined, or all others."""
    rows = []
    moved = []
    for n in (1, 2):
        runs = [_box(measure, 1e-5, "auto", "points", n, times) for times in range(4)]
        rows += [[f"{0.1 / n:g}", f"{times} times", *_entries(run)] for times, run in enumerate(runs)]
        moved.append(runs[-1]["gap"] / runs[0]["gap"] - 1)
    rows += [[f"{0.1 / n:g}", "kept at 0.1", *_entries(_box(measure, 1e-5, "auto", "kept", n))] for n in (2, 4)]
    slices = {gamma: [_box(measure, gamma, "auto", "conforming", r)["gap"] for r in (1, 4)] for gamma in (1e-5, 1e-6)}
    cut = {gamma: gaps[1] / gaps[0] - 1 for gamma, gaps in slices.items()}
    text = (
        f"The squares at the points alone move the gap by {percent(moved[0], 1)} and {percent(moved[1], 1)}. Cutting "
        f"the wall of the coarsest mesh in 4 slices, without any hanging node, can only add functions: it moves the "
        f"gap by {percent(cut[1e-5], 0)} at gamma = 1e-5 and by {percent(cut[1e-6], 0)} at 1e-6."
    )
    return table(("squares of", "at the points refined", "gap", "mean gap", ENERGY, "reaction"), rows) + f"\n\n{text}"


def hanging(measure: Measure) -> str:
    """Hanging nodes at the wall."""
    rows, changes, to_conforming = [], [], {}
    for gamma, slices in ((1e-4, ()), (1e-5, (2, 4, 8)), (1e-6, (4,))):
        runs = {f"hanging, r = {r}": _box(measure, gamma, "auto", "hanging", r) for r in (2, 4, 8)}
        base = _box(measure, gamma, "auto", "equal", 1)
        more = {f"conforming, r = {r}": _box(measure, gamma, "auto", "conforming", r) for r in slices}
        fine = {"kept, squares of 0.025": _box(measure, gamma, "auto", "kept", 4)}
        changes += [[abs(run[name] / base[name] - 1) for name in ("mean", "reaction")] for run in runs.values()]
        for r in slices:
            hung, fits = runs[f"hanging, r = {r}"], more[f"conforming, r = {r}"]
            to_conforming.setdefault(gamma, []).append(abs(hung["mean"] / fits["mean"] - 1))
        for label, run in {"r = 1": base, **runs, **more, **fine}.items():
            rows.append([f"{gamma:.0e}", label, *_entries(run, base), str(run["iterations"])])
    mean, reaction = (100 * max(column) for column in zip(*changes, strict=True))
    head = ("gamma", "mesh", "gap", "mean gap", ENERGY, "reaction", "mean gap to r = 1", "reaction to r = 1",
            "Newton iterations")  # fmt: skip
    apart = " and ".join(f"{100 * max(found):.1f} % at {gamma:.0e}" for gamma, found in to_conforming.items())
    text = (
        f"Hanging nodes change the mean gap by up to {mean:.1f} % and the reaction by up to {reaction:.1f} %. From "
        f"conforming meshes with as many nodes on the faces the mean gap differs by up to {apart}."
    )
    return f"{table(head, rows)}\n\n{text}"


def medium(measure: Measure) -> str:
    """Hanging nodes all over the medium."""
    rows = []
    for gamma, meshes in ((1e-5, ("bricks", "coarse middle row")), (1e-6, ("bricks",))):
        base = _box(measure, gamma, "auto", "equal", 1)
        rows.append(["squares", f"{gamma:.0e}", "auto", *_entries(base, base)])
        for mesh in meshes:
            numbers = (1,) if mesh == "bricks" else ()
            for projection in ("auto", "full"):
                run = _box(measure, gamma, projection, mesh, *numbers)
                rows.append([mesh, f"{gamma:.0e}", projection, *_entries(run, base)])
    head = ("mesh", "gamma", "projection", "gap", "mean gap", ENERGY, "reaction", "mean gap to squares",
            "reaction to squares")  # fmt: skip
    return table(head, rows)


def crushed(measure: Measure) -> str:
    """Composite functions on squares."""
    rows = [[name, *_entries(_box(measure, 1e-6, name, "equal", 1))] for name in ("auto", "composite")]
    return table(("projection", "gap", "mean gap", ENERGY, "reaction"), rows)


def cbox(measure: Measure) -> str:
    """The C-box with various projections."""
    rows = []
    for projection in ("auto", "full", "composite", "macro"):
        for refinement in (1, 2):
            run = measure(studies.cbox, refinement, projection)
            gap = f"{run['gap']:.5f}" if run["load"] == 1.0 else f"stops at {100 * run['load']:.0f} % of the load"
            rows.append([projection, str(refinement), gap, f"{run['regulariser']:.2e}", f"{run['reaction']:.4e}",
                         str(run["iterations"])])  # fmt: skip
    return table(("projection", "medium's cells divided by", "gap", ENERGY, "reaction", "Newton iterations"), rows)


def bricks(measure: Measure) -> str:
    """What bricks do to the gap, for the page on verification."""
    parts = []
    for gamma in (1e-5, 1e-6):
        squares, found = (_box(measure, gamma, "auto", mesh, 1) for mesh in ("equal", "bricks"))
        point, mean = (percent(found[name] / squares[name] - 1, 1) for name in ("gap", "mean"))
        parts.append(f"{point} and {mean} at gamma = {gamma:.0e}")
    return (
        "Bricks in the medium, on a mesh of 20 x 5 squares and so much coarser, change the gap at the point and the "
        f"mean gap by {', by '.join(parts)} ([details](../projection.md))."
    )


BLOCKS = (
    Block("contact-points", "minutes", points),
    Block("contact-hanging", "minutes", hanging),
    Block("contact-medium", "minutes", medium),
    Block("contact-crushed", "seconds", crushed),
    Block("contact-cbox", "minutes", cbox),
)
