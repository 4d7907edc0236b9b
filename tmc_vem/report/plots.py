"""Curves of runs: gap, reaction, smallest J, energies and Newton iterations against the load, and convergence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tmc_vem.problems.probes import GAP
from tmc_vem.report.labels import label
from tmc_vem.report.page import Picture, picture
from tmc_vem.report.tables import probes_of, with_unit
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult

# colours and dashes that stay apart in print and for colour-blind readers
COLOURS = ("#0b5394", "#c55a11", "#2e7d32", "#7b1fa2", "#5d4037", "#00838f")
MARKS = "osD^vP"
MOST_TICKS = 7
DISPLACEMENT = "prescribed displacement, magnitude"
LEGEND = 0.09  # height of a legend below the axes, of the figure's
PANELS = 3  # of probes beside one another

Runs = Mapping[str, RunResult]
Value = Callable[[StepRecord, RunResult], float | None]


def axes_of(columns: int = 1, height: float = 3.6, width: float = 10.0, rows: int = 1) -> tuple[Any, list[Any]]:
    """A figure with axes beside one another, row by row."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False).flat)
    for one in axes:
        one.grid(True, which="both", linewidth=0.4, color="0.88")
        one.set_axisbelow(True)
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _style(n: int) -> dict[str, Any]:
    return {"color": COLOURS[n % len(COLOURS)], "linestyle": ("-", "--", "-.", ":")[n % 4], "linewidth": 1.5}


def against_load(axes: Any, runs: Runs, value: Value, what: str) -> None:
    """Draw a value of the load steps of each run against the prescribed displacement; against the time where there are
    several loads."""
    timed = has_several_loads(runs)
    for n, (name, run) in enumerate(runs.items()):
        points = [
            (record.load if timed else abs(record.displacement), v)
            for record in run.history
            if (v := value(record, run)) is not None
        ]
        if points:
            axes.plot(*np.transpose(points), label=label(name), **_style(n))
    axes.set_xlabel(_abscissa(runs))
    axes.set_ylabel(label(what))


def has_several_loads(runs: Runs) -> bool:
    """Whether a run has loads that are reported by name: its reaction is that of one of them."""
    return any(record.load_work is not None for run in runs.values() for record in run.history[:1])


def _abscissa(runs: Runs) -> str:
    return "time" if has_several_loads(runs) else label(with_unit(DISPLACEMENT, runs, "displacement"))


def gap_and_reaction(runs: Runs) -> Any:
    """Gap and reaction during loading."""
    has_gap = any(record.gap is not None for run in runs.values() for record in run.history)
    figure, axes = axes_of(2 if has_gap else 1)
    if has_gap:
        against_load(axes[0], runs, lambda record, _: record.gap, with_unit("gap", runs, GAP))
        axes[0].set_yscale("log")
    what = with_unit("reaction, magnitude", runs, "reaction")
    against_load(axes[-1], runs, lambda record, _: abs(record.reaction), what)
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def probe_pictures(runs: Runs) -> list[Picture]:
    """The probes during loading, three a picture, but for the gap, which has one already."""
    names, pictures = probes_of(runs), []
    for first in range(0, len(names), PANELS):
        some = names[first : first + PANELS]
        figure, axes = axes_of(len(some), height=3.2, width=10.0 if len(some) > 1 else 5.5)
        for one, name in zip(axes, some, strict=True):
            against_load(one, runs, _probe(name), with_unit(name, runs, name))
            one.set_xlabel("")
        figure.supxlabel(_abscissa(runs), fontsize=10)
        if len(runs) > 1:
            axes[0].legend(fontsize=8, frameon=False)
        pictures.append(picture(figure, f"probes-{first // PANELS + 1}", f"{', '.join(some)} during loading."))
    return pictures


