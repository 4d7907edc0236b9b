"""Blocks: cells of one region, size and projection, which one call of a compiled kernel works on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.system.friction import FrictionLaw
from tmc_vem.system.graded import Graded
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.facets.compiled import SideEnergy
from tmc_vem.vem.kernel.batch import CellBatch
from tmc_vem.vem.kernel.cells import CellKernel
from tmc_vem.vem.kernel.friction_packs import FrictionPacks
from tmc_vem.vem.kernel.packs import Packs
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.element import ElementGroup
from tmc_vem.vem.spaces.potential import potential_of_gradient
from tmc_vem.vem.spaces.projector import n_translated_dofs
from tmc_vem.vem.spaces.spaces import Gradients

Float = NDArray[np.float64]
Int = NDArray[np.int64]

CHUNK = 1024  # cells whose dense arrays are held at a time


@dataclass(frozen=True)
class RegionKernel:
    """The compiled energy of a region and the values of its parameters in the kernel's order.

    Attributes:
        kernel, parameters: of its cells.
        sides: of the sides of its cells, if they have an interior penalty.
        graded: what multiplies the parameters that vary from cell to cell, if there are some.
        friction: of a medium with some.
    """

    kernel: CellKernel
    parameters: Float
    sides: SideEnergy | None = None
    graded: Graded | None = None
    friction: FrictionLaw | None = None


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
    kernel: CellKernel
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

    def polygons(self, mesh: PolygonMesh, chosen: slice | Int = slice(None)) -> Float:
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

    def displacement_gradients(self, u_ni: Float, chosen: slice = slice(None)) -> Float:
        """Projected gradients (n_cells, n_points, 2, 2) at displacements (n_nodes, 2) of the nodes; [..., x, i] is the
        derivative of component i with respect to x.

        The polynomials of a displacement are made first, which is less work than the rows of the basis.
        """
        shapes, position = np.unique(self.batch.shape_c[chosen], return_inverse=True)
        position = position if len(shapes) > 1 else np.zeros(1, dtype=np.int64)  # one shape is not copied for each cell
        polynomials = self._polynomials(u_ni[self.batch.nodes_ca[chosen]], shapes, position)
        return self._at(polynomials, self.batch.xi_sqx[shapes], position)

    def gradients_at(self, u_ni: Float, cells: Int, xi_cqx: Float) -> Float:
        """The same at other points (n_cells, n_points, 2), in scaled coordinates, of the cells at some positions; where
        the gradient has pieces, as many points in each, one after the other."""
        shapes, position = np.unique(self.batch.shape_c[cells], return_inverse=True)
        return self._at(self._polynomials(u_ni[self.batch.nodes_ca[cells]], shapes, position), xi_cqx, slice(None))

    def _polynomials(self, u_cai: Float, shapes: Int, position: Int) -> Float:
        """Coefficients (n_cells, n_pieces, n_monomials, 4) of the displacement's projected gradients."""
        coefficients = self.batch.coefficients(shapes)[0]
        _, n_pieces, _, n_monomials, n_basis = coefficients.shape
        by_direction = np.moveaxis(coefficients, 3, 2).reshape(len(shapes), -1, n_basis)  # pieces, monomials, x
        return (by_direction[position] @ u_cai).reshape(len(u_cai), n_pieces, n_monomials, 4)

    def _at(self, polynomials: Float, xi_sqx: Float, position: Int | slice) -> Float:
        """Values (n_cells, n_points, 2, 2) of such polynomials at points of shapes."""
        n_cells, n_pieces, n_monomials, _ = polynomials.shape
        at_points = monomials.values(monomials.degree_of(n_monomials), xi_sqx)
        at_points = at_points.reshape(len(xi_sqx), n_pieces, -1, n_monomials)
        gradients: Float = (at_points[position] @ polynomials).reshape(n_cells, -1, 2, 2)
        return gradients


def make_blocks(
    distributed: DistributedMesh, dofmap: DofMap, groups: Iterable[ElementGroup], kernels: Mapping[str, RegionKernel]
) -> list[Block]:
    """Gather element groups to blocks, packed as kernels take them.

    Args:
        distributed, dofmap: the mesh and its nodes.
        groups: elements; they are packed as they come, so that there is never a second copy of all.
        kernels: energy by region.
    """
    found: dict[tuple[object, ...], _Gatherer] = {}
    for group in groups:
        region = distributed.mesh.region_names[group.region]
        key = (group.region, group.n_sides, group.projection, group.tables.piece_q.tobytes())
        if key not in found:
            found[key] = _Gatherer(region, kernels[region], group)
        found[key].add(group)
    return [gathered.block(distributed, dofmap) for gathered in found.values()]


