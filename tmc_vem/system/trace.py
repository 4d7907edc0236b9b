"""Integrals along a side of a cell, where displacements are polynomials of order k through its k + 1 nodes.

Virtual and finite elements have the same trace: what acts on sides is one and the same for both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """Integrals over s from 0 to 1 of the Lagrange polynomials N_a of nodes.

    Attributes:
        mean_a: (k + 1,) integrals of N_a.
        mass_ab: (k + 1, k + 1) integrals of N_a N_b.
        turn_ab: (k + 1, k + 1) integrals of N_a N_b' - N_a' N_b, antisymmetric: twice the area that the ray from the
            origin to x(s) sweeps is sum x_a y_b turn_ab, exactly.
    """

    mean_a: Float
    mass_ab: Float
    turn_ab: Float

    @staticmethod
    def of(nodes_a: Float) -> Trace:
        """For nodes (k + 1,) with coordinates from 0 to 1."""
        powers = np.arange(len(nodes_a))
        # N_a = sum_p coefficients_ap s^p
        coefficients_ap = np.linalg.inv(nodes_a[:, None] ** powers).T
        p, q = powers[:, None], powers[None, :]
        mass_pq = 1.0 / (p + q + 1.0)
        slope_pq = q / np.maximum(p + q, 1.0)  # of s^p and (s^q)'
        slope_ab = coefficients_ap @ slope_pq @ coefficients_ap.T
        return Trace(
            coefficients_ap @ (1.0 / (powers + 1.0)),
            coefficients_ap @ mass_pq @ coefficients_ap.T,
            slope_ab - slope_ab.T,
        )
