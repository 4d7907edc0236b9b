"""Width of a contact from its pressure.

The pressure of the medium fades out where contact ends, and how far depends on gamma, so that no threshold of it tells
where that is. What is far from the ends says it: the pressure of a round contact is that of Hertz, whose square is a
parabola, p^2 = p0^2 (1 - (x - c)^2 / a^2). It is fitted to the stations with more than half of the largest pressure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]

FEWEST = 4  # stations for a fit of three numbers
# A fit is one of a round contact if what it is made of reaches as far as this part of its half width to both sides
# (that with more than half of the largest pressure of Hertz reaches as far as 0.87).
REACH = 0.5


@dataclass(frozen=True)
class Bump:
    """Pressure of Hertz.

    Attributes:
        centre: where it is largest (length along the contact).
        half_width: a (length).
        pressure: p0, at the centre.
    """

    centre: float
    half_width: float
    pressure: float

    @staticmethod
    def fit(x_n: Float, pressure_n: Float, weight_n: Float, low: float, high: float) -> Bump | None:
        """Least squares of the squared pressure.

        Args:
            x_n: (n,) positions along the contact.
            pressure_n: (n,) pressures there.
            weight_n: (n,) lengths that they stand for.
            low, high: where contact has ended for certain; a pressure of Hertz vanishes before.

        Returns:
            The bump, or None where the pressure is none: level between two corners, for example.
        """
        parabola = _parabola(x_n, pressure_n**2, weight_n)
        if parabola is None:
            return None
        middle, (c, b, a) = parabola
        if not a < 0.0:
            return None
        shift, top = -0.5 * b / a, c - 0.25 * b**2 / a
        if not top > 0.0:
            return None
        found = Bump(middle + shift, math.sqrt(-top / a), math.sqrt(top))
        reach = min(found.centre - float(x_n.min()), float(x_n.max()) - found.centre)
        inside = low <= found.centre - found.half_width and found.centre + found.half_width <= high
        return found if inside and reach >= REACH * found.half_width else None


def _parabola(x_n: Float, y_n: Float, weight_n: Float) -> tuple[float, list[float]] | None:
    """Mean of the positions, and coefficients of 1, d and d^2 with d counted from it; None for too few positions."""
    if len(x_n) < FEWEST:
        return None
    middle, size = float(x_n.mean()), float(np.ptp(x_n))
    if not size > 0.0:
        return None
    d = (x_n - middle) / size
    root = np.sqrt(weight_n)
    coefficients, _, rank, _ = np.linalg.lstsq(root[:, None] * d[:, None] ** np.arange(3), root * y_n, rcond=None)
    return (middle, (coefficients / size ** np.arange(3)).tolist()) if rank == len(coefficients) else None


def vanishes(x_n: Float, pressure_n: Float, weight_n: Float, limit: float) -> float:
    """Where the extrapolated pressure vanishes beyond the last of some positions.

    Args:
        x_n, pressure_n, weight_n: on one flank of a contact, x increasing outwards.
        limit: beyond which there is none.
    """
    last = float(x_n.max())
    parabola = _parabola(x_n, pressure_n**2, weight_n)
    roots: list[float] = []
    if parabola is not None:
        middle, (c, b, a) = parabola
        found = np.roots([a, b, c])
        roots = (middle + found[np.isreal(found)].real).tolist()
    return min([limit, *(root for root in roots if root >= last)])
