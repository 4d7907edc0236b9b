"""The interior penalty of a mesh: sides inside media and at their edges, on all ranks.

What the second gradient of a C0 function does not see is what it does between cells: there its gradient jumps, and
bending costs nothing. These sides charge it. At the edge of a medium the trace of the cell's polynomial is compared
with the derivative of the displacement along the side, which is known there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.vem.blocks import Block, RegionKernel
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.facets.batch import Faces, Side, SideBatch, jump_of_faces
from tmc_vem.vem.facets.compiled import SideKernel
from tmc_vem.vem.facets.exchange import Halo, Met, meet
from tmc_vem.vem.facets.faces import FaceTable, points_of_side
from tmc_vem.vem.spaces.projector import edge_basis_slopes

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class SideTerms:
    """Sides of one region whose faces have equally many basis functions.

    Attributes:
        region: name.
        kernel, parameters: energy of a point of a face.
        batch: the sides.
        cells: (n_sides, n_faces) cells of this rank, -1 for those of others.
    """

    region: str
    kernel: SideKernel
    parameters: Float
    batch: SideBatch
    cells: Int

    @property
    def nodes_ca(self) -> NDArray[np.int32]:
        """(n_sides, n_basis) nodes of all faces."""
        return self.batch.nodes_sa

    def take(self, chosen: Int | slice) -> SideTerms:
        """Some of the sides, with the same parameters."""
        return SideTerms(self.region, self.kernel, self.parameters, self.batch.take(chosen), self.cells[chosen])

    def energies(self, u_ni: Float, residual_ni: Float | None = None) -> tuple[Float, Float]:
        """Energy and smallest J (n_sides,) of each side; residuals are added to ``residual_ni`` if it is given."""
        return self.kernel.energies(self.batch, u_ni, self.parameters, residual_ni)

    def max_step(self, u_ni: Float, du_ni: Float) -> Float:
        """Largest s of each side, (n_sides,), with J > 0 at its points along u + t du, t < s."""
        return self.kernel.max_step(self.batch, u_ni, du_ni)

    def tangents(self, u_ni: Float) -> Float:
        """Tangents (n_sides, n_basis, 2, n_basis, 2)."""
        return self.kernel.tangents(self.batch, u_ni, self.parameters)

    def add_tangents(
        self, u_ni: Float, values: Float, position_cab: NDArray[np.int32], row_length_n: NDArray[np.int32]
    ) -> None:
        """Add the tangents to the values of a matrix."""
        self.kernel.add_tangents(self.batch, u_ni, self.parameters, values, position_cab, row_length_n)


class InteriorPenalty:
    """Energy of the sides of a mesh.

    Args:
        distributed, dofmap: the mesh and its nodes.
        blocks: all cells of this rank.
        kernels: of all regions; those with an energy of sides take part.
        is_direct: (n_nodes,) nodes whose tangents go straight into the matrix; sides are kept apart by that.
    """

    def __init__(
        self,
        distributed: DistributedMesh,
        dofmap: DofMap,
        blocks: Sequence[Block],
        kernels: Mapping[str, RegionKernel],
        is_direct: NDArray[np.bool_],
    ) -> None:
        self._distributed, self._dofmap, self._kernels = distributed, dofmap, kernels
        self._order = dofmap.order
        media = [block for block in blocks if kernels[block.region].sides is not None]
        self._table = FaceTable(distributed, media, dofmap.order)
        self._node_numbers = dofmap.global_node_n
        inner, single = self._sides()
        met, edge = meet(
            distributed, self._table, single, distributed.mesh.region_c[self._table.cell_s[single]], self._node_numbers
        )
        others = [one.other.nodes_fa.ravel() for one in met]
        strange = np.setdiff1d(np.unique(np.concatenate(others)), self._node_numbers) if others else np.empty(0, int)
        self.halo = Halo(distributed.comm, dofmap, strange)
        self._is_direct = np.concatenate([is_direct, np.zeros(len(strange), dtype=bool)])
        self.terms = [
            *self._inside(inner[:, 0], inner[:, 1]),
            *self._between_ranks(met),
            *self._at_edges(single[edge]),
        ]

    # -- sides -----------------------------------------------------------------------------------------------------

    def _sides(self) -> tuple[Int, Int]:
        """Pairs (n, 2) of sides of one medium that share an edge here, the one along the edge first; all others."""
        edges, region_c = self._distributed.edges, self._distributed.mesh.region_c
        sides = np.flatnonzero(self._table.block_of(np.arange(len(self._table.cell_s))) >= 0)
        along, against = np.full((2, len(edges)), -1)
        forward = edges.forward[sides]
        along[edges.cell_edges[sides[forward]]] = sides[forward]
        against[edges.cell_edges[sides[~forward]]] = sides[~forward]
        both = np.flatnonzero((along >= 0) & (against >= 0))
        cells = self._table.cell_s
        both = both[region_c[cells[along[both]]] == region_c[cells[against[both]]]]
        pairs = np.column_stack([along[both], against[both]])
        return pairs, np.setdiff1d(sides, pairs)

    def _inside(self, first: Int, second: Int) -> Iterator[SideTerms]:
        """Sides with both cells on this rank."""
        for chosen in self._alike(first, self._table.n_basis_of(first), self._table.n_basis_of(second)):
            faces = self._table.faces(first[chosen]), self._table.faces(second[chosen])
            yield from self._two_faces(first[chosen], faces)

    def _between_ranks(self, met: Sequence[Met]) -> Iterator[SideTerms]:
        """Sides whose second cell is another rank's."""
        sides = np.array([one.side for one in met], dtype=np.int64)
        n_basis = np.array([one.other.n_basis for one in met], dtype=np.int64)
        known = np.argsort(self._node_numbers)
        for chosen in self._alike(sides, self._table.n_basis_of(sides), n_basis):
            others = [met[n].other for n in chosen.tolist()]
            numbers = np.concatenate([other.nodes_fa for other in others])
            place = np.minimum(np.searchsorted(self._node_numbers, numbers, sorter=known), len(known) - 1)
            local = known[place]
            nodes = np.where(self._node_numbers[local] == numbers, local, self.halo.local(numbers))
            second = Faces(
                np.concatenate([other.rows_fqra for other in others]), nodes,
                np.concatenate([other.area_f for other in others]), np.full(len(chosen), -1),
                np.concatenate([other.factor_fk for other in others]),
            )  # fmt: skip
            yield from self._two_faces(sides[chosen], (self._table.faces(sides[chosen]), second))

    def _two_faces(self, sides: Int, faces: tuple[Faces, Faces]) -> Iterator[SideTerms]:
        normal, length = self._geometry(sides)
        # the harmonic mean of area over length: hanging nodes need nothing special
        h = 2.0 / (length / faces[0].area_f + length / faces[1].area_f)
        yield from self._made(sides, faces, jump_of_faces(faces), normal, length, h)

    def _at_edges(self, sides: Int) -> Iterator[SideTerms]:
        """Sides at the edge of a medium, one face each."""
        k, mesh = self._order, self._distributed.mesh
        points = points_of_side(k)[0]
        slopes_qa = edge_basis_slopes(k, points), edge_basis_slopes(k, 1.0 - points)
        for chosen in self._alike(sides, self._table.n_basis_of(sides)):
            here = sides[chosen]
            face = self._table.faces(here)
            normal, length = self._geometry(here)
            tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
            # what the cell's polynomial says of the derivative along the side, less what it is
            along = np.einsum("fj,fqja->fqa", tangent, face.rows_fqra[:, :, :2])
            cell = self._table.cell_s[here]
            n_sides, s = mesh.n_sides_c[cell], here - mesh.cell_offsets[cell]
            inside = (n_sides + s * (k - 1))[:, None] + np.arange(k - 1)
            on_side = np.column_stack([s, inside, (s + 1) % n_sides])
            # points are in the order of the edge, the basis in that of the cell
            forward = self._distributed.edges.forward[here][:, None, None]
            slopes = np.where(forward, *slopes_qa) / length[:, None, None]
            along[np.arange(len(here))[:, None, None], np.arange(k + 1)[:, None], on_side[:, None]] -= slopes
            jump = tangent[:, None, :, None] * along[:, :, None]
            yield from self._made(here, (face,), jump, normal, length, face.area_f / length)

    def _made(
        self, sides: Int, faces: tuple[Faces, ...], jump: Float, normal: Float, length: Float, h: Float
    ) -> Iterator[SideTerms]:
        mesh = self._distributed.mesh
        region = mesh.region_names[mesh.region_c[self._table.cell_s[sides[0]]]]
        energy = self._kernels[region].sides
        assert energy is not None
        w = length[:, None] * points_of_side(self._order)[1]
        direct = np.all([self._is_direct[face.nodes_fa].all(axis=1) for face in faces], axis=0)
        for chosen in (np.flatnonzero(direct), np.flatnonzero(~direct)):
            if len(chosen):
                some = tuple(face.take(chosen) for face in faces)
                side = Side(normal[chosen], h[chosen], w[chosen])
                batch = SideBatch.pack(energy.kernel.layout, some, jump[chosen], side)
                cells = np.column_stack([face.cell_f for face in some])
                yield SideTerms(region, energy.kernel, energy.parameters.copy(), batch, cells)

    def _geometry(self, sides: Int) -> tuple[Float, Float]:
        """Unit normals (n, 2) out of the sides' cells, and lengths."""
        mesh, edges = self._distributed.mesh, self._distributed.edges
        ends = mesh.points_vx[edges.vertices_ev[edges.cell_edges[sides]]]
        along = np.where(edges.forward[sides][:, None], 1.0, -1.0) * (ends[:, 1] - ends[:, 0])
        length = np.hypot(along[:, 0], along[:, 1])
        return np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None], length

    def _alike(self, sides: Int, *n_basis: Int) -> Iterator[Int]:
        """Positions (n,) of sides of one region whose faces have equally many basis functions."""
        keys = np.column_stack([self._distributed.mesh.region_c[self._table.cell_s[sides]], *n_basis])
        _, which = np.unique(keys, axis=0, return_inverse=True)
        for kind in range(which.max(initial=-1) + 1):
            yield np.flatnonzero(which.reshape(-1) == kind)

    @property
    def node_numbers(self) -> Int:
        """(n_nodes + n_halo,) number over all ranks of this rank's nodes and those of the halo."""
        return np.concatenate([self._node_numbers, self.halo.numbers])
