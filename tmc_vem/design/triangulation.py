"""Delaunay triangles of some cells of a polygon mesh, with a node in every cell, within the outline of these cells.

Every cell is fanned from its centroid, and sides of triangles are flipped until the angles opposite each add up to
180 degrees at most (Lawson, 1977); where the angle opposite a side on the outline is obtuse, that side is cut at the
foot of the perpendicular. Then the stiffness matrix of linear elements for the Laplacian has no positive entry off its
diagonal, whatever the cells are: stretched rectangles, polygons, cells with hanging nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem.spaces.delaunay import delaunay_pieces

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Angles (radians) are compared up to this: those on one circle stay as they are.
TIE = 1e-9
# Rounds of flips, each of which flips all that are not in each other's way; and of nodes added on the outline.
MOST_FLIPS, MOST_FEET = 10_000, 50


@dataclass(frozen=True)
class Triangulation:
    """Triangles within the outline of some cells.

    Attributes:
        points_px: (n_points, 2) coordinates; the first n_cells are those of the cells, which are their centroids where
            cells are star-shaped about them.
        triangles_tp: (n_triangles, 3) points, counter-clockwise.
        n_cells: number of cells.
    """

    points_px: Float
    triangles_tp: Int
    n_cells: int

    def weights(self) -> tuple[Int, Float]:
        """Sides (n_sides, 2) and the weights (n_sides,) of the stiffness matrix -w between their ends.

        w is half the sum of the cotangents of the angles opposite the side, as of linear elements. Where it is negative
        after all, it is 0: rounding, and sharp corners of the outline.
        """
        sides = _sides(self.points_px, self.triangles_tp)
        cot = 1.0 / np.tan(sides.angle_s)
        other = np.zeros(len(cot))
        inner = sides.there_s >= 0
        other[inner] = 1.0 / np.tan(sides.opposite_s[inner])
        return sides.ends_se, np.maximum(0.5 * (cot + other), 0.0)


@dataclass(frozen=True)
class _Sides:
    """Sides of triangles, once each: ends, and the triangles, their third points and the angles there on both sides."""

    ends_se: Int
    here_s: Int  # triangle in which the side runs from the first end to the second
    tip_s: Int
    angle_s: Float
    there_s: Int  # the other triangle, -1 on the outline
    other_tip_s: Int
    opposite_s: Float  # 0 on the outline


def triangulate(mesh: PolygonMesh, cells: Int) -> Triangulation:
    """Delaunay triangles of some cells of a mesh, within their outline.

    Args:
        mesh: the mesh.
        cells: (n_cells,) numbers of different cells.
    """
    points, triangles = _fans(mesh, cells)
    for _ in range(MOST_FEET):
        triangles = _flipped(points, triangles)
        sides = _sides(points, triangles)
        obtuse = np.flatnonzero((sides.there_s < 0) & (sides.angle_s > 0.5 * np.pi + TIE))
        if not len(obtuse):
            break
        points, triangles = _with_feet(points, triangles, sides, obtuse)
    return Triangulation(points, triangles, len(cells))


def _fans(mesh: PolygonMesh, cells: Int) -> tuple[Float, Int]:
    """Points, those of the cells first, and triangles from the point of each cell to its sides."""
    n_cells = len(cells)
    hubs = np.empty((n_cells, 2))
    pieces: list[Int] = []
    used = np.unique(np.concatenate([mesh.cell(c) for c in cells]))
    number = np.full(mesh.n_vertices, -1, dtype=np.int64)
    number[used] = n_cells + np.arange(len(used))
    sizes = mesh.n_sides_c[cells]
    for size in np.unique(sizes):
        chosen = np.flatnonzero(sizes == size)
        vertices = mesh.cell_vertices[mesh.cell_offsets[cells[chosen]][:, None] + np.arange(size)]
        polygons = mesh.points_vx[vertices]
        center = centroids(polygons)
        star = star_shaped_about(polygons, center)
        hubs[chosen[star]] = center[star]
        loops = number[vertices[star]]
        fan = np.stack([np.repeat(chosen[star][:, None], size, axis=1), loops, np.roll(loops, -1, axis=1)], axis=-1)
        pieces.append(fan.reshape(-1, 3))
        for n in np.flatnonzero(~star):
            hub, triangles = _bent(polygons[n])
            hubs[chosen[n]] = hub
            pieces.append(np.append(number[vertices[n]], chosen[n])[triangles])
    return np.concatenate([hubs, mesh.points_vx[used]]), np.concatenate(pieces)


def _bent(polygon_vx: Float) -> tuple[Float, Int]:
    """Node (2,) and triangles (n, 3) of a polygon that is not star-shaped about its centroid; -1 is the node.

    The node is the centroid of the largest convex piece of its own triangulation.
    """
    loops = delaunay_pieces(polygon_vx)
    extent = [_area(polygon_vx[loop]) for loop in loops]
    largest = int(np.argmax(extent))
    triangles: list[list[int]] = []
    for n, loop in enumerate(loops):
        if n == largest:
            triangles += [[-1, loop[s - 1], loop[s]] for s in range(len(loop))]
        else:
            triangles += [[loop[0], a, b] for a, b in pairwise(loop[1:])]
    return centroids(polygon_vx[loops[largest]][None])[0], np.array(triangles, dtype=np.int64)


def _area(polygon_vx: Float) -> float:
    x, y = (polygon_vx - polygon_vx[0]).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _sides(points: Float, triangles: Int) -> _Sides:
    start = triangles.ravel()
    end = np.roll(triangles, -1, axis=1).ravel()
    tip = np.roll(triangles, -2, axis=1).ravel()
    owner = np.repeat(np.arange(len(triangles)), 3)
    angle = _angles(points, start, tip, end)
    order = np.lexsort([start > end, np.maximum(start, end), np.minimum(start, end)])
    low, high = np.minimum(start, end)[order], np.maximum(start, end)[order]
    first = np.flatnonzero(np.r_[True, (low[1:] != low[:-1]) | (high[1:] != high[:-1])])
    shared = np.diff(np.r_[first, len(order)]) == 2
    here = order[first]
    there = np.full(len(first), -1)
    there[shared] = order[first[shared] + 1]
    return _Sides(
        ends_se=np.stack([start[here], end[here]], axis=1),
        here_s=owner[here],
        tip_s=tip[here],
        angle_s=angle[here],
        there_s=np.where(shared, owner[there], -1),
        other_tip_s=np.where(shared, tip[there], -1),
        opposite_s=np.where(shared, angle[there], 0.0),
    )


def _angles(points: Float, a: Int, tip: Int, b: Int) -> Float:
    """Angles (n,) at the tips of triangles."""
    u, v = points[a] - points[tip], points[b] - points[tip]
    angle: Float = np.arctan2(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), np.einsum("px,px->p", u, v))
    return angle


def _flipped(points: Float, triangles: Int) -> Int:
    """Triangles in which the angles opposite every inner side add up to 180 degrees at most."""
    triangles = triangles.copy()
    for _ in range(MOST_FLIPS):
        sides = _sides(points, triangles)
        excess = np.where(sides.there_s >= 0, sides.angle_s + sides.opposite_s - np.pi, -np.inf)
        bad = np.flatnonzero(excess > TIE)
        if not len(bad):
            break
        bad = bad[np.argsort(-excess[bad], kind="stable")]
        rank = np.arange(len(bad))
        best = np.full(len(triangles), len(bad))
        np.minimum.at(best, sides.here_s[bad], rank)
        np.minimum.at(best, sides.there_s[bad], rank)
        s = bad[(best[sides.here_s[bad]] == rank) & (best[sides.there_s[bad]] == rank)]
        a, b = sides.ends_se[s].T
        c, d = sides.tip_s[s], sides.other_tip_s[s]
        triangles[sides.here_s[s]] = np.stack([a, d, c], axis=1)
        triangles[sides.there_s[s]] = np.stack([d, b, c], axis=1)
    return triangles


def _with_feet(points: Float, triangles: Int, sides: _Sides, chosen: Int) -> tuple[Float, Int]:
    """Triangles cut in two at the feet of their tips on some sides, at most one side of a triangle."""
    a, b = sides.ends_se[chosen].T
    tip = sides.tip_s[chosen]
    along = points[b] - points[a]
    t = np.einsum("sx,sx->s", points[tip] - points[a], along) / np.einsum("sx,sx->s", along, along)
    foot = len(points) + np.arange(len(chosen))
    triangles = triangles.copy()
    triangles[sides.here_s[chosen]] = np.stack([a, foot, tip], axis=1)
    return (
        np.concatenate([points, points[a] + t[:, None] * along]),
        np.concatenate([triangles, np.stack([foot, b, tip], axis=1)]),
    )
