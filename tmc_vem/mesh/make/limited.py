"""A size of cells that users give as a function, as meshes can have it: positive, and no steeper than cells grow.

Where the function is too steep, the smaller of its sizes count, and the size grows from them on: h(x) is the least of
``f(y) + growth |x - y|`` over samples y, along all outlines and inside. Where it is not, it is left as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.growing import STEP, Growing
from tmc_vem.mesh.make.outline import Field, Region, Size, evaluate_size, sizes_along
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import shown

Float = NDArray[np.float64]

# Boxes along each side of the domain that sampling begins with; they are cut into quarters while they have more cells
# along a side than the second number, a quarter of it where the size is steep, and if there are no more than the third.
FIRST, CELLS, MOST = 64, 2.0, 200_000
# Sizes below this fraction of the domain are a slip.
SMALLEST = 1e-6
# A size is too steep where it is smaller by more than this fraction of itself with the limit.
ROUNDING = 1e-9


def limited_size(regions: Sequence[Region], size: Field, growth: float) -> Size:
    """A size of cells that changes by no more than cells grow.

    Args:
        regions: outlines; what the function is elsewhere does not matter.
        size: a function of points (n, 2) that gives their sizes (n,).
        growth: by how much cells grow for each unit of distance.

    Raises:
        InputError: the size is not positive somewhere in the regions, or tiny; the message says where.
    """
    places, h = _samples(regions, size, growth)
    known = _Known(size, growth, places, h)
    # sizes of places are rounded up, so that where the function is not too steep none of them counts
    grown = Growing(growth, 2.0 * STEP * float(h.max())).with_places(places, STEP * h)
    steep = grown(places) < h * (1.0 - ROUNDING)
    if not steep.any():
        return known
    asked = grown.places_asked(places[steep])
    return Growing(growth, known, grown.places_px[asked], grown.sizes_p[asked])


@dataclass(frozen=True)
class _Known:
    """A function that has a size everywhere: where it has none, as it may outside of the regions, that of the nearest
    sample, growing.

    Attributes:
        size: the function.
        growth: by how much cells grow for each unit of distance.
        places_px, sizes_p: (n_places, 2) samples and the sizes (n_places,) there.
    """

    size: Field
    growth: float
    places_px: Float
    sizes_p: Float

    def __call__(self, points: Float) -> Float:
        h = values(self.size, points)
        bad = np.flatnonzero(~(np.isfinite(h) & (h > 0.0)))
        if len(bad):
            h = h.copy()
            distance, nearest = self._tree.query(points[bad])
            h[bad] = self.sizes_p[nearest] + self.growth * distance
        return h

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.places_px)


def values(size: Field, points: Float) -> Float:
    """Sizes (n,) at points (n, 2), as the function gives them; one number is that of all.

    Raises:
        InputError: it gives neither.
    """
    given: Any = size(points)
    try:
        h = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"the size of cells is {shown(given)}, which are no numbers: give one for each point"
        ) from None
    if h.shape not in ((), points.shape[:1]):
        raise InputError(
            f"the size of cells at {len(points)} points is an array of shape {h.shape}: give one number for each point"
        )
    return np.broadcast_to(h, points.shape[:1])


def _samples(regions: Sequence[Region], size: Field, growth: float) -> tuple[Float, Float]:
    """Places (n, 2) along all outlines and inside, about as close as cells there, and the sizes (n,).

    Raises:
        InputError: one is not positive, or tiny.
    """
    import shapely

    polygons = [region.polygon() for region in regions]
    domain = shapely.union_all(polygons)
    shapely.prepare(domain)
    low, high = np.array(domain.bounds).reshape(2, 2)
    extent = float((high - low).max())

    def checked(points: Float) -> Float:
        h = evaluate_size(lambda x: values(size, x), points)
        tiny = np.flatnonzero(h < SMALLEST * extent)
        if len(tiny):
            x, y = points[tiny[0]]
            raise InputError(
                f"the size of cells is {h[tiny[0]]:.3g} at ({x:.4g}, {y:.4g}), less than a millionth of the domain, "
                f"which is {extent:.4g} wide: keep it larger, max(..., {1e-3 * extent:.1g}) for example"
            )
        return h

    found = []
    for curve in (curve for region in regions for curve in region.curves()):
        t, h = sizes_along(curve, checked)
        found.append((curve.at(t), h))
    side = (high - low) / FIRST
    corners = np.stack(np.meshgrid(np.arange(FIRST), np.arange(FIRST)), axis=-1).reshape(-1, 2)
    centers = low + (corners + 0.5) * side
    quarters = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) / 4.0
    while 0 < len(centers) <= MOST:
        inner = (centers[:, None] + quarters * side).reshape(-1, 2)
        inside = shapely.contains_xy(domain, inner)
        inner_h = np.full(len(inner), np.nan)
        inner_h[inside] = checked(inner[inside])
        found.append((inner[inside], inner_h[inside]))
        inner_h = inner_h.reshape(-1, 4)
        smallest, largest = np.fmin.reduce(inner_h, axis=1), np.fmax.reduce(inner_h, axis=1)  # nan for none inside
        steep = largest - smallest > growth * np.hypot(*side) / 2.0
        cut = side.max() > np.where(steep, 0.25 * CELLS, CELLS) * smallest
        centers = inner.reshape(-1, 4, 2)[cut].reshape(-1, 2)
        side = side / 2.0
    return np.concatenate([places for places, _ in found]), np.concatenate([h for _, h in found])