def loops(runs: Runs) -> list[Picture]:
    """Reactions against displacements, signs and all, of runs with friction: on the way back they are others."""
    rubbing = {name: run for name, run in runs.items() if run.friction}
    loads = [each for run in rubbing.values() for each in run.loads.items()]
    names = dict.fromkeys(name for name, values in loads if {"displacement", "reaction"} <= {*values})
    if not rubbing:
        return []
    some = list(names)[:PANELS] or [""]
    figure, axes = axes_of(len(some), height=3.2, width=10.0 if len(some) > 1 else 5.5)
    for one, load in zip(axes, some, strict=True):
        for n, (name, run) in enumerate(rubbing.items()):
            points = [(0.0, 0.0), *(_pair(record, load) for record in run.history)]
            one.plot(*np.transpose(points), label=label(name), **_style(n))
        column = f"{load}." if load else ""
        one.set_xlabel(label(with_unit(f"{column}displacement", rubbing, f"{column}displacement")))
        one.set_ylabel(label(with_unit(f"{column}reaction", rubbing, f"{column}reaction")))
        one.locator_params(axis="x", nbins=5)
    if len(rubbing) > 1:
        axes[0].legend(fontsize=8, frameon=False)
    return [picture(figure, "loops", "Reactions against displacements, there and back.")]


def _pair(record: StepRecord, load: str) -> tuple[float, float]:
    values = record.forces.get(load, {}) if load else {"displacement": record.displacement, "reaction": record.reaction}
    return values.get("displacement", math.nan), values.get("reaction", math.nan)


def _probe(name: str) -> Value:
    return lambda record, _: record.reported.get(name)


def smallest_j(runs: Runs) -> Any:
    """Smallest J of solid and medium during loading."""
    figure, axes = axes_of(2)
    against_load(axes[0], runs, lambda record, run: _least(record, run, medium=True), "smallest J, third medium")
    against_load(axes[1], runs, lambda record, run: _least(record, run, medium=False), "smallest J, solids")
    axes[0].set_yscale("log")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def _least(record: StepRecord, run: RunResult, *, medium: bool) -> float | None:
    return min((v for name, v in record.min_j.items() if (name in run.media) == medium), default=None)


def energy_split(runs: Runs) -> Any:
    """Energies of the regions during loading."""
    rubs = any(record.friction for run in runs.values() for record in run.history)
    figure, axes = axes_of(3 if rubs else 2)
    against_load(axes[0], runs, lambda record, run: _energy(record, run, medium=False), "energy of the solids")
    against_load(axes[1], runs, lambda record, run: _energy(record, run, medium=True), "energy of the third medium")
    if rubs:
        column = next((column for run in runs.values() for column in run.units if column.startswith("friction.")), "")
        what = with_unit("energy dissipated by friction", runs, column)
        against_load(axes[2], runs, lambda record, _: _dissipated(record), what)
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def _dissipated(record: StepRecord) -> float | None:
    return sum(values["dissipated"] for values in record.friction.values()) if record.friction else None


def _energy(record: StepRecord, run: RunResult, *, medium: bool) -> float:
    return sum(v for name, v in record.energy.items() if (name in run.media) == medium)


def newton_iterations(runs: Runs) -> Any:
    """Newton iterations of each load step, those of failed attempts on top."""
    figure, axes = axes_of(max(len(runs), 1), height=2.9)
    failed = any(record.wasted_iterations for run in runs.values() for record in run.history)
    for one, (name, run) in zip(axes, runs.items(), strict=False):
        steps = [record.step for record in run.history]
        good = [record.iterations for record in run.history]
        one.bar(steps, good, color=COLOURS[0], label="converged step")
        if failed:
            wasted = [record.wasted_iterations for record in run.history]
            one.bar(steps, wasted, bottom=good, color=COLOURS[1], label="failed attempts before it")
        one.set_title(label(f"{name}: {run.newton_iterations} in {run.steps} steps"), fontsize=9)
        one.set_xlabel("load step")
        one.xaxis.get_major_locator().set_params(integer=True)
        one.yaxis.get_major_locator().set_params(integer=True)
    axes[0].set_ylabel("Newton iterations")
    if failed:
        # below the axes: matplotlib has a name for that place from 3.7 on only
        figure.get_layout_engine().set(rect=(0.0, LEGEND, 1.0, 1.0 - LEGEND))
        figure.legend(*axes[0].get_legend_handles_labels(), loc="lower center", ncols=2, fontsize=8, frameon=False)
    return figure


