"""A state taken to another mesh, and equilibrium there at the same load.

What is carried over is no equilibrium, and J may be negative at new points. Such cells are untangled first; then
Newton's method looks for the equilibrium, and where it does not find it, over a stiffer medium and back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from tmc_vem.adapt.solved import NotReached, Solved, held, prepared, vector_of, virtual_elements, weights_of
from tmc_vem.mesh.make.change import MeshChange
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.simulation.simulation import Simulation, gamma_of, stepping_of
from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.solve.path import ControlPath
from tmc_vem.solve.stepping import LoadStepper
from tmc_vem.support.distributed import Vec
from tmc_vem.system.control import Control
from tmc_vem.vem.transfer import transferred
from tmc_vem.vem.untangle import untangled

MOST_ITERATIONS = 40  # of Newton's method from a state that was carried over
# Cells whose J is below this part of the smallest one of the state before are untangled: Newton's method would creep.
LEAST = 0.1
STIFFER = (10.0, 100.0)  # gamma, where there is no way to equilibrium with its own


@dataclass(frozen=True)
class Start:
    """Where the equilibrium on another mesh is looked for from.

    Attributes:
        simulation: prepared on that mesh.
        u: displacements with J > 0, and with what is prescribed.
        untangled: how many cells had to be untangled.
    """

    simulation: Simulation
    u: Vec
    untangled: int

    def words(self, how: str) -> str:
        """How equilibrium was found from here."""
        cells = f"{self.untangled} cell{'s' if self.untangled > 1 else ''}"
        return f"{how}, {cells} untangled" if self.untangled else how


def brought(before: Solved, change: MeshChange, simulation: Simulation, *, nested: bool = True) -> Vec:
    """Displacements of a state on a changed mesh, whatever J they have there.

    Args:
        before, change, nested: as for :func:`carried`.
        simulation: prepared on the new mesh.
    """
    vem, parent_c = virtual_elements(simulation), change.parent_c if nested else None
    values_ni = transferred(before.vem, before.nodal_values, vem, change.before_vx, parent_c)
    return vector_of(simulation, values_ni, before.position)


def start_on(before: Solved, change: MeshChange, problem: OnMesh, *, nested: bool = True) -> Start:
    """The state of another mesh on a changed one, without cells that are inside out.

    Args:
        before, change, problem, nested: as for :func:`carried`.

    Raises:
        NotReached: some cannot be untangled.
    """
    simulation = prepared(problem, before.simulation.options)
    vem, u = virtual_elements(simulation), brought(before, change, simulation, nested=nested)
    smallest = min(float(before.simulation.system.cell_jacobians(before.u)[1].min()), 1.0)
    values_ni, stays, weights = simulation.system.nodal_values(u), held(simulation), weights_of(problem)
    found = untangled(vem, values_ni, stays, weights, LEAST * smallest)
    if found is None:
        found = untangled(vem, values_ni, stays, weights, 0.0)
    if found is None:
        raise NotReached("cells of the new mesh are inside out at the state of the old one, and stay so")
    if found.n_cells:
        u = vector_of(simulation, found.u_ni, before.position)
    return Start(simulation, u, found.n_cells)


def carried(before: Solved, change: MeshChange, problem: OnMesh, *, nested: bool = True) -> Solved:
    """Equilibrium on a changed mesh at the load of a state of the mesh before.

    Args:
        before: the state.
        change: to the new mesh.
        problem: on it.
        nested: whether new cells lie in old ones, or are made of them.

    Raises:
        NotReached: none was found.
    """
    start = start_on(before, change, problem, nested=nested)
    simulation, position = start.simulation, before.position
    done = simulation.solver.iterations_done
    u = start.u.copy()
    how = "carried over"
    if not converges(simulation.solver, u, MOST_ITERATIONS):
        u, how = _over_stiffer_medium(start, position)
    iterations = simulation.solver.iterations_done - done
    return Solved(problem, change.mesh, simulation, u, position, start.words(how), iterations)


def converges(solver: NewtonSolver, u: Vec, most_iterations: int) -> bool:
    """Whether Newton's method gets from ``u``, which is changed, to an equilibrium; the solver's options stay, as those
    of a run that goes on from its directory are."""
    options = solver.options
    solver.options = replace(options, max_iterations=most_iterations)
    try:
        return solver.solve(u).converged
    finally:
        solver.options = options


def _over_stiffer_medium(start: Start, position: Control) -> tuple[Vec, str]:
    """Equilibrium with more gamma, and from there with its own.

    Raises:
        NotReached: there is no way.
    """
    simulation = start.simulation
    gamma = {} if position.parameters else gamma_of(simulation.problem)
    for factor in STIFFER if gamma else ():
        stiff = {name: factor * value for name, value in gamma.items()}
        u = start.u.copy()
        simulation.system.set_parameters(stiff)
        simulation.solver.last_shift = 0.0
        if not converges(simulation.solver, u, MOST_ITERATIONS):
            continue
        path = ControlPath([Control(position.load, stiff), Control(position.load, gamma)])
        outcome = LoadStepper(simulation.solver, stepping_of(simulation.options), path=path, jumps=False).run(u)
        if outcome.complete:
            simulation.system.set_parameters(gamma)
            return u, f"carried over, with gamma {factor:g} times larger in between"
    simulation.system.set_parameters(gamma)
    raise NotReached("no equilibrium was found from the state that was carried over")
