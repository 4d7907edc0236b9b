"""Sizes of cells that are given at places and grow with the distance from them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import Size, evaluate_size

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Sizes of places are rounded down to powers of this number; what was said of one place then is said of many at once.
STEP = 1.1
# Up to so many pairs of points and places are looked at one by one.
FEW_PAIRS = 1 << 16


def rounded_up(size: Float) -> Float:
    """The next sizes that places can have."""
    found: Float = STEP ** np.ceil(np.log(size) / np.log(STEP) - 1e-9)
    return found


@dataclass(frozen=True)
class Growing:
    """The size of cells, a function of points (n, 2): at most size + growth * distance from every place.

    Attributes:
        growth: by how much cells grow for each unit of distance from a place.
        largest: what the size is at most, a number or a function of points (n, 2).
        places_px: (n_places, 2).
        sizes_p: (n_places,) sizes there, rounded down by up to a tenth.
    """

    growth: float
    largest: Size
    places_px: Float = field(default_factory=lambda: np.zeros((0, 2)))
    sizes_p: Float = field(default_factory=lambda: np.zeros(0))

    def __call__(self, points: Float) -> Float:
        """Size (n,) at points (n, 2).

        Raises:
            InputError: that of ``largest`` is not positive somewhere.
        """
        h = evaluate_size(self.largest, points).copy()
        if len(points) * len(self.sizes_p) <= FEW_PAIRS:
            away = points[:, None] - self.places_px
            grown = self.sizes_p + self.growth * np.hypot(away[..., 0], away[..., 1])
            return np.minimum(h, grown.min(axis=1, initial=np.inf))
        for level, tree in self._levels:
            asked = np.flatnonzero(h > level)
            if not len(asked):
                break
            reach = (h[asked].max() - level) / self.growth
            distance, _ = tree.query(points[asked], distance_upper_bound=reach)  # infinite beyond
            h[asked] = np.minimum(h[asked], level + self.growth * distance)
        return h

    def with_places(self, places_px: Float, sizes_p: Float) -> Growing:
        """The size with more places; those that others make as small already are left out."""
        from scipy.spatial import cKDTree

        level = STEP ** np.floor(np.log(sizes_p) / np.log(STEP) + 1e-9)
        places = np.concatenate([self.places_px, places_px])
        sizes = np.concatenate([self.sizes_p, level])
        each = np.unique(np.column_stack([sizes, places]), axis=0)  # in order of their sizes
        sizes, places = each[:, 0], each[:, 1:]
        h = evaluate_size(self.largest, places).copy()
        kept = np.zeros(len(sizes), dtype=np.bool_)
        for of in np.unique(sizes):
            kept[sizes == of] = h[sizes == of] > of
            asking = np.flatnonzero((sizes == of) & kept)
            larger = np.flatnonzero((sizes > of) & (h > of))
            if len(asking) and len(larger):
                reach = (h[larger].max() - of) / self.growth
                distance, _ = cKDTree(places[asking]).query(places[larger], distance_upper_bound=reach)
                h[larger] = np.minimum(h[larger], of + self.growth * distance)
        return Growing(self.growth, self.largest, places[kept], sizes[kept])

    def places_asked(self, points: Float) -> Int:
        """Numbers (n,) of the places that make the size at points (n, 2) smaller than the largest, each once."""
        h = evaluate_size(self.largest, points)
        place = np.full(len(points), -1)
        for level, tree in self._levels:
            distance, nearest = tree.query(points)
            smaller = level + self.growth * distance < h
            h = np.where(smaller, level + self.growth * distance, h)
            place[smaller] = np.flatnonzero(self.sizes_p == level)[nearest[smaller]]
        found: Int = np.unique(place[place >= 0])
        return found

    @cached_property
    def _levels(self) -> list[tuple[float, Any]]:
        """Sizes from small to large, and trees of the places that have them."""
        from scipy.spatial import cKDTree

        return [(float(of), cKDTree(self.places_px[self.sizes_p == of])) for of in np.unique(self.sizes_p)]
