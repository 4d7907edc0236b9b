"""What ranks know of a state put together: energies and smallest J by region, step limit, reactions, named points.

A value that is not a number counts as the smallest, whichever cell, rank or region it comes from: it must not be lost
where others are compared with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Pair
from tmc_vem.system.discretisation import Evaluation, RegionValues
from tmc_vem.system.layout import DISPLACEMENT

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Lowest = tuple[float, int]  # J, and the number of the cell it is found in

NOWHERE: Lowest = (np.inf, -1)


def _by_j(lowest: Lowest) -> float:
    return lowest[0] if lowest[0] == lowest[0] else -np.inf


class Shares:
    """Energies and smallest J of a rank's cells, by region.

    Args:
        regions: names of all regions.
    """

    def __init__(self, regions: Sequence[str]) -> None:
        self._energy = dict.fromkeys(regions, 0.0)
        self._lowest = dict.fromkeys(regions, NOWHERE)

    def add(self, region: str, energy: float) -> None:
        """Add energy to a region."""
        self._energy[region] += energy

    def add_cells(self, region: str, energy_c: Float, min_j_c: Float, number_c: Int) -> None:
        """Add cells of a region.

        Args:
            region: its name.
            energy_c, min_j_c: (n_cells,) their energies and smallest J.
            number_c: (n_cells,) their numbers in the whole mesh.
        """
        self.add(region, float(energy_c.sum()))
        if len(min_j_c):
            here = int(np.argmin(min_j_c))  # argmin takes a NaN for the smallest
            lowest = (float(min_j_c[here]), int(number_c[here]))
            self._lowest[region] = min(self._lowest[region], lowest, key=_by_j)

    def together(self, comm: Comm, work: float = 0.0) -> Evaluation:
        """The evaluation of a state, equal on all ranks.

        Args:
            comm: the ranks; all of them call this.
            work: of the dead loads on this rank, which counts off the energy.
        """
        parts = comm.allgather((self._energy, self._lowest, work))
        lowest = {region: min((part[1][region] for part in parts), key=_by_j) for region in self._energy}
        regions = {
            region: RegionValues(sum(part[0][region] for part in parts), lowest[region][0]) for region in self._energy
        }
        worst = min(lowest, key=lambda region: _by_j(lowest[region]))
        where = f"J = {lowest[worst][0]:.3g} in cell {lowest[worst][1]} of region '{worst}'"
        stored = sum(values.energy for values in regions.values())
        return Evaluation(stored - sum(part[2] for part in parts), regions, where)


def step_limit(comm: Comm, steps: Iterable[float]) -> float:
    """Smallest of the steps on all ranks, infinite if there is none."""
    return float(comm.allreduce(min(steps, default=np.inf), op=MPI.MIN))


def extent(comm: Comm, points_nx: Float) -> float:
    """Larger side of the box around the points (n, 2) of all ranks."""
    mine = [points_nx.min(axis=0), points_nx.max(axis=0)] if len(points_nx) else []
    corners = [corner for part in comm.allgather(mine) for corner in part]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return float(np.max(high - low))


def reaction(comm: Comm, residual: Vec, nodes: Int, component: int) -> float:
    """Sum over all ranks of a residual's component at nodes, numbered as in this rank's part of the vector."""
    array = DISPLACEMENT.nodal(residual.getArray(readonly=True))
    return float(comm.allreduce(float(array[nodes, component].sum())))


def resultant(comm: Comm, u: Vec, residual: Vec, nodes: Int, points_nx: Float, about: Pair) -> Float:
    """Resultant (3,) over all ranks of forces at nodes: components, and the moment about a point, counter-clockwise.

    Args:
        comm: the ranks; all of them call this.
        u, residual: displacements and forces.
        nodes: (n,) numbered as in this rank's part of the vectors.
        points_nx: (n, 2) where they are in the reference configuration.
        about: the point, from which arms reach to where the nodes are now.
    """
    force_ni, u_ni = (DISPLACEMENT.nodal(vector.getArray(readonly=True))[nodes] for vector in (residual, u))
    x, y = (points_nx + u_ni - np.asarray(about)).T
    moment = float(x @ force_ni[:, 1] - y @ force_ni[:, 0])
    total: Float = np.sum(comm.allgather(np.array([*force_ni.sum(axis=0), moment])), axis=0)
    return total


def at_named_points(comm: Comm, names: Sequence[str], mine: Mapping[str, Float]) -> Float:
    """Values (n, 2) at named points, equal on all ranks, of which each rank has some or none.

    Raises:
        InputError: no rank has a point of that name.
    """
    return in_order(names, {name: value for part in comm.allgather(dict(mine)) for name, value in part.items()})


def in_order(names: Sequence[str], found: Mapping[str, Float]) -> Float:
    """Values (n, 2) at named points, of a mapping that every rank has.

    Raises:
        InputError: it lacks a point.
    """
    unknown = [name for name in names if name not in found]
    if unknown:
        raise InputError(f"the mesh has no named point '{unknown[0]}'")
    return np.array([found[name] for name in names]).reshape(-1, 2)
