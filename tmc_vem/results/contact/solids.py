"""The solids of a state with their curved sides as chains of straight pieces, and how often they cover the plane.

Sides between two cells cancel: what counts is the outline, which grows with the square root of the number of cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.system.fields import Fields

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Points are the same if they are as close as this fraction of the domain; copies on several ranks differ by rounding.
# (No round number: points of regular meshes must not lie where two intervals meet.)
SAME = 1.2345e-9
CELLS_AT_ONCE = 8192
# Faces times pieces of the outline that are looked at together.
PAIRS_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class Chains:
    """Sides as chains of pieces.

    Attributes:
        before, now: (n, m + 1, 2) points in the reference and the deformed state.
        cell: (n,) position of the side's cell among the solid ones.
    """

    before: Float
    now: Float
    cell: Int

    @cached_property
    def ids(self) -> Int:
        """(n, m + 1) numbers of the points; those at the same place in the reference state have the same."""
        return same_points(self.before.reshape(-1, 2)).reshape(self.before.shape[:2])


class Solids:
    """Solid cells.

    The displacement along a side is a polynomial through its nodes; with the chords between the nodes alone, bodies
    that touch along a curve would seem to overlap.

    Args:
        fields: the whole state.
        is_solid: (n_cells,) which cells, at least one.
        order: polynomial degree along the sides, so that each has ``order - 1`` nodes between its vertices.
        pieces: straight pieces that stand for a side.

    Attributes:
        side_nodes: (n_sides, order + 1) nodes of the sides of all solid cells.
        ends: (n_sides, 2) numbers of the vertices of each; those at the same place in the reference state are equal.
        weights: (pieces + 1, order + 1) of a side's nodes at its points.
        numbers: (n_cells,) of the solid cells, among all cells of the fields.
    """

    def __init__(self, fields: Fields, is_solid: Bool, order: int, pieces: int) -> None:
        polygons = fields.polygons
        first, n_sides = polygons.offsets[:-1] // order, np.diff(polygons.offsets) // order
        following = np.arange(1, int(n_sides.sum()) + 1)
        following[(first + n_sides - 1)[n_sides > 0]] = first[n_sides > 0]
        nodes = polygons.connectivity.reshape(-1, order)
        mine = np.repeat(is_solid, n_sides)
        self.side_nodes = np.column_stack([nodes, nodes[following, 0]])[mine]
        self.offsets = np.concatenate([[0], np.cumsum(n_sides[is_solid])])
        self.n_cells = len(self.offsets) - 1
        self.numbers = np.flatnonzero(is_solid)
        self.cell_s = np.repeat(np.arange(self.n_cells), n_sides[is_solid])
        self._before, self._now = polygons.points_nx, polygons.points_nx + fields.displacement_ni
        self.weights = _lagrange(self._before[self.side_nodes[:1]], order, pieces)
        corners = np.unique(self.side_nodes[:, [0, -1]])
        labels = np.zeros(len(self._before), dtype=np.int64)
        labels[corners] = same_points(self._before[corners])
        self.ends = labels[self.side_nodes[:, [0, -1]]]
        # copies on several ranks differ by rounding, and lines of them would not close
        one_of_them = np.empty(labels.max(initial=0) + 1, dtype=np.int64)
        one_of_them[labels[corners]] = corners
        self.side_nodes[:, [0, -1]] = one_of_them[self.ends]

    @property
    def size(self) -> float:
        """Largest extent of the solids in the reference state."""
        return float(np.ptp(self._before[self.side_nodes.ravel()], axis=0).max())

    def chains(self, sides: Int) -> Chains:
        """Some sides as chains."""
        before = self.weights @ self._before[self.side_nodes[sides]]
        return Chains(before, self.weights @ self._now[self.side_nodes[sides]], self.cell_s[sides])

    def of_cells(self, first: int, last: int) -> Float:
        """(n, m + 1, 2) points of the deformed sides of the cells from ``first`` to before ``last``."""
        points: Float = self.weights @ self._now[self.side_nodes[self.offsets[first] : self.offsets[last]]]
        return points

    def outline(self, cells: Bool | None = None) -> Int:
        """Sides that belong to one cell only, of all cells or some (n_cells,)."""
        sides = np.arange(len(self.ends)) if cells is None else np.flatnonzero(cells[self.cell_s])
        low, high = np.sort(self.ends[sides], axis=1).T
        _, inverse, counts = np.unique(low * (high.max(initial=0) + 1) + high, return_inverse=True, return_counts=True)
        once: Int = sides[counts[inverse] == 1]
        return once

    def batches(self) -> Iterator[tuple[slice, Float, Int]]:
        """All cells, some thousands at a time: which, their deformed sides, and where the sides of each begin."""
        for first in range(0, self.n_cells, CELLS_AT_ONCE):
            last = min(first + CELLS_AT_ONCE, self.n_cells)
            yield slice(first, last), self.of_cells(first, last), self.offsets[first:last] - self.offsets[first]

    def polygons(self, cells: Int) -> NDArray[Any]:
        """Some deformed cells as polygons of shapely, valid ones even where a run went astray."""
        import shapely

        loops = [self.of_cells(c, c + 1)[:, :-1].reshape(-1, 2) for c in cells.tolist()]
        return np.asarray(shapely.make_valid(np.array([shapely.Polygon(loop) for loop in loops])), dtype=object)

    def boxes(self) -> NDArray[Any]:
        """(n_cells,) boxes around the deformed cells."""
        import shapely

        found = []
        for _, sides, starts in self.batches():
            low, high = (find.reduceat(find.reduce(sides, axis=1), starts) for find in (np.minimum, np.maximum))
            found.append(shapely.box(*low.T, *high.T))
        return np.concatenate(found)

    def bodies(self) -> Int:
        """(n_cells,) number of the connected body of each cell."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = int(self.ends.max()) + 1
        graph = coo_array((np.ones(len(self.ends)), self.ends.T), shape=(n, n))
        body: Int = connected_components(graph, directed=False)[1][self.ends[self.offsets[:-1], 0]]
        return body

    def crossed(self) -> Bool:
        """(n_cells,) whether the outline of a deformed cell crosses itself or runs clockwise."""
        bad = np.zeros(self.n_cells, dtype=np.bool_)
        for cells, sides, starts in self.batches():
            bad[cells] = ~_star_shaped(sides, starts)
        doubtful = np.flatnonzero(bad)
        bad[doubtful] = [_is_crossed(self.of_cells(c, c + 1)) for c in doubtful.tolist()]
        return bad


