"""Faults between cells: slits, T-junctions, overlaps and gaps. All show at sides that only one cell has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.faults import Fault, tolerance_of
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# A hole narrower than this fraction of the sides along it is a gap between cells that should touch.
NARROW = 0.05
# Vertices of the outline closer than this fraction of the sides there are meant to be one: coordinates were rounded.
NEAR = 1e-3
# Two sides that meet at a smaller angle (degrees), seen from outside, make a notch or cusp of the outline.
NOTCH = 45.0


@dataclass(frozen=True)
class Outline:
    """The sides that only one cell has, in the direction of their cells.

    Attributes:
        mesh: the mesh.
        pairs_sv: (n, 2) their vertices.
        cell_s: (n,) their cells.
    """

    mesh: PolygonMesh
    pairs_sv: Int
    cell_s: Int

    @staticmethod
    def of(mesh: PolygonMesh) -> Outline:
        """The outline of a mesh whose arrays are in order."""
        once = np.flatnonzero(mesh.edges.n_cells_e[mesh.edges.cell_edges] == 1)
        pairs = mesh.edges.vertices_ev[mesh.edges.cell_edges[once]]
        forward = mesh.edges.forward[once]
        directed = np.where(forward[:, None], pairs, pairs[:, ::-1])
        return Outline(mesh, directed, np.searchsorted(mesh.cell_offsets, once, side="right") - 1)

    @cached_property
    def vertices(self) -> Int:
        """(n,) vertices on it."""
        return np.unique(self.pairs_sv)

    @cached_property
    def length_s(self) -> Float:
        """(n,) lengths of the sides."""
        length: Float = np.hypot(
            *(self.mesh.points_vx[self.pairs_sv[:, 1]] - self.mesh.points_vx[self.pairs_sv[:, 0]]).T
        )
        return length

    @cached_property
    def scale_v(self) -> Float:
        """(n_vertices,) length of the longest side of the outline at each vertex; 0 elsewhere."""
        scale = np.zeros(self.mesh.n_vertices)
        np.maximum.at(scale, self.pairs_sv.ravel(), np.repeat(self.length_s, 2))
        return scale

    @cached_property
    def sides(self) -> NDArray[np.object_]:
        """(n,) the sides as lines of shapely."""
        import shapely

        lines: NDArray[np.object_] = shapely.linestrings(self.mesh.points_vx[self.pairs_sv])
        return lines


def near_vertices(outline: Outline, fraction: float = NEAR) -> list[tuple[int, int]]:
    """Pairs of vertices of the outline, of no common cell, that are closer than a fraction of the sides there.

    Those at the same place are not among them.
    """
    from scipy.spatial import cKDTree

    mesh, vertices = outline.mesh, outline.vertices
    if not len(vertices):
        return []
    points, reach = mesh.points_vx[vertices], fraction * outline.scale_v[vertices]
    found = cKDTree(points).query_ball_point(points, reach)
    tolerance = tolerance_of(mesh)
    pairs = []
    for n, others in enumerate(found):
        for m in others:
            distance = np.hypot(*(points[n] - points[m])) if m > n else 0.0
            if tolerance < distance <= min(reach[n], reach[m]):
                pairs.append((int(vertices[n]), int(vertices[m])))
    if not pairs:
        return []
    cells = _cells_of(mesh, np.unique(np.array(pairs)))
    return [(a, b) for a, b in pairs if not cells[a] & cells[b]]


def _cells_of(mesh: PolygonMesh, vertices: Int) -> dict[int, set[int]]:
    """Cells of each of some vertices."""
    entries = np.flatnonzero(np.isin(mesh.cell_vertices, vertices))
    cells: dict[int, set[int]] = {int(v): set() for v in vertices}
    owners = np.searchsorted(mesh.cell_offsets, entries, side="right") - 1
    for v, c in zip(mesh.cell_vertices[entries].tolist(), owners.tolist(), strict=True):
        cells[v].add(c)
    return cells


def slits(outline: Outline) -> Iterator[Fault]:
    """Vertices that nearly coincide."""
    for a, b in near_vertices(outline):
        (x, y), (s, t) = outline.mesh.points_vx[[a, b]]
        yield Fault(
            "near vertices",
            f"vertices {a} and {b} nearly coincide at ({x:.6g}, {y:.6g}), {np.hypot(x - s, y - t):.3g} apart: "
            "the cells there do not hang together",
            True, f"vertices {a} and {b}",
        )  # fmt: skip


def t_junctions(outline: Outline, fraction: float = NEAR) -> Iterator[Fault]:
    """Vertices that lie on a side of a cell, up to a fraction of its length, and are none of the cell's."""
    import shapely

    mesh, candidates = outline.mesh, outline.vertices
    reach_s = np.maximum(fraction * outline.length_s, tolerance_of(mesh))
    tree = shapely.STRtree(shapely.points(mesh.points_vx[candidates]))
    side, which = tree.query(outline.sides, predicate="dwithin", distance=reach_s)
    cells = _cells_of(mesh, candidates[np.unique(which)])
    for v, s in sorted(zip(candidates[which].tolist(), side.tolist(), strict=True)):
        a, b = outline.pairs_sv[s].tolist()
        near_end = np.hypot(*(mesh.points_vx[[a, b]] - mesh.points_vx[v]).T).min() <= reach_s[s]
        if v not in (a, b) and not near_end and int(outline.cell_s[s]) not in cells[v]:
            yield Fault(
                "T-junction",
                f"vertex {v} lies on the side of cell {outline.cell_s[s]} between vertices {min(a, b)} and {max(a, b)} "
                "but is not one of its vertices: insert it as a hanging node",
                True, f"vertex {v}",
            )  # fmt: skip


