"""The virtual element discretisation of a potential: residual, tangent and step limits, assembled into PETSc."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.locate import TOLERANCE
from tmc_vem.mesh.spread.distribute import DistributedMesh
from tmc_vem.support.distributed import Mat, Vec
from tmc_vem.support.errors import EvaluationError, InputError
from tmc_vem.support.memory import give_back
from tmc_vem.support.parallel import on_every_rank
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Condition, Pair
from tmc_vem.system.control import Control, parameter_of
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.fields import Polygons
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.places import Located
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.reduction import Shares, at_named_points, extent, reaction, resultant, step_limit
from tmc_vem.system.sides import Sides
from tmc_vem.system.unloaded import require_regions
from tmc_vem.vem import cell_values
from tmc_vem.vem.blocks import Block, RegionKernel, make_blocks, resisting_forces
from tmc_vem.vem.dofmap import DofMap
from tmc_vem.vem.facets.exchange import Halo
from tmc_vem.vem.facets.penalty import InteriorPenalty, SideTerms
from tmc_vem.vem.friction import WithFriction, friction_of
from tmc_vem.vem.insertion import CellTerms, MatrixInsertion, Terms, add_products
from tmc_vem.vem.kernel.cells import CellValues
from tmc_vem.vem.loads import body_load, sides_along
from tmc_vem.vem.named_nodes import marked_here
from tmc_vem.vem.near_null_space import rigid_motions
from tmc_vem.vem.pattern import parallel_matrix, serial_matrix
from tmc_vem.vem.point_states import point_states
from tmc_vem.vem.point_weights import locate
from tmc_vem.vem.polygons import node_labels, node_points, polygons_through_nodes
from tmc_vem.vem.sensitivity import WithSensitivities
from tmc_vem.vem.spaces.element import element_groups
from tmc_vem.vem.spaces.element_settings import ElementSettings

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]
T = TypeVar("T")
Evaluated = tuple[list[CellValues], list[tuple[SideTerms, tuple[Float, Float]]]]  # of blocks, and of sides


class VemSystem(WithSensitivities, WithFriction):
    """Stabilization-free virtual elements for a potential of F and G; implements ``Discretisation``.

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
        prescribed: Sequence[Condition] = (),
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
        held = Constrained.of(prescribed, self._named_nodes, node_points(distributed, self.dofmap))
        self._constrained_local = held.along_x_and_y()
        self._constrained = self._constrained_local.renumbered(self.dofmap.owned_node_n)
        groups = element_groups(distributed.mesh, self.settings, distributed.cell_ids)
        self.blocks = on_every_rank(self.comm, lambda: make_blocks(distributed, self.dofmap, groups, kernels))
        self._has_friction = any(kernels[region].friction is not None for region in self.regions)
        self._friction = friction_of(self.blocks, kernels, distributed.mesh)
        self.size = extent(self.comm, distributed.mesh.points_vx)
        self.penalty: InteriorPenalty | None = None
        if any(kernels[region].sides is not None for region in self.regions):
            direct = (self.dofmap.owned_node_n >= 0) & ~self._is_constrained().any(axis=1)
            self.penalty = InteriorPenalty(distributed, self.dofmap, self.blocks, kernels, direct)
        self._load_nodes: Float | None = None
        self._kernel_seconds = 0.0
        self._insertion: MatrixInsertion | None = None
        self._tangent_state: Float | None = None

    # -- Discretisation ------------------------------------------------------------------------------------------

    def create_vector(self) -> Vec:
        """A new global displacement vector, zero."""
        vector: Vec = self.dofmap.dm.createGlobalVec()
        vector.set(0.0)
        return vector

    def create_matrix(self) -> Mat:
        """A new symmetric matrix, preallocated exactly."""
        dm = self.dofmap.dm
        plain = self.comm.size == 1 and not PETSc.Options().hasName("dm_mat_type")
        more = [terms.nodes_ca for terms in self._sides()]
        if plain:
            matrix: Mat = serial_matrix(self.blocks, dm, self.dofmap.n_nodes, more)
        elif self.penalty is None:
            matrix = dm.createMat()
        else:
            first, last = (DISPLACEMENT.n_nodes(bound) for bound in self.dofmap.owned_range)
            matrix = parallel_matrix(self.comm, self.blocks, dm, (first, last), self.penalty.node_numbers, more)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
        matrix.setNearNullSpace(rigid_motions(self.comm, self.node_labels(), self.create_vector))
        return matrix

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What is prescribed, with the axes that it has on the mesh."""
        return self._constrained.prescribed

    def constrained(self) -> NDArray[np.int32]:
        """Constrained entries owned by this rank, as positions in its part of a global vector."""
        return self._constrained.dofs.astype(np.int32)

    def prescribed(self, position: Control) -> Float:
        """Displacements of :meth:`constrained` at a position on the path."""
        return self._constrained.at(position)

    def prescribed_per_load(self, position: Control) -> Float:
        """Their derivatives with respect to the load factor."""
        return self._constrained.per_load(position)

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Change parameters, by name, in every energy that has them, or as ``<region>.<name>`` in one."""
        owners: list[Block | SideTerms] = [*self.blocks, *self._sides()]
        for each in owners:
            for position, name in enumerate(each.kernel.parameters):
                for known in (name, parameter_of(each.region, name)):
                    if known in values:
                        each.parameters[position] = values[known]

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u``."""
        u_nodes = self._extended(u)
        return self._evaluation(self._together(lambda: self._evaluate(u_nodes)), u_nodes)

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Full gradient of the potential into ``out``; its constrained entries are the reactions."""
        u_nodes = self._extended(u)
        total = np.zeros_like(u_nodes) if self._halo else DISPLACEMENT.nodal(self._work.getArray())
        total[: self.dofmap.n_nodes] = 0.0 if self._load_nodes is None else -self._load_nodes
        values = self._together(lambda: self._evaluate(u_nodes, total))
        if self._halo:
            self._add_extended(total, out)
        else:
            self._add_work(out)
        return self._evaluation(values, u_nodes)

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent (56) at ``u`` with rows and columns of the identity at constrained degrees of freedom.

        Raises:
            EvaluationError: a kernel failed on this or on another rank.
        """
        self._tangent_state = self._extended(u).copy()
        self._insertion_into(out).assemble(self._tangent_state, out, self._owned_constrained(), self._together)

    def tangent_action(self, du: Vec, out: Vec) -> None:
        """Product of the last tangent, without boundary conditions, and ``du``.

        Only the cells where ``du`` is not zero are computed, once more: a predictor moves the constrained nodes only.
        """
        if self._tangent_state is None:
            raise ValueError("there is no tangent yet: call jacobian() first")
        state, du_nodes = self._tangent_state, self._extended(du)
        total = np.zeros_like(state)
        self._together(lambda: self._add_products(state, du_nodes, total))
        self._add_extended(total, out)

    def _add_products(self, state: Float, du_nodes: Float, total: Float) -> None:
        for terms in self._terms():
            add_products(terms, state, du_nodes, total)

    def max_step(self, u: Vec, du: Vec) -> float:
        """Largest s with J > 0 at every quadrature point along u + t du, t < s."""
        u_nodes = self._extended(u).copy()
        du_nodes = self._extended(du)
        steps = self._together(
            lambda: [
                *(block.kernel.max_step(block.batch, u_nodes, du_nodes) for block in self.blocks),
                *(terms.max_step(u_nodes, du_nodes) for terms in self._sides()),
            ]
        )
        return step_limit(self.comm, (float(step_c.min(initial=np.inf)) for step_c in steps))

    def point_coordinates(self, names: Sequence[str]) -> Float:
        """Reference coordinates (n, 2) of named points."""
        mesh = self.distributed.mesh
        return self._at_points(names, lambda vertex: mesh.points_vx[vertex])

    def point_displacements(self, u: Vec, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points."""
        u_nodes = self._local_values(u)
        return self._at_points(names, lambda vertex: u_nodes[self.dofmap.vertex_nodes[vertex]])

    def _at_points(self, names: Sequence[str], value: Callable[[int], Float]) -> Float:
        points = self.distributed.mesh.named_points
        mine = {name: value(points[name]).copy() for name in names if name in points}
        return at_named_points(self.comm, names, mine)

    def reaction(self, residual: Vec, where: str, component: int) -> float:
        """Force that holds a named point or edge set, summed over its nodes."""
        return reaction(self.comm, residual, self.owned_nodes(where), component)

    def held_forces(self, residual: Vec) -> Float:
        """(n, 2) forces that hold this rank's nodes at which something is prescribed."""
        return self._constrained.forces(DISPLACEMENT.nodal(residual.getArray(readonly=True)))

    def resultant(self, u: Vec, residual: Vec, where: str, about: Pair) -> Float:
        """Force and moment (3,) that hold a named point or edge set."""
        nodes = self._named_nodes(where)
        points_nx = node_points(self.distributed, self.dofmap)[nodes[self.dofmap.owned_node_n[nodes] >= 0]]
        return resultant(self.comm, u, residual, self.owned_nodes(where), points_nx, about)

    def internal_forces(self, u: Vec, chosen_c: Bool) -> Float:
        """(n_owned_nodes, 2) forces with which some cells of all ranks resist at this rank's nodes."""
        u_nodes = self._local_values(u)
        total = self._together(lambda: resisting_forces(self.blocks, u_nodes, chosen_c))
        vector = self.create_vector()
        self._add(total.ravel(), vector)
        return DISPLACEMENT.nodal(vector.getArray(readonly=True)).copy()

    def point_states(self, u: Vec) -> Iterator[PointStates]:
        """This rank's cells at their quadrature points, some at a time."""
        return point_states(self.blocks, self.distributed.mesh, self._local_values(u).copy())

    def owned_nodes(self, where: str) -> Int:
        """Nodes at a named point or edge set that this rank owns, as positions in its part of a vector."""
        nodes = self.dofmap.owned_node_n[self._named_nodes(where)]
        return nodes[nodes >= 0]

    def sides(self, where: str) -> Sides:
        """Sides of this rank's cells along named edges."""
        return sides_along(self.distributed, self.dofmap, where)

    def area_weights(self, regions: Sequence[str]) -> Float:
        """(n_owned_nodes,) integrals of the basis functions over regions: of moments, those of the projections."""
        require_regions(regions, self.regions)
        vector = self.create_vector()
        self._add(body_load(self.distributed, self.dofmap, self.blocks, regions, np.ones_like).ravel(), vector)
        return DISPLACEMENT.nodal(vector.getArray(readonly=True))[:, 0].copy()

    # -- beyond the solver ------------------------------------------------------------------------------------

    def set_body_force(self, force: Callable[[Float], Float]) -> None:
        """Dead load per reference area: ``force`` maps points (n, 2) to vectors (n, 2).

        Its work is ``int f . Pi0_k u``, which keeps the displacement's order k + 1.
        """
        self._load_nodes = body_load(self.distributed, self.dofmap, self.blocks, self.regions, force)

    @property
    def order(self) -> int:
        """Order k of the elements."""
        return self.settings.order

    @property
    def n_cells_global(self) -> int:
        """Cells of the whole mesh."""
        return self.distributed.n_cells_global

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom of the whole system, constrained ones included."""
        return self.dofmap.n_dofs_global

    def nodal_values(self, u: Vec) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, ghosts included."""
        return self._local_values(u).copy()

    @property
    def virtual_elements(self) -> VemSystem:
        """This, also from what is around it: forces, or nodes with axes of their own."""
        return self

    def nodal_vector(self, values_ni: Float) -> Vec:
        """A new vector with values (n_nodes, 2) of this rank's nodes."""
        vector, owned = self.create_vector(), self.dofmap.owned_node_n
        DISPLACEMENT.nodal(vector.getArray())[owned[owned >= 0]] = values_ni[owned >= 0]
        return vector

    def locate(self, points_nx: Float) -> Located:
        """Points (n, 2) of the reference configuration in this rank's cells."""
        return locate(self.distributed, self.dofmap, self.blocks, points_nx, TOLERANCE * self.size)

    def node_labels(self) -> Float:
        """Labels (n_owned_nodes, 3) of this rank's part of a vector that do not depend on the distribution."""
        return node_labels(self.distributed, self.dofmap)

    def output_polygons(self) -> Polygons:
        """This rank's cells as polygons through vertices and points on the sides."""
        return polygons_through_nodes(self.distributed, self.settings.order)

    def output_displacements(self, u: Vec) -> Float:
        """Displacements (n_points, 2) of the points of :meth:`output_polygons`."""
        nodes = np.concatenate([self.dofmap.vertex_nodes, self.dofmap.edge_nodes.ravel()])
        displacement: Float = self._local_values(u)[nodes]
        return displacement

    def cell_numbers(self) -> Int:
        """Number (n_cells,) of each local cell in the whole mesh."""
        return self.distributed.cell_ids

    def cell_areas(self) -> Float:
        """Reference area (n_cells,) of each local cell."""
        return cell_values.areas(self.blocks, self.distributed.mesh.n_cells)

    def cell_energies(self, u: Vec, without: str = "") -> Float:
        """Energy (n_cells,) of each local cell; the parameter ``without``, where an energy has it, is set to 0."""
        return cell_values.energies(self.blocks, self.distributed.mesh.n_cells, self._local_values(u), without)

    def cell_jacobians(self, u: Vec) -> tuple[Float, Float]:
        """Mean and smallest J (n_cells,) of each local cell."""
        return cell_values.jacobians(self.blocks, self.distributed.mesh.n_cells, self._local_values(u))

    def dense_jacobians(self, u: Vec) -> Float:
        """Smallest J (n_cells,) of each local cell on a grid much finer than the quadrature's."""
        return cell_values.dense_jacobians(self.blocks, self.distributed.mesh, self._local_values(u))

    def work(self) -> dict[str, float]:
        """This rank's share of the work: cells, the cost that the partitioner balanced, seconds spent in kernels."""
        cells, cost = float(self.distributed.mesh.n_cells), float(self.distributed.cost_c.sum())
        return {"cells": cells, "expected_cost": cost, "kernel_seconds": self._kernel_seconds}

    def projection_degrees(self) -> dict[str, int]:
        """How many cells of the whole mesh use which l, or which space of another name."""
        counts: dict[str, int] = {}
        for part in self.comm.allgather([(b.projection, len(b.cells)) for b in self.blocks]):
            for projection, n_cells in part:
                counts[projection] = counts.get(projection, 0) + n_cells
        return dict(sorted(counts.items()))

    # -- internals -----------------------------------------------------------------------------------------------

    def _owned_constrained(self) -> Int:
        """Local numbers of the constrained degrees of freedom that this rank owns."""
        dofs = self._constrained_local.dofs
        owned: Int = dofs[self.dofmap.owned_node_n[DISPLACEMENT.node(dofs)] >= 0]
        return owned

    def _insertion_into(self, matrix: Mat) -> MatrixInsertion:
        """Where the tangents go: the same for all matrices of :meth:`create_matrix`, looked up in the first one."""
        if self._insertion is None:
            numbers = self.dofmap.global_node_n if self.penalty is None else self.penalty.node_numbers
            kernel = self.blocks[0].kernel if self.blocks else None
            self._insertion = MatrixInsertion(
                list(self._terms()), kernel, matrix, numbers, self._constrained_everywhere()
            )
            give_back()
        return self._insertion

    def _terms(self) -> Iterator[Terms]:
        """Everything that has a tangent: cells, and sides."""
        yield from (CellTerms(block, block.batch) for block in self.blocks)
        yield from self._sides()

    def _sides(self) -> Sequence[SideTerms]:
        """Those of the interior penalty, if there is one."""
        return [] if self.penalty is None else self.penalty.terms

    def _is_constrained(self) -> NDArray[np.bool_]:
        """(n_nodes, 2) whether a component of a node is prescribed."""
        flags = np.zeros(DISPLACEMENT.size(self.dofmap.n_nodes), dtype=bool)
        flags[self._constrained_local.dofs] = True
        return DISPLACEMENT.nodal(flags)

    def _constrained_everywhere(self) -> NDArray[np.bool_]:
        """The same, flat, with the nodes of the halo; all ranks call this."""
        flags = self._is_constrained()
        if not self._halo:
            return flags.ravel()
        vector = self.create_vector()
        self._add(flags.astype(float).ravel(), vector)
        everywhere = self._extended(vector).ravel() > 0.0
        vector.destroy()
        return everywhere

    @property
    def _halo(self) -> Halo | None:
        """Nodes of other ranks, if sides of any rank need some."""
        return self.penalty.halo if self.penalty is not None and self.penalty.halo.is_used else None

    def _extended(self, u: Vec) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, and after them those of the halo, if there is one."""
        nodes = self._local_values(u)
        return self._halo.extended(u, nodes) if self._halo else nodes

    def _add_extended(self, total: Float, out: Vec) -> None:
        """Sum such values into a global vector."""
        self._add(total[: self.dofmap.n_nodes].ravel(), out)
        if self._halo:
            self._halo.add(total, out)

    def _nodes_of(self, where: str) -> Int:
        """Local nodes of a named point or edge set (empty if it lies on other ranks).

        Raises:
            InputError: no rank has anything of that name.
        """
        here = marked_here(self.distributed, self.dofmap, where)
        # a rank may share an end vertex of an edge that lies on another rank only: let all ranks know
        total = self.dofmap.dm.createGlobalVec()
        self._add(np.repeat(here, 2), total)
        marked = self._local_values(total)[:, 0] > 0.0
        total.destroy()
        nodes: Int = np.flatnonzero(marked)
        return nodes

    def _local_values(self, u: Vec) -> Float:
        self.dofmap.dm.globalToLocal(u, self._local)
        return DISPLACEMENT.nodal(self._local.getArray())

    def _add(self, total: Float, out: Vec) -> None:
        """Sum the ranks' contributions to shared nodes into a global vector."""
        self._work.getArray()[:] = total
        self._add_work(out)

    def _add_work(self, out: Vec) -> None:
        """The same for what is in the work vector."""
        out.set(0.0)
        self.dofmap.dm.localToGlobal(self._work, out, addv=PETSc.InsertMode.ADD_VALUES)

    def _together(self, compute: Callable[[], T]) -> T:
        """Result of kernels on this rank.

        Raises:
            EvaluationError: a kernel failed on this or on another rank; all ranks raise, so that none waits for ever.
        """

        def timed() -> T:
            started, result = time.perf_counter(), compute()
            self._kernel_seconds += time.perf_counter() - started
            return result

        try:
            return on_every_rank(self.comm, timed)
        except MemoryError as error:
            raise EvaluationError(str(error)) from None

    def _evaluate(self, u_nodes: Float, residual: Float | None = None) -> Evaluated:
        """Energies of all blocks and sides; their residuals are added to ``residual`` (n_nodes, 2)."""
        of_cells = [block.kernel.cells(block.batch, u_nodes, block.parameters, residual) for block in self.blocks]
        return of_cells, [(terms, terms.energies(u_nodes, residual)) for terms in self._sides()]

    def _evaluation(self, values: Evaluated, u_nodes: Float) -> Evaluation:
        shares = Shares(self.regions)
        of_cells, of_sides = values
        for terms, (energy_s, min_j_s) in of_sides:
            shares.add_cells(terms.region, energy_s, min_j_s, self.distributed.cell_ids[terms.cells[:, 0]])
        for block, value in zip(self.blocks, of_cells, strict=True):
            shares.add_cells(block.region, value.energy_c, value.min_j_c, self.distributed.cell_ids[block.cells])
        work = 0.0 if self._load_nodes is None else float((self._load_nodes * u_nodes[: self.dofmap.n_nodes]).sum())
        return shares.together(self.comm, work)


if TYPE_CHECKING:

    def _discretisation(system: VemSystem) -> Discretisation:
        """Seen by mypy only: that the class fulfils the protocol."""
        return system
