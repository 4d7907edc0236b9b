"""Several states of a run side by side, and as an animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fields import Fields
from tmc_vem.report.figures import COLOURS, MEDIUM
from tmc_vem.report.snapshots import read_fields, record_of, snapshots
from tmc_vem.results import RunResult

Float = NDArray[np.float64]
State = tuple[str, Fields]


def states_of(result: RunResult) -> list[State]:
    """Titles and fields of all load steps that a run has written, by increasing load.

    Raises:
        InputError: the run has no fields.
    """
    found = []
    for snapshot in snapshots(result):
        record = record_of(result, snapshot)
        found.append((f"displacement {record.displacement:.3g}", read_fields(result, snapshot)))
    return found


def draw_states(states: Sequence[State], path: Path, *, component: int = 1, columns: int = 2) -> None:
    """Draw deformed states side by side, coloured by a displacement component on one scale.

    Args:
        states: titles and fields.
        path: picture file.
        component: 0 for u_x, 1 for u_y.
        columns: pictures in a row.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = -(-len(states) // columns)
    low, high = _extent(states)
    width = 5.5 * columns
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    figure = Figure(figsize=(width, rows * float(np.clip(5.0 * aspect, 1.3, 6.0) + 0.5) + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    scale = _scale(states, component)
    for place, (title, fields) in zip(axes, states, strict=False):
        drawn = _draw(place, fields, scale, component)
        _frame(place, title, low, high)
    for place in axes[len(states) :]:
        place.set_visible(False)
    figure.colorbar(drawn, ax=list(axes), orientation="horizontal", shrink=0.6, aspect=40,
                    label=f"$u_{'xy'[component]}$")  # fmt: skip
    figure.savefig(path, dpi=110)


def animate(states: Sequence[State], path: Path, *, component: int = 1, seconds_each: float = 0.25) -> None:
    """Write an animation of deformed states (GIF), which rests on the last one.

    Args:
        states: titles and fields.
        path: file; its suffix must be .gif.
        component: 0 for u_x, 1 for u_y.
        seconds_each: how long each state is shown.
    """
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    low, high = _extent(states)
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    figure = Figure(figsize=(7.0, float(np.clip(6.6 * aspect, 1.4, 8.0)) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    place = figure.add_subplot()
    scale = _scale(states, component)

    def show(frame: int) -> list[Any]:
        place.clear()
        title, fields = states[min(frame, len(states) - 1)]
        _draw(place, fields, scale, component)
        _frame(place, title, low, high)
        return []

    rest = max(1, round(1.5 / seconds_each))
    FuncAnimation(figure, show, frames=len(states) + rest, blit=False).save(
        path, writer=PillowWriter(fps=round(1.0 / seconds_each)), dpi=80
    )


def _extent(states: Sequence[State]) -> tuple[Float, Float]:
    deformed = np.concatenate([f.polygons.points_nx + f.displacement_ni for _, f in states])
    low, high = deformed.min(axis=0), deformed.max(axis=0)
    margin = 0.03 * (high - low).max()
    return low - margin, high + margin


def _scale(states: Sequence[State], component: int) -> Any:
    from matplotlib.colors import Normalize

    values = np.concatenate([f.displacement_ni[:, component] for _, f in states])
    return Normalize(values.min(), values.max() if np.ptp(values) > 0 else values.min() + 1.0)


def _frame(place: Any, title: str, low: Float, high: Float) -> None:
    place.set_aspect("equal")
    place.set_xlim(low[0], high[0])
    place.set_ylim(low[1], high[1])
    place.set_title(title, fontsize=9)
    place.tick_params(labelsize=7)


def _draw(place: Any, fields: Fields, scale: Any, component: int) -> Any:
    """Cells by their mean displacement: the medium pale, the solids in full colour."""
    from matplotlib.collections import PolyCollection

    polygons = fields.polygons
    deformed = polygons.points_nx + fields.displacement_ni
    cells = [polygons.cell(c) for c in range(polygons.n_cells)]
    colour_c = np.array([fields.displacement_ni[cell, component].mean() for cell in cells])
    medium_r = np.array([name.startswith(MEDIUM) for name in polygons.region_names])
    is_medium = medium_r[polygons.region_c]
    for chosen, alpha, line, edge in ((is_medium, 0.35, 0.1, "0.5"), (~is_medium, 1.0, 0.2, "0.2")):
        members = np.flatnonzero(chosen)
        drawn = PolyCollection(
            [deformed[cells[c]] for c in members], array=colour_c[members], cmap=COLOURS, norm=scale, alpha=alpha,
            linewidths=line, edgecolors=edge,
        )  # fmt: skip
        place.add_collection(drawn)
    return drawn