def overlaps(outline: Outline, shapes: NDArray[np.object_]) -> Iterator[Fault]:
    """Cells that overlap: then a part of the boundary of one layer of cells lies within a cell of the other layer."""
    import shapely

    mesh, sides, cell_s, tolerance = outline.mesh, outline.sides, outline.cell_s, tolerance_of(outline.mesh)
    side, cell = shapely.STRtree(shapes).query(sides, predicate="intersects")
    foreign = cell != cell_s[side]
    side, cell = side[foreign], cell[foreign]
    common, index = shapely.get_parts(shapely.intersection(sides[side], shapes[cell]), return_index=True)
    long = (shapely.get_type_id(common) == shapely.GeometryType.LINESTRING) & (shapely.length(common) > 10 * tolerance)
    common, index = common[long], index[long]
    middle = shapely.line_interpolate_point(common, 0.5, normalized=True)
    deep = index[shapely.distance(middle, shapely.boundary(shapes[cell[index]])) > tolerance]
    found = {tuple(sorted(pair)) for pair in zip(cell_s[side[deep]].tolist(), cell[deep].tolist(), strict=True)}
    edges = mesh.edges
    forward = np.bincount(edges.cell_edges, weights=edges.forward, minlength=len(edges))
    for e in np.flatnonzero((edges.n_cells_e > 2) | ((edges.n_cells_e == 2) & (forward != 1))).tolist():
        at = np.searchsorted(mesh.cell_offsets, np.flatnonzero(edges.cell_edges == e), side="right") - 1
        signed = [areas(mesh.points_vx[mesh.cell(int(c))][None])[0] for c in at[:2]]
        if signed[0] * signed[1] > 0.0:
            found.add((int(at[0]), int(at[1])))
    for a, b in sorted(found):
        yield Fault("overlap", f"cells {a} and {b} overlap", False, f"cells {a} and {b}")


def shapes_of(mesh: PolygonMesh) -> NDArray[np.object_]:
    """Shapely polygons (n_cells,)."""
    import shapely

    rings = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    lines = shapely.linearrings(mesh.points_vx[mesh.cell_vertices], indices=rings)
    polygons: NDArray[np.object_] = shapely.polygons(lines)
    return polygons


