"""The virtual element discretisation of a potential: residual, tangent and step limits, assembled into PETSc."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from codegen.kernel import ENERGY, GRADIENT, TANGENT, CellBatch, CellValues, Kernel
from tmc_vem.constraints import Prescribed
from tmc_vem.errors import InputError
from tmc_vem.fields import Polygons
from tmc_vem.mesh.distribute import DistributedMesh
from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.parallel import on_every_rank
from tmc_vem.solve.protocol import Evaluation, RegionValues
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.element import ElementGroup, ElementSettings, build_elements
from tmc_vem.vem.quadrature import gauss_lobatto

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class RegionKernel:
    """The compiled energy of a region and the values of its parameters in the kernel's order."""

    kernel: Kernel
    parameters: Float


@dataclass(frozen=True)
class Block:
    """Cells that share energy, size and l: one call of a kernel."""

    region: str
    kernel: Kernel
    parameters: Float
    group: ElementGroup
    batch: CellBatch
    cells: Int
    nodes_ca: Int
    dofs: NDArray[np.int64]  # (n_cells * n_basis * 2,) flat local degrees of freedom
    free_dofs_cn: NDArray[np.int32]  # (n_cells, 2 n_basis), -1 where constrained: PETSc skips those entries
    tangent_caibj: Float

    def first_vertices(self, mesh: PolygonMesh) -> Int:
        """(n_cells,) first vertex of each cell, which quadrature points are relative to."""
        first: Int = mesh.cell_vertices[mesh.cell_offsets[self.cells]]
        return first


