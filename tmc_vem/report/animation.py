"""Several states of a run side by side, and as an animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tmc_vem.report.panels import bounds, colour_scale, draw_panels, draw_state
from tmc_vem.report.tables import stopped
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.system.fields import Fields

State = tuple[str, Fields]


def states_of(result: RunResult) -> list[State]:
    """Titles and fields of all load steps that a run has written, by increasing load.

    Raises:
        InputError: the run has no fields.
    """
    if not result.history:
        raise InputError(f"{result.directory} has no load step to show: {stopped(result)}")
    found = []
    for snapshot in snapshots(result):
        record = record_of(result, snapshot)
        found.append((f"displacement {record.displacement:.3g}", read_fields(result, snapshot)))
    return found


def draw_states(states: Sequence[State], path: Path, *, quantity: str = "uy", columns: int | None = None) -> None:
    """Write a picture of deformed states side by side, coloured by a quantity on one scale.

    Args:
        states: titles and fields.
        path: picture file.
        quantity: 'ux', 'uy', 'J' or 'energy'.
        columns: pictures in a row; by default what suits the shape of the domain.
    """
    draw_panels(states, quantity=quantity, columns=columns).savefig(path, dpi=110)


def animate(states: Sequence[State], path: Path, *, quantity: str = "uy", seconds_each: float = 0.25) -> None:
    """Write an animation of deformed states (GIF), which rests on the last one.

    Args:
        states: titles and fields.
        path: file; its suffix must be .gif.
        quantity: 'ux', 'uy', 'J' or 'energy'.
        seconds_each: how long each state is shown.
    """
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lows, highs = bounds([fields for _, fields in states])
    low, high = lows.min(axis=0), highs.max(axis=0)
    margin = 0.03 * float((high - low).max())
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    figure = Figure(figsize=(7.0, float(np.clip(6.6 * aspect, 1.4, 8.0)) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    scale = colour_scale(quantity, [fields for _, fields in states])

    def show(frame: int) -> list[Any]:
        axes.clear()
        title, fields = states[min(frame, len(states) - 1)]
        draw_state(axes, fields, quantity, scale)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_title(title, fontsize=9)
        axes.tick_params(labelsize=7)
        return []

    rest = max(1, round(1.5 / seconds_each))
    FuncAnimation(figure, show, frames=len(states) + rest, blit=False).save(
        path, writer=PillowWriter(fps=round(1.0 / seconds_each)), dpi=80
    )
