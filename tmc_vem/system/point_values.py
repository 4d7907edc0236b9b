"""Values at points that are found again by their coordinates, as their order depends on the distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

# Coordinates of the same point may differ by rounding; this fraction of the extent is far below any distance of two.
TOLERANCE = 1e-9


@dataclass(frozen=True)
class PointValues:
    """Values at points.

    Attributes:
        points_px: (n, 2) coordinates.
        values_p: (n,).
    """

    points_px: Float
    values_p: Float

    def at(self, points_px: Float) -> Float:
        """The values (m,) at points (m, 2) that are among the known ones.

        Raises:
            InputError: one is not.
        """
        from scipy.spatial import cKDTree

        if not len(points_px):
            return np.empty(0)
        if not len(self.points_px):
            raise _unknown(points_px[0])
        distance, position = cKDTree(self.points_px).query(points_px)
        extent = np.ptp(self.points_px, axis=0).max()
        far = np.flatnonzero(~(distance <= TOLERANCE * extent))
        if len(far):
            raise _unknown(points_px[far[0]])
        values: Float = self.values_p[position]
        return values


def _unknown(place: Float) -> InputError:
    return InputError(f"no friction is known at ({place[0]:g}, {place[1]:g}): it belongs to another mesh")
