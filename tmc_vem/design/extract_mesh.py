"""A body-fitted mesh in the outlines of a design, with the named points and edges of the design's mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.design.outline_domain import Domain, Place
from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.make.narrow import widths
from tmc_vem.mesh.make.outline import Region, Size, make_skeleton
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.optional import load

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Cells are no smaller than this fraction of the width below which gaps are closed.
SMALLEST = 0.2
# Outlines are close where the way between them makes an angle of at least this cosine with one of them.
FACING = 0.8
# By how much more finely narrow places are meshed where no mesh fits into them at first.
FINER = (1.0, 1.5, 2.5)
# So many of the nearest narrow places are asked how small cells are.
ASKED = 8
# Vertices that are tried for a named point inside a region.
TRIED = 6
# The middle of an edge along a curve is this close to it, in lengths of the edge.
ALONG = 0.2


def fitted_mesh(
    regions: Sequence[Region], domain: Domain, cell: float, options: ExtractOptions
) -> tuple[PolygonMesh, str | None]:
    """Mesh of regions, in which points and edges are named as in the design's mesh.

    Args:
        regions: their outlines.
        domain: the design's mesh as geometry.
        cell: size of its cells, a length.
        options: kind and size of the new cells.

    Returns:
        The mesh, and a sentence if it has another kind of cells, because those that were asked for do not fit.

    Raises:
        InputError: no mesh fits into the outlines, or a name has no place in it.
    """
    on, inside = named_places(regions, domain)
    mesh, failed = _made(regions, on, cell, options)
    note = None
    if mesh is None and options.cells == "voronoi" and _there_is_gmsh():
        mesh, _ = _made(regions, on, cell, replace(options, cells="triangles"))
        note = f"triangles instead of Voronoi cells: {failed}"
    if mesh is None:
        raise InputError(
            f"the outlines of the design cannot be meshed: {failed} (a wider narrowest = {options.narrowest:g}, a "
            "smaller size or other cells may help)"
        )
    mesh = replace(mesh, named_edges=named_edges(mesh, domain), validate=False)
    for name, place in inside.items():
        mesh = with_point(mesh, name, place)
    return mesh, note


def _made(
    regions: Sequence[Region], points: Mapping[str, Place], cell: float, options: ExtractOptions
) -> tuple[PolygonMesh | None, InputError | None]:
    """A mesh, with smaller cells in narrow places if it takes them; without one, why not."""
    from tmc_vem.mesh.make.triangles import triangle_mesh
    from tmc_vem.mesh.make.voronoi import voronoi_mesh

    failed = None
    for finer in FINER:
        closer = replace(options, across=options.across * finer, growth=options.growth / np.sqrt(finer))
        size = local_size(regions, cell, closer)
        try:
            if options.cells == "voronoi":
                return voronoi_mesh(regions, size, points), None
            return triangle_mesh(regions, size, points, quadrilaterals=options.cells == "quadrilaterals"), None
        except InputError as error:
            failed = failed or error
    return None, failed


def _there_is_gmsh() -> bool:
    try:
        load("gmsh", "triangles need")
    except InputError:
        return False
    return True


def named_places(regions: Sequence[Region], domain: Domain) -> tuple[dict[str, Place], dict[str, Place]]:
    """Named points on the outlines, and those inside a region."""
    curves = [curve for region in regions for curve in region.curves()]
    on: dict[str, Place] = {}
    inside: dict[str, Place] = {}
    for name, vertex in domain.mesh.named_points.items():
        x, y = domain.mesh.points_vx[vertex].tolist()
        away = min(curve.parameter_of((x, y))[1] for curve in curves)
        (on if away <= domain.tolerance else inside)[name] = (x, y)
    return on, inside


def local_size(regions: Sequence[Region], cell: float, options: ExtractOptions) -> Size:
    """Size of cells: smaller where outlines face each other closely, or have short pieces between corners."""
    largest = cell if options.size is None else options.size
    smallest = min(largest, SMALLEST * options.narrowest * cell)
    skeleton = make_skeleton(regions, 0.5 * largest)
    width_n, _ = widths(skeleton, FACING, both=False)
    narrow = np.flatnonzero(width_n < options.across * largest)
    curves = [curve for region in regions for curve in region.curves() if curve.length < 2.0 * largest]
    short = [curve.at(np.linspace(0.0, 1.0, 3)) for curve in curves]
    places = np.concatenate([skeleton.nodes_nx[narrow], *short])
    h = np.concatenate([width_n[narrow] / options.across, *(np.full(3, 0.5 * curve.length) for curve in curves)])
    if not len(places):
        return largest
    return _graded(places, np.maximum(h, smallest), largest, options.growth)


def _graded(places: Float, size_n: Float, largest: float, growth: float) -> Callable[[Float], Float]:
    """Sizes of places that grow with the distance from them."""
    from scipy.spatial import cKDTree

    order = np.argsort(size_n)
    places, size_n = places[order], size_n[order].copy()
    for n in range(len(places)):  # a place near a much smaller one is smaller too
        np.minimum(size_n, size_n[n] + growth * np.hypot(*(places - places[n]).T), out=size_n)
    tree, asked = cKDTree(places), min(ASKED, len(places))

    def size(points: Float) -> Float:
        distance, nearest = tree.query(points, k=asked)
        h = (size_n[nearest] + growth * distance).reshape(len(points), -1).min(axis=1)
        found: Float = np.minimum(h, largest)
        return found

    return size


def named_edges(mesh: PolygonMesh, domain: Domain) -> dict[str, Int]:
    """Edges of outlines that lie along those of a name in the design's mesh.

    Raises:
        InputError: nothing is left of a name, because its edges are inside a region.
    """
    import shapely

    left, right = (np.append(mesh.region_c, -1)[cells_e] for cells_e in mesh.cells_of_edges)
    borders = mesh.edges.vertices_ev[left != right]
    ends = mesh.points_vx[borders]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    found = {}
    for name, pairs in domain.mesh.named_edges.items():
        if not len(pairs):
            continue
        along = shapely.MultiLineString(list(domain.mesh.points_vx[pairs]))
        shapely.prepare(along)
        on = shapely.dwithin(along, shapely.points(ends), domain.tolerance).all(axis=1)
        on &= shapely.distance(along, shapely.points(ends.mean(axis=1))) <= ALONG * length
        if not on.any():
            raise InputError(
                f"edges '{name}' are inside a region of the extracted design, whose mesh follows outlines only: leave "
                "the name out of the design's mesh, or put its edges between two regions"
            )
        found[name] = borders[on]
    return found


def with_point(mesh: PolygonMesh, name: str, place: Place) -> PolygonMesh:
    """The mesh with a vertex inside a region moved to a place, and named.

    Raises:
        InputError: no vertex can be moved there without harm to its cells.
    """
    left, right = (np.append(mesh.region_c, -1)[cells_e] for cells_e in mesh.cells_of_edges)
    fixed = np.zeros(mesh.n_vertices, dtype=bool)
    fixed[mesh.edges.vertices_ev[left != right]] = True
    fixed[list(mesh.named_points.values())] = True
    away = np.where(fixed, np.inf, np.hypot(*(mesh.points_vx - place).T))
    for vertex in np.argsort(away)[:TRIED].tolist():
        points = mesh.points_vx.copy()
        points[vertex] = place
        if np.isfinite(away[vertex]) and _good(mesh, points, vertex):
            named = {**mesh.named_points, name: vertex}
            return replace(mesh, points_vx=points, named_points=named, validate=False)
    raise InputError(
        f"named point '{name}' at ({place[0]:.6g}, {place[1]:.6g}) lies inside a region of the extracted design, and "
        "no vertex can be moved there: use smaller cells (size), or put it on an outline of the design's mesh"
    )


def _good(mesh: PolygonMesh, points: Float, vertex: int) -> bool:
    """Whether all cells at a vertex are star-shaped about their centroid."""
    cells = np.unique(
        np.searchsorted(mesh.cell_offsets, np.flatnonzero(mesh.cell_vertices == vertex), side="right") - 1
    )
    polygons: list[Any] = [points[mesh.cell(c)][None] for c in cells.tolist()]
    return all(bool(star_shaped_about(p, centroids(p), tolerance=0.05).all()) for p in polygons)
