"""Curves of runs: gap, reaction, smallest J, energies and Newton iterations against the load, and convergence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tmc_vem.results import RunResult, StepRecord

# colours and dashes that stay apart in print and for colour-blind readers
COLOURS = ("#0b5394", "#c55a11", "#2e7d32", "#7b1fa2", "#5d4037", "#00838f")
MARKS = "osD^vP"

Runs = Mapping[str, RunResult]


def _figure(columns: int = 1, height: float = 3.6, width: float = 10.0) -> tuple[Any, list[Any]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, columns, squeeze=False)[0])
    for one in axes:
        one.grid(True, which="both", linewidth=0.4, color="0.88")
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _style(n: int) -> dict[str, Any]:
    return {"color": COLOURS[n % len(COLOURS)], "linestyle": ("-", "--", "-.", ":")[n % 4], "linewidth": 1.5}


def against_load(axes: Any, runs: Runs, value: Callable[[StepRecord], float | None], label: str) -> None:
    """Draw a value of the load steps against the prescribed displacement."""
    for n, (name, run) in enumerate(runs.items()):
        points = [(abs(record.displacement), v) for record in run.history if (v := value(record)) is not None]
        if points:
            axes.plot(*np.transpose(points), label=name, **_style(n))
    axes.set_xlabel("prescribed displacement, magnitude")
    axes.set_ylabel(label)


def gap_and_reaction(runs: Runs) -> Any:
    """Gap and reaction during loading."""
    has_gap = any(record.gap is not None for run in runs.values() for record in run.history)
    figure, axes = _figure(2 if has_gap else 1)
    if has_gap:
        against_load(axes[0], runs, lambda record: record.gap, "gap")
        axes[0].set_yscale("log")
    against_load(axes[-1], runs, lambda record: abs(record.reaction), "reaction, magnitude")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def smallest_j(runs: Runs) -> Any:
    """Smallest J of solid and medium during loading."""
    figure, axes = _figure(2)
    against_load(axes[0], runs, lambda record: _least(record, medium=True), "smallest J, third medium")
    against_load(axes[1], runs, lambda record: _least(record, medium=False), "smallest J, solids")
    axes[0].set_yscale("log")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def _least(record: StepRecord, *, medium: bool) -> float | None:
    return min((v for name, v in record.min_j.items() if name.startswith("medium") == medium), default=None)


def energy_split(runs: Runs) -> Any:
    """Energies of the regions during loading."""
    figure, axes = _figure(2)
    against_load(axes[0], runs, lambda record: _energy(record, medium=False), "energy of the solids")
    against_load(axes[1], runs, lambda record: _energy(record, medium=True), "energy of the third medium")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def _energy(record: StepRecord, *, medium: bool) -> float:
    return sum(v for name, v in record.energy.items() if name.startswith("medium") == medium)


def newton_iterations(runs: Runs) -> Any:
    """Newton iterations of each load step, those of failed attempts on top."""
    figure, axes = _figure(max(len(runs), 1), height=2.6)
    for one, (name, run) in zip(axes, runs.items(), strict=False):
        steps = [record.step for record in run.history]
        good = [record.iterations for record in run.history]
        one.bar(steps, good, color=COLOURS[0], label="converged step")
        one.bar(
            steps, [r.wasted_iterations for r in run.history], bottom=good, color=COLOURS[1], label="failed attempts"
        )
        one.set_title(f"{name}: {run.newton_iterations} in {run.steps} steps", fontsize=9)
        one.set_xlabel("load step")
    axes[0].set_ylabel("Newton iterations")
    axes[0].legend(fontsize=8, frameon=False)
    return figure


def convergence(series: Mapping[str, Sequence[tuple[float, float, float]]], floor: float = 0.0) -> Any:
    """Relative error against degrees of freedom and against time, with fitted rates.

    Args:
        series: by name, (degrees of freedom, seconds, relative error) of each mesh.
        floor: relative uncertainty of the reference, drawn as a line.
    """
    figure, axes = _figure(2)
    for one, column, label in zip(axes, (0, 1), ("degrees of freedom", "time of the run in s"), strict=True):
        for n, (name, points) in enumerate(series.items()):
            usable = sorted((p[column], p[2]) for p in points if p[2] > 0.0)
            if not usable:
                continue
            x, error = np.transpose(usable)
            slope = rate(x, error)
            shown = name if slope is None else f"{name}, rate {slope:.1f}"
            one.loglog(x, error, marker=MARKS[n % len(MARKS)], markersize=5, label=shown, **_style(n))
        if floor > 0.0:
            one.axhline(floor, color="0.5", linestyle=":", linewidth=1.0, label="uncertainty of the reference")
        one.set_xlabel(label)
        one.set_ylabel("relative error of the gap")
        one.legend(fontsize=8, frameon=False)
    return figure


def rate(x: Sequence[float], error: Sequence[float]) -> float | None:
    """Exponent p of error ~ x^-p by least squares over all meshes, or None for fewer than two."""
    if len(x) < 2:
        return None
    return -float(np.polyfit(np.log(x), np.log(error), 1)[0])
