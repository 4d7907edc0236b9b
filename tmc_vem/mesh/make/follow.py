"""Middles of interfaces and boundaries are moved onto curves where no cell suffers from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.make.loops import Loops
from tmc_vem.mesh.make.onto_curves import Followed, onto_curves
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.validate import is_simple

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# A triangle of hub and edge keeps at least this fraction of its height where a vertex is moved onto a curve.
SQUEEZED = 0.25


def follow(
    mesh: PolygonMesh,
    points: Float,
    halved: Int,
    full: Loops,
    hub_c: Int,
    parts: tuple[Loops, Int],
    curves: Sequence[Followed],
) -> None:
    """Move middles of edges between regions, and on the boundary, onto curves, where no cell suffers from it.

    Args:
        mesh: the mesh before.
        points: of the mesh after, of which middles are moved; they come after the vertices of the mesh before.
        halved: (n,) edges of the mesh before that have them.
        full: its cells with these middles.
        hub_c: (n_cells,) points from which they are cut, -1 for cells that are not.
        parts: those that other cells are cut into, and their cells.
        curves: the curves.
    """
    left, right = (cells[halved] for cells in mesh.cells_of_edges)
    rows = np.flatnonzero((left < 0) | (right < 0) | (mesh.region_c[left] != mesh.region_c[right]))
    target, moves = onto_curves(mesh.points_vx, mesh.edges.vertices_ev[halved[rows]], curves)
    rows, target = rows[moves], target[moves]
    straight = points.copy()
    while len(rows):
        points[mesh.n_vertices + rows] = target
        moved = np.zeros(len(points), dtype=bool)
        moved[mesh.n_vertices + rows] = True
        bad = np.zeros(mesh.n_cells + 1, dtype=bool)  # the last for where there is no cell
        for loops, cells in ((full, np.arange(mesh.n_cells)), parts):
            touched = np.flatnonzero(loops.any(moved[loops.vertices]))
            good = _still_good(loops.chosen(touched), hub_c[cells[touched]], points, straight)
            bad[cells[touched[~good]]] = True
        reverted = bad[left[rows]] | bad[right[rows]]
        if not reverted.any():
            return
        points[mesh.n_vertices + rows[reverted]] = straight[mesh.n_vertices + rows[reverted]]
        rows, target = rows[~reverted], target[~reverted]


def _still_good(loops: Loops, hub_n: Int, points: Float, straight: Float) -> Bool:
    """Whether cells are still seen from their hub, if they have one, or are as good as with straight sides."""
    good = np.empty(len(loops), dtype=bool)
    for which, vertices in loops.by_size():
        hub = hub_n[which]
        fan = hub >= 0
        after, before = (_heights(x[vertices], x[hub][:, None]) for x in (points, straight))
        good[which[fan]] = (after >= SQUEEZED * before)[fan].all(axis=1)
        now, was = points[vertices[~fan]], straight[vertices[~fan]]
        star = star_shaped_about(now, centroids(now))
        lost = star_shaped_about(was, centroids(was)) & ~star
        good[which[~fan]] = ~lost
        for n in np.flatnonzero(~star & ~lost).tolist():
            good[which[~fan][n]] = is_simple(now[n])
    return good


def _heights(polygons: Float, hubs: Float) -> Float:
    a = polygons - hubs
    b = np.roll(a, -1, axis=1)
    height: Float = (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / np.hypot(*np.moveaxis(b - a, -1, 0))
    return height
