"""Results and their estimated errors over the degrees of freedom, round by round."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tmc_vem.report.adapted_tables import signed_error
from tmc_vem.report.labels import label
from tmc_vem.report.page import Picture, picture
from tmc_vem.report.plots import COLOURS, PANELS, axes_of, plain_ticks
from tmc_vem.report.tables import with_unit
from tmc_vem.results.adaptivity import Adaptivity, Round
from tmc_vem.results.run_result import RunResult

DOFS = "degrees of freedom"
LARGER, SMALLER = "^", "v"  # in size, the exact value by the estimate


def adapted_curves(name: str, result: RunResult, adaptivity: Adaptivity) -> list[Picture]:
    """Each result that the mesh was adapted to, and its estimated error, three results a picture."""
    names, pictures = adaptivity.of, []
    several = len(loads_of(adaptivity)) > 1
    for first in range(0, len(names), PANELS):
        some = names[first : first + PANELS]
        whose = ", relative to the last estimate at each load" if several else ""
        caption = (
            f"{', '.join(some)} round by round{whose}, with the estimated error to both sides and, as a cross, where "
            "the exact value is by the estimate; the band is the tolerance around the last cross. The estimated error "
            "alone: triangles point up where the exact value is larger in size, and are hollow if it is doubtful."
        )
        figure = curves_figure(adaptivity, some, [with_unit(each, {name: result}, each) for each in some])
        pictures.append(picture(figure, f"adapted-{first // PANELS + 1}", caption))
    return pictures


def loads_of(adaptivity: Adaptivity) -> list[tuple[float, list[Round]]]:
    """The rounds of each load, in order."""
    found: list[tuple[float, list[Round]]] = []
    for each in adaptivity.rounds:
        if not found or found[-1][0] != each.load:
            found.append((each.load, []))
        found[-1][1].append(each)
    return found


def curves_figure(adaptivity: Adaptivity, names: Sequence[str], headings: Sequence[str]) -> Any:
    """Values over errors, a column a result; beside them if there is one.

    Args:
        adaptivity: the rounds.
        names: results.
        headings: what they are called.
    """
    if len(names) == 1:
        figure, axes = axes_of(2)
        pairs = [(axes[0], axes[1])]
    else:
        figure, axes = axes_of(len(names), height=6.2, rows=2)
        pairs = list(zip(axes[: len(names)], axes[len(names) :], strict=True))
    loads = loads_of(adaptivity)
    for (upper, lower), name, heading in zip(pairs, names, headings, strict=True):
        _draw_values(upper, loads, name, adaptivity.tolerance)
        _draw_errors(lower, loads, name, adaptivity.tolerance)
        several = len(loads) > 1
        upper.set_ylabel(label(f"{name}, % off the last estimate" if several else heading))
        lower.set_ylabel(label(f"estimated error of {name}, %"))
        plain_ticks(lower.yaxis)
        for axes in (upper, lower):
            axes.set_xscale("log")
            plain_ticks(axes.xaxis)
            axes.set_xlabel(DOFS)
    pairs[0][0].legend(fontsize=8, frameon=False)
    pairs[0][1].legend(fontsize=8, framealpha=0.9, edgecolor="none")
    return figure


def _draw_values(axes: Any, loads: Sequence[tuple[float, Sequence[Round]]], name: str, tolerance: float) -> None:
    several = len(loads) > 1
    for n, (load, rounds) in enumerate(loads):
        known = [each for each in rounds if _is_number(each.values.get(name))]
        if not known:
            continue
        colour = COLOURS[n % len(COLOURS)]
        exact = _exact(known[-1], name)
        scale, shift = (100.0 / exact, 100.0) if several and exact else (1.0, 0.0)
        x = [each.n_dofs for each in known]
        y = [scale * each.values[name] - shift for each in known]
        bars = [abs(scale * each.errors.get(name, 0.0)) for each in known]
        shown = f"load {load:.4g}" if several else None
        style = {"color": colour, "linewidth": 1.2, "elinewidth": 1.0, "capsize": 3.5, "marker": "o", "markersize": 4}
        axes.errorbar(x, y, yerr=bars, label=shown, **style)
        sure = [each for each in known if name in each.errors]
        crosses = [scale * _exact(each, name) - shift for each in sure]
        axes.plot(
            [each.n_dofs for each in sure], crosses, "x", color=colour, markersize=6, markeredgewidth=1.2,
            label=None if n else "exact, by the estimate",
        )  # fmt: skip
        if n == 0 or not several:
            half = 100.0 * tolerance if several else tolerance * abs(exact)
            middle = 0.0 if several else exact
            axes.axhspan(middle - half, middle + half, color="0.5", alpha=0.15, linewidth=0.0, label="tolerance")


def _draw_errors(axes: Any, loads: Sequence[tuple[float, Sequence[Round]]], name: str, tolerance: float) -> None:
    percent = 100.0 * tolerance
    axes.set_yscale("log")
    axes.axhline(percent, color="0.4", linestyle=":", linewidth=1.2, label=f"tolerance {percent:.3g} %")
    for n, (_, rounds) in enumerate(loads):
        found = [(each, signed_error(each, name)) for each in rounds]
        points = [
            (each.n_dofs, 100.0 * error, bool(each.doubt)) for each, error in found if error and math.isfinite(error)
        ]
        if not points:
            continue
        colour = COLOURS[n % len(COLOURS)]
        sizes = [(dofs, abs(error)) for dofs, error, _ in points]
        axes.plot(*zip(*sizes, strict=True), "-", color=colour, linewidth=1.2)
        for dofs, error, doubted in points:
            mark = LARGER if error > 0.0 else SMALLER
            filled = "white" if doubted else colour
            axes.plot(dofs, abs(error), mark, color=colour, markersize=6, markerfacecolor=filled)


def _exact(round_: Round, name: str) -> float:
    """The exact value by the estimate; the value itself without one."""
    return round_.values[name] + round_.errors.get(name, 0.0)


def _is_number(value: float | None) -> bool:
    return value is not None and math.isfinite(value)
