"""Displacements of any points of the reference configuration, on any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.locate import TOLERANCE, Cells
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# A point lies in the nearest cell; those that are as near up to this fraction of the tolerance count as equally near.
ROUNDING = 1e-6


@dataclass(frozen=True)
class Located:
    """Points in the cells of a rank.

    Attributes:
        cells: the cell of each point.
        number_n: (n,) numbers of these cells in the whole mesh.
        weights: sparse (n, n_nodes); times the rank's nodal values, the points' displacements.
    """

    cells: Cells
    number_n: Int
    weights: Any


class PointSource(Protocol):
    """What a discretisation offers to find points, for the cells of this rank."""

    comm: Comm
    size: float

    def locate(self, points_nx: Float) -> Located:
        """Points (n, 2) in this rank's cells."""

    def nodal_values(self, u: Vec) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, ghosts included."""


def outside(name: str, point_x: Float, distance: float, nearest_x: Float) -> InputError:
    """What to say about a point that lies outside of the mesh, with the nearest point of the mesh."""
    (x, y), (near_x, near_y) = point_x, nearest_x
    return InputError(
        f"{name} ({x:g}, {y:g}) lies {distance:.3g} outside of the mesh, whose nearest point is "
        f"({near_x:.6g}, {near_y:.6g})"
    )


class Places:
    """Points, each in one cell of one rank; which one does not depend on the number of ranks.

    Inside a cell a virtual element function is not known; what is evaluated there is its L2 projection on polynomials
    of the order k, which is as accurate. On the sides of cells it is known, and taken as it is. A point outside of the
    mesh, by no more than the tolerance, takes the nearest cell.

    Args:
        system: the discretisation; all ranks make this object together, of the same points.
        points_nx: (n, 2) the points.
        names: what to call them in messages.

    Raises:
        InputError: a point lies outside of the mesh.
    """

    def __init__(self, system: PointSource, points_nx: Float, names: Sequence[str] | None = None) -> None:
        self._system = system
        points = np.asarray(points_nx, dtype=float).reshape(-1, 2)
        located = system.locate(points)
        cells = located.cells
        parts = system.comm.allgather((cells.distance_n, located.number_n, cells.nearest_nx))
        distance_rn, number_rn, nearest_rnx = (np.array([part[i] for part in parts]) for i in range(3))
        ranks = np.broadcast_to(np.arange(len(parts))[:, None], distance_rn.shape)
        rank_n = np.lexsort((ranks, number_rn, distance_rn), axis=0)[0]
        every = np.arange(len(points))
        for n in np.flatnonzero(distance_rn[rank_n, every] > TOLERANCE * system.size).tolist():
            name, away = names[n] if names else "point", float(distance_rn[rank_n[n], n])
            raise outside(name, points[n], away, nearest_rnx[rank_n[n], n])
        self._mine = np.flatnonzero(rank_n == system.comm.rank)
        self._weights = located.weights[self._mine]

    def displacements(self, u: Vec) -> Float:
        """Displacements (n, 2) at a state, equal on all ranks; called on all of them."""
        mine = (self._mine, self._weights @ self._system.nodal_values(u))
        parts = self._system.comm.allgather(mine)
        found = np.empty((sum(len(where) for where, _ in parts), 2))
        for where, values in parts:
            found[where] = values
        return found

    def spread(self, force_ni: Float) -> Float:
        """(n_nodes, 2) forces at this rank's nodes, ghosts included, that do the work of forces (n, 2) at the points;
        those of all ranks together."""
        spread_ni: Float = self._weights.T @ force_ni[self._mine]
        return spread_ni
