"""Which cells are cut for the next mesh, and how often.

A cell that contributes a lot is cut once or twice, those first where a cut promises most for each new cell, until the
error that is expected has gone down as far as one round should bring it. For one level this is Doerfler's marking (SIAM
J. Numer. Anal. 33 (1996) 1106): the smallest set with a given share of the error. Cells that contribute as much as the
last one that is needed are cut with it, so that meshes of symmetric problems stay symmetric, and neither the numbers of
cells nor rounding decide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

LEVELS = 2  # by which a cell is cut in one round at most
# What is left of a cell's contribution after a cut: 1/16 where the solution is smooth, more than 1/3 at corners.
LEFT = 0.3
LEAST_LEFT = 0.3  # of the error in a round, as expected; noise decides beyond
SAFETY = 0.6  # of the tolerance: what a round aims at, so that the next estimate is within it
NEW_CELLS = np.array([3.0, 12.0])  # that a first and a second cut of a quadrilateral add
LAG = 2  # by which media may be behind solids: three hanging nodes on a side
SAME = 1e-4  # relative: contributions that differ by less, as Newton's method leaves them, are equal


def levels_of(mesh: PolygonMesh, contributions_c: Float, error: float, tolerance: float) -> Int:
    """(n_cells,) how often each cell is to be cut.

    Args:
        mesh: the cells.
        contributions_c: (n_cells,) to an error, not negative.
        error: relative error that is estimated.
        tolerance: that is wanted.
    """
    total = float(contributions_c.sum())
    if not total > 0.0:
        return np.zeros(mesh.n_cells, dtype=np.int64)
    goal = max(LEAST_LEFT, min(SAFETY * tolerance / error, 1.0)) if np.isfinite(error) and error else LEAST_LEFT
    gain_cl = contributions_c[:, None] * (1.0 - LEFT) * LEFT ** np.arange(LEVELS)
    worth_cl = gain_cl / NEW_CELLS
    # a second cut is never worth more than the first, so any prefix of this order can be done
    order = np.argsort(-worth_cl, axis=None, kind="stable")
    left = total - np.cumsum(gain_cl.ravel()[order])
    enough = goal * total * (1.0 + SAME)  # one cut of everything leaves just as much as is looked for
    last = order[min(int(np.searchsorted(-left, -enough)), len(order) - 1)]
    level_c: Int = ((worth_cl >= (1.0 - SAME) * worth_cl.ravel()[last]) & (gain_cl > 0.0)).sum(axis=1)
    return level_c


def graded(mesh: PolygonMesh, level_c: Int, before_c: Int, media: Bool) -> Int:
    """The same, and as many more cells that neighbours do not differ much in how often they have been cut in all.

    Within solids and within media that is once. Cells of media may be ``LAG`` times behind solids beside them: at
    corners of solids, small cells of medium are crushed and take Newton's method to its limits, for nothing.

    Args:
        mesh, level_c: the cells, and how often they are to be cut.
        before_c: (n_cells,) how often they have been cut already.
        media: (n_regions,) which regions are third medium.
    """
    left, right = mesh.cells_of_edges
    inner = (left >= 0) & (right >= 0)
    own, other = np.concatenate([[left[inner], right[inner]], [right[inner], left[inner]]], axis=1)
    is_medium = media[mesh.region_c]
    allowed = np.where(is_medium[own] & ~is_medium[other], LAG, 1)
    total_c = before_c + level_c
    while True:
        needed_c = total_c.copy()
        # cells that are not cut now do not make others be cut
        cut = level_c[other] > 0
        np.maximum.at(needed_c, own[cut], (total_c[other] - allowed)[cut])
        if np.array_equal(needed_c, total_c):
            return level_c
        level_c, total_c = needed_c - before_c, needed_c
