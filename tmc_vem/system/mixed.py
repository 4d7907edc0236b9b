"""Derivatives of regions' energies at quadrature points in numpy: sums over cells, and tangents times a direction."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from codegen.integrand import Integrand
from codegen.mixed import MixedDerivatives, mixed_of
from tmc_vem.system.point_states import PointStates
from tmc_vem.system.sensitivity import CellDerivatives

Float = NDArray[np.float64]
Gradients = tuple[Float, Float | None]  # (n_cells, n_points, 2, 2), and (n_cells, n_points, 2, 2, 2) where needed


class MixedPoints:
    """Mixed derivatives of energies, recorded when they are first asked for.

    Args:
        integrands: energy by region name.
    """

    def __init__(self, integrands: Mapping[str, Integrand]) -> None:
        self._of = functools.cache(lambda region: mixed_of(integrands[region]))

    def cell_derivatives(self, states: PointStates, adjoint: Gradients | None = None) -> CellDerivatives:
        """Derivatives of cells by the parameters of their energy.

        ``sum_q w dpsi/dp`` and ``sum_q w d/dp (P : grad L + T :. grad grad L)``, at the values that the parameters have
        in the cells.

        Args:
            states: the cells.
            adjoint: gradients of the adjoint field L at the same points.
        """
        mixed: MixedDerivatives = self._of(states.region)
        F, G = states.F_cqij, states.G_cqijk
        # near F = I energies are differences of numbers that are almost equal: extended precision, where there is some
        energy_cqk = mixed.energy_by_parameters((F.astype(np.longdouble), G), states.parameters)
        energy_ck = np.einsum("cq,cqk->ck", states.w_cq, energy_cqk).astype(np.float64)
        residual_ck = np.zeros_like(energy_ck)
        if adjoint is not None:
            rate_cqk = mixed.rate_by_parameters((F, G), adjoint, states.parameters)
            residual_ck = np.einsum("cq,cqk->ck", states.w_cq, rate_cqk)
        return CellDerivatives(states.region, states.cells, mixed.parameters, energy_ck, residual_ck)

    def stress_rates(self, states: PointStates, along: Gradients) -> tuple[Float, Float | None]:
        """Rates of ``P_cqij`` and ``T_cqijk`` (None where the energy has no second gradient) along a displacement.

        Args:
            states: cells.
            along: gradients of the displacement at their points.
        """
        mixed: MixedDerivatives = self._of(states.region)
        return mixed.rate_of_stress((states.F_cqij, states.G_cqijk), along, states.parameters)
