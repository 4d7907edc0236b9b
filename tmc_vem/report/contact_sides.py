"""What pictures of contact are made of: outlines that press, and axes around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.report.figures import border_lines
from tmc_vem.report.labels import label
from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.records import heading
from tmc_vem.support.units import LENGTH, Units
from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]
Int = NDArray[np.int64]

SEEN = 0.02  # of the largest pressure: below it there is nothing to draw
WIDEST = 10.0  # inches: of a picture


@dataclass(frozen=True)
class Side:
    """An outline that faces another one, with contact: its name and its stations in their order."""

    name: str
    stations: Int


def sides_of(curves: ContactCurves) -> Iterator[Side]:
    """Outlines by body and what it faces, whose pressure is seen; a body that faces itself has its lines' parts."""
    most = float(curves.pressure_n.max(initial=0.0))
    if not most > 0.0:
        return
    for body, name in enumerate(curves.bodies):
        for other, faced in enumerate(curves.bodies):
            chosen = (curves.body_n == body) & (curves.faces_n == other) & (curves.pressure_n > SEEN * most)
            if chosen.any():
                yield Side(f"on {name}, from {'itself' if name == faced else faced}", np.flatnonzero(chosen))


def draw_solids(axes: Any, curves: ContactCurves, fields: Fields | None) -> None:
    """Draw the deformed solids, or their outlines alone."""
    from matplotlib.collections import LineCollection, PolyCollection

    if fields is None:
        lines = [curves.point_nx[line] for line in curves.lines(closing=True)]
    else:
        polygons, points = fields.polygons, fields.polygons.points_nx + fields.displacement_ni
        solid = polygons.is_solid_c
        loops = [points[polygons.cell(c)] for c in np.flatnonzero(solid).tolist()]
        axes.add_collection(PolyCollection(loops, facecolors="0.9", edgecolors="0.8", linewidths=0.2, rasterized=True))
        lines = border_lines(polygons.offsets, polygons.connectivity, solid, points)
    axes.add_collection(LineCollection(lines, colors="0.25", linewidths=0.8))


def runs_of(curves: ContactCurves, stations: Int) -> list[Int]:
    """Stations that follow each other on one line, with those before and behind them."""
    breaks = np.flatnonzero((np.diff(stations) > 2) | (np.diff(curves.line_n[stations]) != 0)) + 1
    found = []
    for run in np.split(stations, breaks):
        line = np.flatnonzero(curves.line_n == curves.line_n[run[0]])
        found.append(np.arange(max(run[0] - 1, line[0]), min(run[-1] + 1, line[-1]) + 1))
    return found


def around(points: Float, margin: float) -> tuple[Float, Float]:
    """Lower left and upper right corner around points, with a margin of a part of their extent."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = margin * float((high - low).max())
    return low - room, high + room


def axis_name(name: str, units: Units) -> str:
    """What an axis of lengths is called."""
    return label(heading(name, units.of(LENGTH) if units.declared else ""))


def figure_of(columns: int, height: float, widths: list[float] | None = None) -> tuple[Any, list[Any]]:
    """A figure with axes beside one another."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDEST, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(1, columns, squeeze=False, gridspec_kw={"width_ratios": widths})[0])
    for one in axes:
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes
