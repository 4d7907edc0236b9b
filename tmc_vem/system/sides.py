"""Sides of cells along named edges: what a rank has of them, and what all ranks know of them together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.distributed import Comm
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.trace import Trace

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
Names = NDArray[np.str_]


@dataclass(frozen=True)
class Sides:
    """Sides of a rank's cells along named edges, in the direction that has the cell on the left.

    Attributes:
        nodes_sa: (n, k + 1) nodes from one end to the other, numbered over all ranks.
        points_sax: (n, k + 1, 2) their reference coordinates.
        ends_se: (n, 2) vertices of the whole mesh at both ends.
        cell_s: (n,) numbers of the cells in the whole mesh.
        region_s: (n,) names of the cells' regions.
    """

    nodes_sa: Int
    points_sax: Float
    ends_se: Int
    cell_s: Int
    region_s: Names

    def __len__(self) -> int:
        return len(self.ends_se)

    @property
    def dofs_sm(self) -> Int:
        """(n, 2 (k + 1)) degrees of freedom of the nodes, numbered over all ranks."""
        return DISPLACEMENT.dofs(self.nodes_sa).reshape(len(self), DISPLACEMENT.size(self.nodes_sa.shape[1]))

    @property
    def length_s(self) -> Float:
        """(n,) reference lengths."""
        along = self.points_sax[:, -1] - self.points_sax[:, 0]
        return np.hypot(along[:, 0], along[:, 1])

    @property
    def trace(self) -> Trace:
        """Integrals along a side; of any nodes, if there is none to integrate over."""
        if not len(self):
            return Trace.of(np.arange(float(self.nodes_sa.shape[1])))
        first = self.points_sax[0] - self.points_sax[0, 0]
        return Trace.of(np.hypot(first[:, 0], first[:, 1]) / self.length_s[0])

    def take(self, chosen: Bool) -> Sides:
        """Those of a mask (n,)."""
        return Sides(
            self.nodes_sa[chosen], self.points_sax[chosen], self.ends_se[chosen], self.cell_s[chosen],
            self.region_s[chosen],
        )  # fmt: skip


@dataclass(frozen=True)
class AllSides:
    """The same sides over all ranks, equal on all of them.

    Attributes:
        ends_se, cell_s, region_s: as in :class:`Sides`.
        nodes_se: (n, 2) nodes at both ends.
        corners_sex: (n, 2, 2) reference coordinates of both ends.
        other_s: (n,) the side of the cell across the edge, -1 where there is none.
        mine: this rank's sides among them.
    """

    ends_se: Int
    nodes_se: Int
    corners_sex: Float
    cell_s: Int
    region_s: Names
    other_s: Int
    mine: slice

    def __len__(self) -> int:
        return len(self.ends_se)

    @property
    def first_s(self) -> Bool:
        """(n,) one side of every edge: that of the cell with the smaller number."""
        return (self.other_s < 0) | (self.cell_s < self.cell_s[self.other_s])

    @property
    def origin(self) -> Float:
        """(2,) a point near them, to count coordinates from."""
        origin: Float = self.corners_sex[0, 0]
        return origin

    @staticmethod
    def gather(comm: Comm, sides: Sides) -> AllSides:
        """Put the sides of all ranks together; called on all of them."""
        both = [0, -1]
        mine = (sides.ends_se, sides.nodes_sa[:, both], sides.points_sax[:, both], sides.cell_s, sides.region_s)
        parts = comm.allgather(mine)
        ends, nodes, corners, cells, regions = (np.concatenate([part[n] for part in parts]) for n in range(len(mine)))
        before = sum(len(part[0]) for part in parts[: comm.rank])
        low, high = np.sort(ends, axis=1).T
        order = np.lexsort((high, low))
        same = (low[order[1:]] == low[order[:-1]]) & (high[order[1:]] == high[order[:-1]])
        other = np.full(len(ends), -1)
        other[order[1:][same]], other[order[:-1][same]] = order[:-1][same], order[1:][same]
        return AllSides(ends, nodes, corners, cells, regions, other, slice(before, before + len(sides)))
