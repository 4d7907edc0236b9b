"""Stiffness of an energy at rest: the norm in which errors of gradients are measured, whatever the energy.

At F = I and G = 0 an energy is quadratic in the strain, and its second derivative by F is what a linear material would
have. Only that is positive wherever a state is: tangents of a squeezed medium, or of a solid that buckles, are not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from codegen.stress_rates import StressRates, stress_rates_of
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Parameters = Mapping[str, float | Float]  # of an energy by name: numbers, or (n_cells, 1) of those that vary

# From dF_I to its symmetric part, I = 2 i + j: the other part is a rotation.
_SYMMETRIC = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.5, 0.0], [0.0, 0.5, 0.5, 0.0], [0.0, 0.0, 0.0, 1.0]])


def small_strain_stiffness(region: RegionEnergy, parameters: Parameters | None = None) -> Float:
    """``D_IJ = d2psi/dF_I dF_J`` at F = I and G = 0, I = 2 i + j, as far as it is positive and of strains.

    Energies that are not free of stress at F = I, or are soft there in some direction, have a second derivative that is
    negative for some strains, or not 0 for rotations: eigenvalues below 0 count as 0, and rotations have none.

    Args:
        region: whose energy.
        parameters: its values; those of the region by default.

    Returns:
        (4, 4), energy per reference area; (n_cells, 4, 4) if any parameter varies from cell to cell.

    Raises:
        InputError: the energy has no second derivative there.
        CodegenError: it cannot be traced.
    """
    return stiffness_at_rest(stress_rates_of(region.integrand), region.values if parameters is None else parameters)


def stiffness_at_rest(rates: StressRates, parameters: Parameters) -> Float:
    """The same from the derivatives of the energy's stress, for who has many cells of a region.

    Raises:
        InputError: as above.
    """
    cells = max((np.shape(value)[:1] for value in parameters.values()), default=())
    n_cells = cells[0] if cells else 1
    F = np.broadcast_to(np.eye(2), (n_cells, 4, 2, 2))
    along = np.broadcast_to(np.eye(4).reshape(4, 2, 2), F.shape)
    G = np.zeros((n_cells, 4, 2, 2, 2)) if rates.uses_second_gradient else None
    D = rates.at(F, G, parameters, along).by_F.reshape(n_cells, 4, 4)
    if not np.isfinite(D).all():
        raise InputError(
            f"energy '{rates.name}' has no second derivative at F = I and G = 0, with which errors of cells are "
            "measured: write it so that it is smooth there"
        )
    found = _positive_part(_SYMMETRIC @ D @ _SYMMETRIC)
    return found if cells else found[0]


def strain_products(D: Float, A_cqij: Float, B_cqij: Float, w_cq: Float) -> Float:
    """(n_cells,) ``sum_q w A : D : B``.

    Args:
        D: (4, 4), or (n_cells, 4, 4).
        A_cqij, B_cqij: (n_cells, n_points, 2, 2).
        w_cq: (n_cells, n_points) weights.
    """
    A_cqI, B_cqI = (tensor.reshape(*w_cq.shape, 4) for tensor in (A_cqij, B_cqij))
    products: Float = (((A_cqI @ D) * B_cqI).sum(axis=2) * w_cq).sum(axis=1)
    return products


def _positive_part(D: Float) -> Float:
    """Symmetric matrices (..., n, n) with their negative eigenvalues at 0."""
    values, vectors = np.linalg.eigh(0.5 * (D + np.swapaxes(D, -1, -2)))
    found: Float = (vectors * np.maximum(values, 0.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return found