def resisting_forces(blocks: Iterable[Block], u_ni: Float, chosen_c: NDArray[np.bool_]) -> Float:
    """(n_nodes, 2) residual of some cells (n_cells,) of the local mesh alone, at displacements of the nodes."""
    total = np.zeros_like(u_ni)
    for block in blocks:
        chosen = np.flatnonzero(chosen_c[block.cells])
        if len(chosen):
            block.kernel.cells(block.batch.take(chosen), u_ni, block.parameters, total)
    return total


class _Gatherer:
    """A block whose groups come one after the other.

    Args:
        region: name of their region.
        energy: of the region.
        group: the first one, which is not added yet.
    """

    def __init__(self, region: str, energy: RegionKernel, group: ElementGroup) -> None:
        self._region, self._energy, self._group = region, energy, group
        self._cells: list[Int] = []
        self._shape_c: list[NDArray[np.int32]] = []
        self._n_shapes = 0
        self._packs = [Packs(group.most_shapes, values.shape[1:]) for values in self._values(group)]

    def _values(self, group: ElementGroup) -> list[Float]:
        """Weights, points, inverse scales, gradients or potentials, and the second gradient if it is another."""
        tables = group.tables
        first = tables.gradients.first_stxma
        if tables.gradients.has_potential:
            first = potential_of_gradient(first, tables.h_s)
        values = [tables.w_sq, tables.xi_sqx, 1.0 / tables.h_s, first]
        if self._energy.kernel.uses_second_gradient and not tables.gradients.shared:
            values.append(tables.gradients.second_sxma)
        return values

    def add(self, group: ElementGroup) -> None:
        """Pack one more group."""
        for packs, values in zip(self._packs, self._values(group), strict=True):
            packs.append(values)
        self._cells.append(group.cells)
        self._shape_c.append(group.shape_c + np.int32(self._n_shapes))
        self._n_shapes += len(group.tables.h_s)

    def _factors(self, distributed: DistributedMesh, cells: Int) -> Float | None:
        graded = self._energy.graded
        if graded is None:
            return None
        mesh = distributed.mesh
        sides = mesh.cell_offsets[cells][:, None] + np.arange(self._group.n_sides)
        centroid_cx = centroids(mesh.points_vx[mesh.cell_vertices[sides]])
        data = {name: values[cells] for name, values in mesh.cell_data.items()}
        return np.ascontiguousarray(graded.factors(centroid_cx, data), dtype=np.float64)

    def block(self, distributed: DistributedMesh, dofmap: DofMap) -> Block:
        """All of them."""
        group, kernel, cells = self._group, self._energy.kernel, np.concatenate(self._cells)
        w_sp, xi_sp, inverse_h_sp, gradient_sp, *second = (packs.finish() for packs in self._packs)
        gradients = group.tables.gradients
        batch = CellBatch(
            shape_c=np.concatenate(self._shape_c),
            nodes_ca=dofmap.cell_nodes(distributed, cells, group.n_sides),
            piece_q=group.tables.piece_q.astype(np.int32),
            w_sp=w_sp,
            xi_sp=xi_sp,
            inverse_h_sp=inverse_h_sp,
            gradient_sp=gradient_sp,
            second_sp=second[0] if second else gradient_sp if kernel.uses_second_gradient else None,
            gradient_degree=monomials.degree_of(gradients.first_stxma.shape[3]),
            second_degree=monomials.degree_of(gradients.second_sxma.shape[2]) if kernel.uses_second_gradient else 0,
            n_pieces=gradients.first_stxma.shape[1],
            n_translated=n_translated_dofs(group.n_sides, dofmap.order),
            has_potential=gradients.has_potential,
            factor_ck=self._factors(distributed, cells),
            friction=None if self._energy.friction is None else FrictionPacks(len(cells), len(group.tables.piece_q)),
        )
        return Block(
            region=self._region,
            kernel=kernel,
            parameters=self._energy.parameters.copy(),
            batch=batch,
            cells=cells,
            n_sides=group.n_sides,
            degree=group.degree,
            projection=group.projection,
        )
