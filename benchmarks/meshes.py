"""Meshes and energies that the speed benchmarks share."""

from __future__ import annotations

from typing import Any

import numpy as np

from codegen.integrand import second_gradient_energy
from tmc_vem.energy import DENSITIES
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem.blocks import RegionKernel
from tmc_vem.vem.kernel.cells import compile_cells

ENERGIES = {"huhu_lulu": "medium_huhu_lulu_damped", "angle": "medium_angle_damped", "solid": "solid"}
VALUES = {"K": 20.0, "mu": 10.0, "gamma": 1e-3, "alpha_r": 0.7, "beta": 5.0}
DOFS_PER_CELL = {"quadrilaterals": 8, "voronoi": 12}


def square(kind: str, n_dofs: float) -> PolygonMesh:
    """Unit square with about as many degrees of freedom of the VEM of order 2; one region, 'body'."""
    n_cells = n_dofs / DOFS_PER_CELL[kind]
    if kind == "quadrilaterals":
        lines = np.linspace(0.0, 1.0, round(np.sqrt(n_cells)) + 1)
        return structured_quadrilaterals(lines, lines, [Rectangle("body", 0.0, 1.0, 0.0, 1.0)])
    from tmc_vem.mesh.make.outline import Region

    corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    return voronoi_mesh([Region("body", corners)], 1.03 / np.sqrt(n_cells))


def region(name: str) -> RegionKernel:
    """Compiled energy with the benchmarks' parameters."""
    energy = DENSITIES[ENERGIES.get(name, name)]
    kernel = compile_cells(second_gradient_energy(energy.density, energy.name, energy.parameters))
    return RegionKernel(kernel, kernel.parameter_array(VALUES))


def bend(points: Any) -> Any:
    """A smooth displacement of points (n, 2) with J well above 0."""
    x, y = np.asarray(points).T
    return 0.02 * np.stack([np.sin(3.0 * x + y), np.cos(2.0 * y - x) * x], axis=1)
