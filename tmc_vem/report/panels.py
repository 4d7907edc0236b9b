"""Deformed states drawn side by side to the same scale, in the same colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import COLOURS, border_lines
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]
FOOT, TITLE, MARGIN, HIGHEST = 0.9, 0.35, 0.2, 7.0  # inches: colour scale, titles, around panels, panels at most
PALE = 0.4  # how strong the medium's colours are
WIDE = 4.5  # domains wider than that relative to their height get a row of their own
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
    columns: int | None = None,
    width: float = 10.0,
) -> Any:
    """Figure with a panel for each state, all to the same scale; solids in full colour and outlined, the medium pale.

    Args:
        states: titles and fields.
        quantity: what colours the cells, see :func:`values_of`.
        columns: panels side by side; by default two, or one for domains much wider than high.
        width: of the figure, in inches.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    scale = colour_scale(quantity, [fields for _, fields in states])
    low, high = bounds([fields for _, fields in states])
    extent = (high - low).max(axis=0) * 1.04
    columns = min(columns or (1 if extent[0] > WIDE * extent[1] else 2), len(states))
    rows = [range(first, min(first + columns, len(states))) for first in range(0, len(states), columns)]
    inch = (width - MARGIN * (columns + 1)) / columns / extent[0]  # per unit of length
    if extent[1] * inch > HIGHEST:
        inch = HIGHEST / extent[1]
    heights = [float((high - low)[list(row), 1].max()) * 1.04 * inch + TITLE for row in rows]
    height = sum(heights) + FOOT
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    top = height
    for row, tall in zip(rows, heights, strict=True):
        for column, n in enumerate(row):
            title, fields = states[n]
            left = MARGIN + column * (width - MARGIN) / columns
            box = (left, top - tall, (width - MARGIN) / columns - MARGIN, tall - TITLE)
            axes = figure.add_axes((box[0] / width, box[1] / height, box[2] / width, box[3] / height))
            axes.set_axis_off()
            draw_state(axes, fields, quantity, scale)
            middle, half = 0.5 * (low[n] + high[n]), 0.5 * np.array(box[2:]) / inch
            axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
            axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
            axes.set_title(title, fontsize=9, pad=3)
        top -= tall
    bar = figure.add_axes((0.25, 0.6 * FOOT / height, 0.5, 0.15 * FOOT / height))
    figure.colorbar(
        ScalarMappable(norm=scale, cmap=COLOURS), cax=bar, orientation="horizontal", label=QUANTITIES[quantity]
    )
    return figure


def deformed(fields: Fields) -> Float:
    """(n, 2) nodes in the deformed state."""
    points: Float = fields.polygons.points_nx + fields.displacement_ni
    return points


def bounds(states: Sequence[Fields]) -> tuple[Float, Float]:
    """Lower left and upper right corners of each deformed state."""
    points = [deformed(fields) for fields in states]
    return np.array([p.min(axis=0) for p in points]), np.array([p.max(axis=0) for p in points])


def colour_scale(quantity: str, states: Sequence[Fields]) -> Any:
    """Norm for the colours of all states: from the smallest to the largest value, logarithmic for energies."""
    from matplotlib.colors import LogNorm, Normalize

    if quantity in ("ux", "uy"):
        values = np.concatenate([fields.displacement_ni[:, "xy".index(quantity[1])] for fields in states])
    else:
        values = np.concatenate([values_of(fields, quantity) for fields in states])
    positive = values[values > 0.0]
    if quantity == "energy" and len(positive):
        return LogNorm(max(float(positive.min()), 1e-10 * float(positive.max())), float(positive.max()))
    low, high = float(values.min()), float(values.max())
    return Normalize(low, high if high > low else low + 1.0)


def draw_state(axes: Any, fields: Fields, quantity: str, scale: Any) -> None:
    """Draw one state on axes that exist already: displacements as smooth contours, other quantities by cell."""
    from matplotlib.collections import LineCollection, PolyCollection

    polygons, points = fields.polygons, deformed(fields)
    cells = [polygons.cell(c) for c in range(polygons.n_cells)]
    is_medium = ~polygons.is_solid_c
    line = float(np.clip(6.0 / math.sqrt(max(polygons.n_cells, 1)), 0.05, 0.3))
    smooth = quantity in ("ux", "uy")
    for members, strength, edge in ((is_medium, PALE, "0.55"), (~is_medium, 1.0, "0.25")):
        chosen = np.flatnonzero(members)
        if not len(chosen):
            continue
        style: dict[str, Any] = {"facecolors": "none"}
        if smooth:
            _shade(axes, fields, members, "xy".index(quantity[1]), scale, strength)
        else:
            style = {"array": values_of(fields, quantity)[chosen], "cmap": _colours(strength), "norm": scale}
        loops = [points[cells[c]] for c in chosen]
        axes.add_collection(PolyCollection(loops, linewidths=line, edgecolors=edge, rasterized=True, **style))
    axes.add_collection(
        LineCollection(
            border_lines(polygons.offsets, polygons.connectivity, ~is_medium, points),
            colors="black",
            linewidths=0.7,
            capstyle="round",
        )
    )
    axes.set_aspect("equal")


def _shade(axes: Any, fields: Fields, members: NDArray[np.bool_], component: int, scale: Any, strength: float) -> None:
    """Colour cells by a displacement component, linear between their nodes and a mean in their middle."""
    polygons, u = fields.polygons, fields.displacement_ni
    sizes = np.diff(polygons.offsets)
    cell = np.repeat(np.arange(polygons.n_cells), sizes)
    following = np.arange(len(cell)) + 1
    following[polygons.offsets[1:] - 1] = polygons.offsets[:-1]
    first, second = polygons.connectivity, polygons.connectivity[following]
    sums = np.add.reduceat(np.column_stack([deformed(fields), u[:, component]])[first], polygons.offsets[:-1])
    middle = sums / sizes[:, None]
    points = np.vstack([deformed(fields), middle[:, :2]])
    values = np.concatenate([u[:, component], middle[:, 2]])
    triangles = np.column_stack([first, second, len(u) + cell])[members[cell]]
    axes.tripcolor(
        *points.T, triangles, values, shading="gouraud", cmap=_colours(strength), norm=scale, rasterized=True
    )


def _colours(strength: float) -> Any:
    """The colours, mixed with white; transparent ones would show where triangles meet."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    full = colormaps[COLOURS](np.linspace(0.0, 1.0, 256))[:, :3]
    return ListedColormap(1.0 - strength * (1.0 - full))
