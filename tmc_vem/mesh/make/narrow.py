"""Where regions are too narrow for the cells that are asked for: the width there, and the size that would do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import COINCIDE, Region, Size, Skeleton, evaluate_size

Float = NDArray[np.float64]

# Two outlines face each other if the way between them is across both, up to this cosine.
ACROSS = 0.3
CELLS_ACROSS = 2.0
PAIRS_AT_ONCE = 1 << 20


def narrow_place(regions: Sequence[Region], skeleton: Skeleton, size: Size) -> str | None:
    """A sentence about the place that is narrowest in cells, None if two cells fit across everywhere.

    Args:
        regions: outlines.
        skeleton: nodes along them.
        size: of cells.
    """
    nodes = skeleton.nodes_nx
    width, foot = widths(skeleton)
    h = evaluate_size(size, nodes)
    n = int((width / h).argmin())
    if not width[n] < CELLS_ACROSS * h[n]:
        return None
    middle = 0.5 * (nodes[n] + foot[n])
    return (
        f"the interface near ({middle[0]:.4g}, {middle[1]:.4g}) is not resolved: {_region_at(regions, middle)} is "
        f"{width[n]:.3g} wide there, too narrow for cells of size {h[n]:.3g}; two must fit across, so use a size of "
        f"{width[n] / CELLS_ACROSS:.3g} or less there (refine), or make it wider"
    )


def widths(skeleton: Skeleton, cosine: float = ACROSS, *, both: bool = True) -> tuple[Float, Float]:
    """Distance (n_nodes,) from every node to the nearest outline that faces its own, infinite without one, and the
    place (n_nodes, 2) there.

    Args:
        skeleton: nodes along outlines.
        cosine: of the smallest angle between the way across and an outline.
        both: whether the way is across the other outline too; if not, corners count, and at a corner of its own the way
            is across both sides.
    """
    nodes, segments = skeleton.nodes_nx, skeleton.segments_sn
    start, arm = nodes[segments[:, 0]], nodes[segments[:, 1]] - nodes[segments[:, 0]]
    length = np.hypot(*arm.T)
    tangent = arm / length[:, None]
    touching = COINCIDE * float(np.ptp(nodes, axis=0).max())
    width, foot = np.full(len(nodes), np.inf), np.zeros_like(nodes)
    step = max(1, PAIRS_AT_ONCE // len(segments))
    own = np.stack([np.full(len(nodes), -1)] * 2, axis=1)
    own[segments[:, 0], 0] = own[segments[:, 1], 1] = np.arange(len(segments))
    own = np.where(own < 0, own[:, ::-1], own)  # at the end of a curve there may be one segment alone
    for first in range(0, len(nodes), step):
        x = nodes[first : first + step]
        t = np.clip(np.einsum("nsx,sx->ns", x[:, None] - start, tangent), 0.0, length)
        way = start + t[..., None] * tangent - x[:, None]
        distance = np.hypot(*np.moveaxis(way, -1, 0))
        mine = (
            np.abs(np.einsum("nsx,nkx->nsk", way, tangent[own[first : first + step]])) <= cosine * distance[..., None]
        )
        across = mine.any(axis=-1) if both else mine.all(axis=-1)
        if both:
            across &= np.abs(np.einsum("nsx,sx->ns", way, tangent)) <= cosine * distance
        distance[~across | (distance <= touching)] = np.inf
        nearest = distance.argmin(axis=1)
        rows = np.arange(len(x))
        width[first : first + step] = distance[rows, nearest]
        foot[first : first + step] = x + way[rows, nearest]
    return width, foot


def _region_at(regions: Sequence[Region], point: Float) -> str:
    import shapely

    for region in regions:
        if shapely.intersects_xy(region.polygon(), *point):
            return f"region '{region.name}'"
    return "the gap between regions"
