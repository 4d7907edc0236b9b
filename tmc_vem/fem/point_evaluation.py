"""Points in finite elements, and the weights of the nodes for the displacement there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from tmc_vem.fem import compat
from tmc_vem.fem.mesh import FemMesh
from tmc_vem.fem.nodes import Nodes
from tmc_vem.mesh.locate import find_cells
from tmc_vem.system.places import ROUNDING, Located

Float = NDArray[np.float64]
ITERATIONS = 20  # of Newton's method for the reference coordinates; triangles take one


def locate(mesh: FemMesh, nodes: Nodes, order: int, points_nx: Float, tolerance: float) -> Located:
    """Points (n, 2) in the cells that this rank owns."""
    corners = mesh.points_cvx[: mesh.n_owned]
    loops = list(corners[:, compat.tensor_order(mesh.cell)])
    cells = find_cells(loops, mesh.cell_ids[: mesh.n_owned], points_nx, ROUNDING * tolerance)
    shape = (len(points_nx), nodes.n_local)
    if not mesh.n_owned:
        return Located(cells, np.full(len(points_nx), -1), csr_array(shape))
    xi = _reference(mesh.cell, corners[cells.cell_n], points_nx)
    values = np.concatenate([compat.lagrange_table(mesh.cell, order, x[None], 0)[0] for x in xi])
    columns = nodes.cell_nodes_ca[cells.cell_n]
    rows = np.repeat(np.arange(len(points_nx)), columns.shape[1])
    weights = csr_array((values.ravel(), (rows, columns.ravel())), shape=shape)
    return Located(cells, mesh.cell_ids[cells.cell_n], weights)


def _reference(cell: str, corners_nvx: Float, points_nx: Float) -> Float:
    """Reference coordinates (n, 2) of points in cells with the given corners, by Newton's method."""
    xi = np.full_like(points_nx, 1.0 / 3.0)
    for _ in range(ITERATIONS):
        table = compat.lagrange_table(cell, 1, xi, 1)  # (value, d1, d2) x points x corners
        missing = points_nx - np.einsum("nv,nvx->nx", table[0], corners_nvx)
        slope = np.einsum("rnv,nvx->nxr", table[1:], corners_nvx)
        step = np.linalg.solve(slope, missing[..., None])[..., 0]
        xi += step
        if np.abs(step).max(initial=0.0) < 1e-14:
            break
    return xi
