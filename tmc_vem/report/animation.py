"""Several states or meshes of a run side by side, and as an animation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from tmc_vem.report.adapted_meshes import draw_cells, has_several_loads, title_of
from tmc_vem.report.labels import label
from tmc_vem.report.panels import bounds, colour_scale, deformed, draw_panels, draw_state
from tmc_vem.report.tables import stopped
from tmc_vem.results.adapted_rounds import adaptivity_of, read_round
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, record_of, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.system.fields import Fields

State = tuple[str, Fields]
REST = 1500  # milliseconds that the last state stays longer
LONGEST = 90  # characters of a line of a title


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
    scale = colour_scale(quantity, [fields for _, fields in states])

    def draw(axes: Any, fields: Fields) -> None:
        draw_state(axes, fields, quantity, scale)

    _film(states, draw, path, seconds_each)


def animate_meshes(states: Sequence[State], path: Path, *, seconds_each: float = 1.0) -> None:
    """Write an animation of deformed meshes (GIF), coloured by region, which rests on the last one.

    Args:
        states: titles and fields, each on a mesh of its own.
        path: file; its suffix must be .gif.
        seconds_each: how long each mesh is shown.
    """
    _film(states, lambda axes, fields: draw_cells(axes, fields, deformed(fields)), path, seconds_each)


def meshes_of(result: RunResult) -> list[State]:
    """Titles and fields of the rounds of a run whose mesh was adapted, or is being adapted.

    Raises:
        InputError: there are none, or a file is not readable.
    """
    adaptivity = adaptivity_of(result)
    if adaptivity is None or result.directory is None:
        raise InputError(f"{result.directory or 'the run'} has no adapted mesh to show: run it with --adapt gap")
    several = has_several_loads(adaptivity.rounds)
    return [
        (title_of(each, adaptivity.of, load=several), read_round(result.directory, each.number))
        for each in adaptivity.rounds
    ]


def _film(states: Sequence[State], draw: Callable[[Any, Fields], None], path: Path, seconds_each: float) -> None:
    """Write what is drawn of each state to axes that have room for all."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    lows, highs = bounds([fields for _, fields in states])
    low, high = lows.min(axis=0), highs.max(axis=0)
    margin = 0.03 * float((high - low).max())
    aspect = (high[1] - low[1]) / (high[0] - low[0])
    size = (7.0, float(np.clip(6.6 * aspect, 1.4, 8.0)) + 0.6)
    figure = Figure(figsize=size, dpi=80, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()

    frames = []
    for title, fields in states:
        axes.clear()
        draw(axes, fields)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_title("\n".join(map(label, wrap(title, LONGEST))), fontsize=9)
        axes.tick_params(labelsize=7)
        canvas.draw()
        figure.set_layout_engine("none")  # that of the first frame is that of all
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    each = round(1000.0 * seconds_each)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], loop=0, duration=[each] * (len(frames) - 1) + [each + REST]
    )
