"""Blocks: cells of one region, size and projection, which one call of a compiled kernel works on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codegen.batch import CellBatch
from codegen.kernel import Kernel
from tmc_vem.mesh.distribute import DistributedMesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.element import ElementGroup
from tmc_vem.vem.projector import n_translated_dofs
from tmc_vem.vem.spaces import Gradients

Float = NDArray[np.float64]
Int = NDArray[np.int64]

CHUNK = 1024  # cells whose dense arrays are held at a time


@dataclass(frozen=True)
class RegionKernel:
    """The compiled energy of a region and the values of its parameters in the kernel's order."""

    kernel: Kernel
    parameters: Float


@dataclass(frozen=True)
class Block:
    """Cells that share energy, number of sides and projection.

    Attributes:
        region: name of their region.
        kernel, parameters: their energy.
        batch: projectors, quadrature and local nodes, as the kernel takes them.
        cells: (n_cells,) cells of the local mesh.
        n_sides: vertices of each cell.
        degree: of the polynomials that gradients are projected on.
        projection: name of the space, or l.
    """

    region: str
    kernel: Kernel
    parameters: Float
    batch: CellBatch
    cells: Int
    n_sides: int
    degree: int
    projection: str

    def chunks(self) -> Iterator[slice]:
        """The positions of the cells, not too many at a time."""
        for first in range(0, len(self.cells), CHUNK):
            yield slice(first, min(first + CHUNK, len(self.cells)))

    def polygons(self, mesh: PolygonMesh, chosen: slice = slice(None)) -> Float:
        """Vertices (n_cells, n_sides, 2) of the cells."""
        sides = mesh.cell_offsets[self.cells[chosen]][:, None] + np.arange(self.n_sides)
        polygons: Float = mesh.points_vx[mesh.cell_vertices[sides]]
        return polygons

    def weights(self, chosen: slice = slice(None)) -> Float:
        """Quadrature weights (n_cells, n_points)."""
        weights: Float = self.batch.w_sq[self.batch.shape_c[chosen]]
        return weights

    def scaled_points(self, chosen: slice = slice(None)) -> Float:
        """Quadrature points (n_cells, n_points, 2) in scaled coordinates."""
        points: Float = self.batch.xi_sqx[self.batch.shape_c[chosen]]
        return points

    def rows(self, n_rows: int, chosen: slice = slice(None)) -> Float:
        """Derivatives (n_cells, n_points, n_rows, n_basis) of the projected basis; 6 only if the energy has G."""
        shapes, position = np.unique(self.batch.shape_c[chosen], return_inverse=True)
        gradients = Gradients(*self.batch.coefficients(shapes))
        h_s, xi_sqx = 1.0 / self.batch.inverse_h_s[shapes], self.batch.xi_sqx[shapes]
        rows: Float = gradients.rows(h_s, xi_sqx, self.batch.piece_q, n_rows)[position]
        return rows


def make_blocks(
    distributed: DistributedMesh,
    dofmap: DofMap,
    groups: Sequence[ElementGroup],
    kernels: Mapping[str, RegionKernel],
) -> list[Block]:
    """Split element groups by region and pack what their kernels need."""
    blocks = []
    regions, region_c = distributed.mesh.region_names, distributed.mesh.region_c
    for group in groups:
        for number in np.unique(region_c[group.cells]).tolist():
            energy = kernels[regions[number]]
            chosen = np.flatnonzero(region_c[group.cells] == number)
            chosen = chosen[np.argsort(group.shape_c[chosen], kind="stable")]  # shapes in a row are read in place
            cells = group.cells[chosen]
            used, shape_c = np.unique(group.shape_c[chosen], return_inverse=True)
            tables = group.tables if len(used) == len(group.tables.h_s) else group.tables.take(used)
            batch = CellBatch.pack(
                shape_c=shape_c,
                nodes_ca=dofmap.cell_nodes(distributed, cells, group.n_sides),
                piece_q=tables.piece_q,
                w_sq=tables.w_sq,
                xi_sqx=tables.xi_sqx,
                h_s=tables.h_s,
                gradient_stxma=tables.gradients.first_stxma,
                second_sxma=tables.gradients.second_sxma if energy.kernel.uses_second_gradient else None,
                n_translated=n_translated_dofs(group.n_sides, dofmap.order),
            )
            blocks.append(
                Block(
                    region=regions[number],
                    kernel=energy.kernel,
                    parameters=energy.parameters.copy(),
                    batch=batch,
                    cells=cells,
                    n_sides=group.n_sides,
                    degree=group.degree,
                    projection=group.projection,
                )
            )
    return blocks