class VemSystem:
    """Stabilization-free virtual elements for a potential of F and G; implements ``NonlinearSystem``.

    Args:
        distributed: the mesh.
        kernels: compiled energy by region name.
        prescribed: displacement boundary conditions.
        settings: order, projection degree and quadrature.

    Raises:
        InputError: a region has no energy, or a condition refers to a name that the mesh does not have.
    """

    def __init__(
        self,
        distributed: DistributedMesh,
        kernels: Mapping[str, RegionKernel],
        prescribed: Sequence[Prescribed] = (),
        settings: ElementSettings | None = None,
    ) -> None:
        self.comm = distributed.comm
        self.distributed = distributed
        self.settings = settings or ElementSettings()
        self.regions = distributed.mesh.region_names
        for region in self.regions:
            if region not in kernels:
                raise InputError(f"region '{region}' has no energy (given: {', '.join(kernels)})")
        self.dofmap = DofMap.create(distributed, self.settings.order)
        self._local = self.dofmap.dm.createLocalVec()
        self._work = self.dofmap.dm.createLocalVec()
        self._named_nodes = functools.cache(self._nodes_of)
        self._constrained_local, self._constraint_values = self._locate(prescribed)
        groups = on_every_rank(self.comm, lambda: build_elements(distributed.mesh, self.settings, distributed.cell_ids))
        self.blocks = self._make_blocks(groups, kernels)
        self.size = self._extent()
        self._load_nodes: Float | None = None
        # positions of owned constrained entries in this rank's part of a global vector
        lgmap = self.dofmap.dm.getLGMap()
        first, last = self._owned_range()
        numbers = lgmap.apply(self._constrained_local.astype(PETSc.IntType))
        owned = (numbers >= first) & (numbers < last)
        self._owned = (numbers[owned] - first).astype(np.int32)
        self._owned_local = self._constrained_local[owned]
        self._owned_values = self._constraint_values[owned]

    # -- NonlinearSystem -----------------------------------------------------------------------------------------

    def create_vector(self) -> Any:
        """A new global displacement vector, zero."""
        vector = self.dofmap.dm.createGlobalVec()
        vector.set(0.0)
        return vector

    def create_matrix(self) -> Any:
        """A new symmetric matrix, preallocated exactly."""
        matrix = self.dofmap.dm.createMat()
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
        return matrix

    def constrained(self) -> NDArray[np.int32]:
        """Constrained entries owned by this rank, as positions in its part of a global vector."""
        owned: NDArray[np.int32] = self._owned
        return owned

    def prescribed(self, load: float) -> Float:
        """Displacements of :meth:`constrained` at a load factor."""
        values: Float = load * self._owned_values
        return values

    def energy(self, u: Any) -> Evaluation:
        """Potential at ``u``."""
        u_nodes = self._local_values(u)
        return self._evaluation([self._evaluate(block, ENERGY, u_nodes) for block in self.blocks], u_nodes)

    def residual(self, u: Any, out: Any) -> Evaluation:
        """Full gradient of the potential into ``out``; its constrained entries are the reactions."""
        u_nodes = self._local_values(u)
        values = [self._evaluate(block, GRADIENT, u_nodes) for block in self.blocks]
        total = self._accumulate([v.residual_cai for v in values if v.residual_cai is not None])
        if self._load_nodes is not None:
            total -= self._load_nodes.ravel()
        self._add(total, out)
        return self._evaluation(values, u_nodes)

    def jacobian(self, u: Any, out: Any) -> None:
        """Tangent (56) at ``u`` with rows and columns of the identity at constrained degrees of freedom."""
        u_nodes = self._local_values(u)
        out.zeroEntries()
        for block in self.blocks:
            self._evaluate(block, TANGENT, u_nodes)
            dofs = block.free_dofs_cn
            n = dofs.shape[1]
            out.setValuesLocalRCV(dofs, dofs, block.tangent_caibj.reshape(-1, n, n), addv=PETSc.InsertMode.ADD_VALUES)
        for dof in self._owned_local.tolist():
            out.setValueLocal(dof, dof, 1.0, addv=PETSc.InsertMode.ADD_VALUES)
        out.assemble()

    def tangent_action(self, du: Any, out: Any) -> None:
        """Product of the last tangent, without boundary conditions, and ``du``."""
        du_nodes = self._local_values(du)
        products = []
        for block in self.blocks:
            n = block.free_dofs_cn.shape[1]
            du_cn = du_nodes[block.nodes_ca].reshape(-1, n, 1)
            products.append(block.tangent_caibj.reshape(-1, n, n) @ du_cn)
        self._add(self._accumulate(products), out)

    def max_step(self, u: Any, du: Any) -> float:
        """Largest s with J > 0 at every quadrature point along u + t du, t < s."""
        u_nodes = self._local_values(u).copy()
        du_nodes = self._local_values(du)
        step = np.inf
        for block in self.blocks:
            step_c = block.kernel.max_step(block.batch, u_nodes[block.nodes_ca], du_nodes[block.nodes_ca])
            step = min(step, float(step_c.min(initial=np.inf)))
        return float(self.comm.allreduce(step, op=MPI.MIN))

    def point_coordinates(self, names: Sequence[str]) -> Float:
        """Reference coordinates (n, 2) of named points."""
        mesh = self.distributed.mesh
        return self._at_points(names, lambda vertex: mesh.points_vx[vertex])

    def point_displacements(self, u: Any, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points."""
        u_nodes = self._local_values(u)
        return self._at_points(names, lambda vertex: u_nodes[self.dofmap.vertex_nodes[vertex]])

    def _at_points(self, names: Sequence[str], value: Callable[[int], Float]) -> Float:
        points = self.distributed.mesh.named_points
        mine = {name: value(points[name]).copy() for name in names if name in points}
        found = {name: entry for part in self.comm.allgather(mine) for name, entry in part.items()}
        unknown = [name for name in names if name not in found]
        if unknown:
            raise InputError(f"the mesh has no named point '{unknown[0]}'")
        return np.array([found[name] for name in names]).reshape(-1, 2)

    def reaction(self, residual: Any, where: str, component: int) -> float:
        """Force that holds a named point or edge set, summed over its nodes."""
        nodes = self._named_nodes(where)
        first, last = self._owned_range()
        numbers = self.dofmap.dm.getLGMap().apply((2 * nodes + component).astype(PETSc.IntType))
        owned = numbers[(numbers >= first) & (numbers < last)] - first
        array = residual.getArray(readonly=True)
        return float(self.comm.allreduce(float(array[owned].sum())))

    # -- beyond the protocol -------------------------------------------------------------------------------------

    def set_body_force(self, force: Callable[[Float], Float]) -> None:
        """Dead load per reference area: ``force`` maps points (n, 2) to vectors (n, 2).

        Its work is ``int f . Pi0_k u``, which keeps the displacement's order k + 1.
        """
        load = np.zeros((self.dofmap.n_nodes, 2))
        mesh = self.distributed.mesh
        for block in self.blocks:
            shape_c = block.batch.shape_c
            corner_cx = mesh.points_vx[block.first_vertices(mesh)]
            points_cqx = block.group.points_sqx[shape_c] + corner_cx[:, None]
            f_cqi = force(points_cqx.reshape(-1, 2)).reshape(points_cqx.shape)
            work_cai = np.einsum("cq,cqa,cqi->cai", block.batch.w_sq[shape_c], block.group.values_sqa[shape_c], f_cqi)
            np.add.at(load, block.nodes_ca, work_cai)
        self._load_nodes = load

    @property
    def n_cells_global(self) -> int:
        """Cells of the whole mesh."""
        return self.distributed.n_cells_global

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom of the whole system, constrained ones included."""
        return self.dofmap.n_dofs_global

    def nodal_values(self, u: Any) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, ghosts included."""
        return self._local_values(u).copy()

    def node_labels(self) -> Float:
        """Labels (n_owned_nodes, 3) of this rank's part of a vector that do not depend on the distribution.

        Coordinates and 0 for nodes on sides; a cell's centroid and 1, 2, ... for its moments.
        """
        polygons = self.output_polygons()
        labels = np.zeros((self.dofmap.n_nodes, 3))
        on_sides = np.concatenate([self.dofmap.vertex_nodes, self.dofmap.edge_nodes.ravel()])
        labels[on_sides, :2] = polygons.points_nx
        for _, cells, vertices_cv in self.distributed.mesh.cells_by_size():
            center_cx = centroids(self.distributed.mesh.points_vx[vertices_cv])
            for m, nodes in enumerate(self.dofmap.cell_moments[cells].T):
                labels[nodes] = np.column_stack([center_cx, np.full(len(cells), m + 1.0)])
        first, last = self._owned_range()
        numbers = self.dofmap.dm.getLGMap().apply((2 * np.arange(len(labels))).astype(PETSc.IntType))
        owned = (numbers >= first) & (numbers < last)
        ordered = np.empty(((last - first) // 2, 3))
        ordered[(numbers[owned] - first) // 2] = labels[owned]
        return ordered

    def output_polygons(self) -> Polygons:
        """This rank's cells as polygons through vertices and points on the sides."""
        mesh, edges = self.distributed.mesh, self.distributed.edges
        order = self.settings.order
        interior = gauss_lobatto(order + 1)[0][1:-1]
        start, end = (mesh.points_vx[edges.vertices_ev[:, n]] for n in (0, 1))
        along = start[:, None] + (end - start)[:, None] * interior[:, None]
        on_edges = mesh.n_vertices + np.arange(len(edges))[:, None] * (order - 1) + np.arange(order - 1)
        side_points = on_edges[edges.cell_edges]
        side_points = np.where(edges.forward[:, None], side_points, side_points[:, ::-1])
        return Polygons(
            points_nx=np.concatenate([mesh.points_vx, along.reshape(-1, 2)]),
            offsets=mesh.cell_offsets * order,
            connectivity=np.column_stack([mesh.cell_vertices, side_points]).ravel(),
            region_c=mesh.region_c,
            region_names=mesh.region_names,
        )

    def output_displacements(self, u: Any) -> Float:
        """Displacements (n_points, 2) of the points of :meth:`output_polygons`."""
        nodes = np.concatenate([self.dofmap.vertex_nodes, self.dofmap.edge_nodes.ravel()])
        displacement: Float = self._local_values(u)[nodes]
        return displacement

    def cell_areas(self) -> Float:
        """Reference area (n_cells,) of each local cell."""
        area_c = np.empty(self.distributed.mesh.n_cells)
        for block in self.blocks:
            area_c[block.cells] = block.batch.w_sq.sum(axis=1)[block.batch.shape_c]
        return area_c

    def cell_energies(self, u: Any, without: str = "") -> Float:
        """Energy (n_cells,) of each local cell; the parameter ``without``, where an energy has it, is set to 0."""
        u_nodes = self._local_values(u)
        energies = np.empty(self.distributed.mesh.n_cells)
        for block in self.blocks:
            parameters = block.parameters.copy()
            parameters[[name == without for name in block.kernel.parameters]] = 0.0
            values = block.kernel.cells(ENERGY, block.batch, u_nodes[block.nodes_ca], parameters)
            energies[block.cells] = values.energy_c
        return energies

    def cell_jacobians(self, u: Any) -> tuple[Float, Float]:
        """Mean and smallest J (n_cells,) of each local cell."""
        u_nodes = self._local_values(u)
        mean, smallest = np.empty((2, self.distributed.mesh.n_cells))
        for block in self.blocks:
            n = block.batch.n_basis
            gradient = block.batch.B_sqra[block.batch.shape_c, :, :2, :n] @ u_nodes[block.nodes_ca][:, None]
            # gradient_cqji: derivative j of component i
            F = np.swapaxes(gradient, 2, 3) + np.eye(2)
            J = F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]
            w = block.batch.w_sq[block.batch.shape_c]
            mean[block.cells] = (w * J).sum(axis=1) / w.sum(axis=1)
            smallest[block.cells] = J.min(axis=1)
        return mean, smallest

    def projection_degrees(self) -> dict[str, int]:
        """How many cells of the whole mesh use which l, or which space of another name."""
        counts: dict[str, int] = {}
        for part in self.comm.allgather([(b.group.projection, len(b.cells)) for b in self.blocks]):
            for projection, n_cells in part:
                counts[projection] = counts.get(projection, 0) + n_cells
        return dict(sorted(counts.items()))

    # -- internals -----------------------------------------------------------------------------------------------

    def _make_blocks(self, groups: Sequence[ElementGroup], kernels: Mapping[str, RegionKernel]) -> list[Block]:
        blocks = []
        is_constrained = np.zeros(2 * self.dofmap.n_nodes, dtype=bool)
        is_constrained[self._constrained_local] = True
        region_c = self.distributed.mesh.region_c
        for group in groups:
            for number in np.unique(region_c[group.cells]).tolist():
                chosen = np.flatnonzero(region_c[group.cells] == number)
                cells = group.cells[chosen]
                nodes = self.dofmap.cell_nodes(self.distributed, cells, group.n_sides)
                dofs_cn = (2 * nodes[..., None] + np.arange(2)).reshape(len(cells), -1)
                energy = kernels[self.regions[number]]
                blocks.append(
                    Block(
                        region=self.regions[number],
                        kernel=energy.kernel,
                        parameters=energy.parameters,
                        group=group,
                        batch=CellBatch(group.shape_c[chosen], group.B_sqra, group.w_sq, group.n_basis),
                        cells=cells,
                        nodes_ca=nodes,
                        dofs=dofs_cn.ravel(),
                        free_dofs_cn=np.where(is_constrained[dofs_cn], -1, dofs_cn).astype(PETSc.IntType),
                        tangent_caibj=np.zeros((len(cells), group.n_basis, 2, group.n_basis, 2)),
                    )
                )
        return blocks

    def _locate(self, prescribed: Sequence[Prescribed]) -> tuple[Int, Float]:
        """Local constrained degrees of freedom, without duplicates, and their values at load factor 1."""
        values: dict[int, float] = {}
        for condition in prescribed:
            for node in self._named_nodes(condition.where).tolist():
                values[2 * node + condition.component] = condition.value
        dofs = np.array(sorted(values), dtype=np.int64)
        return dofs, np.array([values[dof] for dof in dofs.tolist()])

    def _nodes_of(self, where: str) -> Int:
        """Local nodes of a named point or edge set (empty if it lies on other ranks).

        Raises:
            InputError: no rank has anything of that name.
        """
        mesh = self.distributed.mesh
        known = self.comm.allreduce(where in mesh.named_points or where in mesh.named_edges, op=MPI.LOR)
        if not known:
            raise InputError(f"the mesh has neither a point nor edges named '{where}'")
        here = np.zeros(self.dofmap.n_nodes)
        if where in mesh.named_points:
            here[self.dofmap.vertex_nodes[mesh.named_points[where]]] = 1.0
        pairs = mesh.named_edges.get(where)
        if pairs is not None and len(pairs):
            ordered = {tuple(sorted(pair)): e for e, pair in enumerate(self.distributed.edges.vertices_ev.tolist())}
            edges = [ordered[tuple(sorted(pair))] for pair in pairs.tolist()]
            here[self.dofmap.vertex_nodes[np.unique(pairs)]] = 1.0
            here[self.dofmap.edge_nodes[edges].ravel()] = 1.0
        # a rank may share an end vertex of an edge that lies on another rank only: let all ranks know
        total = self.dofmap.dm.createGlobalVec()
        self._add(np.repeat(here, 2), total)
        marked = self._local_values(total)[:, 0] > 0.0
        total.destroy()
        nodes: Int = np.flatnonzero(marked)
        return nodes

    def _owned_range(self) -> tuple[int, int]:
        probe = self.dofmap.dm.getGlobalVec()
        first, last = probe.getOwnershipRange()
        self.dofmap.dm.restoreGlobalVec(probe)
        return first, last

    def _extent(self) -> float:
        points = self.distributed.mesh.points_vx
        mine = [points.min(axis=0), points.max(axis=0)] if len(points) else []
        corners = [corner for part in self.comm.allgather(mine) for corner in part]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        return float(np.max(high - low))

    def _local_values(self, u: Any) -> Float:
        self.dofmap.dm.globalToLocal(u, self._local)
        array: Float = self._local.getArray().reshape(-1, 2)
        return array

    def _accumulate(self, per_block: Sequence[Float]) -> Float:
        """Sum of element vectors at this rank's degrees of freedom."""
        total = np.zeros(2 * self.dofmap.n_nodes)
        for block, values in zip(self.blocks, per_block, strict=True):
            total += np.bincount(block.dofs, weights=values.ravel(), minlength=len(total))
        return total

    def _add(self, total: Float, out: Any) -> None:
        """Sum the ranks' contributions to shared nodes into a global vector."""
        self._work.getArray()[:] = total
        out.set(0.0)
        self.dofmap.dm.localToGlobal(self._work, out, addv=PETSc.InsertMode.ADD_VALUES)

    def _evaluate(self, block: Block, level: int, u_nodes: Float) -> CellValues:
        return block.kernel.cells(
            level, block.batch, u_nodes[block.nodes_ca], block.parameters,
            tangent_out=block.tangent_caibj if level == TANGENT else None,
        )  # fmt: skip

    def _evaluation(self, values: Sequence[CellValues], u_nodes: Float) -> Evaluation:
        energy = dict.fromkeys(self.regions, 0.0)
        smallest = dict.fromkeys(self.regions, (np.inf, -1))
        for block, value in zip(self.blocks, values, strict=True):
            energy[block.region] += float(value.energy_c.sum())
            position = int(np.argmin(value.min_j_c))  # argmin takes a NaN for the smallest
            candidate = (float(value.min_j_c[position]), int(self.distributed.cell_ids[block.cells[position]]))
            if not candidate[0] >= smallest[block.region][0]:
                smallest[block.region] = candidate
        work = 0.0 if self._load_nodes is None else float((self._load_nodes * u_nodes).sum())
        parts = self.comm.allgather((energy, smallest, work))
        regions, worst = {}, (np.inf, -1, "")
        for region in self.regions:
            lowest = min((part[1][region] for part in parts), key=lambda c: c[0] if c[0] == c[0] else -np.inf)
            regions[region] = RegionValues(sum(part[0][region] for part in parts), lowest[0])
            if not lowest[0] >= worst[0]:
                worst = (lowest[0], lowest[1], region)
        where = f"J = {worst[0]:.3g} in cell {worst[1]} of region '{worst[2]}'"
        stored = sum(r.energy for r in regions.values())
        return Evaluation(stored - sum(part[2] for part in parts), regions, where)
