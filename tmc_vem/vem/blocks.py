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
from tmc_vem.vem.kernel.pieces import Pieces
from tmc_vem.vem.spaces import monomials
from tmc_vem.vem.spaces.element import ElementGroup
from tmc_vem.vem.spaces.piecewise import PiecewiseGradients
from tmc_vem.vem.spaces.projector import n_translated_dofs
from tmc_vem.vem.spaces.spaces import Gradients, ProjectedGradients, second_rows
from tmc_vem.vem.spaces.tabulated import Tables

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
        return self.rule(chosen)[1]

    def scaled_points(self, chosen: slice = slice(None)) -> Float:
        """Quadrature points (n_cells, n_points, 2) in scaled coordinates."""
        return self.rule(chosen)[0]

    def rule(self, chosen: slice = slice(None)) -> tuple[Float, Float]:
        """Both: points (n_cells, n_points, 2) in scaled coordinates, and weights (n_cells, n_points)."""
        shapes, position = self._shapes(chosen)
        points, weights = self.batch.points(shapes)
        return points[position], weights[position]

    def _shapes(self, chosen: slice) -> tuple[Int, Int]:
        """Shapes of cells, each once, and which of them every cell has."""
        return np.unique(self.batch.shape_c[chosen], return_inverse=True)

    def rows(self, n_rows: int, chosen: slice = slice(None)) -> Float:
        """Derivatives (n_cells, n_points, n_rows, n_basis) of the projected basis; 6 only if the energy has G."""
        shapes, position = self._shapes(chosen)
        h_s, xi_sqx = 1.0 / self.batch.inverse_h_s[shapes], self.batch.points(shapes)[0]
        return self.batch.gradients(shapes).rows(h_s, xi_sqx, self.batch.piece_q, n_rows)[position]

    def second_rows(self, chosen: slice = slice(None)) -> Float:
        """The last four of these rows, (n_cells, n_points, 4, n_basis)."""
        shapes, position = self._shapes(chosen)
        second_sxma, h_s = self.batch.gradients(shapes).second_sxma, 1.0 / self.batch.inverse_h_s[shapes]
        return second_rows(second_sxma, h_s, self.batch.points(shapes)[0])[position]

    def displacement_gradients(self, u_ni: Float, chosen: slice = slice(None)) -> Float:
        """Projected gradients (n_cells, n_points, 2, 2) at displacements (n_nodes, 2) of the nodes; [..., x, i] is the
        derivative of component i with respect to x.

        The polynomials of a displacement are made first, which is less work than the rows of the basis.
        """
        shapes, position = self._shapes(chosen)
        position = position if len(shapes) > 1 else np.zeros(1, dtype=np.int64)  # one shape is not copied for each cell
        gradients = self.batch.gradients(shapes)
        values = self.batch.values(shapes, gradients)
        at_points = values if len(values) == 1 else values[position]
        return self._at(gradients.take(position), u_ni[self.batch.nodes_ca[chosen]], at_points)

    def gradients_at(self, u_ni: Float, cells: Int, xi_cqx: Float) -> Float:
        """The same at other points (n_cells, n_points, 2), in scaled coordinates, of the cells at some positions; where
        the gradient has pieces, as many points in each, one after the other."""
        gradients = self.batch.gradients(self.batch.shape_c[cells])
        return self._at(gradients, u_ni[self.batch.nodes_ca[cells]], gradients.values(xi_cqx))

    @staticmethod
    def _at(gradients: ProjectedGradients, u_cai: Float, values_ctqm: Float) -> Float:
        """Gradients (n_cells, n_points, 2, 2) from the values of their polynomials at points."""
        at_points: Float = (values_ctqm @ gradients.polynomials(u_cai)).reshape(len(u_cai), -1, 2, 2)
        return at_points


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
        gradients = group.tables.gradients
        pieces = gradients.topology.corners_tp.tobytes() if isinstance(gradients, PiecewiseGradients) else b""
        key = (group.region, group.n_sides, group.projection, group.tables.piece_q.tobytes(), pieces)
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


def _pieces(tables: Tables) -> Pieces | None:
    if not isinstance(tables.gradients, PiecewiseGradients):
        return None
    assert tables.on_pieces is not None, "piecewise polynomials take rules of sub-triangles"
    return Pieces(tables.gradients.topology, tables.on_pieces)


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
        values = self._values(group)
        self._packs = {name: Packs(group.most_shapes, of.shape[1:]) for name, of in values.items()}

    def _values(self, group: ElementGroup) -> dict[str, Float]:
        """Values of the shapes by the names that they have in a batch, without the ``_sp``."""
        tables, gradients = group.tables, group.tables.gradients
        values = {"inverse_h": 1.0 / tables.h_s}
        if isinstance(gradients, PiecewiseGradients):
            values |= {"corners": gradients.corners_sdx, "gradient": gradients.inside_sba}
        elif isinstance(gradients, Gradients):
            values |= {"w": tables.w_sq, "xi": tables.xi_sqx, "gradient": gradients.first_stxma}
        if self._energy.kernel.uses_second_gradient and not (isinstance(gradients, Gradients) and gradients.shared):
            values["second"] = gradients.second_sxma
        return values

    def add(self, group: ElementGroup) -> None:
        """Pack one more group."""
        for name, values in self._values(group).items():
            self._packs[name].append(values)
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
        packed, gradients = {name: packs.finish() for name, packs in self._packs.items()}, group.tables.gradients
        uses_second = kernel.uses_second_gradient
        batch = CellBatch(
            shape_c=np.concatenate(self._shape_c),
            nodes_ca=dofmap.cell_nodes(distributed, cells, group.n_sides),
            piece_q=group.tables.piece_q.astype(np.int32),
            w_sp=packed.get("w"),
            xi_sp=packed.get("xi"),
            inverse_h_sp=packed["inverse_h"],
            gradient_sp=packed["gradient"],
            second_sp=packed.get("second", packed["gradient"]) if uses_second else None,
            gradient_degree=gradients.degree,
            second_degree=monomials.degree_of(gradients.second_sxma.shape[2]) if uses_second else 0,
            n_pieces=gradients.n_pieces,
            n_translated=n_translated_dofs(group.n_sides, dofmap.order),
            corners_sp=packed.get("corners"),
            pieces=_pieces(group.tables),
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
