"""Structured quadrilaterals on a tensor grid with rectangular regions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Rectangle:
    """Axis-parallel rectangle [x0, x1] x [y0, y1] that belongs to a region."""

    region: str
    x0: float
    x1: float
    y0: float
    y1: float


def structured_quadrilaterals(
    x_lines: Float | Sequence[float],
    y_lines: Float | Sequence[float],
    rectangles: Sequence[Rectangle],
    named_points: Mapping[str, tuple[float, float]] | None = None,
) -> PolygonMesh:
    """Quadrilaterals between mesh lines; a cell belongs to the last rectangle that contains it.

    Args:
        x_lines: increasing abscissae of the vertical mesh lines.
        y_lines: increasing ordinates of the horizontal mesh lines.
        rectangles: regions; later ones lie on top of earlier ones. Their sides must be mesh lines.
        named_points: names for nodes, given by their coordinates.

    Raises:
        InputError: lines do not increase, a rectangle's side is not on a mesh line, a cell is in no rectangle, or a
            named point has no node.
    """
    x, y = np.asarray(x_lines, dtype=float), np.asarray(y_lines, dtype=float)
    for name, lines in (("x", x), ("y", y)):
        if lines.ndim != 1 or len(lines) < 2 or not (np.diff(lines) > 0).all() or not np.isfinite(lines).all():
            raise InputError(f"{name} mesh lines must be at least two increasing numbers, got {lines.tolist()}")
    nx, ny = len(x) - 1, len(y) - 1
    region_names = tuple(dict.fromkeys(rectangle.region for rectangle in rectangles))
    region_yx = np.full((ny, nx), -1, dtype=np.int64)
    for rectangle in rectangles:
        if not (rectangle.x0 < rectangle.x1 and rectangle.y0 < rectangle.y1):
            raise InputError(
                f"region '{rectangle.region}' is an empty rectangle: x0 = {rectangle.x0:g}, x1 = {rectangle.x1:g}, "
                f"y0 = {rectangle.y0:g}, y1 = {rectangle.y1:g}"
            )
        columns = slice(_line(x, rectangle.x0, "x", rectangle), _line(x, rectangle.x1, "x", rectangle))
        rows = slice(_line(y, rectangle.y0, "y", rectangle), _line(y, rectangle.y1, "y", rectangle))
        region_yx[rows, columns] = region_names.index(rectangle.region)
    if (region_yx < 0).any():
        row, column = np.argwhere(region_yx < 0)[0]
        raise InputError(f"the cell with lower left corner ({x[column]:g}, {y[row]:g}) is in no region")

    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    lower_left = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    cells = lower_left[:, None] + np.array([0, 1, nx + 2, nx + 1])
    mesh = PolygonMesh(
        points_vx=points,
        cell_offsets=np.arange(nx * ny + 1) * 4,
        cell_vertices=cells.ravel(),
        region_c=region_yx.ravel(),
        region_names=region_names,
        validate=False,
    )
    names = {}
    for name, position in (named_points or {}).items():
        try:
            names[name] = mesh.find_vertex(*position)
        except InputError as error:
            raise InputError(f"named point '{name}': {error}") from None
    return PolygonMesh(
        mesh.points_vx, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, region_names, named_points=names
    )


def _line(lines: Float, value: float, axis: str, rectangle: Rectangle) -> int:
    nearest = int(np.argmin(np.abs(lines - value)))
    if abs(lines[nearest] - value) > 1e-9 * np.ptp(lines):
        raise InputError(
            f"region '{rectangle.region}' ends at {axis} = {value:g}, which is not a mesh line "
            f"(nearest {lines[nearest]:g}): change the number of cells so that the spacing divides it"
        )
    return nearest
