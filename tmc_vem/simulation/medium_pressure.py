"""The pressure that the medium's own stress shows, without its regulariser: a second measure of contact, cell by cell.

The normal of contact is the eigenvector of b = F F^T to its smallest eigenvalue, along which the medium is squeezed
most; slip does not turn it away from the normal by more than half of the smallest stretch. The pressure is
-n . sigma n.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.stress import Stress, stress_of
from tmc_vem.support.distributed import Vec
from tmc_vem.system.discretisation import Discretisation

Float = NDArray[np.float64]


class MediumPressure:
    """Pressure in the cells of the media.

    Args:
        system: the discretisation.
        media: energies of the regions that are third medium, by their names.
    """

    def __init__(self, system: Discretisation, media: Mapping[str, Integrand]) -> None:
        self._system = system
        self._stress: dict[str, Stress] = {name: stress_of(integrand) for name, integrand in media.items()}

    def of_cells(self, u: Vec) -> Float:
        """(n_cells,) means over the deformed area of this rank's cells; not a number in solids."""
        found = np.full(len(self._system.cell_numbers()), np.nan)
        for states in self._system.point_states(u):
            if states.region not in self._stress:
                continue
            # a regulariser is one of the second gradient, and without that there is none
            G = None if states.G_cqijk is None else np.zeros_like(states.G_cqijk)
            P, _ = self._stress[states.region].at(states.F_cqij, G, states.parameters)
            pressure = normal_pressure(states.F_cqij, P)
            weight = states.w_cq * np.linalg.det(states.F_cqij)
            found[states.cells] = (weight * pressure).sum(axis=1) / weight.sum(axis=1)
        return found


def normal_pressure(F_cqij: Float, P_cqij: Float) -> Float:
    """(n_cells, n_points) pressures -n . sigma n of a first Piola-Kirchhoff stress."""
    b = F_cqij @ np.swapaxes(F_cqij, -1, -2)
    n = np.linalg.eigh(b)[1][..., 0]  # eigenvalues increase
    J = np.linalg.det(F_cqij)
    sigma = P_cqij @ np.swapaxes(F_cqij, -1, -2) / J[..., None, None]
    pressure: Float = -np.einsum("cqi,cqij,cqj->cq", n, sigma, n)
    return pressure
