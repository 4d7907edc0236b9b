"""Symmetric designs: which cells are each other's mirror image, so that they share a variable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice, require_finite

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Mirror images of centroids are this fraction of the cell's size apart at most, and areas differ by this fraction.
TOLERANCE = 1e-4


@dataclass(frozen=True)
class Mirror:
    """A line of symmetry, x = at or y = at.

    Attributes:
        axis: ``x`` or ``y``, the coordinate that is mirrored.
        at: its value on the line (length).

    Raises:
        InputError: there is no such axis, or the place is no number.
    """

    axis: str
    at: float

    def __post_init__(self) -> None:
        require_choice("axis of symmetry", self.axis, ("x", "y"), "the coordinate that is mirrored")
        require_finite("place of symmetry", self.at)

    def __str__(self) -> str:
        return f"{self.axis} = {self.at:g}"

    def image(self, points_px: Float) -> Float:
        """Mirror images (n, 2) of points (n, 2)."""
        images = points_px.copy()
        column = "xy".index(self.axis)
        images[:, column] = 2.0 * self.at - images[:, column]
        return images


def partners(center_cx: Float, area_c: Float, mirror: Mirror, tolerance: float = TOLERANCE) -> Int:
    """The mirror image (n_cells,) of every cell: a number among these cells, its own for a cell on the line.

    Args:
        center_cx: (n_cells, 2) centroids.
        area_c: (n_cells,) areas.
        mirror: the line.
        tolerance: how far centroids of a pair may be from each other's image, over the square root of the area.

    Raises:
        InputError: a cell has no image; the message says where it is.
    """
    size = np.sqrt(area_c)
    distance, other = cKDTree(center_cx).query(mirror.image(center_cx))
    alike = np.abs(area_c[other] - area_c) <= tolerance * area_c
    bad = np.flatnonzero((distance > tolerance * size) | ~alike | (other[other] != np.arange(len(other))))
    if len(bad):
        worst = bad[np.argmax(distance[bad] / size[bad])]
        x, y = center_cx[worst]
        raise InputError(
            f"the design is not symmetric about {mirror}: {len(bad)} of {len(other)} cells have no mirror image, "
            f"such as the one at ({x:.6g}, {y:.6g}) of area {area_c[worst]:.3g}, whose image is {distance[worst]:.3g} "
            f"from the nearest centroid, of area {area_c[other[worst]]:.3g}; use a symmetric mesh, or no symmetry"
        )
    return np.asarray(other, dtype=np.int64)


def orbits(center_cx: Float, area_c: Float, mirrors: Sequence[Mirror], tolerance: float = TOLERANCE) -> Int:
    """A number (n_cells,) of every cell, from 0 on, the same for all that mirrors make each other's image.

    Raises:
        InputError: as for :func:`partners`.
    """
    n_cells = len(center_cx)
    pairs = [partners(center_cx, area_c, mirror, tolerance) for mirror in mirrors]
    row = np.tile(np.arange(n_cells), len(pairs))
    column = np.concatenate([np.empty(0, dtype=np.int64), *pairs])
    graph = scipy.sparse.coo_matrix((np.ones(len(row)), (row, column)), shape=(n_cells, n_cells))
    label = connected_components(graph, directed=False)[1]
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))  # numbered as the cells come
    return np.asarray(rank[number], dtype=np.int64)
