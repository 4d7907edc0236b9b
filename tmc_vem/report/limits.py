"""Limits for gamma to 0 in a report: a table of their values, and curves along the path with their bands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tmc_vem.report.labels import label
from tmc_vem.report.page import Block, Entry, Picture, Table, picture
from tmc_vem.report.plots import COLOURS, DISPLACEMENT, PANELS, axes_of, has_several_loads
from tmc_vem.report.tables import number, with_unit
from tmc_vem.results.limit import REACTION, GammaLimit, LimitPoint, reported
from tmc_vem.results.run_result import RunResult

WITHHELD = "withheld"


def limit_blocks(name: str, result: RunResult) -> list[Block]:
    """Everything about the limits of a run; nothing if none were asked for."""
    if result.limit is None:
        return []
    return [limit_table(name, result, result.limit), *limit_curves(name, result, result.limit)]


def limit_names(runs: Mapping[str, RunResult]) -> list[str]:
    """Names of all that some runs have limits of, withheld ones included."""
    return list(dict.fromkeys(name for run in runs.values() if run.limit for name in run.limit.values))


def limit_table(name: str, result: RunResult, limit: GammaLimit) -> Table:
    """Values at each gamma, and their limits with uncertainties or why they are withheld."""
    rows: list[list[str | Entry]] = []
    for quantity, entry in limit.values.items():
        at = [number(value) for value in entry.at]
        at += ["–"] * (len(limit.gammas) - len(at))
        shown = Entry(WITHHELD, entry.reason or "", "suspect") if entry.value is None else str(entry)
        ratio = "–" if entry.ratio is None else f"{entry.ratio:.3f}"
        rows.append([with_unit(quantity, {name: result}, quantity), *at, shown, ratio])
    head = ("quantity", *(f"gamma {gamma:.3g}" for gamma in limit.gammas), "limit", "ratio")
    title = (
        "Limits for gamma to 0 at the end of the path: what contact without medium between the bodies gives on this "
        "mesh. The ratio is that of two changes over a decade of gamma, "
        f"{limit.expected_ratio:.3f} where contact is established."
    )
    return Table(title, head, rows)


def limit_curves(name: str, result: RunResult, limit: GammaLimit) -> list[Picture]:
    """Reaction, gap and all other values along the path, with the problem's gamma and in the limit with its band."""
    names = [quantity for quantity in limit.values if any(_known(limit.path, quantity))]
    pictures = []
    for first in range(0, len(names), PANELS):
        some = names[first : first + PANELS]
        figure, axes = axes_of(len(some), height=3.6, width=10.0 if len(some) > 1 else 5.5)
        for one, quantity in zip(axes, some, strict=True):
            _draw(one, result, limit, quantity, with_unit(quantity, {name: result}, quantity))
        axes[0].legend(fontsize=8, frameon=False)
        figure.supxlabel(_abscissa(name, result), fontsize=10)
        caption = f"{', '.join(some)} with the problem's gamma, and in the limit for gamma to 0 with its uncertainty."
        pictures.append(picture(figure, f"limit-{first // PANELS + 1}", caption))
    return pictures


def _draw(axes: Any, result: RunResult, limit: GammaLimit, quantity: str, what: str) -> None:
    history = [record for record in result.history if quantity in reported(record)]
    timed = has_several_loads({"": result})
    x = [record.load if timed else abs(record.displacement) for record in history]
    y = [reported(record)[quantity] for record in history]
    sign = -1.0 if quantity == REACTION and sum(y) < 0.0 else 1.0
    axes.plot(x, [sign * value for value in y], color=COLOURS[0], linewidth=1.5, label=f"gamma {limit.gammas[0]:.3g}")
    points = [(point, point.values[quantity]) for point in limit.path if quantity in point.values]
    for n, piece in enumerate(_pieces(points)):
        at = [point.load if timed else abs(point.displacement) for point, _ in piece]
        values = [sign * (entry.value or 0.0) for _, entry in piece]
        off = [entry.uncertainty or 0.0 for _, entry in piece]
        low, high = ([v + s * u for v, u in zip(values, off, strict=True)] for s in (-1.0, 1.0))
        axes.fill_between(at, low, high, color=COLOURS[1], alpha=0.25, linewidth=0.0)
        shown = "limit for gamma to 0" if n == 0 else None
        axes.plot(at, values, color=COLOURS[1], linestyle="--", marker="o", markersize=3.5, linewidth=1.2, label=shown)
    axes.set_ylabel(label(f"-{what}" if sign < 0.0 else what))


def _pieces(points: Sequence[tuple[LimitPoint, Any]]) -> list[list[tuple[LimitPoint, Any]]]:
    """Points that follow each other and have limits."""
    pieces: list[list[tuple[LimitPoint, Any]]] = [[]]
    for point in points:
        if point[1].value is None:
            pieces.append([])
        else:
            pieces[-1].append(point)
    return [piece for piece in pieces if piece]


def _known(path: Sequence[LimitPoint], quantity: str) -> list[bool]:
    return [quantity in point.values and point.values[quantity].value is not None for point in path]


def _abscissa(name: str, result: RunResult) -> str:
    runs = {name: result}
    return "time" if has_several_loads(runs) else label(with_unit(DISPLACEMENT, runs, "displacement"))
