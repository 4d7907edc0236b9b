"""Masks over the cells of a mesh: by box, by circle, by region; combine them with ``&``, ``|`` and ``~``.

A cell belongs to what its centroid lies in, or on the border of: symmetric shapes choose symmetric cells.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_finite, require_known, require_positive

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

TIE = 1e-6  # a centroid is on a border if it is this fraction of the cell's size off it


def in_regions(mesh: PolygonMesh, names: Iterable[str]) -> Bool:
    """Mask (n_cells,) of the cells of some regions.

    Raises:
        InputError: the mesh has no such region.
    """
    wanted = list(names)
    require_known(wanted, mesh.region_names, "regions of the mesh")
    mask: Bool = np.isin(mesh.region_c, [mesh.region_names.index(name) for name in wanted])
    return mask


def in_box(mesh: PolygonMesh, x0: float, y0: float, x1: float, y1: float) -> Bool:
    """Mask (n_cells,) of the cells with their centroid in [x0, x1] x [y0, y1] (length).

    Raises:
        InputError: the box is empty, or a bound is no finite number.
    """
    for name, value in (("x0", x0), ("y0", y0), ("x1", x1), ("y1", y1)):
        require_finite(f"{name} of the box", value)
    if not (x0 < x1 and y0 < y1):
        raise InputError(f"the box x0 = {x0:g}, y0 = {y0:g}, x1 = {x1:g}, y1 = {y1:g} is empty: x0 < x1 and y0 < y1")
    center, area = centroids_and_areas(mesh)
    (x, y), tie = center.T, TIE * np.sqrt(area)
    mask: Bool = (x0 - tie <= x) & (x <= x1 + tie) & (y0 - tie <= y) & (y <= y1 + tie)
    return mask


def in_circle(mesh: PolygonMesh, x: float, y: float, radius: float) -> Bool:
    """Mask (n_cells,) of the cells with their centroid at most ``radius`` (length) from (x, y).

    Raises:
        InputError: the radius is not positive, or the centre no point.
    """
    require_finite("x of the circle's centre", x)
    require_finite("y of the circle's centre", y)
    require_positive("radius of the circle", radius, "give a length")
    center, area = centroids_and_areas(mesh)
    mask: Bool = np.hypot(*(center - (x, y)).T) <= radius + TIE * np.sqrt(area)
    return mask
