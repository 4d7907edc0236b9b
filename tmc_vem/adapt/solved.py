"""A problem in equilibrium on a mesh, on one rank: by loading it, or from a state of another mesh."""

from __future__ import annotations

import gc
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, media_of
from tmc_vem.sensitivity.equilibrium import Equilibrium
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.sensitivity.functionals_record import FunctionalState
from tmc_vem.simulation.adaptable import DISPLACEMENT, ENERGY, REACTION
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import times_of
from tmc_vem.simulation.simulation import Simulation, prepare, stepping_of
from tmc_vem.solve.path import ControlPath
from tmc_vem.solve.stepping import LoadStepper
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import TmcError
from tmc_vem.support.petsc import PETSc
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import FromNodes
from tmc_vem.vem.system import VemSystem

Float = NDArray[np.float64]


class NotReached(TmcError):
    """A load could not be applied in full."""


@dataclass(frozen=True)
class Solved:
    """A problem in equilibrium on a mesh.

    Attributes:
        problem: with this mesh.
        mesh: its cells.
        simulation: prepared for it, on one rank.
        u: displacements.
        position: where on the path.
        found: how equilibrium was found.
        iterations: of Newton's method for that.
    """

    problem: Problem
    mesh: PolygonMesh
    simulation: Simulation
    u: Vec
    position: Control
    found: str
    iterations: int

    @property
    def vem(self) -> VemSystem:
        """The virtual elements, without what is around them."""
        return virtual_elements(self.simulation)

    @property
    def nodal_values(self) -> Float:
        """Displacements (n_nodes, 2) along x and y."""
        return self.simulation.system.nodal_values(self.u)

    def equilibrium(self) -> Equilibrium:
        """The equations linearised there.

        Raises:
            SingularTangent: the tangent has no inverse.
        """
        behind = partial(self.simulation.recorder.watch.behind, self.u)
        return Equilibrium(self.simulation.solver, self.simulation.system, self.u, self.position, behind)

    def values(self) -> dict[str, float]:
        """Results by name: probes, reaction, displacement and energy."""
        system, recorder = self.simulation.system, self.simulation.recorder
        residual = system.create_vector()
        system.set_position(self.position)
        system.residual(self.u, residual)
        contact = recorder.contact.read(self.u, residual, along_path=False)
        state = FunctionalState(self.u, residual, self.position)
        found = {ENERGY: functional_of(ENERGY, self.problem, system).derivative(state).value}
        reading = recorder.loads.read(self.u, residual, self.position, None)
        if reading.reaction is not None:
            found[REACTION] = reading.reaction
        found[DISPLACEMENT] = reading.displacement
        probes = recorder.gauge.read(self.u, residual, partial(recorder.watch.behind, self.u), contact)
        return {**found, **probes}


def virtual_elements(simulation: Simulation) -> VemSystem:
    """The virtual elements of a discretisation, whatever is around them."""
    return cast("VemSystem", simulation.system).virtual_elements


def vector_of(simulation: Simulation, values_ni: Float, position: Control) -> Vec:
    """A vector with displacements (n_nodes, 2) of the nodes, and with what is prescribed at a position."""
    u = nodal_vector(simulation, values_ni)
    simulation.solver.set_prescribed(u, position)
    return u


def nodal_vector(simulation: Simulation, values_ni: Float) -> Vec:
    """A vector with values (n_nodes, 2) of the nodes along x and y."""
    return cast("FromNodes", simulation.system).nodal_vector(values_ni)


def held(simulation: Simulation) -> NDArray[np.bool_]:
    """(n_nodes, 2) whether nodes are held; both components of those that are in any direction."""
    vem = virtual_elements(simulation)
    owned = np.zeros(len(vem.create_vector().getArray(readonly=True)) // 2, dtype=bool)
    owned[simulation.system.constrained() // 2] = True
    return np.repeat(owned[vem.dofmap.owned_node_n][:, None], 2, axis=1)


def prepared(problem: Problem, options: RunOptions, monitor: Monitor | None = None) -> Simulation:
    """A simulation on this rank alone."""
    return prepare(problem, None, options, comm=cast("Any", MPI.COMM_SELF), monitor=monitor)


def loaded(simulation: Simulation, mesh: PolygonMesh) -> Solved:
    """Equilibrium at the end of the path, gone through from its beginning.

    Args:
        simulation: prepared, on this rank alone; it has not gone yet.
        mesh: that it is on.

    Raises:
        NotReached: the load could not be applied in full.
    """
    problem, result = simulation.problem, simulation.go()
    if not result.complete or result.end is None:
        raise NotReached(f"the load stopped at {result.load:.4g}: {result.reason}")
    if result.errors:
        raise NotReached(f"the state at load {result.load:.4g} is not to be trusted: {result.errors[0]}")
    u = result.end.give(simulation.system)
    how = "loaded from the beginning"
    return Solved(problem, mesh, simulation, u, result.end.position, how, result.newton_iterations)


def loaded_further(start: Solved, load: float) -> Solved:
    """Equilibrium on the same mesh at a larger load factor.

    Raises:
        NotReached: the load could not be applied in full.
    """
    simulation, u = start.simulation, start.u.copy()
    before = simulation.solver.iterations_done
    end = Control(load, start.position.parameters)
    path = ControlPath([start.position, end], (), times_of(start.problem))
    outcome = LoadStepper(simulation.solver, stepping_of(simulation.options), path=path).run(u)
    if not outcome.complete:
        raise NotReached(f"the load stopped at {outcome.load:.4g}: {outcome.reason}")
    how, iterations = f"loaded from {start.position.load:.4g}", simulation.solver.iterations_done - before
    return replace(start, u=u, position=end, found=how, iterations=iterations)


def let_go() -> None:
    """Free what PETSc has of meshes before, which petsc4py only puts aside: 20 MB a round with 1600 cells, else. It is
    that of this rank alone, so that no other one has to take part."""
    gc.collect()  # simulations refer to themselves
    PETSc.garbage_cleanup(MPI.COMM_SELF)


def weights_of(problem: Problem, heavy: float = 1000.0) -> Mapping[str, float]:
    """How much cells of each region resist when others are untangled."""
    media = set(media_of(problem))
    return {name: 1.0 if name in media else heavy for name in problem.regions()}
