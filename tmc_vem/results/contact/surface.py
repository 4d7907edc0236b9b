"""The surface of the solids towards the medium: sides between both, joined to lines with nodes along them.

A line runs so that its solid is on the left. It ends where the medium does, at the edge of the domain for example;
around a body that is all in medium it is closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.bodies import named_bodies
from tmc_vem.problems.contact_quantities import joint_of
from tmc_vem.results.contact.solids import same_points
from tmc_vem.system.fields import Polygons
from tmc_vem.system.trace import Trace

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

GAUSS = 4  # points for the length between two nodes


@dataclass(frozen=True)
class Surface:
    """Stations on lines: nodes of the sides, line by line in the order in which they follow each other.

    A node where two lines meet is a station of each.

    Attributes:
        points_nx: (n, 2) reference coordinates of the stations.
        place_n: (n,) number of the place of each; stations at one node have the same.
        line_n: (n,) line of each.
        closed_l: (n_lines,) which lines are closed.
        body_l: (n_lines,) body of each line.
        bodies: names of the bodies that have a line: that of their regions, with ``-2``, ``-3``, ... for further ones.
        stations_sa: (n_sides, k + 1) stations of each side, from its first point to its last.
        solid_s, medium_s: (n_sides,) cells on both sides, by position in the polygons.
        joint: what stands between the names of two bodies in that of their pair; see
            :func:`tmc_vem.problems.contact_quantities.joint_of`.
    """

    points_nx: Float
    place_n: Int
    line_n: Int
    closed_l: Bool
    body_l: Int
    bodies: tuple[str, ...]
    stations_sa: Int
    solid_s: Int
    medium_s: Int
    joint: str

    def __len__(self) -> int:
        return len(self.points_nx)

    @property
    def body_n(self) -> Int:
        """(n,) body of each station."""
        return self.body_l[self.line_n]

    @cached_property
    def trace(self) -> Trace:
        """Integrals along a side."""
        return Trace.of(self._nodes_a)

    @cached_property
    def _nodes_a(self) -> Float:
        first = self.points_nx[self.stations_sa[0]]
        along = np.hypot(*(first - first[0]).T)
        nodes: Float = along / along[-1]
        return nodes

    @cached_property
    def length_s(self) -> Float:
        """(n_sides,) reference lengths."""
        ends = self.points_nx[self.stations_sa[:, [0, -1]]]
        length: Float = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return length

    @cached_property
    def weight_n(self) -> Float:
        """(n,) reference length that each station stands for: Simpson's rule along each side for k = 2, the rule of
        the side's own nodes for any k. The sum is the length of the lines."""
        return self.summed(self.length_s[:, None] * self.trace.mean_a)

    @cached_property
    def share_n(self) -> Float:
        """(n,) part of its node's forces that each station has: 1 but where lines meet."""
        total = np.bincount(self.place_n, weights=self.weight_n)
        share: Float = self.weight_n / total[self.place_n]
        return share

    def summed(self, values_sa: Float) -> Float:
        """(n,) sums at the stations of values (n_sides, k + 1) of the sides."""
        return np.bincount(self.stations_sa.ravel(), values_sa.ravel(), len(self)).astype(np.float64)

    def tangents(self, points_nx: Float) -> Float:
        """(n_sides, k + 1, 2) derivatives of the sides' points by the reference length, at their nodes.

        Args:
            points_nx: (n, 2) where the stations are.
        """
        at_nodes_ab = _slopes(self._nodes_a, self._nodes_a)
        slopes: Float = at_nodes_ab @ points_nx[self.stations_sa] / self.length_s[:, None, None]
        return slopes

    def arc_length(self, points_nx: Float) -> Float:
        """(n,) lengths along each line from its first station, in a state.

        Args:
            points_nx: (n, 2) where the stations are.
        """
        x, w = np.polynomial.legendre.leggauss(GAUSS)  # type: ignore[no-untyped-call]
        start, width = self._nodes_a[:-1, None], np.diff(self._nodes_a)[:, None]
        slopes_qb = _slopes(self._nodes_a, (start + 0.5 * width * (x + 1.0)).ravel())
        speed_sq = np.hypot(*np.moveaxis(slopes_qb @ points_nx[self.stations_sa], -1, 0))
        pieces_sb = speed_sq.reshape(len(speed_sq), -1, GAUSS) @ (0.5 * w) * width.ravel()
        before_n = np.zeros(len(self))  # length from the station before; a closed line's last piece is left out
        following = self.stations_sa[:, 1:]
        onwards = following > self.stations_sa[:, :-1]
        before_n[following[onwards]] = pieces_sb[onwards]
        total = np.cumsum(before_n)
        first = np.flatnonzero(np.diff(self.line_n, prepend=-1))
        arc: Float = total - total[first][self.line_n]
        return arc

    @staticmethod
    def of(polygons: Polygons, numbers_c: Int, order: int) -> Surface:
        """The surface of the solids of a mesh.

        Args:
            polygons: all cells; points on borders between ranks may be doubled.
            numbers_c: (n_cells,) their numbers in the mesh, by which bodies are ordered, so that names do not depend on
                the distribution.
            order: polynomial degree along the sides.
        """
        place_p = same_points(polygons.points_nx) if len(polygons.points_nx) else np.empty(0, dtype=np.int64)
        nodes_sa, cell_s = _sides(polygons, order)
        ends = place_p[nodes_sa[:, [0, -1]]]
        solid = polygons.is_solid_c[cell_s]
        inside, across = _both_sides(ends, solid)
        body_c, names = named_bodies(
            polygons.offsets, place_p[polygons.connectivity], polygons.region_c, polygons.region_names,
            polygons.is_solid_c, numbers_c,
        )  # fmt: skip
        chosen, line_s, closed_l = _lines(place_p[nodes_sa[inside]], polygons.points_nx[nodes_sa[inside, 0]],
                                          body_c[cell_s[inside]])  # fmt: skip
        inside, across = inside[chosen], across[chosen]
        body_l = body_c[cell_s[inside]][np.unique(line_s, return_index=True)[1]]
        used = np.unique(body_l)
        stations, node_n, line_n = _stations(nodes_sa[inside], line_s, closed_l)
        return Surface(
            polygons.points_nx[node_n], np.unique(place_p[node_n], return_inverse=True)[1], line_n, closed_l,
            np.searchsorted(used, body_l), tuple(names[b] for b in used.tolist()), stations, cell_s[inside],
            cell_s[across], joint_of(names),
        )  # fmt: skip