def convergence(
    series: Mapping[str, Sequence[tuple[float, float, float]]], quantity: str, floors: Mapping[str, float]
) -> Any:
    """Relative error against degrees of freedom and against time, with fitted rates.

    Args:
        series: by name, (degrees of freedom, seconds, relative error) of each mesh.
        quantity: what the error is of.
        floors: by name, relative uncertainty of what the error is measured against, drawn as a line; errors below it do
            not count for the rate.
    """
    figure, axes = axes_of(2)
    for one, column, what in zip(axes, (0, 1), ("degrees of freedom", "time of the run in s"), strict=True):
        for n, (name, points) in enumerate(series.items()):
            usable = sorted((p[column], p[2]) for p in points if p[2] > 0.0)
            if not usable:
                continue
            certain = [point for point in usable if point[1] > floors[name]]
            slope = rate(*np.transpose(certain)) if len(certain) > 1 else None
            shown = label(f"{name}, no rate" if slope is None else f"{name}, rate {slope:.1f}")
            one.loglog(*np.transpose(usable), marker=MARKS[n % len(MARKS)], markersize=5, label=shown, **_style(n))
        common = len(set(floors.values())) == 1
        for n, (name, floor) in enumerate(floors.items()):
            if floor > 0.0 and not (common and n):
                which = "uncertainty" if common else f"uncertainty, {name}"
                colour = "0.5" if common else COLOURS[n % len(COLOURS)]
                one.axhline(floor, color=colour, linestyle=":", linewidth=1.0, label=label(which))
        plain_ticks(one.xaxis)
        one.set_xlabel(what)
        one.set_ylabel(f"relative error of the {quantity}")
        one.legend(fontsize=8, framealpha=0.9, edgecolor="none")
    return figure


def final_values(
    lines: Mapping[str, Mapping[str, Sequence[tuple[float, float]]]], parameter: str, name: str
) -> list[Picture]:
    """Values at full load against a parameter, three a picture.

    Args:
        lines: by heading of the value, and by name of the line, its points (parameter, value).
        parameter: what it is called.
        name: beginning of the pictures' names.
    """
    headings, pictures = list(lines), []
    for first in range(0, len(headings), PANELS):
        some = headings[first : first + PANELS]
        figure, axes = axes_of(len(some), height=3.2, width=10.0 if len(some) > 1 else 5.5)
        for one, heading in zip(axes, some, strict=True):
            for n, (line, points) in enumerate(lines[heading].items()):
                mark = MARKS[n % len(MARKS)]
                one.plot(*np.transpose(sorted(points)), marker=mark, markersize=4, label=label(line), **_style(n))
            one.set_ylabel(label(heading))
        figure.supxlabel(label(parameter), fontsize=10)
        if len(lines[some[0]]) > 1:
            axes[0].legend(fontsize=8, frameon=False)
        caption = f"{', '.join(some)} at full load against {parameter}."
        pictures.append(picture(figure, f"{name}-{first // PANELS + 1}", caption))
    return pictures


def plain_ticks(axis: Any) -> None:
    """A few round numbers as they would be said, on a logarithmic axis that may be shorter than a decade."""
    from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

    low, high = axis.get_view_interval()
    if low <= 0.0:
        return  # nothing is drawn
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for digits in ((1.0, 1.5, 2.0, 3.0, 5.0, 7.0), (1.0, 2.0, 5.0), (1.0,)):
        ticks = [digit * 10.0**decade for decade in decades for digit in digits if low <= digit * 10.0**decade <= high]
        if len(ticks) <= MOST_TICKS:
            break
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def rate(x: Sequence[float], error: Sequence[float]) -> float | None:
    """Exponent p of error ~ x^-p by least squares over all meshes, or None for fewer than two."""
    if len(x) < 2:
        return None
    return -float(np.polyfit(np.log(x), np.log(error), 1)[0])
