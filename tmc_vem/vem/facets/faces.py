"""Faces: what a cell knows of its own polynomials on one of its sides.

The trace on a side is that of the one polynomial whose derivatives are the second gradient of the cell's energy, not
that of a piece of the gradient: with pieces, bending would hide between the sub-triangles, and not even x^2 would pass
a patch test. Points lie along the edge's own direction, so that both cells, on whatever ranks, have the same ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.vem.blocks import Block
from tmc_vem.vem.facets.batch import Faces
from tmc_vem.vem.spaces.quadrature import gauss
from tmc_vem.vem.spaces.spaces import smooth_rows

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def points_of_side(order: int) -> tuple[Float, Float]:
    """Gauss points on [0, 1] and weights: k + 1 of them, exact for products of two traces of degree k."""
    return gauss(order + 1)


class FaceTable:
    """The faces of this rank's cells of some blocks, by the number of the side: the place in ``cell_vertices``.

    Args:
        distributed: the mesh.
        blocks: of the cells.
        order: k.
    """

    def __init__(self, distributed: DistributedMesh, blocks: Sequence[Block], order: int) -> None:
        self._mesh, self._edges, self._blocks = distributed.mesh, distributed.edges, blocks
        self._points = points_of_side(order)[0]
        self._block_c = np.full(self._mesh.n_cells, -1)
        self._place_c = np.zeros(self._mesh.n_cells, dtype=np.int64)
        for number, block in enumerate(blocks):
            self._block_c[block.cells] = number
            self._place_c[block.cells] = np.arange(len(block.cells))
        self.cell_s = np.repeat(np.arange(self._mesh.n_cells), self._mesh.n_sides_c)

    def block_of(self, sides: Int) -> Int:
        """The block of each side's cell, -1 for cells of none."""
        blocks: Int = self._block_c[self.cell_s[sides]]
        return blocks

    def n_basis_of(self, sides: Int) -> Int:
        """Basis functions of each side's cell."""
        return np.array([block.batch.n_basis for block in self._blocks], dtype=np.int64)[self.block_of(sides)]

    def faces(self, sides: Int) -> Faces:
        """Faces of sides of cells with equally many basis functions."""
        blocks = self.block_of(sides)
        parts, order = [], []
        for block in np.unique(blocks).tolist():
            chosen = np.flatnonzero(blocks == block)
            parts.append(self._of_block(block, sides[chosen]))
            order.append(chosen)
        place = np.argsort(np.concatenate(order))
        return Faces(*(np.concatenate([getattr(part, of.name) for part in parts])[place] for of in fields(Faces)))

    def _of_block(self, block: int, sides: Int) -> Faces:
        batch = self._blocks[block].batch
        cells = self.cell_s[sides]
        place = self._place_c[cells]
        shapes, position = np.unique(batch.shape_c[place], return_inverse=True)
        second = batch.gradients(shapes).second_sxma[position]
        h = (1.0 / batch.inverse_h_s[shapes])[position]
        polygons = self._blocks[block].polygons(self._mesh, place)
        ends = self._mesh.points_vx[self._edges.vertices_ev[self._edges.cell_edges[sides]]]
        points = ends[:, :1] + self._points[:, None] * (ends[:, 1:] - ends[:, :1])
        xi = (points - centroids(polygons)[:, None]) / h[:, None, None]
        factor_fk = np.empty((len(sides), 0)) if batch.factor_ck is None else batch.factor_ck[place]
        return Faces(
            smooth_rows(second, h, xi), batch.nodes_ca[place].astype(np.int64), areas(polygons), cells, factor_fk
        )
