"""Where regions are too narrow for the cells that are asked for: the width there, and the size that would do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.make.outline import COINCIDE, Region, Size, Skeleton, evaluate_size

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Two outlines face each other if the way between them is across both, up to this cosine.
ACROSS = 0.3
# A corner faces what lies in a direction that is along none of its sides, up to this cosine. An outline that turns by
# less than this angle is smooth, and the nearest place on it is where the way is across up to this cosine.
BESIDE, SMOOTH, NEAREST = 0.8, np.radians(20.0), 0.15
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
        f"the interface near ({middle[0]:.4g}, {middle[1]:.4g}) is not resolved: {region_at(regions, middle)} is "
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


def facing(skeleton: Skeleton, reach_n: Float) -> tuple[Int, Float, Float]:
    """Nodes (n_pairs,) that an outline faces within a reach, how far it is away (n_pairs,), and where (n_pairs, 2).

    The way between them is across both outlines, where they are smooth; at a corner it is along no side of it.

    Args:
        skeleton: nodes along outlines, close enough that a smooth outline turns by little from segment to segment.
        reach_n: (n_nodes,) distance within which outlines count.
    """
    import shapely

    nodes, segments = skeleton.nodes_nx, skeleton.segments_sn
    arms_nkx, cosine_n = _arms(skeleton)
    tree = shapely.STRtree(shapely.linestrings(nodes[segments]))
    pairs = tree.query(shapely.points(nodes), predicate="dwithin", distance=reach_n)
    n, s = pairs[:, np.lexsort(pairs[::-1])]
    start, arm = nodes[segments[s, 0]], nodes[segments[s, 1]] - nodes[segments[s, 0]]
    t = np.clip(((nodes[n] - start) * arm).sum(axis=1) / (arm * arm).sum(axis=1), 0.0, 1.0)
    way = start + t[:, None] * arm - nodes[n]
    distance = np.hypot(*way.T)
    apart = distance > COINCIDE * float(np.ptp(nodes, axis=0).max())
    n, s, t, way, distance = n[apart], s[apart], t[apart], way[apart], distance[apart]
    across = _along(way, arms_nkx[n]) <= cosine_n[n] * distance
    for side in (0, 1):  # the ends of the other segment
        there = segments[s, side]
        at_most = np.where(cosine_n[there] == BESIDE, BESIDE, NEAREST)
        across &= (t != float(side)) | (_along(-way, arms_nkx[there]) <= at_most * distance)
    return n[across], distance[across], nodes[n[across]] + way[across]


def _arms(skeleton: Skeleton) -> tuple[Float, Float]:
    """Unit vectors (n_nodes, n_arms, 2) along the segments from every node, 0 for those that it does not have, and the
    largest cosine (n_nodes,) between a way across and one of them."""
    nodes, segments = skeleton.nodes_nx, skeleton.segments_sn
    here, there = segments.ravel(), segments[:, ::-1].ravel()
    order = np.argsort(here, kind="stable")
    here, there = here[order], there[order]
    count = np.bincount(here, minlength=len(nodes))
    which = np.arange(len(here)) - np.repeat(np.cumsum(count) - count, count)
    arms = np.zeros((len(nodes), int(count.max()), 2))
    way = nodes[there] - nodes[here]
    arms[here, which] = way / np.hypot(*way.T)[:, None]
    smooth = (count == 2) & ((arms[:, :2].prod(axis=1)).sum(axis=1) < -np.cos(SMOOTH))
    return arms, np.where(smooth, ACROSS, BESIDE)


def _along(way: Float, arms: Float) -> Float:
    """Largest component (n,) of ways (n, 2) along one of some directions (n, n_arms, 2)."""
    largest: Float = np.einsum("nx,nkx->nk", way, arms).max(axis=1)
    return largest


def region_at(regions: Sequence[Region], point: Float) -> str:
    """What is at a point, in words: a region, or the gap between regions."""
    import shapely

    for region in regions:
        if shapely.intersects_xy(region.polygon(), *point):
            return f"region '{region.name}'"
    return "the gap between regions"
