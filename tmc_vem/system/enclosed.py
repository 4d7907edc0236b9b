"""On which side of named edges a pressure is: in the cavity that they enclose, or across from their cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.system.sides import AllSides

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def around_cavity(name: str, where: str, sides: AllSides) -> Int:
    """(n,) 1 for sides whose direction goes counter-clockwise round the cavity, -1 against it; 0 for those left out,
    the second ones of edges with two cells.

    Args:
        name, where: of pressure and edges, for messages.
        sides: all sides along the edges.

    Raises:
        InputError: the edges do not close, or cells are on the side where the cavity is.
    """
    chosen = np.flatnonzero(sides.first_s)
    ends, corners = sides.ends_se[chosen], sides.corners_sex[chosen]
    _, first, count = np.unique(ends, return_index=True, return_counts=True)
    loose = np.flatnonzero(count % 2)
    if len(loose):
        places = " and ".join(shown_place(corners.reshape(-1, 2)[first[n]]) for n in loose[:2])
        raise InputError(
            f"{name}: the edges '{where}' do not close, they end at {places}: name the whole boundary of the cavity, "
            "or give edges that are open a follower pressure"
        )
    inside = _left_is_inside(corners)
    wrong = np.flatnonzero(inside & (sides.other_s[chosen] < 0))
    if len(wrong):
        place = shown_place(corners[wrong[0]].mean(axis=0))
        raise InputError(
            f"{name}: the edges '{where}' have the body inside, at {place}, and no cavity: leave out "
            "what bounds the body on its outside, or give it a follower pressure"
        )
    turns = np.zeros(len(sides), dtype=np.int64)
    turns[chosen] = np.where(inside, 1, -1)
    return turns


def _left_is_inside(corners_sex: Float) -> Bool:
    """(n,) whether the left of each edge of closed loops is inside, as every second crossing on the way out says.

    The ray goes from the middle of the edge along the axis that is across it; an end that lies on it counts with one
    of its two edges.
    """
    middle_sx, along_sx = corners_sex.mean(axis=1), corners_sex[:, 1] - corners_sex[:, 0]
    across = np.argmin(np.abs(along_sx), axis=1)
    inside = np.empty(len(corners_sex), dtype=np.bool_)
    for n, axis in enumerate(across.tolist()):
        place, others = middle_sx[n], np.delete(corners_sex, n, axis=0)
        low, high = others[:, 0, 1 - axis], others[:, 1, 1 - axis]
        crossed = others[(low > place[1 - axis]) != (high > place[1 - axis])]
        start, end = crossed[:, 0], crossed[:, 1]
        share = (place[1 - axis] - start[:, 1 - axis]) / (end[:, 1 - axis] - start[:, 1 - axis])
        beyond = start[:, axis] + share * (end[:, axis] - start[:, axis]) > place[axis]
        # the ray leaves to the left if it has a positive component along (-dy, dx)
        leaves_left = (-along_sx[n, 1], along_sx[n, 0])[axis] > 0.0
        inside[n] = (beyond.sum() % 2 == 1) == leaves_left
    return inside


def against_cells(name: str, where: str, sides: AllSides, media: Sequence[str]) -> Bool:
    """(n,) the sides that a follower pressure acts on: of edges with one cell, and of solids that border on medium.

    Args:
        name, where: of pressure and edges, for messages.
        sides: all sides along the edges.
        media: names of the regions that are third medium.

    Raises:
        InputError: an edge lies between two solids, or inside a medium.
    """
    medium = np.isin(sides.region_s, media)
    alone = sides.other_s < 0
    wrong = np.flatnonzero(~alone & (medium == medium[sides.other_s]))
    if len(wrong):
        raise InputError(
            f"{name}: of the edges '{where}' the one at {shown_place(sides.corners_sex[wrong[0]].mean(axis=0))} has "
            f"{'medium' if medium[wrong[0]] else 'solid'} on both sides, so that pressure has no direction: name edges "
            "on the outside of the mesh, or between a solid and medium"
        )
    chosen: Bool = alone | ~medium
    return chosen


def shown_place(point: Float) -> str:
    """Coordinates in a message, without the rounding of zeros."""
    x, y = np.round(point, 12) + 0.0
    return f"({x:.6g}, {y:.6g})"
