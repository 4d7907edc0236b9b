"""Local refinement: marked cells are cut from centroid to middles of sides, neighbours get hanging nodes.

A side is the chain of edges between two corners, a corner is a vertex where the boundary turns. So a quadrilateral with
hanging nodes is cut into four quadrilaterals (a quadtree), a hexagon into six; and where a side has a hanging node in
its middle, that node is used.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# A vertex is a corner if the boundary turns there by more than the angle with this sine.
TURN = 1e-6
# A hanging node serves as the middle of a side if it is at most this fraction of its length away from it.
OFF_MIDDLE = 0.2


def refine(mesh: PolygonMesh, marked: Int | Sequence[int] | NDArray[np.bool_], *, max_hanging: int = 1) -> PolygonMesh:
    """Mesh with the marked cells cut into one cell a corner.

    Args:
        mesh: any mesh of cells that are star-shaped about their centroid.
        marked: numbers of cells, or a mask over all cells.
        max_hanging: largest number of hanging nodes that refinement may leave on a side; cells with more are refined
            too. Every hanging node raises the degree l that a cell needs, and l = 8 is the end.

    Returns:
        The mesh; cells keep their region, named points their place, and named edges that are cut are named in pieces.

    Raises:
        InputError: a number is no cell, ``max_hanging`` is below 1, or a marked cell is not star-shaped about its
            centroid.
    """
    if max_hanging < 1:
        raise InputError(f"max_hanging = {max_hanging}: a refined cell leaves one hanging node, use 1 or more")
    mask = np.zeros(mesh.n_cells, dtype=bool)
    chosen = np.asarray(marked) if len(marked) else np.empty(0, dtype=np.int64)
    if chosen.dtype != np.bool_ and len(chosen) and not (chosen.min() >= 0 and chosen.max() < mesh.n_cells):
        raise InputError(
            f"cells {chosen.min()} to {chosen.max()} are marked, but cells run from 0 to {mesh.n_cells - 1}"
        )
    if chosen.dtype == np.bool_ and chosen.shape != mask.shape:
        raise InputError(f"the mask has {len(chosen)} entries for {mesh.n_cells} cells")
    mask[chosen] = True
    work = _Refinement(mesh)
    pending = np.flatnonzero(mask).tolist()
    while pending:
        for c in pending:
            work.cut(c)
        pending = work.overloaded(max_hanging)
    return work.result()


class _Refinement:
    """Collects new points, middles of edges and children."""

    def __init__(self, mesh: PolygonMesh) -> None:
        self.mesh = mesh
        self.points = mesh.points_vx.tolist()
        self.loops: list[list[int]] = [loop.tolist() for loop in mesh.cells()]
        self.region = mesh.region_c.tolist()
        self.children: dict[int, list[list[int]]] = {}
        self.middle: dict[tuple[int, int], int] = {}
        self.cells_at: dict[tuple[int, int], list[int]] = {}
        for c, loop in enumerate(self.loops):
            for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
                self.cells_at.setdefault((min(a, b), max(a, b)), []).append(c)
        self.touched: set[int] = set()

    def cut(self, c: int) -> None:
        """Replace cell ``c`` by its children."""
        if c in self.children:
            return
        corners, chains = _sides(self.full_loop(c), self.points)
        polygon = np.array([self.points[v] for v in corners])[None]
        center = centroids(polygon)
        if not star_shaped_about(polygon, center)[0]:
            raise InputError(f"cell {c} cannot be refined: it is not star-shaped about its centroid")
        halves = [self._halve(chain, c) for chain in chains]
        hub = self._add(center[0].tolist())
        self.children[c] = []
        for s in range(len(corners)):  # the child at corner s lies between the sides s - 1 and s
            before, after = halves[s - 1][1], halves[s][0]
            self.children[c].append([*before, *after[1:], hub])

    def full_loop(self, c: int) -> list[int]:
        """Vertices of a cell with the middles that refinement put on its edges."""
        full = []
        loop = self.loops[c]
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            full.append(a)
            if (min(a, b), max(a, b)) in self.middle:
                full.append(self.middle[min(a, b), max(a, b)])
        return full

    def overloaded(self, limit: int) -> list[int]:
        """Cells next to refined ones with more hanging nodes on a side than the limit."""
        over = []
        for c in self.touched - set(self.children):
            _, chains = _sides(self.full_loop(c), self.points)
            if max(len(chain) for chain in chains) - 2 > limit:
                over.append(c)
        return over

    def result(self) -> PolygonMesh:
        """The refined mesh."""
        cells, region = [], []
        for c in range(len(self.loops)):
            # children of a cell that was cut before its neighbour may have got middles on their outer edges since
            parts = self.children.get(c, [self.full_loop(c)])
            cells += [self._with_middles(part) for part in parts] if c in self.children else parts
            region += [self.region[c]] * len(parts)
        mesh = self.mesh
        named_edges = {}
        for name, pairs in mesh.named_edges.items():
            pieces = []
            for a, b in pairs.tolist():
                middle = self.middle.get((min(a, b), max(a, b)))
                pieces += [(a, b)] if middle is None else [(a, middle), (middle, b)]
            named_edges[name] = np.array(pieces, dtype=np.int64)
        return PolygonMesh.from_cells(
            self.points, cells, region, mesh.region_names, dict(mesh.named_points), named_edges
        )  # fmt: skip

    def _with_middles(self, loop: list[int]) -> list[int]:
        full = []
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            full.append(a)
            if (min(a, b), max(a, b)) in self.middle:
                full.append(self.middle[min(a, b), max(a, b)])
        return full

    def _halve(self, chain: list[int], cell: int) -> tuple[list[int], list[int]]:
        """Both halves of a side, the middle in each; an edge is halved if no node is near the middle."""
        p = np.array([self.points[v] for v in chain])
        at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])
        at /= at[-1]
        n = int(np.argmin(np.abs(at - 0.5)))
        if 0 < n < len(chain) - 1 and abs(at[n] - 0.5) <= OFF_MIDDLE:
            return chain[: n + 1], chain[n:]
        n = int(np.searchsorted(at, 0.5)) - 1  # the edge that has the middle in it
        a, b = chain[n], chain[n + 1]
        key = (min(a, b), max(a, b))
        if key in self.cells_at:
            node = self._add(((p[n] + p[n + 1]) / 2).tolist())
            self.middle[key] = node
            self.touched.update(self.cells_at[key])
        else:  # half of an edge that is already cut: take the middle there is
            n += 0 if abs(at[n] - 0.5) <= abs(at[n + 1] - 0.5) else 1
            n = min(max(n, 1), len(chain) - 2)
            return chain[: n + 1], chain[n:]
        return [*chain[: n + 1], node], [node, *chain[n + 1 :]]

    def _add(self, point: list[float]) -> int:
        self.points.append(point)
        return len(self.points) - 1


def _sides(loop: list[int], points: list[list[float]]) -> tuple[list[int], list[list[int]]]:
    """Corners of a loop, and its sides as chains from corner to corner."""
    p = np.array([points[v] for v in loop])
    before, after = p - np.roll(p, 1, axis=0), np.roll(p, -1, axis=0) - p
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    turns = np.abs(cross) > TURN * np.hypot(*before.T) * np.hypot(*after.T)
    at = np.flatnonzero(turns).tolist()
    chains = []
    for n, first in enumerate(at):
        last = at[(n + 1) % len(at)]
        last += len(loop) if last <= first else 0
        chains.append([loop[i % len(loop)] for i in range(first, last + 1)])
    return [loop[i] for i in at], chains
