"""Pictures of designs: densities on undeformed and deformed cells, and how a search went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import border_lines
from tmc_vem.system.fields import Fields, Polygons

Float = NDArray[np.float64]

WIDTH, LEAST, MOST = 7.0, 1.2, 8.0  # inches
DENSITIES, SOLID, MEDIUM = "Greys", "#4a7ab5", "#fdfdf5"  # of the design, and of what is not designed
VOLUMES = 0.02  # fractions over which the axis of volumes goes at least
REST = 1500  # milliseconds that the last design stays longer


def densities_figure(
    polygons: Polygons, density_c: Float, title: str = "", displacement_ni: Float | None = None
) -> Any:
    """Densities from 0, white, to 1, black; cells that are not designed in colours of their own.

    Args:
        polygons: the cells.
        density_c: (n_cells,) densities; not a number for cells that are not designed.
        title: text above the picture.
        displacement_ni: (n_points, 2) of the deformed state; undeformed without it.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    points = polygons.points_nx if displacement_ni is None else polygons.points_nx + displacement_ni
    low, high = points.min(axis=0), points.max(axis=0)
    figure = Figure(figsize=_size(low, high), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    norm = _draw(axes, polygons, density_c, points)
    _frame(axes, low, high)
    axes.set_title(title, fontsize=10)
    bar = figure.colorbar(ScalarMappable(norm=norm, cmap=DENSITIES), ax=axes, shrink=0.8, pad=0.02)
    bar.set_label("density")
    return figure


def deformed_figure(fields: Fields, title: str = "") -> Any:
    """Densities on the deformed cells of a state, which has them as ``density`` of its cells."""
    return densities_figure(fields.polygons, fields.cell_fields["density"], title, fields.displacement_ni)


def history_figure(rows: Sequence[Mapping[str, str]], objective: str, limits: Sequence[str]) -> Any:
    """Objective, violation of limits and volume over the evaluations.

    Args:
        rows: of history.csv.
        objective: its name.
        limits: columns of limits, but for the volume's.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    def numbers(name: str) -> Float:
        return np.array([float(row.get(name) or "nan") for row in rows])

    number, better = numbers("evaluation"), numbers("better") > 0.0
    panels = 2 + bool(limits)
    figure = Figure(figsize=(WIDTH, 1.9 * panels + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    all_axes = figure.subplots(panels, 1, sharex=True)
    first = all_axes[0]
    values = numbers("objective")
    first.plot(number, values, color="0.7", linewidth=0.8)
    first.plot(number[better], values[better], "o", markersize=3, label="better than all before")
    seen = values[np.isfinite(values)]
    if len(seen) and seen.min() > 0.0 and seen.max() > 20.0 * seen.min():
        first.set_yscale("log")
    first.set_ylabel(objective)
    first.legend(fontsize=8)
    second = all_axes[1]
    second.plot(number, numbers("volume"))
    second.set_ylabel("volume fraction")
    second.ticklabel_format(useOffset=False)
    _widen(second, VOLUMES)
    if limits:
        third = all_axes[2]
        for name in limits:
            third.plot(number, numbers(name), label=name.removeprefix("limit "))
        third.axhline(0.0, color="black", linewidth=0.8)
        third.set_ylabel("value / limit - 1")
        third.legend(fontsize=8)
    levels = numbers("level")
    for axes in all_axes:
        axes.grid(alpha=0.3)
        for n in np.flatnonzero(np.diff(levels) > 0.0):
            axes.axvline(number[n] + 0.5, color="0.5", linewidth=0.8, linestyle=":")
    all_axes[-1].set_xlabel("evaluation")
    all_axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


def _widen(axes: Any, least: float) -> None:
    """Let an axis go over some length at least: a constant is no picture of its rounding errors."""
    low, high = axes.get_ylim()
    if high - low < least:
        axes.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def animate_designs(
    polygons: Polygons, frames: Sequence[tuple[str, Float]], path: Path, *, seconds_each: float = 0.15
) -> None:
    """Write an animation of densities (GIF), which rests on the last one.

    Args:
        polygons: the cells.
        frames: titles and densities (n_cells,).
        path: file; its suffix must be .gif.
        seconds_each: how long each design is shown.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    from tmc_vem.support.files import whole_file

    low, high = polygons.points_nx.min(axis=0), polygons.points_nx.max(axis=0)
    figure = Figure(figsize=_size(low, high), dpi=80, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    pictures = []
    for title, density_c in frames:
        axes.clear()
        _draw(axes, polygons, density_c, polygons.points_nx)
        _frame(axes, low, high)
        axes.set_title(title, fontsize=9)
        canvas.draw()
        figure.set_layout_engine("none")  # that of the first frame is that of all
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).convert("P", palette=1))
    each = round(1000.0 * seconds_each)
    with whole_file(path, durable=False) as temporary:
        pictures[0].save(
            temporary, format="GIF", save_all=True, append_images=pictures[1:], loop=0,
            duration=[each] * (len(pictures) - 1) + [each + REST],
        )  # fmt: skip


def _draw(axes: Any, polygons: Polygons, density_c: Float, points: Float) -> Any:
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import Normalize

    norm = Normalize(0.0, 1.0)
    loops = [points[polygons.cell(c)] for c in range(polygons.n_cells)]
    designed, solid = np.isfinite(density_c), polygons.is_solid_c
    for chosen, colour in ((~designed & ~solid, MEDIUM), (~designed & solid, SOLID)):
        cells = [loops[c] for c in np.flatnonzero(chosen)]
        axes.add_collection(
            PolyCollection(cells, facecolors=colour, edgecolors=colour, linewidths=0.2, rasterized=True)
        )
    cells = [loops[c] for c in np.flatnonzero(designed)]
    axes.add_collection(
        PolyCollection(
            cells, array=density_c[designed], cmap=DENSITIES, norm=norm, edgecolors="face", linewidths=0.2,
            rasterized=True,
        )
    )  # fmt: skip
    lines = border_lines(polygons.offsets, polygons.connectivity, np.ones(polygons.n_cells, dtype=bool), points)
    axes.add_collection(LineCollection(lines, colors="0.4", linewidths=0.6))
    return norm


def _frame(axes: Any, low: Float, high: Float) -> None:
    margin = 0.03 * float((high - low).max())
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=7)


def _size(low: Float, high: Float) -> tuple[float, float]:
    aspect = float((high[1] - low[1]) / (high[0] - low[0]))
    return WIDTH, float(np.clip(0.85 * WIDTH * aspect, LEAST, MOST)) + 0.6
