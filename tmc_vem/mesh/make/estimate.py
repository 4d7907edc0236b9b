"""How many cells a mesh of outlines would have, before it is made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import check_cells
from tmc_vem.mesh.make.outline import Curve, Point, Region, Size, evaluate_size

Float = NDArray[np.float64]

# Sizes of cells grow at most by this for each unit of distance.
STEEPEST = 1.0
_FIRST = 64  # boxes along each side that an estimate begins with
_STATIONS = 401


@dataclass(frozen=True)
class Estimate:
    """Number of cells to some percent, or a lower bound of it, and the smallest size that was found, with its place."""

    n_cells: float
    smallest: float
    at_least: bool = False
    place: Point = (math.nan, math.nan)


def check_size(regions: Sequence[Region], size: Size, density: float, limit: float) -> None:
    """Check that the cells of a size would not be too many.

    Args:
        regions: outlines.
        size: of cells, a number or a function of points (n, 2) whose slope is STEEPEST at most.
        density: cells in a square whose side is the size.
        limit: how many there may be, see :func:`tmc_vem.support.environment.cells_allowed`.

    Raises:
        InputError: they would be, or the size is not positive.
    """
    found = estimate(regions, size, density, limit)
    low, high = _bounds(regions)
    domain = f"on a domain of {high[0] - low[0]:.4g} x {high[1] - low[1]:.4g}"
    if isinstance(size, (int, float)):
        hint = f"cells of size {found.smallest:.3g} {domain}; use a larger size"
    else:
        x, y = found.place
        hint = (
            f"cells down to size {found.smallest:.3g}, near ({x:.4g}, {y:.4g}), {domain}; use larger sizes, or small "
            "cells in fewer and smaller places"
        )
    check_cells(found.n_cells, limit, hint, at_least=found.at_least)


def estimate(regions: Sequence[Region], size: Size, density: float, limit: float) -> Estimate:
    """How many cells of a size regions have; see :func:`check_size`.

    Where the size varies, the domain is cut into boxes until it hardly does within any. That ends at the limit, as
    every box that is still to be cut stands for one cell at least.
    """
    import shapely

    # at least one cell for two edges along an outline, which two regions may share
    along = 0.5 * sum(_along(curve, size) for region in regions for curve in region.curves())
    polygons = [region.polygon() for region in regions]
    if isinstance(size, (int, float)):
        h = float(evaluate_size(size, np.zeros((1, 2)))[0])
        return Estimate(max(density * sum(float(polygon.area) for polygon in polygons) / h / h, along), h)
    domain = shapely.union_all(polygons)
    outline = domain.boundary
    shapely.prepare([domain, outline])
    low, high = _bounds(regions)
    side = (high - low) / _FIRST
    corners = np.stack(np.meshgrid(np.arange(_FIRST), np.arange(_FIRST)), axis=-1).reshape(-1, 2)
    centers = low + (corners + 0.5) * side
    quarters = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) / 4.0
    inside = np.zeros(len(centers), dtype=bool)  # boxes that the outline is known to be away from, and their quarters
    total, smallest, place, capped = 0.0, np.inf, centers[0], False
    while len(centers) and not capped:
        reach = 0.5 * float(np.hypot(*side))
        unknown = np.flatnonzero(~inside)
        points = shapely.points(centers[unknown])
        within = shapely.dwithin(domain, points, reach)
        inside[unknown] = within & ~shapely.dwithin(outline, points, reach)
        kept = inside.copy()
        kept[unknown] = within
        centers, inside = centers[kept], inside[kept]
        capped = len(centers) > max(limit, _FIRST**2)
        h_c = evaluate_size(size, centers)
        if len(h_c) and h_c.min() < smallest:
            smallest, place = float(h_c.min()), centers[h_c.argmin()]
        cut = (STEEPEST * reach > 0.5 * h_c) & (not capped)
        counted = ~cut
        counted[~inside] &= shapely.contains_xy(domain, centers[~inside])
        with np.errstate(over="ignore"):
            total += float((side.prod() / h_c[counted] / h_c[counted]).sum())
        centers, inside = (centers[cut][:, None] + quarters * side).reshape(-1, 2), inside[cut].repeat(4)
        side = side / 2.0
    x, y = place.tolist()
    return Estimate(max(density * total, along), smallest, capped, (x, y))


def _along(curve: Curve, size: Size) -> float:
    """Edges along a curve."""
    h = evaluate_size(size, curve.at(np.linspace(0.0, 1.0, _STATIONS)))
    with np.errstate(over="ignore"):
        return float((0.5 * curve.length / h[1:] + 0.5 * curve.length / h[:-1]).mean())


def _bounds(regions: Sequence[Region]) -> tuple[Float, Float]:
    """Lower left and upper right corner."""
    ends = np.concatenate([np.array(region.polygon().bounds).reshape(2, 2) for region in regions])
    return ends.min(axis=0), ends.max(axis=0)
