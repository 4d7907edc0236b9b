"""Where cells are divided: a hub, or parts, and a place on every side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.change import MeshChange
from tmc_vem.mesh.make.hub import find_hubs, star_parts, worst_hub
from tmc_vem.mesh.make.loops import Loops
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# A hanging node serves as the middle of a side if it is at most this fraction of its length away from it.
OFF_MIDDLE = 0.2
# Corners to the right that turn by more than this angle (degrees) divide their side, wherever they are.
REFLEX = 20.0
# Differences of fractions of a side, and of angles (radians), that are rounding.
EQUAL = 1e-9


@dataclass(frozen=True)
class Plan:
    """How the chosen cells are cut.

    Attributes:
        fans: cells that are cut from a hub.
        hubs_nx: their hubs.
        split_s: one for each of their sides, entry (of all loops) after whose vertex, or at it, the side is divided.
        new_s: whether it is divided in the middle of the edge that begins there, or else at the vertex.
        n_sides_n: (n_fans,) numbers of sides.
        parts: for cells without a hub, numbers of their vertices in the cell, for each part.
    """

    fans: Int
    hubs_nx: Float
    split_s: Int
    new_s: Bool
    n_sides_n: Int
    parts: dict[int, list[list[int]]]


def plan_of(change: MeshChange, loops: Loops, chosen_c: Bool, flat: float) -> Plan:
    """How the chosen cells of a mesh, that was made of another one, are cut.

    Raises:
        InputError: one cannot be cut; the message has its number in the other mesh.
    """
    mesh = change.mesh
    chosen = np.flatnonzero(chosen_c)
    hubs, good = find_hubs(mesh.points_vx, loops.chosen(chosen))
    parts = {}
    for n in np.flatnonzero(~good).tolist():
        polygon = mesh.points_vx[mesh.cell(int(chosen[n]))]
        found = star_parts(polygon)
        if found is not None:
            parts[int(chosen[n])] = found
            continue
        hub = worst_hub(polygon)
        if hub is None:
            raise InputError(
                f"cell {change.parent_c[chosen[n]]} cannot be refined: no point sees all of it, and no diagonals cut "
                "it into parts of which that is true; divide it"
            )
        hubs[n], good[n] = hub, True
    fans = chosen[good]
    turn = loops.turns(mesh.points_vx)
    corner = loops.corners(np.maximum(turn, 0.0), flat)
    split, new, n_sides = _divided(mesh.points_vx, loops, fans, corner, turn)
    return Plan(fans, hubs[good], split, new, n_sides, parts)


def _divided(points: Float, loops: Loops, fans: Int, corner: Bool, turn: Float) -> tuple[Int, Bool, Int]:
    """Where the sides of some cells are divided, beginning with the side at a cell's first corner."""
    if not len(fans):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=bool), np.empty(0, dtype=np.int64)
    corners = np.flatnonzero(corner)
    first = corners[np.searchsorted(corners, loops.offsets[fans])] - loops.offsets[fans]
    entries = loops.entries_from(fans, first)
    begins = np.flatnonzero(corner[entries])
    side = np.cumsum(corner[entries]) - 1
    ends = points[loops.vertices[loops.following[entries]]] - points[loops.vertices[entries]]
    length = np.hypot(ends[:, 0], ends[:, 1])
    length /= np.add.reduceat(length, begins)[side]
    at_end = np.cumsum(length) - side
    at_start = at_end - length
    off = np.where(corner[entries], np.inf, np.abs(at_start - 0.5))
    sharpest = np.minimum.reduceat(turn[entries], begins)[side]  # negative to the right
    reflex = sharpest < -np.radians(REFLEX)
    off = np.where(reflex & (turn[entries] > sharpest + EQUAL), np.inf, off)
    nearest = np.minimum.reduceat(off, begins)[side]
    new = ~reflex & (nearest > OFF_MIDDLE + EQUAL)
    hit = np.where(new, (at_start < 0.5) & (at_end >= 0.5), off <= nearest + EQUAL)
    found = np.flatnonzero(hit)
    split = np.empty(len(begins), dtype=np.int64)
    split[side[found][::-1]] = entries[found][::-1]  # the first of those that are equally near
    n_sides = np.bincount(loops.loop_of_entry[entries[begins]], minlength=len(loops))[fans]
    return split, new[begins], n_sides
