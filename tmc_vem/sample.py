"""Virtual element solutions at any point, from there onto dolfinx functions, and these at any point.

Inside a cell a virtual element function is not known; what is evaluated is its L2 projection on polynomials of the
order k, which is as accurate.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError
from tmc_vem.problems.base import Problem
from tmc_vem.simulation import RunOptions, discretise

Float = NDArray[np.float64]

# Points outside of all cells are taken to the nearest one up to this fraction of the mesh's extent.
OUTSIDE = 1e-6


def last_state(problem: Problem, directory: str | Path, options: RunOptions | None = None) -> tuple[Any, Any]:
    """The discretisation of a run and the displacements of its last checkpoint, as a vector of it.

    Args:
        problem, options: those of the run.
        directory: its run directory.

    Raises:
        InputError: there is no checkpoint, or it belongs to another mesh.
    """
    from mpi4py import MPI

    from tmc_vem.checkpoint import Checkpoint

    system = discretise(problem, options or RunOptions(), MPI.COMM_WORLD)
    u = system.create_vector()
    state = Checkpoint.read(Path(directory)).values_at(system.node_labels())[-1]  # the newest is last
    u.getArray()[:] = state.ravel()
    return system, u


def displacement_at(system: Any, u: Any, points_nx: Float) -> Float:
    """Displacements (n, 2) of a virtual element state at points (n, 2) of the reference configuration.

    Args:
        system: a ``VemSystem`` on one rank.
        u: vector of its degrees of freedom.
        points_nx: where.

    Raises:
        InputError: there are several ranks, or a point lies outside of the mesh.
    """
    import shapely

    from tmc_vem.vem.tables import points_and_values

    if system.comm.size > 1:
        raise InputError(f"{system.comm.size} ranks: points are sampled on one; resume the run's state on one rank")
    points = np.asarray(points_nx, dtype=float).reshape(-1, 2)
    mesh = system.distributed.mesh
    cells = np.array([shapely.Polygon(mesh.points_vx[loop]) for loop in mesh.cells()])
    at = shapely.points(points)
    (which, found), distance = shapely.STRtree(cells).query_nearest(at, return_distance=True, all_matches=False)
    cell_n, away = np.empty(len(points), dtype=np.int64), np.empty(len(points))
    cell_n[which], away[which] = found, distance
    far = np.flatnonzero(away > OUTSIDE * system.size)
    if len(far):
        x, y = points[far[0]]
        raise InputError(f"point ({x:g}, {y:g}) lies {away[far[0]]:.3g} outside of the mesh")
    values = system.nodal_values(u)
    result = np.empty((len(points), 2))
    for block in system.blocks:
        position = np.full(mesh.n_cells, -1)
        position[block.cells] = np.arange(len(block.cells))
        chosen = np.flatnonzero(position[cell_n] >= 0)
        if not len(chosen):
            continue
        local = position[cell_n[chosen]]
        polygons = block.polygons(mesh)[local]
        xi = _scaled(polygons, points[chosen])
        _, basis = points_and_values(polygons, system.settings.order, xi[:, None])
        result[chosen] = np.einsum("na,nai->ni", basis[:, 0], values[block.batch.nodes_ca[local]])
    return result


def onto_function(system: Any, u: Any, function: Any) -> None:
    """Set a dolfinx function of a vector-valued Lagrange space to a virtual element state, by its values at the nodes.

    Raises:
        InputError: as for :func:`displacement_at`; the function's mesh must lie within that of the state.
    """
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


def _scaled(polygons_cvx: Float, points_cx: Float) -> Float:
    from tmc_vem.mesh.geometry import centroids, diameters

    scaled: Float = (points_cx - centroids(polygons_cvx)) / diameters(polygons_cvx)[:, None]
    return scaled
