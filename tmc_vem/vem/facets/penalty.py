"""The interior penalty of a mesh: sides inside media and at their edges, on all ranks.

What the second gradient of a C0 function does not see is what it does between cells: there its gradient jumps, and
bending costs nothing. These sides charge it. At the edge of a medium the trace of the cell's polynomial is compared
with the derivative of the displacement along the side, which is known there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.vem.blocks import Block, RegionKernel
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.facets.exchange import Halo, meet
from tmc_vem.vem.facets.faces import Faces, FaceTable, points_of_side
from tmc_vem.vem.facets.terms import FacetTerms, Side, dofs, jump_of_faces
from tmc_vem.vem.spaces.projector import edge_basis_slopes

Float = NDArray[np.float64]
Int = NDArray[np.int64]


class InteriorPenalty:
    """Energy of the sides of a mesh.

    Args:
        distributed, dofmap: the mesh and its nodes.
        blocks: all cells of this rank.
        kernels: of all regions; those with an energy of sides take part.
    """

    def __init__(
        self,
        distributed: DistributedMesh,
        dofmap: DofMap,
        blocks: Sequence[Block],
        kernels: Mapping[str, RegionKernel],
    ) -> None:
        self._distributed, self._dofmap, self._kernels = distributed, dofmap, kernels
        self._order = dofmap.order
        media = [block for block in blocks if kernels[block.region].sides is not None]
        self._media = media
        self._table = FaceTable(distributed, media, dofmap.order)
        numbers = dofmap.dm.getLGMap().apply(DISPLACEMENT.dof(np.arange(dofmap.n_nodes)).astype(PETSc.IntType))
        self._node_numbers: Int = DISPLACEMENT.node(numbers.astype(np.int64))
        inner, single = self._sides()
        met, edge = meet(
            distributed, self._table, single, distributed.mesh.region_c[self._table.cell_s[single]], self._node_numbers
        )
        others = [one.other.nodes_fa.ravel() for one in met]
        strange = np.setdiff1d(np.unique(np.concatenate(others)), self._node_numbers) if others else np.empty(0, int)
        self.halo = Halo(distributed.comm, dofmap, strange)
        self.terms = [
            *self._inside(inner[:, 0], inner[:, 1]),
            *self._between_ranks([(one.side, one.other) for one in met]),
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

    def _inside(self, first: Int, second: Int) -> Iterator[FacetTerms]:
        """Sides with both cells on this rank."""
        a, b = self._table.block_of(first), self._table.block_of(second)
        for chosen in _alike(np.column_stack([a, b])):
            faces = (
                self._table.faces(int(a[chosen[0]]), first[chosen]),
                self._table.faces(int(b[chosen[0]]), second[chosen]),
            )
            yield self._two_faces(first[chosen], faces)

    def _between_ranks(self, met: Sequence[tuple[int, Faces]]) -> Iterator[FacetTerms]:
        """Sides whose second cell is another rank's."""
        sides = np.array([side for side, _ in met], dtype=np.int64)
        blocks = self._table.block_of(sides)
        kinds = np.column_stack([blocks, [other.n_basis for _, other in met]]) if met else np.empty((0, 2), int)
        known = np.argsort(self._node_numbers)
        for chosen in _alike(kinds):
            others = [met[n][1] for n in chosen.tolist()]
            numbers = np.concatenate([other.nodes_fa for other in others])
            place = np.minimum(np.searchsorted(self._node_numbers, numbers, sorter=known), len(known) - 1)
            local = known[place]
            nodes = np.where(self._node_numbers[local] == numbers, local, self.halo.local(numbers))
            second = Faces(
                np.concatenate([other.rows_fqra for other in others]), nodes,
                np.concatenate([other.area_f for other in others]), np.full(len(chosen), -1),
            )  # fmt: skip
            yield self._two_faces(sides[chosen], (self._table.faces(int(blocks[chosen[0]]), sides[chosen]), second))

    def _two_faces(self, sides: Int, faces: tuple[Faces, Faces]) -> FacetTerms:
        normal, length = self._geometry(sides)
        # the harmonic mean of area over length: hanging nodes and short sides need nothing special
        h = 2.0 / (length / faces[0].area_f + length / faces[1].area_f)
        return self._made(sides, faces, jump_of_faces(faces), normal, length, h)

    def _at_edges(self, sides: Int) -> Iterator[FacetTerms]:
        """Sides at the edge of a medium, one face each."""
        block, local = self._table.block_of(sides), self._place_in_cell(sides)
        for chosen in _alike(np.column_stack([block, local])):
            here = sides[chosen]
            face = self._table.faces(int(block[chosen[0]]), here)
            normal, length = self._geometry(here)
            tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
            along = np.einsum("fj,fqja->fqa", tangent, face.rows_fqra[:, :, :2])
            n_sides, s = self._media[int(block[chosen[0]])].n_sides, int(local[chosen[0]])
            k = self._order
            on_side = [s, *range(n_sides + s * (k - 1), n_sides + (s + 1) * (k - 1)), (s + 1) % n_sides]
            points = points_of_side(k)[0]
            forward = self._distributed.edges.forward[here]
            for direction in (True, False):
                # a side that runs against its edge has the points in the other order
                slopes = edge_basis_slopes(k, points if direction else 1.0 - points)
                which = np.flatnonzero(forward == direction)
                along[which[:, None, None], np.arange(k + 1)[:, None], on_side] -= (
                    slopes / length[which, None, None]
                )
            jump = tangent[:, None, :, None] * along[:, :, None]
            yield self._made(here, (face,), jump, normal, length, face.area_f / length)

    def _made(
        self, sides: Int, faces: tuple[Faces, ...], jump: Float, normal: Float, length: Float, h: Float
    ) -> FacetTerms:
        mesh = self._distributed.mesh
        region = mesh.region_names[mesh.region_c[self._table.cell_s[sides[0]]]]
        energy = self._kernels[region].sides
        assert energy is not None
        side = Side(normal, h, length[:, None] * points_of_side(self._order)[1])
        return FacetTerms(region, energy.kernel, energy.parameters.copy(), faces, jump, side)

    def _geometry(self, sides: Int) -> tuple[Float, Float]:
        """Unit normals (n, 2) out of the sides' cells, and lengths."""
        mesh, edges = self._distributed.mesh, self._distributed.edges
        ends = mesh.points_vx[edges.vertices_ev[edges.cell_edges[sides]]]
        along = np.where(edges.forward[sides][:, None], 1.0, -1.0) * (ends[:, 1] - ends[:, 0])
        length = np.hypot(along[:, 0], along[:, 1])
        return np.column_stack([along[:, 1], -along[:, 0]]) / length[:, None], length

    def _place_in_cell(self, sides: Int) -> Int:
        return sides - self._distributed.mesh.cell_offsets[self._table.cell_s[sides]]

    @property
    def node_numbers(self) -> Int:
        """(n_nodes + n_halo,) number over all ranks of this rank's nodes and those of the halo."""
        return np.concatenate([self._node_numbers, self.halo.numbers])

    # -- values ----------------------------------------------------------------------------------------------------

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name."""
        for term in self.terms:
            for position, name in enumerate(term.kernel.parameters):
                if name in values:
                    term.parameters[position] = values[name]

    def node_groups(self) -> Iterable[Int]:
        """Nodes (n_sides, n) that sides couple."""
        return (term.nodes_fa for term in self.terms)

    def insert(self, u_ni: Float, matrix: Mat, is_constrained: NDArray[np.bool_]) -> None:
        """Add the tangents to a matrix; constrained rows and columns are left out.

        Args:
            u_ni: displacements of this rank's nodes and the halo.
            matrix: not yet assembled.
            is_constrained: (n_nodes + n_halo) 2 flags.
        """
        numbers = self.node_numbers
        for term in self.terms:
            for chosen in term.chunks():
                tangents = term.tangents(u_ni, chosen)
                nodes = term.nodes_fa[chosen]
                free = np.where(is_constrained[dofs(nodes)], -1, dofs(numbers[nodes])).astype(PETSc.IntType)
                n = free.shape[1]
                matrix.setValuesRCV(free, free, tangents.reshape(-1, n, n), addv=PETSc.InsertMode.ADD_VALUES)

    def add_products(self, u_ni: Float, du_ni: Float, total_ni: Float) -> None:
        """Add tangents times ``du_ni``, where it is not zero."""
        moves = du_ni.any(axis=1)
        for term in self.terms:
            nodes = term.nodes_fa
            moving = np.flatnonzero(moves[nodes].any(axis=1))
            for chosen in np.array_split(moving, len(moving) // 512 + 1):
                if len(chosen):
                    n = 2 * nodes.shape[1]
                    products = term.tangents(u_ni, chosen).reshape(-1, n, n) @ du_ni[nodes[chosen]].reshape(-1, n, 1)
                    np.add.at(total_ni, nodes[chosen], products.reshape(*nodes[chosen].shape, 2))


def _alike(keys: Any) -> Iterator[Int]:
    """Positions (n,) of equal rows of keys."""
    if len(keys):
        _, which = np.unique(keys, axis=0, return_inverse=True)
        for kind in range(which.max() + 1):
            yield np.flatnonzero(which.reshape(-1) == kind)
