"""Parameters of an energy that vary from cell to cell: what the value of a region is multiplied with in each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]


class Graded(Protocol):
    """Factors of some parameters of a region's energy in every cell; the same for both discretisations."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters of the energy that vary; kernels have them last, in this order."""

    def factors(self, centroid_cx: Float, data: Mapping[str, Float]) -> Float:
        """What the region's values of these parameters are multiplied with.

        Args:
            centroid_cx: (n_cells, 2) centroids of cells.
            data: (n_cells,) of the same cells, what the mesh carries of numbers by name.

        Returns:
            (n_cells, n_names) factors.

        Raises:
            InputError: a value is not usable in a cell; the message says where.
        """
