"""Equal squares in regions whose outlines run along the lines of a grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import QUADRILATERALS
from tmc_vem.mesh.make.estimate import check_size
from tmc_vem.mesh.make.far import meshed_near_origin
from tmc_vem.mesh.make.outline import Line, Point, Region
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

ON = 1e-6  # of the size of the cells: outlines are on the lines of the grid up to that


@meshed_near_origin
def grid_mesh(
    regions: Sequence[Region],
    size: float,
    points: Mapping[str, Point] | None = None,
    *,
    most_cells: float | None = None,
) -> PolygonMesh:
    """Squares of one size, whose lines begin at the smallest x and y of all outlines.

    All cells have the same shape, so that they share one element, and a mesh of a symmetric domain is symmetric to the
    last bit but for rounding of coordinates.

    Args:
        regions: outlines of straight sides along x and y.
        size: of the squares.
        points: names for nodes, by their coordinates.
        most_cells: how many cells there may be; None for what the environment says, or a million.

    Raises:
        InputError: a side is not along x or y or not on a line of the grid, a named point is no node, or there would be
            too many cells.
    """
    check_size(regions, size, QUADRILATERALS, cells_allowed(most_cells))
    ends = np.array([end for region in regions for curve in region.curves() for end in (curve.start, curve.end)])
    low, high = ends.min(axis=0), ends.max(axis=0)
    for region in regions:
        _check(region, low, size)
    nx, ny = (round(float(extent)) for extent in (high - low) / size)
    lines = [np.linspace(low[axis], high[axis], n + 1) for axis, n in enumerate((nx, ny))]
    names = tuple(dict.fromkeys(region.name for region in regions))
    region_c = _regions(regions, names, low, size, (nx, ny))
    inside = np.flatnonzero(region_c >= 0)
    corners_cv = (inside // nx * (nx + 1) + inside % nx)[:, None] + np.array([0, 1, nx + 2, nx + 1])
    used, vertices = np.unique(corners_cv.ravel(), return_inverse=True)
    points_vx = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)[used]
    offsets = np.arange(len(inside) + 1) * 4
    mesh = PolygonMesh(points_vx, offsets, vertices.astype(np.int64), region_c[inside], names)
    try:
        return with_names(mesh, points)
    except InputError as error:
        raise InputError(
            f"{error}: points are corners of the grid of size {size:g} that begins at {_at(low)}"
        ) from None


def _check(region: Region, low: Float, size: float) -> None:
    """Check that all sides of a region are on lines of the grid.

    Raises:
        InputError: one is not; the message says which and by how much.
    """
    for curve in region.curves():
        if not isinstance(curve, Line):
            raise InputError(
                f"region '{region.name}' has a round side at {_at(np.asarray(curve.start))}: cells = 'grid' is for "
                "rectangles; use other cells, or shapes without discs and rounded corners"
            )
        start, end = np.asarray(curve.start), np.asarray(curve.end)
        across = np.flatnonzero(np.abs(end - start) <= ON * size)
        if len(across) != 1:
            raise InputError(
                f"region '{region.name}' has a side from {_at(start)} to {_at(end)}, which is neither along x nor "
                "along y: cells = 'grid' is for rectangles; use other cells"
            )
        axis = int(across[0])
        steps = float((start[axis] - low[axis]) / size)
        off = steps - round(steps)
        if abs(off) > ON:
            nearest, name = low[axis] + round(steps) * size, "xy"[axis]
            raise InputError(
                f"region '{region.name}' has a side at {name} = {start[axis]:.10g}, which is {abs(off) * size:.4g} off "
                f"the line {name} = {nearest:.10g} of the grid of size {size:g} that begins at {name} = "
                f"{low[axis]:.10g}: move the side there, or choose a size that divides {start[axis] - low[axis]:.10g}"
            )


def _regions(regions: Sequence[Region], names: Sequence[str], low: Float, size: float, cells: tuple[int, int]) -> Int:
    """(nx ny,) number of the region of every square, row by row; -1 where there is none."""
    nx, ny = cells
    region_yx = np.full((ny, nx), -1, dtype=np.int64)
    for region in regions:
        # a square is inside where an odd number of sides along y is to its right
        odd_yx = np.zeros((ny, nx + 1), dtype=np.int64)
        for curve in region.curves():
            (x0, y0), (x1, y1) = np.rint((np.array([curve.start, curve.end]) - low) / size).astype(int).tolist()
            if x0 == x1:
                odd_yx[min(y0, y1) : max(y0, y1), x0] += 1
        inside_yx = np.cumsum(odd_yx, axis=1)[:, :nx] % 2 == 1
        region_yx[inside_yx] = names.index(region.name)
    return region_yx.ravel()


def _at(point: Float) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"
