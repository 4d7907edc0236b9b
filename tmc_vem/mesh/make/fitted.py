"""Cells that are smaller by themselves where regions are narrow, so that enough fit across.

How narrow a place is shows only with outlines sampled more closely than it is wide, which the size says in turn. So
outlines are sampled with the size that is known, places found narrow make it smaller, and that again until nothing
changes. From every such place on, the size grows with the distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.estimate import check_size
from tmc_vem.mesh.make.growing import Growing, rounded_up
from tmc_vem.mesh.make.narrow import facing, region_at
from tmc_vem.mesh.make.outline import Point, Region, Size, Skeleton, evaluate_size, make_skeleton
from tmc_vem.mesh.make.voronoi import UnresolvedError
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Where two cells are to fit across, they have the size of which this many times two do.
MARGIN = 1.25
# Segments of outlines are to be this fraction of the size of cells there, at least: short pieces make cells smaller.
SHORT = 0.7
# Cells are no smaller than this fraction of the size that is asked for, unless another limit is given.
SMALLEST = 0.01
# Outlines are looked at in segments of this fraction of the size of cells, of which arcs have one for this angle, in
# degrees, at least.
CLOSE, TURN = 0.5, 15.0
# Nothing changes any more if no size falls by more than this factor; outlines are looked at so often at most.
SAME, PASSES = 1.02, 40
# Where a mesher has failed, cells become smaller by this factor, so often at most.
FINER, ATTEMPTS = 1.5, 10


@dataclass(frozen=True)
class Fit:
    """How cells are fitted to narrow places.

    Attributes:
        across: cells that fit across a narrow place.
        growth: by how much cells grow for each unit of distance from such a place.
        smallest: size of cells that no place goes below; None for a hundredth of the size that is asked for there.
    """

    across: float = 2.0
    growth: float = 0.3
    smallest: float | None = None

    def least(self, size: Size, points: Float) -> Float:
        """Smallest sizes (n,) at points (n, 2), for a size that is asked for."""
        if self.smallest is not None:
            return rounded_up(np.full(len(points), self.smallest))
        return rounded_up(SMALLEST * evaluate_size(size, points))


def fitted_mesh(
    mesher: Callable[[Size], PolygonMesh],
    regions: Sequence[Region],
    size: Size,
    points: Mapping[str, Point] | None = None,
    fit: Fit = Fit(),
    *,
    density: float = 1.0,
    limit: float = np.inf,
) -> PolygonMesh:
    """A mesh with cells of :func:`fitted_size`, smaller still where the mesher cannot do with them.

    Args:
        mesher: makes the mesh of a size.
        regions, size, points, fit, density, limit: of :func:`fitted_size`.

    Raises:
        InputError: there is no mesh with cells that are as small as they may be, or there would be too many.
    """
    found = fitted_size(regions, size, points, fit, density=density, limit=limit)
    for attempt in range(ATTEMPTS + 1):
        try:
            return mesher(found)
        except UnresolvedError as error:
            failed, place = error, np.asarray(error.place, dtype=float)[None]
        h, least = found(place), fit.least(size, place)
        if attempt == ATTEMPTS or not h[0] > SAME * least[0]:
            break
        found = found.with_places(place, np.maximum(h / FINER, least))
    raise InputError(
        f"{failed}. fit = true makes no cells below {least[0]:.3g} there: give a smaller one, smallest = ..."
        if not h[0] > SAME * least[0]
        else f"{failed}. fit = true has tried cells down to {h[0]:.3g} there"
    )


def fitted_size(
    regions: Sequence[Region],
    size: Size,
    points: Mapping[str, Point] | None = None,
    fit: Fit = Fit(),
    *,
    density: float = 1.0,
    limit: float = np.inf,
) -> Growing:
    """The size of cells that is asked for, smaller where outlines face each other closely or have short pieces.

    Args:
        regions: outlines.
        size: that is asked for, a number or a function of points (n, 2), which is nowhere exceeded.
        points: named places on the outlines.
        fit: how many cells fit across, and how they grow.
        density, limit: of the cells, see :func:`tmc_vem.mesh.make.estimate.check_size`.

    Raises:
        InputError: there would be too many cells, or the size is not positive; the message says where.
    """
    found, tightest = Growing(fit.growth, size), ""
    for _ in range(PASSES):
        try:
            check_size(regions, found, density, limit)
        except InputError as error:
            raise InputError(f"{error}{tightest}") from None
        close = make_skeleton(regions, lambda x, h=found: CLOSE * h(x), points, turn=TURN)  # type: ignore[misc]
        narrow, short = _narrow(close, found, fit.across), _short(make_skeleton(regions, found, points))
        places = np.concatenate([narrow.at_px, short.at_px])
        wanted = np.maximum(np.concatenate([narrow.size_p, short.size_p]), fit.least(size, places))
        new = np.flatnonzero(wanted < found(places) / SAME)
        if not len(new):
            return found
        smallest = int(new[wanted[new].argmin()])
        n_narrow = len(narrow.at_px)
        tightest = (
            narrow.said(smallest, f"where {region_at(regions, places[smallest])} is {{:.3g}} wide")
            if smallest < n_narrow
            else short.said(smallest - n_narrow, "where an outline has a piece of length {:.3g}")
        )
        found = found.with_places(places[new], wanted[new])
    raise InputError(f"the size of cells has no end after {PASSES} passes over the outlines{tightest}")


@dataclass(frozen=True)
class _Places:
    """Where cells are to be smaller.

    Attributes:
        at_px: (n_places, 2).
        size_p: (n_places,) of the cells there.
        length_p: (n_places,) of what asks for them, the width of a region or the length of a piece of an outline.
    """

    at_px: Float
    size_p: Float
    length_p: Float

    def said(self, n: int, why: str) -> str:
        """What to add to a message about a place."""
        x, y = self.at_px[n].tolist()
        return (
            f". The smallest, of size {self.size_p[n]:.3g}, fit = true wants near ({x:.4g}, {y:.4g}), "
            f"{why.format(self.length_p[n])}: give a larger smallest = ..., or change the shapes there"
        )


def _narrow(close: Skeleton, size: Growing, across: float) -> _Places:
    """Where fewer cells fit across, all the way from one side to the other."""
    nodes = close.nodes_nx
    n, width, foot = facing(close, MARGIN * across * size(nodes))
    stations = np.linspace(0.0, 1.0, math.ceil(across) + 1)
    width = np.tile(width, len(stations))
    places = np.concatenate([nodes[n] + t * (foot - nodes[n]) for t in stations])
    return _Places(places, width / (MARGIN * across), width)


def _short(skeleton: Skeleton) -> _Places:
    """Ends and middles of the segments of outlines."""
    ends = skeleton.nodes_nx[skeleton.segments_sn]
    length = np.tile(np.hypot(*(ends[:, 1] - ends[:, 0]).T), 3)
    return _Places(np.concatenate([ends[:, 0], ends.mean(axis=1), ends[:, 1]]), length / SHORT, length)
