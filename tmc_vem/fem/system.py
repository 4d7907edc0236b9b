"""The finite element discretisation of a potential in dolfinx: residual, tangent and step limits in PETSc objects."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from codegen.layout import Take
from codegen.stress import stress_of
from tmc_vem.fem import compat
from tmc_vem.fem.forms import CompiledForms, RegionDensity, make_forms
from tmc_vem.fem.friction import PointFriction
from tmc_vem.fem.maths import density_at_points
from tmc_vem.fem.mesh import distribute
from tmc_vem.fem.nodes import Nodes
from tmc_vem.fem.point_evaluation import locate
from tmc_vem.fem.points import QuadraturePoints, jacobian, largest_step
from tmc_vem.mesh.locate import TOLERANCE
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.distributed import Comm, Mat, Vec
from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Condition, Pair
from tmc_vem.system.control import Control, parameter_of
from tmc_vem.system.discretisation import Discretisation, Evaluation
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.fields import Polygons
from tmc_vem.system.friction import FrictionLaw, FrictionStates, shear_of
from tmc_vem.system.layout import DISPLACEMENT
from tmc_vem.system.mixed import Gradients, MixedPoints
from tmc_vem.system.places import Located
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.reduction import Shares, at_named_points, in_order, reaction, resultant, step_limit
from tmc_vem.system.sensitivity import CellDerivatives, PointForces
from tmc_vem.system.sides import Sides
from tmc_vem.system.unloaded import Unloaded, require_regions

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

CELLS_AT_ONCE = 4096  # whose dense arrays are held at a time


class FemSystem(Unloaded):
    """Lagrange elements of order 2 or 3 for a potential of F and G; implements ``Discretisation``.

    Residual and tangent come from compiled forms; energies, J and the step limit from numpy at the same quadrature
    points.

    Args:
        comm: communicator.
        make_mesh: makes the problem's mesh; called on rank 0 only.
        regions: energy by region name.
        prescribed: displacement boundary conditions.
        settings: element, quadrature and interior penalty.

    Raises:
        InputError: dolfinx is missing or of an unsupported version, the mesh has other cells than triangles or
            quadrilaterals, a region has no energy, or a condition refers to a name that the mesh does not have.
    """

    def __init__(
        self,
        comm: Comm,
        make_mesh: Callable[[], PolygonMesh],
        regions: Mapping[str, RegionDensity],
        prescribed: Sequence[Condition] = (),
        settings: FemSettings | None = None,
    ) -> None:
        self.comm = comm
        self.settings = settings or FemSettings()
        self.mesh = distribute(comm, make_mesh, triangles=self.settings.triangles)
        self.region_names = self.mesh.names.regions
        for name in self.region_names:
            if name not in regions:
                raise InputError(f"region '{name}' has no energy (given: {', '.join(regions)})")
        self.densities = dict(regions)
        self.size = self.mesh.extent
        self.space = compat.vector_space(self.mesh.mesh, self.settings.order)
        self.nodes = Nodes(self.mesh, self.space, self.settings.order)
        self.points = QuadraturePoints.create(
            self.mesh.cell, self.settings.order, self.settings.quadrature, self.mesh.points_cvx[: self.mesh.n_owned]
        )
        owned = self.mesh.region_c[: self.mesh.n_owned]
        self._cells_of = [np.flatnonzero(owned == number) for number in range(len(self.region_names))]
        self._state, self._gradient = self.nodes.function(), self.nodes.function()
        laws = {
            name: FrictionLaw(friction, stress_of(regions[name].integrand))
            for name in self.region_names
            if (friction := regions[name].friction) is not None
        }
        self._friction = PointFriction(self.mesh, self.settings.quadrature, laws)
        self.forms = make_forms(self.mesh, self._state, regions, self.settings, self._friction)
        self._compiled = CompiledForms(comm, self.forms)
        self._values = {name: dict(region.values) for name, region in regions.items()}
        self._factors = {name: self._factors_of(number) for number, name in enumerate(self.region_names)}
        self._mixed = MixedPoints({name: regions[name].integrand for name in self.region_names})
        self._tangent: Mat | None = None
        self._load_nodes: Float | None = None
        held = Constrained.of(prescribed, self.nodes.named, self.nodes.points_nx)
        self._constrained = held.along_x_and_y()

    # -- Discretisation ------------------------------------------------------------------------------------------

    def create_vector(self) -> Vec:
        """A new global displacement vector, zero."""
        vector: Vec = PETSc.Vec().createMPI((DISPLACEMENT.size(self.nodes.n_owned), PETSc.DECIDE), comm=self.comm)
        vector.set(0.0)
        return vector

    def create_matrix(self) -> Mat:
        """A new symmetric matrix with the pattern of the tangent."""
        self.compile()
        matrix: Mat = compat.create_matrix(self._compiled.tangent)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
        matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
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
        self.forms.set_parameters(values)
        for region, own in self._values.items():
            names = {known: name for name in own for known in (name, parameter_of(region, name))}
            own.update({names[known]: value for known, value in values.items() if known in names})

    def set_factors(self, region: str, factor_ck: Float) -> None:
        """Change what multiplies the parameters of a region that vary, (n_cells, n_varying), in its cells.

        Raises:
            InputError: the mesh has no such region.
            ValueError: there are other numbers of cells or of parameters that vary.
        """
        require_regions((region,), self.region_names)
        factors, cells = self._factors[region], self._cells_of[self.region_names.index(region)]
        expected = (self.mesh.n_owned, len(factors))
        if factor_ck.shape != expected:
            raise ValueError(f"factors of region '{region}': shape {factor_ck.shape}, expected {expected}")
        for n, name in enumerate(factors):
            factors[name] = factor_ck[cells, n : n + 1]
        self.forms.set_factors(region, factor_ck[cells])

    def energy(self, u: Vec) -> Evaluation:
        """Potential at ``u``."""
        return self._evaluation(self._local_values(u))

    def residual(self, u: Vec, out: Vec) -> Evaluation:
        """Full gradient of the potential into ``out``; its constrained entries are the reactions."""
        u_nodes = self._local_values(u)
        compat.assemble_vector(self._gradient, self._compiled.residual)
        gradient = self._gradient.x.array[: DISPLACEMENT.size(self.nodes.n_owned)]
        out.getArray()[:] = gradient if self._load_nodes is None else gradient - self._load_nodes.ravel()
        return self._evaluation(u_nodes)

    def jacobian(self, u: Vec, out: Mat) -> None:
        """Tangent at ``u`` with rows and columns of the identity at constrained degrees of freedom."""
        self._local_values(u)
        compat.assemble_matrix(out, self._compiled.tangent)
        if self._tangent is None:
            self._tangent = out.duplicate(copy=True)
        else:
            out.copy(self._tangent, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        first, _ = out.getOwnershipRange()
        out.zeroRowsColumns((self._constrained.dofs + first).astype(PETSc.IntType), diag=1.0)

    def tangent_action(self, du: Vec, out: Vec) -> None:
        """Product of the last tangent, without boundary conditions, and ``du``."""
        if self._tangent is None:
            raise ValueError("there is no tangent yet: call jacobian() first")
        self._tangent.mult(du, out)

    def max_step(self, u: Vec, du: Vec) -> float:
        """Largest s with J > 0 at every quadrature point along u + t du, t < s."""
        gradient = self._first_gradient(self._local_values(u))
        return step_limit(self.comm, [largest_step(gradient, self._first_gradient(self._local_values(du)))])

    def point_displacements(self, u: Vec, names: Sequence[str]) -> Float:
        """Displacements (n, 2) of named points, equal on all ranks."""
        owned = DISPLACEMENT.nodal(u.getArray(readonly=True))
        mine = {name: owned[node].copy() for name in names for node in self.nodes.named(name).tolist()}
        return at_named_points(self.comm, names, mine)

    def reaction(self, residual: Vec, where: str, component: int) -> float:
        """Force that holds a named point or edge set, summed over its nodes."""
        return reaction(self.comm, residual, self.owned_nodes(where), component)

    def held_forces(self, residual: Vec) -> Float:
        """(n, 2) forces that hold this rank's nodes at which something is prescribed."""
        return self._constrained.forces(DISPLACEMENT.nodal(residual.getArray(readonly=True)))

    def resultant(self, u: Vec, residual: Vec, where: str, about: Pair) -> Float:
        """Force and moment (3,) that hold a named point or edge set."""
        nodes = self.owned_nodes(where)
        return resultant(self.comm, u, residual, nodes, self.nodes.points_nx[nodes], about)

    def internal_forces(self, u: Vec, chosen_c: Bool) -> Float:
        """(n_owned_nodes, 2) forces with which some cells of all ranks resist at this rank's nodes."""
        self._local_values(u)
        compat.assemble_vector(self._gradient, self._compiled.residual_of(chosen_c))
        return DISPLACEMENT.nodal(self._gradient.x.array)[: self.nodes.n_owned].copy()

    def cell_tangent_action(self, u: Vec, du: Vec, chosen_c: Bool, out: Vec) -> None:
        """Add the product of ``du`` and the tangent at ``u`` of some cells of all ranks: of :meth:`internal_forces`."""
        u_nodes, du_nodes = self._local_values(u), self._local_values(du)

        def rates(states: PointStates) -> tuple[Float, Float | None]:
            along = self._gradients_beside(states, du_nodes)
            dP, dT = self._mixed.stress_rates(states, along)
            return dP + self._friction.stress_rates(states, along[0]), dT

        self._add_forces(self._point_states(u_nodes, self.region_names, chosen_c=chosen_c), rates, out)

    def add_point_forces(self, u: Vec, forces: PointForces, out: Vec) -> None:
        """Add ``sum_q w (P : grad v + T :. grad grad v)`` of all basis functions v, P and T from a function."""
        self._add_forces(self.point_states(u), forces, out)

    def parameter_derivatives(self, u: Vec, adjoint: Vec | None = None) -> Iterator[CellDerivatives]:
        """Derivatives of this rank's cells by the parameters of their energies, some cells at a time; friction of the
        step, which is frozen, has none.

        Raises:
            InputError: there is an interior penalty, whose sides depend on the parameters of two cells.
        """
        if self.forms.facets:
            raise InputError(
                f"interior penalty '{self.settings.interior_penalty}': its sides have parameters of two cells, and no "
                "derivatives with respect to them; use 'none'"
            )
        u_nodes = self._local_values(u)
        adjoint_nodes = None if adjoint is None else self._local_values(adjoint)

        def of(states: PointStates) -> CellDerivatives:
            along = None if adjoint_nodes is None else self._gradients_beside(states, adjoint_nodes)
            return self._mixed.cell_derivatives(states, along)

        return map(of, self._point_states(u_nodes, self.region_names))

    def point_states(self, u: Vec) -> Iterator[PointStates]:
        """This rank's cells at their quadrature points, some at a time."""
        return self._point_states(self._local_values(u), self.region_names)

    def friction_states(self, u: Vec) -> Iterator[FrictionStates]:
        """This rank's cells with friction at their quadrature points, some at a time."""
        return self._friction.states(self._points_with_friction(self._local_values(u)))

    def advance(self, u: Vec) -> None:
        """Friction of the step that begins at ``u``."""
        self._friction.begin_step(self._points_with_friction(self._local_values(u)))

    def damp_slip(self, fraction: float) -> bool:
        """Tangents have this fraction of the stiffness of sticking points where points slip."""
        return self._friction.damp_slip(fraction)

    def shear(self, u: Vec) -> tuple[Float, Float]:
        """Points (n, 2) with friction of this rank, and the shear (n,) there."""
        return shear_of(self.friction_states(u))

    def remember_shear(self, u: Vec, shear_at: Callable[[Float], Float]) -> None:
        """Begin a step at ``u`` with the shear that a function gives at points."""
        self._friction.begin_step(self._points_with_friction(self._local_values(u)), shear_at)

    def owned_nodes(self, where: str) -> Int:
        """Nodes at a named point or edge set that this rank owns, as positions in its part of a vector."""
        return self.nodes.named(where)

    def sides(self, where: str) -> Sides:
        """Sides of this rank's cells along named edges."""
        return self.nodes.sides_along(where)

    def area_weights(self, regions: Sequence[str]) -> Float:
        """(n_owned_nodes,) integrals of the basis functions over regions."""
        require_regions(regions, self.region_names)
        inside_c = np.isin(np.array(self.region_names)[self.mesh.region_c[: self.mesh.n_owned]], regions)
        loads = self.points.nodal_loads(inside_c[:, None, None] * np.ones_like(self.points.X_cqx))
        return self.nodes.sum_over_cells(loads)[:, 0]

    # -- beyond the solver ---------------------------------------------------------------------------------------

    @property
    def n_dofs(self) -> int:
        """Degrees of freedom of the whole system, constrained ones included."""
        return DISPLACEMENT.size(self.nodes.n_global)

    @property
    def order(self) -> int:
        """Order k of the elements."""
        return self.settings.order

    @property
    def n_cells_global(self) -> int:
        """Cells of the whole mesh."""
        return self.mesh.n_cells_global

    def work(self) -> dict[str, float]:
        """This rank's share of the work."""
        return {"cells": float(self.mesh.n_owned)}

    def projection_degrees(self) -> dict[str, int]:
        """Nothing is projected here."""
        return {}

    def point_coordinates(self, names: Sequence[str]) -> Float:
        """Reference coordinates (n, 2) of named points."""
        return in_order(names, self.mesh.names.coordinates)

    def nodal_values(self, u: Vec) -> Float:
        """Values (n_nodes, 2) of this rank's nodes, ghosts included."""
        return self._local_values(u)

    def locate(self, points_nx: Float) -> Located:
        """Points (n, 2) of the reference configuration in this rank's cells."""
        return locate(self.mesh, self.nodes, self.settings.order, points_nx, TOLERANCE * self.size)

    def compile(self) -> None:
        """Compile the forms, or find them in dolfinx' cache; otherwise this happens when they are first needed."""
        _ = self._compiled.residual, self._compiled.tangent, self._compiled.facets

    def interpolate(self, displacement: Callable[[Float], Float]) -> Vec:
        """Vector of the nodal values of a function that maps points (n, 2) to displacements (n, 2)."""
        vector = self.create_vector()
        vector.getArray()[:] = displacement(self.nodes.points_nx[: self.nodes.n_owned]).ravel()
        return vector

    def set_body_force(self, force: Callable[[Float], Float]) -> None:
        """Dead load per reference area: ``force`` maps points (n, 2) to vectors (n, 2)."""
        points = self.points.X_cqx
        loads = self.points.nodal_loads(force(points.reshape(-1, 2)).reshape(points.shape))
        self._load_nodes = self.nodes.sum_over_cells(loads)

    def node_labels(self) -> Float:
        """Labels (n_owned_nodes, 3) of this rank's part of a vector: coordinates and 0."""
        return np.column_stack([self.nodes.points_nx[: self.nodes.n_owned], np.zeros(self.nodes.n_owned)])

    def output_polygons(self) -> Polygons:
        """This rank's cells as polygons through all nodes of their boundary."""
        return self.nodes.polygons()

    def output_displacements(self, u: Vec) -> Float:
        """(n_points, 2) displacements of the polygons' points."""
        return self._local_values(u)[self.nodes.polygon_nodes()]

    def cell_numbers(self) -> Int:
        """(n_cells,) numbers of this rank's cells in the whole mesh."""
        return self.mesh.cell_ids[: self.mesh.n_owned]

    def cell_areas(self) -> Float:
        """(n_cells,) reference areas of this rank's cells."""
        return self.mesh.areas_c[: self.mesh.n_owned]

    def cell_energies(self, u: Vec, without: str = "") -> Float:
        """(n_cells,) energies of this rank's cells, without the interior penalty; parameter ``without`` is set to 0."""
        return self._cell_values(self._local_values(u), without)[0]

    def cell_jacobians(self, u: Vec) -> tuple[Float, Float]:
        """Mean and smallest J (n_cells,) of this rank's cells."""
        J = jacobian(self._first_gradient(self._local_values(u)))
        w = self.points.w_cq
        return (w * J).sum(axis=1) / w.sum(axis=1), J.min(axis=1)

    def dense_jacobians(self, u: Vec) -> Float:
        """Smallest J (n_cells,) of this rank's cells on a grid much finer than the quadrature's."""
        u_nodes, smallest = self._local_values(u), np.empty(self.mesh.n_owned)
        for first in range(0, self.mesh.n_owned, CELLS_AT_ONCE):
            cells = slice(first, min(first + CELLS_AT_ONCE, self.mesh.n_owned))
            points = QuadraturePoints.dense(self.mesh.cell, self.settings.order, self.mesh.points_cvx[cells])
            gradient = points.first_gradient(u_nodes[self.nodes.cell_nodes_ca[cells]])
            smallest[cells] = jacobian(gradient).min(axis=1)
        return smallest

    # -- internals -----------------------------------------------------------------------------------------------

    def _local_values(self, u: Vec) -> Float:
        """Write ``u`` into the forms' function; values (n_nodes, 2) of this rank's nodes, ghosts included."""
        array = self._state.x.array
        array[: DISPLACEMENT.size(self.nodes.n_owned)] = u.getArray(readonly=True)
        self._state.x.scatter_forward()
        return DISPLACEMENT.nodal(np.array(array))

    def _factors_of(self, number: int) -> dict[str, Float]:
        """What multiplies parameters of a region that vary, (n_cells, 1) in its cells that this rank owns."""
        graded = self.densities[self.region_names[number]].graded
        if graded is None:
            return {}
        factor_cp = self.mesh.factors(graded, self._cells_of[number])
        return {name: factor_cp[:, n : n + 1] for n, name in enumerate(graded.names)}

    def _point_states(
        self, u_nodes: Float, regions: Collection[str], second: bool = True, chosen_c: Bool | None = None
    ) -> Iterator[PointStates]:
        """Owned cells of some regions, all or those that are chosen, some at a time; second gradients of energies that
        have them if asked for."""
        for name, of_region in zip(self.region_names, self._cells_of, strict=True):
            integrand = self.densities[name].integrand
            needs_second = second and any(entry.take is Take.SECOND_GRADIENT for entry in integrand.inputs)
            wanted = np.arange(len(of_region)) if chosen_c is None else np.flatnonzero(chosen_c[of_region])
            for first in range(0, len(wanted) if name in regions else 0, CELLS_AT_ONCE):
                some = wanted[first : first + CELLS_AT_ONCE]
                cells = of_region[some]
                gradient, G = self._gradients(u_nodes, cells, needs_second)
                at, F = self.points, np.eye(2) + gradient
                yield PointStates(name, cells, at.w_cq[cells], at.X_cqx[cells], F, G, self._parameters_in(name, some))

    def _gradients(self, u_nodes: Float, cells: Int, second: bool) -> Gradients:
        """First gradients at the points of some cells, and second ones if asked for."""
        u_cai = u_nodes[self.nodes.cell_nodes_ca[cells]]
        return self.points.gradients(u_cai, cells) if second else (self.points.first_gradient(u_cai, cells), None)

    def _gradients_beside(self, states: PointStates, u_nodes: Float) -> Gradients:
        """Those of another displacement at the points of some states."""
        return self._gradients(u_nodes, states.cells, second=states.G_cqijk is not None)

    def _add_forces(self, points: Iterable[PointStates], forces: PointForces, out: Vec) -> None:
        """Add the nodal forces of what a function gives at points of some cells; all ranks together."""
        forces_cai = np.zeros((self.mesh.n_owned, self.nodes.cell_nodes_ca.shape[1], DISPLACEMENT.components))
        for states in points:
            found = forces(states)
            if found is not None:
                forces_cai[states.cells] = self.points.nodal_forces(*found, states.cells)
        out.getArray()[:] += self.nodes.sum_over_cells(forces_cai).ravel()

    def _points_with_friction(self, u_nodes: Float, second: bool = True) -> Iterator[PointStates]:
        return self._point_states(u_nodes, self._friction.laws, second)

    def _first_gradient(self, u_nodes: Float) -> Float:
        return self.points.first_gradient(u_nodes[self.nodes.cell_nodes_ca[: self.mesh.n_owned]])

    def _cell_values(self, u_nodes: Float, without: str = "") -> tuple[Float, Float]:
        """Energy and smallest J of this rank's cells."""
        energy_c, min_j_c = np.zeros((2, self.mesh.n_owned))
        for name, cells in zip(self.region_names, self._cells_of, strict=True):
            values = self._parameters_in(name)
            if without in values:
                values[without] = 0.0
            gradient, second = self.points.gradients(u_nodes[self.nodes.cell_nodes_ca[cells]], cells)
            min_j_c[cells] = jacobian(gradient).min(axis=1)
            psi_cq = density_at_points(self.densities[name].integrand, gradient, second, values)
            energy_c[cells] = (self.points.w_cq[cells] * psi_cq).sum(axis=1)
        return energy_c, min_j_c

    def _parameters_in(self, region: str, some: Int | slice = slice(None)) -> dict[str, float | Float]:
        """Values of the parameters of a region, (n, 1) of those that vary in some of its cells that this rank owns."""
        values, factors = self._values[region], self._factors[region]
        return {
            name: values[name] * factors[name][some] if name in factors else float(values[name])
            for name in self.densities[region].integrand.parameter_names
        }

    def _evaluation(self, u_nodes: Float) -> Evaluation:
        """Energies and extremes; the forms' function holds the same state."""
        energy_c, min_j_c = self._cell_values(u_nodes)
        shares = Shares(self.region_names)
        for name, cells in zip(self.region_names, self._cells_of, strict=True):
            shares.add_cells(name, energy_c[cells], min_j_c[cells], self.mesh.cell_ids[cells])
        for states in self._friction.states(self._points_with_friction(u_nodes, second=False)):
            shares.add(states.points.region, float((states.points.w_cq * states.response.energy).sum()))
        for name, form in self._compiled.facets.items():
            shares.add(name, compat.assemble_scalar(form))
        work = 0.0
        if self._load_nodes is not None:
            work = float((self._load_nodes * u_nodes[: self.nodes.n_owned]).sum())
        return shares.together(self.comm, work)


if TYPE_CHECKING:

    def _discretisation(system: FemSystem) -> Discretisation:
        """Seen by mypy only: that the class fulfils the protocol."""
        return system
