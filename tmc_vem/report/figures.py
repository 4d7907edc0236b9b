"""Pictures of states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fields import Fields

Float = NDArray[np.float64]

MEDIUM = "medium"
COLOURS = "viridis"


def draw_deformed(fields: Fields, path: Path, title: str = "", *, component: int = 1) -> None:
    """Draw the deformed configuration, coloured by a displacement component.

    Solid cells are drawn in full colour with a dark outline of the solid; cells of the third medium are pale with
    hairline edges.

    Args:
        fields: the state.
        path: picture file; its suffix decides the format.
        title: text above the picture.
        component: 0 for u_x, 1 for u_y.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    polygons = fields.polygons
    deformed = polygons.points_nx + fields.displacement_ni
    cells = [polygons.cell(c) for c in range(polygons.n_cells)]
    u = fields.displacement_ni[:, component]
    colour_c = np.array([u[cell].mean() for cell in cells])
    is_medium = np.array([polygons.region_names[region].startswith(MEDIUM) for region in polygons.region_c])
    scale = Normalize(u.min(), u.max() if np.ptp(u) > 0 else u.min() + 1.0)

    extent = np.ptp(deformed, axis=0)
    width = 9.0
    height = float(np.clip(0.85 * width * extent[1] / extent[0], 1.5, 8.0)) + 1.7  # 1.7 for title, labels and scale
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.08, 1.3 / height, 0.89, 1.0 - 1.7 / height))
    scale_axes = figure.add_axes((0.08, 0.5 / height, 0.89, 0.15 / height))
    styles = ((is_medium, 0.35, 0.15, "0.45"), (~is_medium, 1.0, 0.25, "0.25"))
    for members, alpha, line, edge in styles:
        chosen = np.flatnonzero(members)
        collection = PolyCollection(
            [deformed[cells[c]] for c in chosen], array=colour_c[chosen], cmap=COLOURS, norm=scale,
            alpha=alpha, linewidths=line, edgecolors=edge,
        )  # fmt: skip
        axes.add_collection(collection)
    axes.add_collection(LineCollection(outline(cells, ~is_medium, deformed), colors="black", linewidths=0.9))
    figure.colorbar(collection, cax=scale_axes, orientation="horizontal", label=f"$u_{'xy'[component]}$")
    if is_medium.any():
        middle = collection.get_cmap()(0.5)
        axes.legend(
            handles=[
                Patch(facecolor=middle, edgecolor="black", label="solid"),
                Patch(facecolor=middle, alpha=0.35, edgecolor="0.45", linewidth=0.3, label="third medium"),
            ],
            loc="lower right",
            fontsize=8,
        )
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("x")
    axes.set_ylabel("y")
    figure.savefig(path, dpi=130)


def outline(cells: list[NDArray[np.int64]], chosen: NDArray[np.bool_], points: Float) -> list[Float]:
    """Polylines of all sides that belong to exactly one of the chosen cells, compared by position (points of ranks are
    doubled). They are joined, as dots would show where single sides meet."""
    import shapely

    loops = [cell for cell, use in zip(cells, chosen, strict=True) if use]
    if not loops:
        return []
    start, end = np.concatenate(loops), np.concatenate([np.roll(loop, -1) for loop in loops])
    rounded, place = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    ends = np.sort(np.column_stack([place.ravel()[start], place.ravel()[end]]), axis=1)
    sides, count = np.unique(ends, axis=0, return_counts=True)
    once = sides[(count == 1) & (sides[:, 0] != sides[:, 1])]
    if not len(once):
        return []
    joined = shapely.line_merge(shapely.multilinestrings(shapely.linestrings(rounded[once])))
    return [shapely.get_coordinates(line) for line in shapely.get_parts(joined)]
