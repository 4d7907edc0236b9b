"""Errors by comparison with the mesh refined once more.

All cells are cut, the state is carried over and the equilibrium is found there, which takes a few iterations as it is
near. With u_f that of the refined mesh and e = I u - u_f, a result v has

    v(u_f) - v(u) = -z . K e + second order,

z being the adjoint field there. z may be replaced by z - I z_h, with z_h that of the coarse mesh, as residuals vanish
against coarse functions. So a cell contributes at most ``(int e : D : e)^1/2 (int z : D : z)^1/2``, where D is taken at
F = I, at which it is positive, with the modulus of each region: the tangent of squeezed cells is neither small nor
positive, and contributions of neighbours would cancel by orders of magnitude.

The differences are those of all results, whether they have derivatives or not. Between h and h/2 they are 1 - 2^-p of
the error, which is taken to be of order p = 2. Where the refined equilibrium is not found from the carried state, it is
found from the beginning of the path; on large meshes, or where that fails too, one Newton step from the carried state
gives the differences of those results that have derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.adapt.carried import brought, converges, start_on
from tmc_vem.adapt.estimate import Estimate
from tmc_vem.adapt.small_strain import small_strain_stiffness, strain_products
from tmc_vem.adapt.solved import NotReached, Solved, nodal_vector
from tmc_vem.mesh.make.change import MeshChange
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results.adaptivity import LINEARISED, SOLVED
from tmc_vem.sensitivity.equilibrium import Equilibrium, SingularTangent
from tmc_vem.sensitivity.functionals import functional_of
from tmc_vem.simulation.adaptable import ENERGY
from tmc_vem.support.distributed import Vec
from tmc_vem.support.errors import EvaluationError, InputError
from tmc_vem.vem.transfer import transferred

Float = NDArray[np.float64]

MOST_ITERATIONS = 40  # for the refined equilibrium from the carried state
MOST_DOFS = 60_000  # of a refined problem that is gone through from the beginning where that fails
ORDER = 2.0  # of the errors, as assumed
WHOLE = 1.0 / (1.0 - 2.0**-ORDER)  # error of the mesh, by the difference to the refined one
CRUDE = "the refined problem was only linearised: where contact is about to change, this is crude"


def refined_estimate(
    solved: Solved, names: tuple[str, ...], change: MeshChange, problem: OnMesh,
    from_start: Callable[[OnMesh], Solved] | None = None,
) -> Estimate:  # fmt: skip
    """Errors of the results of a state.

    Args:
        solved: the state.
        names: results that the mesh is adapted to.
        change: to the mesh with all cells cut.
        problem: on that mesh.
        from_start: solves it from the beginning of the path; it may raise NotReached. None for never.

    Raises:
        NotReached: there is no state on the refined mesh to begin with.
    """
    fine, start, iterations = _refined(solved, change, problem, from_start)
    values, comparison = solved.values(), _Comparison(solved, fine or start, change)
    if fine is not None:
        error = brought(solved, change, fine.simulation)
        error.axpy(-1.0, fine.u)
        refined = fine.values()
        errors = {name: WHOLE * (refined[name] - value) for name, value in values.items() if name in refined}
    else:
        error, errors = comparison.linearised(values)
    return Estimate(
        values=values,
        errors={name: value for name, value in errors.items() if np.isfinite(value)},
        indicators={name: comparison.indicators(name, error) for name in names},
        kind=LINEARISED if fine is None else SOLVED,
        doubt=CRUDE if fine is None else "",
        n_dofs=start.simulation.n_dofs,
        iterations=iterations,
    )


def _refined(
    solved: Solved, change: MeshChange, problem: OnMesh, from_start: Callable[[OnMesh], Solved] | None
) -> tuple[Solved | None, Solved, int]:
    """The state on the refined mesh, None if it was not found; where it was looked for from, which is as good as any
    if it was found; and the iterations.

    Raises:
        NotReached: it was not found, and not even a state to linearise at that is like the one on the mesh before.
    """
    at_start, reason, iterations = None, "", 0
    try:
        start = start_on(solved, change, problem)
    except NotReached as error:
        reason = str(error)
    else:
        u, solver = start.u.copy(), start.simulation.solver
        before = solver.iterations_done
        is_solved = converges(solver, u, MOST_ITERATIONS)
        iterations = solver.iterations_done - before
        at_start = Solved(problem, change.mesh, start.simulation, start.u, solved.position, "", iterations)
        if is_solved:
            return replace(at_start, u=u), at_start, iterations
        if start.untangled:
            reason = f"the refined problem was not solved from a state with {start.untangled} cells untangled"
    if from_start is not None and 4 * solved.simulation.n_dofs <= MOST_DOFS:
        with suppress(NotReached):
            fine = from_start(problem)
            return fine, fine, iterations + fine.iterations
    if at_start is None or reason:
        raise NotReached(reason)
    return None, at_start, iterations


class _Comparison:
    """A state on a mesh, and one on the mesh with all cells cut.

    Args:
        coarse, fine: the states, the second one not in equilibrium perhaps.
        change: from one mesh to the other.

    Raises:
        NotReached: the tangent of the second one has no inverse.
    """

    def __init__(self, coarse: Solved, fine: Solved, change: MeshChange) -> None:
        self._coarse, self._fine, self._change = coarse, fine, change
        self._at_coarse: Equilibrium | None = None
        try:
            self._at_fine = fine.equilibrium()
        except SingularTangent as error:
            raise NotReached(f"refined mesh: {error}") from None
        regions = fine.problem.regions()
        self._stiffness = {name: small_strain_stiffness(region) for name, region in regions.items()}

    def linearised(self, values: Mapping[str, float]) -> tuple[Vec, dict[str, float]]:
        """Error of the displacements, and of those of results by name that have derivatives, after one Newton step."""
        system, residual = self._fine.simulation.system, self._at_fine.state.residual.copy()
        residual.getArray()[system.constrained()] = 0.0
        error, errors = system.create_vector(), {}
        if not self._fine.simulation.solver.correction(residual, error):
            raise NotReached("refined mesh: the linear solver failed")
        error.scale(-1.0)
        for name, value in values.items():
            try:
                derivative = functional_of(name, self._fine.problem, system).derivative(self._at_fine.state)
                field = self._at_fine.adjoint(derivative).field
            except (InputError, SingularTangent):
                continue
            refined = derivative.value + field.dot(residual)
            if name == ENERGY:  # the first order is of the size of the second: a state is a minimum of the potential
                refined += 0.5 * residual.dot(error)
            errors[name] = WHOLE * (refined - value)
        return error, errors

    def indicators(self, name: str, error: Vec) -> Float:
        """(n_cells of the coarse mesh,) contributions of its cells to the error of a result."""
        weight = self._weight(name)
        if weight is None:  # the energy of the error, that of results without derivatives too
            weight = error.copy()
            weight.scale(0.5)
        found_c = np.zeros(self._coarse.mesh.n_cells)
        system = self._fine.simulation.system
        numbers = system.cell_numbers()
        pairs = zip(system.point_states(error), system.point_states(weight), strict=True)
        for of_error, of_weight in pairs:
            D, w_cq = self._stiffness[of_error.region], of_error.w_cq
            A, B = (of.F_cqij - np.eye(2) for of in (of_error, of_weight))
            product = np.sqrt(strain_products(D, A, A, w_cq) * strain_products(D, B, B, w_cq))
            np.add.at(found_c, self._change.parent_c[numbers[of_error.cells]], product)
        return found_c

    def _weight(self, name: str) -> Vec | None:
        """What the adjoint field of a result has that the coarse mesh has not; None for the energy, or without one."""
        if name == ENERGY:
            return None
        try:
            self._at_coarse = self._at_coarse or self._coarse.equilibrium()
            adjoints = []
            for equilibrium, of in ((self._at_coarse, self._coarse), (self._at_fine, self._fine)):
                functional = functional_of(name, of.problem, of.simulation.system)
                adjoints.append(equilibrium.adjoint(functional.derivative(equilibrium.state)).field)
        except (InputError, SingularTangent, EvaluationError):
            return None
        coarse, weight = adjoints
        nodal = self._coarse.simulation.system.nodal_values(coarse)
        on_fine = transferred(self._coarse.vem, nodal, self._fine.vem, self._change.before_vx, self._change.parent_c)
        weight.axpy(-1.0, nodal_vector(self._fine.simulation, on_fine))
        return weight
