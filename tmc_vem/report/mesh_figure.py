"""Pictures of meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.report.labels import label


def draw_mesh(mesh: PolygonMesh, path: Path, *, numbers: bool = False) -> None:
    """Draw a mesh, a colour for each region, with its named points and edges.

    Args:
        mesh: what to draw.
        path: picture file; its suffix decides the format.
        numbers: write the number of each cell at its middle.
    """
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    extent = np.ptp(mesh.points_vx, axis=0)
    width = 10.0
    figure = Figure(figsize=(width, float(np.clip(width * extent[1] / extent[0], 2.0, 12.0)) + 1.0))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    colours = colormaps["Set2"]
    loops = [mesh.points_vx[loop] for loop in mesh.cells()]
    line = float(np.clip(60.0 / np.sqrt(mesh.n_cells) / 4.0, 0.05, 0.8))
    faces = [colours(r % 8) for r in mesh.region_c.tolist()]
    axes.add_collection(PolyCollection(loops, facecolors=faces, edgecolors="0.25", linewidths=line))
    handles = [Patch(facecolor=colours(r % 8), label=label(name)) for r, name in enumerate(mesh.region_names)]
    for n, (name, pairs) in enumerate(mesh.named_edges.items()):
        colour = f"C{n}"
        lines = LineCollection(mesh.points_vx[pairs], colors=colour, linewidths=2.5, label=label(name))
        axes.add_collection(lines)
        handles.append(lines)
    for name, vertex in mesh.named_points.items():
        axes.plot(*mesh.points_vx[vertex], "k.", markersize=6)
        axes.annotate(label(name), mesh.points_vx[vertex], textcoords="offset points", xytext=(3, 3), fontsize=7)
    if numbers:
        for c, loop in enumerate(loops):
            axes.text(*loop.mean(axis=0), str(c), fontsize=5, ha="center", va="center")
    axes.legend(handles=handles, fontsize=7, loc="upper right", framealpha=0.8)
    axes.set_title(f"{mesh.n_cells} cells, {mesh.n_vertices} vertices", fontsize=9)
    axes.set_aspect("equal")
    axes.autoscale_view()
    figure.savefig(path, dpi=130)