def gaps(outline: Outline, shapes: NDArray[np.object_]) -> Iterator[Fault]:
    """Narrow holes and slits between cells that should share their sides; notches and cusps of the outline are none."""
    import shapely

    median = float(np.median(outline.length_s))
    width = NARROW * median
    boundary_cells = np.unique(outline.cell_s)
    joined = shapely.union_all(shapes[boundary_cells])
    closed = shapely.buffer(shapely.buffer(joined, 0.5 * width, join_style="mitre"), -0.5 * width, join_style="mitre")
    filled = shapely.get_parts(shapely.difference(closed, joined))
    filled = filled[shapely.area(filled) > 1e-3 * width * width]
    if not len(filled):
        return
    # cells behind those of the boundary fill most of it
    all_cells, all_sides = shapely.STRtree(shapes), shapely.STRtree(outline.sides)
    apexes = shapely.points(outline.mesh.points_vx[_notches(outline)])
    small = 1e-6 * width
    for whole in filled:
        rest = shapely.difference(whole, shapely.union_all(shapes[all_cells.query(whole)]))
        for piece in shapely.get_parts(rest):
            if piece.area <= 0.1 * width * width or piece.area <= 1e-6 * median**2:
                continue
            along = all_sides.query(piece, predicate="dwithin", distance=small)
            local = float(np.median(outline.length_s[along])) if len(along) else median
            if 2.0 * piece.area / piece.length > 0.5 * NARROW * local * 1.5:
                continue
            rim = shapely.union_all(shapely.intersection(outline.sides[along], shapely.buffer(piece, small)))
            enclosed = rim.length >= (1.0 - 1e-3) * piece.length
            if not enclosed and (shapely.distance(apexes, piece) <= small).any():
                continue
            spot = piece.point_on_surface()
            near = boundary_cells[shapely.STRtree(shapes[boundary_cells]).query(spot, predicate="dwithin",
                                                                               distance=width)]  # fmt: skip
            names = " and ".join(str(c) for c in near[:2].tolist())
            yield Fault(
                "gap", f"there is a gap at ({spot.x:.6g}, {spot.y:.6g}) between cells {names}: move their vertices",
                False, f"({spot.x:.6g}, {spot.y:.6g})",
            )  # fmt: skip


def _notches(outline: Outline) -> Int:
    """Vertices where two sides of the outline meet at a small angle, seen from outside."""
    points, pairs = outline.mesh.points_vx, outline.pairs_sv
    n = len(pairs)
    vertex = np.concatenate([pairs[:, 0], pairs[:, 1]])
    other = np.concatenate([pairs[:, 1], pairs[:, 0]])
    arrives = np.repeat([False, True], n)  # outside lies counter-clockwise of sides that arrive
    angle = np.degrees(np.arctan2(*(points[other] - points[vertex]).T[::-1])) % 360.0
    order = np.lexsort([angle, vertex])
    vertex, angle, arrives = vertex[order], angle[order], arrives[order]
    first = np.searchsorted(vertex, vertex, side="left")
    last = np.searchsorted(vertex, vertex, side="right") - 1
    following = np.where(np.arange(2 * n) == last, first, np.minimum(np.arange(2 * n) + 1, 2 * n - 1))
    opening = (angle[following] - angle) % 360.0
    sharp = arrives & (following != np.arange(2 * n)) & (opening < NOTCH)
    found: Int = np.unique(vertex[sharp])
    return found


def parts_of(mesh: PolygonMesh) -> Int:
    """(n_cells,) number of the part, of cells that share sides with each other, that each cell is in."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    owner = np.repeat(np.arange(mesh.n_cells), mesh.n_sides_c)
    shape = (mesh.n_cells, len(mesh.edges))
    incidence = coo_array((np.ones(len(owner), dtype=np.int8), (owner, mesh.edges.cell_edges)), shape=shape).tocsr()
    _, part = connected_components(incidence @ incidence.T, directed=False)
    return np.asarray(part, dtype=np.int64)
