"""Solutions at any point, from there onto dolfinx functions, and these at any point.

Inside a cell a virtual element function is not known; what is evaluated is its L2 projection on polynomials of the
order k, which is as accurate. On the sides of cells it is known.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.base import Problem
from tmc_vem.simulation.discretised import discretise
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import InputError
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.places import Places

Float = NDArray[np.float64]


def last_state(
    problem: Problem, directory: str | Path, options: RunOptions | None = None
) -> tuple[Discretisation, Vec]:
    """The discretisation of a run and the displacements of its last checkpoint, as a vector of it.

    Args:
        problem, options: those of the run.
        directory: its run directory.

    Raises:
        InputError: there is no checkpoint, or it belongs to another mesh.
    """
    from mpi4py import MPI

    from tmc_vem.simulation.checkpoint import Checkpoint

    system = discretise(problem, options or RunOptions(), MPI.COMM_WORLD)
    u = system.create_vector()
    checkpoint = Checkpoint.read(Path(directory))
    last = len(checkpoint.facts["controls"]) - 1  # slopes, and what else a run goes on with, come after the states
    u.getArray()[:] = checkpoint.values_at(system.node_labels())[last].ravel()
    return system, u


def displacement_at(system: Discretisation, u: Vec, points_nx: Float) -> Float:
    """Displacements (n, 2) of a state at points (n, 2) of the reference configuration, equal on all ranks.

    Args:
        system: the discretisation.
        u: vector of its degrees of freedom.
        points_nx: where; the same on all ranks.

    Raises:
        InputError: a point lies outside of the mesh.
    """
    return Places(system, points_nx).displacements(u)


def onto_function(system: Discretisation, u: Vec, function: Any) -> None:
    """Set a dolfinx function of a vector-valued Lagrange space to a virtual element state, by its values at the nodes.

    Raises:
        InputError: there are several ranks, or the function's mesh does not lie within that of the state.
    """
    if system.comm.size > 1:
        raise InputError(f"{system.comm.size} ranks: a state goes onto a function on one; resume it on one rank")
    nodes = function.function_space.tabulate_dof_coordinates()[:, :2]
    function.x.array[:] = displacement_at(system, u, nodes).ravel()


def function_at(function: Any, points_nx: Float) -> Float:
    """Values (n, 2) of a dolfinx function at points (n, 2) of this rank's part of its mesh.

    Raises:
        InputError: a point is in none of its cells.
    """
    from tmc_vem.fem.compat import evaluate

    points = np.asarray(points_nx, dtype=float).reshape(-1, 2)
    values, found = evaluate(function, points)
    missing = np.flatnonzero(~found)
    if len(missing):
        x, y = points[missing[0]]
        raise InputError(f"point ({x:g}, {y:g}) lies in no cell of the function's mesh")
    return values
