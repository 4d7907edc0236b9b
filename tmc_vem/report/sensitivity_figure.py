"""A picture of derivatives by the values of numbers in cells: where more of a number raises a result, where less."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import border_lines
from tmc_vem.report.labels import label
from tmc_vem.support.units import LENGTH, Units
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]

WIDTH, LEAST, MOST = 9.0, 2.4, 8.0  # inches: a panel alone, and how high it may be
COLUMNS = 2  # panels side by side
# Colours end at the value that so many of the cells are below: a few at a corner would leave all others white.
SHOWN = 0.99
TICKS = (-1.0, -0.1, 0.0, 0.1, 1.0)  # parts of the largest value
LINEAR = 0.01  # part of the largest value up to which colours are linear; logarithmic beyond


@dataclass(frozen=True)
class Panel:
    """Derivatives of one result by one number.

    Attributes:
        title: what it is.
        density_c: (n_cells,) derivatives by the number in each cell, per area of the cell.
        has_c: (n_cells,) which cells have the number.
        unit: of the densities; empty if there is none or it is not known.
    """

    title: str
    density_c: Float
    has_c: NDArray[np.bool_]
    unit: str = ""


def sensitivity_figure(fields: Fields, panels: Sequence[Panel], units: Units) -> Any:
    """A figure with a panel for each pair, on the deformed cells."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    points = fields.polygons.points_nx + fields.displacement_ni
    extent = np.ptp(points, axis=0)
    width = WIDTH / columns if columns == 1 else 0.75 * WIDTH
    height = float(np.clip(0.75 * width * extent[1] / max(float(extent[0]), 1e-300), LEAST, MOST)) + 1.0
    figure = Figure(figsize=(columns * width, rows * height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("Red where more of the number raises the result, blue where it lowers it", fontsize=10)
    for n, panel in enumerate(panels):
        _draw(figure, figure.add_subplot(rows, columns, n + 1), fields, points, panel, units)
    return figure


def _draw(figure: Any, axes: Any, fields: Fields, points: Float, panel: Panel, units: Units) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection, PolyCollection

    polygons = fields.polygons
    loops = [points[polygons.cell(c)] for c in range(polygons.n_cells)]
    chosen = np.flatnonzero(panel.has_c)
    pale = [loops[c] for c in np.flatnonzero(~panel.has_c)]
    axes.add_collection(PolyCollection(pale, facecolors="0.93", edgecolors="0.85", linewidths=0.2, rasterized=True))
    scale, beyond = _scale(panel.density_c[chosen])
    style: dict[str, Any] = {"array": panel.density_c[chosen], "cmap": colormaps["RdBu_r"], "norm": scale}
    cells = [loops[c] for c in chosen]
    axes.add_collection(PolyCollection(cells, edgecolors="face", linewidths=0.2, rasterized=True, **style))
    lines = border_lines(polygons.offsets, polygons.connectivity, polygons.is_solid_c, points)
    axes.add_collection(LineCollection(lines, colors="black", linewidths=0.7, capstyle="round"))
    margin = 0.03 * np.ptp(points, axis=0).max()
    axes.set_xlim(points[:, 0].min() - margin, points[:, 0].max() + margin)
    axes.set_ylim(points[:, 1].min() - margin, points[:, 1].max() + margin)
    axes.set_aspect("equal")
    axes.set_xlabel(f"x, deformed [{units.of(LENGTH)}]")
    axes.set_ylabel(f"y, deformed [{units.of(LENGTH)}]")
    axes.set_title(label(panel.title), fontsize=10)
    shown = ScalarMappable(norm=scale, cmap=colormaps["RdBu_r"])
    bar = figure.colorbar(shown, ax=axes, extend="both" if beyond else "neither", shrink=0.9, pad=0.02)
    bar.set_ticks([part * scale.vmax for part in TICKS])
    bar.ax.yaxis.set_major_formatter("{x:.2g}")
    bar.ax.minorticks_off()
    bar.set_label(f"per area of the cell [{panel.unit}]" if panel.unit else "per area of the cell", fontsize=9)


def _scale(density_c: Float) -> tuple[Any, bool]:
    """Colours the same on both sides of 0, and whether there are values beyond their ends."""
    from matplotlib.colors import SymLogNorm

    size = np.abs(density_c[np.isfinite(density_c)])
    largest = float(size.max(initial=0.0))
    end = float(np.quantile(size, SHOWN)) if len(size) else 0.0
    end = end if end > 0.0 else largest or 1.0
    return SymLogNorm(LINEAR * end, vmin=-end, vmax=end), largest > end