def _slopes(nodes_a: Float, at_q: Float) -> Float:
    """(n_points, k + 1) derivatives of the Lagrange polynomials of nodes (k + 1,) at points (n_points,) of 0 to 1."""
    powers = np.arange(len(nodes_a))
    coefficients_pa = np.linalg.inv(nodes_a[:, None] ** powers)
    slopes: Float = (powers * at_q[:, None] ** np.maximum(powers - 1, 0)) @ coefficients_pa
    return slopes


def _sides(polygons: Polygons, order: int) -> tuple[Int, Int]:
    """Points (n_sides, k + 1) of the sides of all cells, and the cell (n_sides,) of each."""
    n_c = np.diff(polygons.offsets) // order
    starts = polygons.offsets[:-1] // order
    following = np.arange(1, int(n_c.sum()) + 1)
    following[(starts + n_c - 1)[n_c > 0]] = starts[n_c > 0]
    nodes = polygons.connectivity.reshape(-1, order)
    return np.column_stack([nodes, nodes[following, 0]]), np.repeat(np.arange(polygons.n_cells), n_c)


def _both_sides(ends_se: Int, solid_s: Bool) -> tuple[Int, Int]:
    """Sides of solids (n,) that are sides of a medium's cell too, and these (n,)."""
    low, high = np.sort(ends_se, axis=1).T
    key = low * (int(high.max(initial=0)) + 1) + high
    solids, media = np.flatnonzero(solid_s), np.flatnonzero(~solid_s)
    _, s, m = np.intersect1d(key[solids], key[media], return_indices=True)
    order = np.argsort(solids[s], kind="stable")
    return solids[s[order]], media[m[order]]


def _lines(places_sa: Int, starts_sx: Float, body_s: Int) -> tuple[Int, Int, Bool]:
    """Sides (n,) in the order of the lines, the line (n,) of each, and which lines (n_lines,) are closed.

    Lines come by body, and those of a body by their first point, the lowest and of these the leftmost; a closed line
    begins at such a point too.
    """
    begins: dict[tuple[int, int], list[int]] = {}
    by_place = np.lexsort((starts_sx[:, 0], starts_sx[:, 1]))
    for side in by_place[::-1].tolist():  # so that the lowest is taken first from the end of a list
        begins.setdefault((int(body_s[side]), int(places_sa[side, 0])), []).append(side)
    arrives = {(int(b), int(place)) for b, place in zip(body_s, places_sa[:, -1], strict=True)}
    taken = np.zeros(len(places_sa), dtype=bool)
    found: list[tuple[tuple[int, float, float], list[int], bool]] = []
    heads = [s for s in by_place.tolist() if (int(body_s[s]), int(places_sa[s, 0])) not in arrives]
    for head in [*heads, *by_place.tolist()]:
        if taken[head]:
            continue
        line, body = [head], int(body_s[head])
        taken[head] = True
        while True:
            at = (body, int(places_sa[line[-1], -1]))
            onwards = [side for side in begins.get(at, []) if not taken[side]]
            if not onwards:
                break
            line.append(onwards[-1])
            taken[line[-1]] = True
        x, y = starts_sx[head].tolist()
        found.append(((body, y, x), line, bool(places_sa[line[-1], -1] == places_sa[head, 0])))
    found.sort(key=lambda each: each[0])
    order = np.array([side for _, line, _ in found for side in line], dtype=np.int64)
    number = np.repeat(np.arange(len(found)), [len(line) for _, line, _ in found])
    return order, number, np.array([closed for *_, closed in found], dtype=bool)


def _stations(nodes_sa: Int, line_s: Int, closed_l: Bool) -> tuple[Int, Int, Int]:
    """Stations (n_sides, k + 1) of sides in the order of their lines; node (n,) and line (n,) of each station."""
    order = nodes_sa.shape[1] - 1
    stations = np.empty_like(nodes_sa)
    nodes: list[Int] = []
    lines: list[Int] = []
    count = 0
    for line, closed in enumerate(closed_l.tolist()):
        sides = np.flatnonzero(line_s == line)
        here = count + order * np.arange(len(sides))[:, None] + np.arange(order + 1)
        along = nodes_sa[sides][:, :-1].ravel()
        if closed:
            here[-1, -1] = count
        else:
            along = np.append(along, nodes_sa[sides[-1], -1])
        stations[sides] = here
        nodes.append(along)
        lines.append(np.full(len(along), line))
        count += len(along)
    empty = np.empty(0, dtype=np.int64)
    return stations, np.concatenate([empty, *nodes]), np.concatenate([empty, *lines])
