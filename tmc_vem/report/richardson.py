"""Mesh-converged values and their uncertainty from runs on three meshes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tmc_vem.support.errors import InputError

SAFETY = 1.25  # Roache's factor for three meshes with an observed order
CAUTION = 3.0  # his factor where the order cannot be trusted


@dataclass(frozen=True)
class Extrapolation:
    """Limit of a value for vanishing mesh size.

    Attributes:
        value: estimate of the limit.
        order: observed order of convergence, or None if the three values do not show one.
        uncertainty: the limit is expected within ``value +- uncertainty``.
    """

    value: float
    order: float | None
    uncertainty: float

    def __str__(self) -> str:
        order = "no clear order" if self.order is None else f"order {self.order:.1f}"
        return f"{self.value:.4e} ± {self.uncertainty:.0e} ({self.relative:.1%}, {order})"

    @property
    def relative(self) -> float:
        """Uncertainty relative to the value."""
        return abs(self.uncertainty / self.value) if self.value else math.inf


def extrapolate(sizes: Sequence[float], values: Sequence[float], highest_order: float = 4.5) -> Extrapolation:
    """Richardson extrapolation with the observed order from three meshes.

    With ``f(h) = f0 + C h^p`` on three meshes, p solves ``(f1 - f2) / (f2 - f3) = (h1^p - h2^p) / (h2^p - h3^p)``, and
    f0 follows. The uncertainty is Roache's grid convergence index: 1.25 times the distance of the finest value from f0.
    Where no model fits, the finest value is returned. If the values oscillate with shrinking changes, the limit is
    expected within the larger change; if they diverge or converge slower than with order 1/2, within three times that.
    An order that is too high to be believed is chance: the limit is expected within three times the last change.

    Args:
        sizes: decreasing mesh sizes.
        values: result on each mesh.
        highest_order: the best order to believe in. Functionals of quadratic elements converge with order 4 at most;
            the default leaves room for scatter.

    Raises:
        InputError: there are not three of each, or the sizes do not decrease.
    """
    if len(sizes) != 3 or len(values) != 3:
        raise InputError(f"{len(sizes)} sizes and {len(values)} values: the extrapolation needs three of each")
    h1, h2, h3 = sizes
    if not h1 > h2 > h3 > 0.0:
        raise InputError(f"mesh sizes {h1:g}, {h2:g}, {h3:g} must decrease and be positive")
    f1, f2, f3 = values
    if f2 == f3:
        return Extrapolation(f3, None, CAUTION * abs(f1 - f2))
    ratio = (f1 - f2) / (f2 - f3)
    order = _order(h1, h2, h3, ratio)
    if order is None:
        factor = 1.0 if ratio < -1.0 else CAUTION
        return Extrapolation(f3, None, factor * max(abs(f1 - f2), abs(f2 - f3)))
    if order > highest_order:
        return Extrapolation(f3, None, CAUTION * abs(f2 - f3))
    distance = (f2 - f3) / ((h2 / h3) ** order - 1.0)
    return Extrapolation(f3 - distance, order, SAFETY * abs(distance))


def _order(h1: float, h2: float, h3: float, ratio: float) -> float | None:
    """Order p >= 1/2 that explains a ratio of changes, or None."""

    def explained(p: float) -> float:
        return float((h1**p - h2**p) / (h2**p - h3**p))

    low, high = 0.5, 16.0
    if not (math.isfinite(ratio) and ratio >= explained(low)):
        return None
    if ratio >= explained(high):
        return high
    for _ in range(80):  # the ratio grows with p
        middle = 0.5 * (low + high)
        low, high = (middle, high) if explained(middle) < ratio else (low, middle)
    return 0.5 * (low + high)
