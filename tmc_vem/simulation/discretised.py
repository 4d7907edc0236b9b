"""The discretised system of a problem, and whether a run can begin on it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, RegionEnergy, forces_of, media_of, stages_of
from tmc_vem.problems.directions import on_mesh as resolved
from tmc_vem.problems.graded import check_cells
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import loads_of
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError
from tmc_vem.support.memory import reuse_freed
from tmc_vem.support.parallel import from_root, on_every_rank
from tmc_vem.system.constraints import Condition
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.vem.spaces.element_settings import ElementSettings

if TYPE_CHECKING:
    from tmc_vem.vem.blocks import RegionKernel

# Work of a medium's cell relative to a solid's: second derivatives make its tangent 3 times as dear.
MEDIUM_COST = 2.5


def discretise(
    problem: Problem, options: RunOptions, comm: Comm, on_mesh: Callable[[PolygonMesh], object] | None = None
) -> Discretisation:
    """The discretised system of a problem; kernels or forms are compiled if they are not in the cache.

    Args:
        problem: what to discretise.
        options: how.
        comm: MPI communicator.
        on_mesh: called on rank 0 with the whole mesh before it is distributed; what it raises is raised on all ranks.

    Raises:
        InputError: mesh and problem do not fit, or the method is 'fem' and dolfinx is missing.
        CodegenError: an energy's kernel cannot be made.
    """

    from tmc_vem.system.inclined import with_axes
    from tmc_vem.system.loaded import with_forces
    from tmc_vem.system.stages import with_stages

    system = with_axes(_along_x_and_y(problem, options, comm, on_mesh))
    system = with_forces(system, forces_of(problem), media_of(problem))
    stages = stages_of(problem)
    return with_stages(system, problem.prescribed(), stages, loads_of(problem, options)[-1]) if stages else system


@dataclass
class _Whole:
    """The whole mesh on rank 0, until it is taken, and what is prescribed on it, which all ranks know.

    Args:
        problem: whose mesh.
        comm: the ranks.
        on_mesh: called with the mesh before anything else.
    """

    problem: Problem
    comm: Comm
    on_mesh: Callable[[PolygonMesh], object] | None

    def __post_init__(self) -> None:
        self._meshes: list[PolygonMesh] = []
        self.prescribed = from_root(self.comm, self._make)

    def take(self) -> PolygonMesh:
        """The mesh, once, so that nothing holds it afterwards."""
        return self._meshes.pop()

    def _make(self) -> tuple[Condition, ...]:
        mesh = self.problem.make_mesh()
        check_cells(mesh, {name: region.graded for name, region in self.problem.regions().items()})
        if self.on_mesh is not None:
            self.on_mesh(mesh)
        self._meshes.append(mesh)
        always = [condition for condition in self.problem.prescribed() if not condition.stages]
        return resolved(always, mesh, media_of(self.problem))


def _along_x_and_y(
    problem: Problem, options: RunOptions, comm: Comm, on_mesh: Callable[[PolygonMesh], object] | None
) -> Discretisation:
    """The system of a problem without its forces, whose vectors are along x and y."""
    if options.method == "fem":
        from tmc_vem.fem.system import FemSystem

        whole = _Whole(problem, comm, on_mesh)
        return FemSystem(comm, whole.take, problem.regions(), whole.prescribed, options.fem)

    from tmc_vem.mesh.spread.distribute import distribute
    from tmc_vem.vem.system import VemSystem

    kernels = on_every_rank(
        comm, lambda: {name: _kernels(name, region, options.element) for name, region in problem.regions().items()}
    )
    costs = {name: MEDIUM_COST for name, region in problem.regions().items() if region.is_medium}
    whole = _Whole(problem, comm, on_mesh)
    mesh = distribute(comm, whole.take, costs)
    reuse_freed()
    return VemSystem(mesh, kernels, whole.prescribed, options.element)


def require_finite_start(system: Discretisation, problem: Problem) -> None:
    """Check that energies and stresses can be computed before anything is deformed.

    Raises:
        InputError: they cannot; load stepping would only say that it found no way to begin.
    """
    u, residual = system.create_vector(), system.create_vector()
    evaluation = system.residual(u, residual)
    bad = [f"the energy of region '{name}'" for name, of in evaluation.regions.items() if not math.isfinite(of.energy)]
    if not bad and not math.isfinite(residual.norm()):
        bad = ["the stress, that is the derivative of the energy,"]
    if bad:
        checked = "'tmc-vem codegen FILE.py:FUNCTION --check' checks an energy of your own"
        fault = fault_at_start(problem)
        why = f"{fault}; " if fault else ""
        raise InputError(f"{bad[0]} is no finite number in the undeformed state: {why}{checked}")


def fault_at_start(problem: Problem) -> str:
    """What is wrong with a region's energy at F = I, in words; empty if that does not show."""
    from codegen.reference import fault_at_reference
    from codegen.trace import trace

    for name, region in problem.regions().items():
        fault = fault_at_reference(trace(region.integrand), region.values)
        if fault:
            return f"region '{name}': {fault}"
    return ""


def _kernels(name: str, region: RegionEnergy, element: ElementSettings) -> RegionKernel:
    """Compiled energies of a region's cells and, in media with an interior penalty, of their sides."""
    from codegen.stress import stress_of
    from tmc_vem.system.friction import FrictionLaw
    from tmc_vem.vem.blocks import RegionKernel
    from tmc_vem.vem.facets.compiled import compile_sides

    kernel, parameters = compile_region(region)
    friction = None if region.friction is None else FrictionLaw(region.friction, stress_of(region.integrand))
    if not region.is_medium or element.interior_penalty == "none":
        return RegionKernel(kernel, parameters, graded=region.graded, friction=friction)
    sides = compile_sides(name, region.integrand, region.values, element.interior_penalty, element.penalty_factor)
    return RegionKernel(kernel, parameters, sides, region.graded, friction)


def compile_region(region: RegionEnergy) -> tuple[Any, Any]:
    """Kernel of a region's energy and its parameter array."""
    from tmc_vem.vem.kernel.cells import compile_cells

    kernel = compile_cells(region.integrand)
    return kernel, kernel.parameter_array(region.values)
