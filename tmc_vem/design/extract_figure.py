"""Pictures of designs: densities in greys, and the outlines of what becomes of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

WIDTH = 8.0  # inches
PASSIVE, LINE = (0.72, 0.80, 0.90), (0.80, 0.15, 0.10)


def density_figure(
    mesh: PolygonMesh, density_c: Float, outlines: Any = None, displacements: Float | None = None, title: str = ""
) -> Any:
    """Figure of matplotlib with the densities of cells, white for void to black for solid.

    Args:
        mesh: the mesh of the design.
        density_c: (n_cells,) densities; those that are not a number are passive cells, which are blue.
        outlines: shapely geometry drawn on top, such as ``solid`` of :class:`tmc_vem.design.extract.Outlines`.
        displacements: (n_vertices, 2), to draw the deformed state.
        title: above.

    Raises:
        InputError: an array has another shape.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    density, points = np.asarray(density_c, dtype=float), mesh.points_vx
    if density.shape != (mesh.n_cells,):
        raise InputError(f"densities have shape {density.shape} for {mesh.n_cells} cells: give one for each cell")
    if displacements is not None:
        if np.shape(displacements) != (mesh.n_vertices, 2):
            raise InputError(
                f"displacements have shape {np.shape(displacements)} for {mesh.n_vertices} vertices: give two for each"
            )
        points = points + displacements
    extent = np.ptp(points, axis=0)
    figure = Figure(
        figsize=(WIDTH, float(np.clip(WIDTH * extent[1] / extent[0], 1.5, 10.0)) + 0.8), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    grey = 1.0 - np.clip(np.nan_to_num(density), 0.0, 1.0)
    colours = np.where(np.isnan(density)[:, None], PASSIVE, np.repeat(grey[:, None], 3, axis=1))
    cells = PolyCollection(
        [points[loop] for loop in mesh.cells()], facecolors=colours, edgecolors="face", linewidths=0.2
    )
    axes.add_collection(cells)
    left, right = mesh.cells_of_edges
    border = mesh.edges.vertices_ev[(left < 0) | (right < 0)]
    axes.add_collection(LineCollection(list(points[border]), colors="0.4", linewidths=0.6))
    if outlines is not None:
        axes.add_collection(LineCollection(_lines(mesh, outlines, displacements), colors=[LINE], linewidths=1.2))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("x" if displacements is None else "x, deformed")
    axes.set_ylabel("y" if displacements is None else "y, deformed")
    if title:
        axes.set_title(title, fontsize=10)
    return figure


def _lines(mesh: PolygonMesh, outlines: Any, displacements: Float | None) -> list[Float]:
    """Points of all rings, moved along with the mesh."""
    import shapely

    fine = 0.01 * float(np.ptp(mesh.points_vx, axis=0).max())  # straight lines bend with the mesh
    rings = shapely.get_parts(
        outlines.boundary if displacements is None else shapely.segmentize(outlines.boundary, fine)
    )
    lines: list[Float] = [shapely.get_coordinates(ring) for ring in rings]
    if displacements is None:
        return lines
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    inside, beside = (of(mesh.points_vx, displacements) for of in (LinearNDInterpolator, NearestNDInterpolator))
    found = []
    for line in lines:
        u = inside(line)
        found.append(line + np.where(np.isnan(u), beside(line), u))
    return found
