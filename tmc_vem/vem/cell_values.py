"""Values of cells of virtual elements: areas, energies and volume ratios."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.dense import smallest_jacobians

Float = NDArray[np.float64]


def areas(blocks: Sequence[Block], n_cells: int) -> Float:
    """Reference areas (n_cells,)."""
    area_c = np.empty(n_cells)
    for block in blocks:
        area_c[block.cells] = block.weights().sum(axis=1)
    return area_c


def energies(blocks: Sequence[Block], n_cells: int, u_ni: Float, without: str) -> Float:
    """Energies (n_cells,) of the densities, friction left out; the parameter ``without`` is set to 0."""
    energy_c = np.empty(n_cells)
    for block in blocks:
        parameters = block.parameters.copy()
        parameters[[name == without for name in block.kernel.parameters]] = 0.0
        batch = replace(block.batch, friction=None)
        energy_c[block.cells] = block.kernel.cells(batch, u_ni, parameters).energy_c
    return energy_c


def jacobians(blocks: Sequence[Block], n_cells: int, u_ni: Float) -> tuple[Float, Float]:
    """Mean and smallest J (n_cells,)."""
    mean, smallest = np.empty((2, n_cells))
    for block in blocks:
        for chosen in block.chunks():
            H = block.displacement_gradients(u_ni, chosen)
            J = (1.0 + H[..., 0, 0]) * (1.0 + H[..., 1, 1]) - H[..., 0, 1] * H[..., 1, 0]
            w = block.weights(chosen)
            mean[block.cells[chosen]] = (w * J).sum(axis=1) / w.sum(axis=1)
            smallest[block.cells[chosen]] = J.min(axis=1)
    return mean, smallest


def dense_jacobians(blocks: Sequence[Block], mesh: PolygonMesh, u_ni: Float) -> Float:
    """Smallest J (n_cells,) on a grid much finer than the quadrature's."""
    smallest = np.empty(mesh.n_cells)
    for block in blocks:
        for chosen in block.chunks():
            smallest[block.cells[chosen]] = smallest_jacobians(block, mesh, u_ni, chosen)
    return smallest
