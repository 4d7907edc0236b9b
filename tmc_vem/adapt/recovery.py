"""What a state says about its own error: gradients that neighbours agree on, less those that cells have.

Recovered gradients F* (:mod:`tmc_vem.adapt.patches`) are nearer to the true ones than the cells' own gradients F where
the solution is smooth, so that F* - F estimates the error there (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng. 33
(1992) 1331). Nothing is solved and no finer mesh is made; everything is on one rank, which has all cells.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from codegen.stress_rates import StressRates, stress_rates_of
from tmc_vem.adapt.patches import Patches, PointValues
from tmc_vem.adapt.small_strain import stiffness_at_rest, strain_products
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.point_states import PointStates

Float = NDArray[np.float64]


def gradient_errors(system: Discretisation, mesh: PolygonMesh, u: Vec) -> list[tuple[PointStates, Float]]:
    """Estimated errors of the deformation gradient at the quadrature points of all cells.

    Args:
        system: the discretisation, with all cells on this rank.
        mesh: its mesh.
        u: displacements.

    Returns:
        States and recovered less own gradients (n_cells, n_points, 2, 2) at their points.

    Raises:
        ValueError: this rank does not have all cells of the mesh.
    """
    return [(of_u, dF) for (of_u,), (dF,) in _errors(system, mesh, (u,))]


def energy_indicators(problem: Problem, system: Discretisation, mesh: PolygonMesh, u: Vec) -> Float:
    """(n_cells,) estimated errors of the cells in the energy of small strains, ``sqrt(1/2 int dF : D : dF)``.

    D is that of the region's energy at rest (:mod:`tmc_vem.adapt.small_strain`) with the parameters that the system
    has now; second gradients are left out.

    Args:
        problem: whose energies.
        system: its discretisation, with all cells on this rank.
        mesh: its mesh.
        u: displacements.

    Raises:
        InputError: an energy has no second derivative at F = I.
        ValueError: this rank does not have all cells of the mesh.
    """
    rates_of = _rates(problem)
    found = np.zeros(mesh.n_cells)
    for states, dF in gradient_errors(system, mesh, u):
        D = stiffness_at_rest(rates_of(states.region), states.parameters)
        found[system.cell_numbers()[states.cells]] = np.sqrt(0.5 * strain_products(D, dF, dF, states.w_cq))
    return found


def dual_indicators(problem: Problem, system: Discretisation, mesh: PolygonMesh, u: Vec, z: Vec) -> tuple[float, Float]:
    """Estimated error of a result, and what the cells have to do with it.

    With dF and dZ, the estimated errors of the gradients of the state and of the adjoint field, the error is
    ``int dF : A : dZ`` with the tangent ``A = d2psi/dF dF`` at the state, second gradients held. With the field of
    :meth:`tmc_vem.sensitivity.equilibrium.Equilibrium.adjoint`, the true result less the one that was found is MINUS
    that, to first order. Its terms have both signs and are no measure of cells; indicators are
    ``sqrt(int dF : D : dF  int dZ : D : dZ)`` with D at rest.

    Args:
        problem: whose energies.
        system: its discretisation, with all cells on this rank.
        mesh: its mesh.
        u: displacements.
        z: an adjoint field, a vector of the system.

    Returns:
        The integral, and indicators (n_cells,), whose unit is that of the result.

    Raises:
        InputError: an energy has no second derivative at F = I.
        ValueError: this rank does not have all cells of the mesh.
    """
    rates_of = _rates(problem)
    total, found = 0.0, np.zeros(mesh.n_cells)
    for (states, _), (dF, dZ) in _errors(system, mesh, (u, z)):
        rates = rates_of(states.region)
        D = stiffness_at_rest(rates, states.parameters)
        of_u, of_z = (strain_products(D, error, error, states.w_cq) for error in (dF, dZ))
        found[system.cell_numbers()[states.cells]] = np.sqrt(of_u * of_z)
        dP = rates.at(states.F_cqij, states.G_cqijk, states.parameters, dZ).by_F
        total += float(np.einsum("cq,cqij,cqij->", states.w_cq, dF, dP))
    return total, found


def _rates(problem: Problem) -> Callable[[str], StressRates]:
    """Derivatives of stresses by region name, recorded when they are first asked for."""
    regions = problem.regions()
    return functools.cache(lambda region: stress_rates_of(regions[region].integrand))


def _errors(
    system: Discretisation, mesh: PolygonMesh, vectors: Sequence[Vec]
) -> list[tuple[tuple[PointStates, ...], tuple[Float, ...]]]:
    """States of several vectors at the same points, and the estimated errors of their gradients."""
    numbers = system.cell_numbers()
    if len(numbers) != mesh.n_cells:
        raise ValueError(f"this rank has {len(numbers)} of {mesh.n_cells} cells: gradients are recovered on one rank")
    states = list(zip(*(system.point_states(vector) for vector in vectors), strict=True))
    values = [
        PointValues(
            numbers[some[0].cells],
            some[0].w_cq,
            some[0].X_cqx,
            np.concatenate([each.F_cqij.reshape(*each.w_cq.shape, 4) for each in some], axis=2),
        )
        for some in states
    ]
    found = []
    for some, own, fitted in zip(states, values, Patches(mesh, system.order).fitted(values), strict=True):
        errors = (fitted - own.value_cqt).reshape(*own.w_cq.shape, len(vectors), 2, 2)
        found.append((some, tuple(errors[:, :, n] for n in range(len(vectors)))))
    return found