def same_points(points_nx: Float) -> Int:
    """(n,) numbers from 0 of places; points at the same place have the same."""
    low = points_nx.min(axis=0)
    grid = np.round((points_nx - low) / (SAME * float(np.ptp(points_nx, axis=0).max()))).astype(np.int64)
    number: Int = np.unique((grid[:, 0] << 31) | grid[:, 1], return_inverse=True)[1]
    return number


def covered(outline: Chains) -> tuple[NDArray[Any], Int]:
    """Faces into which an outline divides the plane, and how many cells cover each: its winding number there."""
    import shapely

    faces = shapely.get_parts(
        shapely.polygonize(shapely.get_parts(shapely.union_all(shapely.linestrings(outline.now))))
    )
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    start, end = outline.now[:, :-1].reshape(-1, 2), outline.now[:, 1:].reshape(-1, 2)
    step = max(1, PAIRS_AT_ONCE // max(1, len(start)))
    times = [_winding(inside[n : n + step], start, end) for n in range(0, len(inside), step)]
    return faces, np.concatenate([np.empty(0, dtype=np.int64), *times])


def _winding(points: Float, start: Float, end: Float) -> Int:
    """(n,) how often closed directed lines of pieces run round points: pieces that cross the ray to the right."""
    x, y = points.T[:, :, None]
    side = (end[:, 0] - start[:, 0]) * (y - start[:, 1]) - (x - start[:, 0]) * (end[:, 1] - start[:, 1])
    up = (start[:, 1] <= y) & (end[:, 1] > y) & (side > 0.0)
    down = (start[:, 1] > y) & (end[:, 1] <= y) & (side < 0.0)
    number: Int = up.sum(axis=1) - down.sum(axis=1)
    return number


def _lagrange(side: Float, order: int, pieces: int) -> Float:
    """Weights (pieces + 1, order + 1) of a side's nodes at its points; its nodes as they are along the first side."""
    nodes = np.arange(order + 1) / order
    if len(side):
        along = np.hypot(*(side[0] - side[0, 0]).T)
        nodes = along / along[-1]
    t = np.arange(pieces + 1) / pieces
    weights = np.ones((pieces + 1, order + 1))
    for a in range(order + 1):
        for b in range(order + 1):
            if a != b:
                weights[:, a] *= (t - nodes[b]) / (nodes[a] - nodes[b])
    return weights


def _star_shaped(sides: Float, starts: Int) -> Bool:
    """(n_cells,) whether from a cell's middle all of its outline (sides (n, m + 1, 2)) is seen, counter-clockwise and
    once; then it does not cross itself."""
    counts = np.diff([*starts, len(sides)])
    middle = np.add.reduceat(sides[:, 0], starts) / counts[:, None]
    x, y = np.moveaxis(sides - np.repeat(middle, counts, axis=0)[:, None], -1, 0)
    positive = (x[:, :-1] * y[:, 1:] > x[:, 1:] * y[:, :-1]).all(axis=1)
    turns = ((y[:, :-1] <= 0.0) & (y[:, 1:] > 0.0)).sum(axis=1)
    seen: Bool = np.logical_and.reduceat(positive, starts) & (np.add.reduceat(turns, starts) == 1)
    return seen


def _is_crossed(sides: Float) -> bool:
    import shapely

    ring = shapely.linearrings(sides[:, :-1].reshape(-1, 2))
    return not (shapely.is_valid(shapely.polygons(ring)) and shapely.is_ccw(ring))
