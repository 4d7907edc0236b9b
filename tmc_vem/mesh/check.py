"""Find everything that is wrong with a mesh, by cell or vertex, and repair what can be repaired without guessing.

:class:`PolygonMesh` refuses a bad mesh at its first fault. Here all faults are listed, including those between cells:
overlaps, gaps, and vertices that lie on a side of a cell without being one of its hanging nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.validate import check_polygons
from tmc_vem.mesh.weld import weld

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# A hole narrower than this fraction of the edges around it is a gap between cells that should touch.
NARROW = 0.05


@dataclass(frozen=True)
class Fault:
    """Something wrong with a mesh.

    Attributes:
        kind: 'structure', 'polygon', 'clockwise', 'duplicate cell', 'duplicate vertex', 'unreferenced vertex',
            'T-junction', 'overlap' or 'gap'.
        message: what is wrong and where; names the cell or vertex.
        fixable: whether :func:`repair` removes it.
    """

    kind: str
    message: str
    fixable: bool = False


def find_faults(mesh: PolygonMesh) -> list[Fault]:
    """All faults of a mesh, made with ``validate=False`` or not; an empty list for a good one."""
    try:
        mesh._check_arrays()
    except InputError as error:
        return [Fault("structure", str(error))]
    faults = [*_bad_polygons(mesh), *_duplicate_cells(mesh), *_vertices(mesh)]
    if not any(fault.kind in ("polygon", "duplicate cell") for fault in faults):
        faults += _between_cells(mesh)
    if not faults:
        try:
            mesh._check_connectivity()
        except InputError as error:
            faults.append(Fault("structure", str(error)))
    return faults


def repair(mesh: PolygonMesh) -> PolygonMesh:
    """A valid mesh: duplicate vertices and cells merged, clockwise cells turned, unused vertices dropped, and vertices
    that lie on the sides of other cells inserted there as hanging nodes.

    Raises:
        InputError: something else is wrong, such as an overlap; the message names the cell.
    """
    from scipy.spatial import cKDTree

    mesh._check_arrays()
    # vertices: coincident ones become the first of them
    tolerance = _tolerance(mesh)
    pairs = cKDTree(mesh.points_vx).query_pairs(tolerance, output_type="ndarray")
    label = np.arange(mesh.n_vertices)
    for a, b in np.sort(pairs, axis=1)[np.lexsort(np.sort(pairs, axis=1).T)].tolist():
        label[b] = min(label[b], label[a])
    cells, region, seen = [], [], set()
    for c, loop in enumerate(mesh.cells()):
        named = label[loop]
        named = named[named != np.roll(named, 1)]
        key = tuple(sorted(named.tolist()))
        if key in seen or len(named) < 3:
            continue
        seen.add(key)
        backwards = areas(mesh.points_vx[named][None])[0] < 0.0
        cells.append(named[::-1] if backwards else named)
        region.append(int(mesh.region_c[c]))
    used, local = np.unique(np.concatenate(cells), return_inverse=True)
    number = np.full(mesh.n_vertices, -1)
    number[used] = np.arange(len(used))
    clean = PolygonMesh.from_cells(
        mesh.points_vx[used],
        [part.tolist() for part in np.split(local, np.cumsum([len(cell) for cell in cells])[:-1])],
        region,
        mesh.region_names,
        {name: int(number[label[v]]) for name, v in mesh.named_points.items() if number[label[v]] >= 0},
        {name: number[label[pairs]] for name, pairs in mesh.named_edges.items()},
    )
    mesh = weld([clean])
    left = find_faults(mesh)
    if left:
        raise InputError(f"{left[0].message} ({len(left)} faults that cannot be repaired)")
    return mesh


def _tolerance(mesh: PolygonMesh) -> float:
    return 1e-9 * float(np.ptp(mesh.points_vx, axis=0).max())


def _bad_polygons(mesh: PolygonMesh) -> Iterator[Fault]:
    """Faults of single polygons. Good ones are passed over in groups, the others are looked at one by one."""
    for _, cells, vertices_cv in mesh.cells_by_size():
        size = vertices_cv.shape[1]
        pending = [cells]
        while pending:
            group = pending.pop()
            entries = mesh.cell_offsets[group][:, None] + np.arange(size)
            try:
                check_polygons(mesh.points_vx, np.arange(len(group) + 1) * size, mesh.cell_vertices[entries].ravel())
            except InputError as error:
                if len(group) > 1:
                    pending += np.array_split(group, 2)
                    continue
                message = str(error).replace("cell 0 ", f"cell {group[0]} ")
                fixable = "clockwise" in message or "length zero" in message
                yield Fault("clockwise" if "clockwise" in message else "polygon", message, fixable)


def _duplicate_cells(mesh: PolygonMesh) -> Iterator[Fault]:
    for _, cells, vertices_cv in mesh.cells_by_size():
        _, first, inverse = np.unique(np.sort(vertices_cv, axis=1), axis=0, return_index=True, return_inverse=True)
        original = cells[first[inverse.reshape(-1)]]
        for c, o in zip(cells[original != cells].tolist(), original[original != cells].tolist(), strict=True):
            yield Fault("duplicate cell", f"cell {c} has the same vertices as cell {o}: remove one of them", True)


def _vertices(mesh: PolygonMesh) -> Iterator[Fault]:
    from scipy.spatial import cKDTree

    for a, b in sorted(map(sorted, cKDTree(mesh.points_vx).query_pairs(_tolerance(mesh)))):
        x, y = mesh.points_vx[a]
        yield Fault("duplicate vertex", f"vertices {a} and {b} are both at ({x:.6g}, {y:.6g}): merge them", True)
    for v in np.setdiff1d(np.arange(mesh.n_vertices), mesh.cell_vertices).tolist():
        yield Fault("unreferenced vertex", f"vertex {v} belongs to no cell: remove it", True)


def _between_cells(mesh: PolygonMesh) -> Iterator[Fault]:
    """T-junctions, overlaps and gaps; all show at sides that only one cell has.

    If cells overlap, then a part of the boundary of one layer of cells lies within a cell of the other layer.
    """
    import shapely

    once = np.flatnonzero(mesh.edges.n_cells_e[mesh.edges.cell_edges] == 1)
    cell_s = np.searchsorted(mesh.cell_offsets, once, side="right") - 1
    pairs = mesh.edges.vertices_ev[mesh.edges.cell_edges[once]]
    sides = shapely.linestrings(mesh.points_vx[pairs])
    tolerance = _tolerance(mesh)

    candidates = np.unique(pairs)
    which, side = shapely.STRtree(sides).query(
        shapely.points(mesh.points_vx[candidates]), predicate="dwithin", distance=tolerance
    )
    for v, s in zip(candidates[which].tolist(), side.tolist(), strict=True):
        a, b = pairs[s].tolist()
        near_end = np.hypot(*(mesh.points_vx[[a, b]] - mesh.points_vx[v]).T).min() <= tolerance
        if v not in (a, b) and not near_end:
            yield Fault(
                "T-junction",
                f"vertex {v} lies on the side of cell {cell_s[s]} between vertices {a} and {b} but is not one of its "
                "vertices: insert it as a hanging node",
                True,
            )

    cells = _shapes(mesh)
    side, cell = shapely.STRtree(cells).query(sides, predicate="intersects")
    foreign = cell != cell_s[side]
    side, cell = side[foreign], cell[foreign]
    common, index = shapely.get_parts(shapely.intersection(sides[side], cells[cell]), return_index=True)
    long = (shapely.get_type_id(common) == shapely.GeometryType.LINESTRING) & (shapely.length(common) > 10 * tolerance)
    common, index = common[long], index[long]
    middle = shapely.line_interpolate_point(common, 0.5, normalized=True)
    deep = index[shapely.distance(middle, shapely.boundary(cells[cell[index]])) > tolerance]
    found = {tuple(sorted(pair)) for pair in zip(cell_s[side[deep]].tolist(), cell[deep].tolist(), strict=True)}
    edges = mesh.edges
    forward = np.bincount(edges.cell_edges, weights=edges.forward, minlength=len(edges))
    for e in np.flatnonzero((edges.n_cells_e > 2) | ((edges.n_cells_e == 2) & (forward != 1))).tolist():
        at = np.searchsorted(mesh.cell_offsets, np.flatnonzero(edges.cell_edges == e), side="right") - 1
        clockwise = (
            areas(mesh.points_vx[mesh.cell(int(at[0]))][None])[0]
            * areas(mesh.points_vx[mesh.cell(int(at[1]))][None])[0]
        )
        if clockwise > 0.0:
            found.add((int(at[0]), int(at[1])))
    for a, b in sorted(found):
        yield Fault("overlap", f"cells {a} and {b} overlap")
    yield from _gaps(mesh, pairs, cells)


def _shapes(mesh: PolygonMesh) -> NDArray[np.object_]:
    """Shapely polygons (n_cells,)."""
    import shapely

    rings = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    lines = shapely.linearrings(mesh.points_vx[mesh.cell_vertices], indices=rings)
    polygons: NDArray[np.object_] = shapely.polygons(lines)
    return polygons


def _gaps(mesh: PolygonMesh, pairs: Int, cells: NDArray[np.object_]) -> Iterator[Fault]:
    """Narrow holes: slits between cells that should share their sides."""
    import shapely

    boundary_cells = np.unique(
        np.searchsorted(
            mesh.cell_offsets,
            np.flatnonzero(mesh.edges.n_cells_e[mesh.edges.cell_edges] == 1),
            side="right",
        )
        - 1
    )
    length = np.hypot(*(mesh.points_vx[pairs[:, 1]] - mesh.points_vx[pairs[:, 0]]).T)
    width = NARROW * float(np.median(length))
    joined = shapely.union_all(cells[boundary_cells])
    closed = shapely.buffer(shapely.buffer(joined, 0.5 * width, join_style="mitre"), -0.5 * width, join_style="mitre")
    filled = shapely.get_parts(shapely.difference(closed, joined))
    spots = shapely.point_on_surface(filled)
    real = (shapely.area(filled) > 0.1 * width * width) & (shapely.area(filled) > 1e-6 * float(np.median(length)) ** 2)
    tree = shapely.STRtree(cells[boundary_cells])
    for spot in spots[real]:
        near = boundary_cells[tree.query(spot, predicate="dwithin", distance=width)]
        names = " and ".join(str(c) for c in near[:2].tolist())
        yield Fault("gap", f"there is a gap at ({spot.x:.6g}, {spot.y:.6g}) between cells {names}: move their vertices")
