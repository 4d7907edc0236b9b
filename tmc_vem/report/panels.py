"""Deformed states drawn side by side on common axes and a common colour scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fields import Fields
from tmc_vem.report.figures import COLOURS, MEDIUM, _outline

Float = NDArray[np.float64]
FOOT = 0.9  # inches below the panels for the scale of colours
QUANTITIES = {"ux": "$u_x$", "uy": "$u_y$", "J": "$J$", "energy": "energy density"}


def values_of(fields: Fields, quantity: str) -> Float:
    """(n_cells,) values to colour cells with: 'ux', 'uy' (means over the nodes), 'J' or 'energy'."""
    if quantity in ("ux", "uy"):
        u = fields.displacement_ni[:, "xy".index(quantity[1])]
        polygons = fields.polygons
        sums = np.add.reduceat(u[polygons.connectivity], polygons.offsets[:-1])
        means: Float = sums / np.diff(polygons.offsets)
        return means
    return fields.jacobian_c if quantity == "J" else fields.energy_density_c


def draw_panels(
    states: Sequence[tuple[str, Fields]],
    *,
    quantity: str = "uy",
    columns: int = 2,
    width: float = 10.0,
) -> Any:
    """Figure with a panel for each state; solids in full colour and outlined, the medium pale.

    Args:
        states: titles and fields.
        quantity: what colours the cells, see :func:`values_of`.
        columns: panels side by side.
        width: of the figure, in inches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    colours = [values_of(fields, quantity) for _, fields in states]
    scale = _scale(quantity, np.concatenate(colours))
    deformed = [fields.polygons.points_nx + fields.displacement_ni for _, fields in states]
    low = np.min([points.min(axis=0) for points in deformed], axis=0)
    high = np.max([points.max(axis=0) for points in deformed], axis=0)
    extent = high - low
    columns = min(columns, len(states))
    rows = math.ceil(len(states) / columns)
    panel = float(np.clip(width / columns * extent[1] / extent[0], 0.8, 7.0)) + 0.45
    figure = Figure(figsize=(width, rows * panel + FOOT))
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False)
    bottom = FOOT / (rows * panel + FOOT)
    figure.subplots_adjust(0.02, bottom, 0.98, 1 - 0.3 / (rows * panel + FOOT), 0.04, 0.16)
    for axes in grid.flat:
        axes.set_axis_off()
    for axes, (title, fields), points, colour in zip(grid.flat, states, deformed, colours, strict=False):
        draw_state(axes, fields, points, colour, scale)
        axes.set_xlim(low[0] - 0.02 * extent[0], high[0] + 0.02 * extent[0])
        axes.set_ylim(low[1] - 0.02 * extent[1], high[1] + 0.02 * extent[1])
        axes.set_title(title, fontsize=9)
    bar = figure.add_axes((0.25, 0.6 * bottom, 0.5, 0.15 * bottom))
    figure.colorbar(
        ScalarMappable(norm=scale, cmap=COLOURS), cax=bar, orientation="horizontal", label=QUANTITIES[quantity]
    )
    return figure


def draw_state(axes: Any, fields: Fields, points: Float, colour_c: Float, scale: Any) -> None:
    """Draw one state on axes that exist already."""
    from matplotlib.collections import LineCollection, PolyCollection

    polygons = fields.polygons
    cells = [polygons.cell(c) for c in range(polygons.n_cells)]
    is_medium = np.array([name.startswith(MEDIUM) for name in polygons.region_names])[polygons.region_c]
    line = float(np.clip(6.0 / math.sqrt(max(polygons.n_cells, 1)), 0.05, 0.3))
    for members, alpha, edge in ((is_medium, 0.4, "0.45"), (~is_medium, 1.0, "0.25")):
        chosen = np.flatnonzero(members)
        axes.add_collection(
            PolyCollection(
                [points[cells[c]] for c in chosen],
                array=colour_c[chosen],
                cmap=COLOURS,
                norm=scale,
                alpha=alpha,
                linewidths=line,
                edgecolors=edge,
                rasterized=True,
            )
        )
    axes.add_collection(LineCollection(_outline(cells, ~is_medium, points), colors="black", linewidths=0.7))
    axes.set_aspect("equal")


def _scale(quantity: str, values: Float) -> Any:
    from matplotlib.colors import LogNorm, Normalize

    positive = values[values > 0.0]
    if quantity == "energy" and len(positive):
        return LogNorm(max(float(positive.min()), 1e-10 * float(positive.max())), float(positive.max()))
    low, high = float(values.min()), float(values.max())
    return Normalize(low, high if high > low else low + 1.0)
