"""The mesh of a description with shapes: the kind of its cells, and their size from place to place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import POLYGONS, QUADRILATERALS, TRIANGLES
from tmc_vem.mesh.make.far import moved, near
from tmc_vem.mesh.make.outline import Point, Region, Size, evaluate_size
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.cell_size import field_of, size_text
from tmc_vem.problems.mesh_tables import GRID, MeshTable
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

VORONOI, QUADS = "voronoi", "quadrilaterals"


def mesh_of_shapes(
    table: MeshTable, regions: Sequence[Region], points: Mapping[str, Point], origin: Point | None = None
) -> PolygonMesh:
    """The mesh with all interfaces as edges.

    Args:
        table: what cells it has.
        regions: outlines, counted from ``origin`` on.
        points: named places on them, as they stand in the description.
        origin: where coordinates are counted from while the mesh is made; None for their own origin.

    Raises:
        InputError: it cannot be made.
    """
    from tmc_vem.mesh.make.grid import grid_mesh

    named = {name: place if origin is None else near(place, origin) for name, place in points.items()}
    try:
        if table.cells == GRID:
            assert isinstance(table.size, float | int)
            mesh = grid_mesh(regions, table.size, named)
        else:
            mesh = _of_sizes(table, regions, named, size_of(table, regions, origin))
    except InputError as error:
        if origin is None:
            raise
        raise InputError(f"{error} (places are counted from ({origin[0]:.17g}, {origin[1]:.17g}) on)") from None
    return mesh if origin is None else moved(mesh, origin)


def size_of(table: MeshTable, regions: Sequence[Region], origin: Point | None = None) -> Size:
    """The size of cells: a number, or a function of points (n, 2) counted from an origin on.

    Raises:
        InputError: a formula or function is not positive somewhere in the regions; the message says where.
    """
    from tmc_vem.mesh.make.limited import limited_size

    assert table.size is not None
    largest: Size
    if isinstance(table.size, float | int):
        largest = table.size
    else:
        try:
            largest = limited_size(regions, field_of(table.size, origin), table.growth)
        except InputError as error:
            raise InputError(f"mesh: size = {size_text(table.size)}: {error}") from None
    if not table.refine:
        return largest

    def size(points: Float) -> Float:
        h = evaluate_size(largest, points).copy()
        for place in table.refine:
            ends = np.asarray(place.near, dtype=float).reshape(-1, 2)
            if origin is not None:
                ends = np.array([near(end, origin) for end in ends.tolist()])
            away = np.maximum(distance_to_line(points, ends[0], ends[-1]) - place.within, 0.0)
            np.minimum(h, place.size + table.growth * away, out=h)
        return h

    return size


def distance_to_line(points: Float, start: Float, end: Float) -> Float:
    """Distance (n,) of points (n, 2) to a straight line between two points, which may coincide."""
    arm, d = points - start, end - start
    squared = float(d @ d)
    t = np.clip(arm @ d / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(points))
    distance: Float = np.hypot(*(arm - t[:, None] * d).T)
    return distance


def _of_sizes(table: MeshTable, regions: Sequence[Region], points: Mapping[str, Point], size: Size) -> PolygonMesh:
    """A mesh of a kind whose cells may be of many sizes.

    Raises:
        InputError: it cannot be made.
    """
    from tmc_vem.mesh.make.fitted import Fit, fitted_mesh
    from tmc_vem.mesh.make.triangles import triangle_mesh
    from tmc_vem.mesh.make.voronoi import UnresolvedError, voronoi_mesh

    def made(of: Size) -> PolygonMesh:
        if table.cells == VORONOI:
            return voronoi_mesh(regions, of, points)
        return triangle_mesh(regions, of, points, quadrilaterals=table.cells == QUADS)

    if table.fit:
        density = {VORONOI: POLYGONS, QUADS: QUADRILATERALS}.get(table.cells, TRIANGLES)
        fit = Fit(table.across, table.growth, table.smallest)
        return fitted_mesh(made, regions, size, points, fit, density=density, limit=cells_allowed(None))
    try:
        return made(size)
    except UnresolvedError as error:
        raise InputError(f"{error}; fit = true in [mesh] makes cells smaller by itself where they must be") from None
