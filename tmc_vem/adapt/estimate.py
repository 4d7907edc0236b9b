"""What both estimators find: errors of results, and how much each cell has to do with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """Estimated errors of results on a mesh.

    Attributes:
        values: results by name.
        errors: what is to be added to them for the exact ones, of those that have an estimate.
        indicators: (n_cells,) for each result that the mesh is adapted to, how much the cells contribute to its error,
            without sign and in its unit; their sum is a bound rather than the error.
        kind: how it was made, see :mod:`tmc_vem.results.adaptivity`.
        doubt: what is to be said about it; empty for nothing.
        n_dofs, iterations: of the refined problem, if it was made with one.
    """

    values: Mapping[str, float]
    errors: Mapping[str, float]
    indicators: Mapping[str, Float]
    kind: str
    doubt: str = ""
    n_dofs: int = 0
    iterations: int = 0

    def within(self, names: tuple[str, ...], tolerance: float) -> bool:
        """Whether the errors of results are within a relative tolerance."""
        return all(name in self.errors and abs(self.errors[name]) <= tolerance * abs(self.values[name])
                   for name in names)  # fmt: skip

    def largest(self, names: tuple[str, ...]) -> float:
        """The largest relative error of some results, infinite without an estimate."""
        found = [abs(self.errors[n] / self.values[n]) if n in self.errors and self.values[n] else np.inf for n in names]
        return float(max(found))

    def relative_indicators(self, names: tuple[str, ...]) -> Float:
        """(n_cells,) contributions to the relative errors of results, of the result that each cell matters most to.

        Those of each result are scaled so that they sum up to the size of its error.
        """
        found = []
        for name in names:
            indicators, value = self.indicators[name], abs(self.values[name]) or 1.0
            error = abs(self.errors.get(name, float(indicators.sum())))
            total = float(indicators.sum())
            found.append(indicators * (error / total if total else 0.0) / value)
        worst: Float = np.max(found, axis=0)
        return worst
