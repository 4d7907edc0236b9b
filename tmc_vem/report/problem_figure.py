"""A problem drawn with its regions, supports, load and gap, and meshes side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.constraints import Gap, Prescribed
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.report.figures import MEDIUM, _outline

SOLIDS = ("#c9d3dc", "#aebccb", "#dcd2c4")
MEDIUM_COLOUR = "#eaf3fb"
SUPPORT, LOAD, GAP = "#1c2024", "#c0392b", "#0b5394"


def draw_problem(mesh: PolygonMesh, prescribed: Sequence[Prescribed], load: Prescribed, gap: Gap | None) -> Any:
    """Figure of a problem: fixed components as triangles that point along them, loads as arrows, the gap as a line."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    points = np.asarray(mesh.points_vx)
    extent = np.ptp(points, axis=0)
    figure, (axes,) = _panels(1, extent, width=9.0, height=(1.5, 5.5), margin=0.9)
    _fill(axes, mesh, edges=False)
    unit = 0.05 * float(extent.max())
    for condition in prescribed:
        at = _places(mesh, condition.where)
        if condition.value:
            direction = np.eye(2)[condition.component] * math.copysign(1.0, condition.value)
            for x in at[:: max(1, len(at) // 6)]:
                tail = x - 1.6 * unit * direction
                axes.annotate("", x, tail, arrowprops={"arrowstyle": "-|>", "color": LOAD, "linewidth": 1.6})
        else:
            marker = (">", "^")[condition.component]
            shown = at[:: max(1, len(at) // 12)] - 0.35 * unit * np.eye(2)[condition.component]
            axes.plot(*shown.T, marker, color=SUPPORT, markersize=7, clip_on=False)
    handles = [
        Patch(facecolor=SOLIDS[0], edgecolor="black", label="solid"),
        Patch(facecolor=MEDIUM_COLOUR, edgecolor="0.6", label="third medium"),
        Line2D([], [], marker="^", linestyle="", color=SUPPORT, label="fixed component"),
        Line2D([], [], marker="v", linestyle="-", color=LOAD, label=f"$u_{'xy'[load.component]}$ = {load.value:g}"),
    ]
    if gap is not None:
        ends = np.concatenate([_places(mesh, gap.first), _places(mesh, gap.second)])
        axes.plot(*ends.T, "o-", color=GAP, markersize=4, linewidth=1.2)
        handles.append(Line2D([], [], marker="o", color=GAP, label="gap"))
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=5, fontsize=8, frameon=False)
    axes.set_ylim(points[:, 1].min() - 2 * unit, points[:, 1].max() + 2 * unit)
    axes.set_xlim(points[:, 0].min() - 2 * unit, points[:, 0].max() + 2 * unit)
    return figure


def draw_meshes(meshes: Sequence[tuple[str, PolygonMesh]]) -> Any:
    """Figure with a panel for each mesh."""
    extent = np.ptp(np.asarray(meshes[0][1].points_vx), axis=0)
    figure, panels = _panels(len(meshes), extent, width=10.0, height=(0.8, 4.0), margin=0.3)
    for axes, (title, mesh) in zip(panels, meshes, strict=True):
        _fill(axes, mesh, edges=True)
        axes.autoscale_view()
        axes.set_title(title, fontsize=9)
    return figure


def _panels(n: int, extent: NDArray[np.float64], width: float, height: tuple[float, float], margin: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(n, 3)
    rows = math.ceil(n / columns)
    panel = float(np.clip(width / columns * extent[1] / extent[0], *height)) + margin
    figure = Figure(figsize=(width, rows * panel), layout="constrained")
    FigureCanvasAgg(figure)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in panels:
        axes.set_axis_off()
        axes.set_aspect("equal")
    return figure, panels[:n]


def _fill(axes: Any, mesh: PolygonMesh, *, edges: bool) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    points = np.asarray(mesh.points_vx)
    cells = [np.asarray(cell) for cell in mesh.cells()]
    solids = [name for name in mesh.region_names if not name.startswith(MEDIUM)]
    for number, name in enumerate(mesh.region_names):
        medium = name.startswith(MEDIUM)
        colour = MEDIUM_COLOUR if medium else SOLIDS[solids.index(name) % len(SOLIDS)]
        chosen = np.flatnonzero(np.asarray(mesh.region_c) == number)
        collection = PolyCollection(
            [points[cells[c]] for c in chosen],
            facecolors=colour,
            edgecolors="0.55" if edges else colour,
            linewidths=float(np.clip(8.0 / math.sqrt(len(cells)), 0.05, 0.4)),
            rasterized=True,
        )
        axes.add_collection(collection)
    inside = np.array([not name.startswith(MEDIUM) for name in mesh.region_names])[np.asarray(mesh.region_c)]
    axes.add_collection(LineCollection(_outline(cells, inside, points), colors="black", linewidths=0.9))


def _places(mesh: PolygonMesh, where: str) -> NDArray[np.float64]:
    """(n, 2) vertices of a named point or of named edges."""
    points = np.asarray(mesh.points_vx)
    if where in mesh.named_points:
        return points[[mesh.named_points[where]]]
    return points[np.unique(np.asarray(mesh.named_edges[where]))]
