"""Where a design is solid: level lines of densities that are constant in the cells of a polygon mesh.

The densities become a continuous function: the mean of the design cells that meet there, weighted with their areas, at
vertices and in the middle of sides, in the middle of a cell its own density, and linear in the triangles between. So
bars and gaps that are one cell wide keep their width, a staircase becomes a slope, and lines end on the edges of the
mesh. Passive cells do not count: a solid is not thinner where it lies against one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_within
from tmc_vem.vem.spaces.delaunay import delaunay_pieces
from tmc_vem.vem.spaces.quadrature import star_shaped

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Values that are closer to the level than this are above it: a line through a vertex goes round it.
ON_LEVEL = 1e-6
# Levels that are looked at for the one with the volume of the densities, which it has up to this fraction.
HALF, BETWEEN, SAME_VOLUME = 0.5, (0.01, 0.99), 0.01
# Densities may be beyond 0 and 1 by this, from an optimiser's rounding.
ROUNDED = 1e-6


@dataclass(frozen=True)
class DensityField:
    """Densities as a continuous function, linear in triangles.

    Attributes:
        points_px: (n_points, 2) vertices of the mesh, then middles of cells, then of sides.
        triangles_tp: (n_triangles, 3) counter-clockwise, of the design cells alone.
        value_p: (n_points,) density; 0 where there is no design cell.
        edges_ev: (n_edges, 2) vertices of the edges around the design cells.
        volume: sum of density times area of the design cells.
        design: the design cells' union, a shapely geometry.
        area_c: (n_cells,) area of every cell of the mesh, for sizes.
        mixed_c: (n_cells,) design cells that are neither above nor below 1/2 altogether.
    """

    points_px: Float
    triangles_tp: Int
    value_p: Float
    edges_ev: Int
    volume: float
    design: Any
    area_c: Float
    mixed_c: Bool

    @cached_property
    def cell_size(self) -> float:
        """Side of a square as large as the cells at the level line, or all design cells if there is no line."""
        chosen = self.area_c[self.mixed_c] if self.mixed_c.any() else self.area_c[self.area_c > 0.0]
        return float(np.sqrt(chosen.mean()))

    def above(self, points_nx: Float, level: float) -> Bool:
        """(n,) whether the function is above a level at points inside the design cells."""
        corners = self.points_px[self.triangles_tp]
        a, b, c = np.moveaxis(corners, 1, 0)
        twice = _cross(b - a, c - a)
        value_p = self._apart(level)
        found = np.zeros(len(points_nx), dtype=bool)
        for n, x in enumerate(points_nx):
            weights = (
                np.stack([_cross(b - x, c - x), _cross(c - x, a - x), _cross(a - x, b - x)], axis=1) / twice[:, None]
            )
            t = int(weights.min(axis=1).argmax())
            found[n] = weights[t] @ value_p[self.triangles_tp[t]] > level
        return found

    def lines(self, level: float) -> list[Float]:
        """Level lines as points (n, 2): closed ones have their first point again at the end, others end at an edge
        around the design cells."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.tri import Triangulation

        value_p = self._apart(level)
        inside = value_p[self.triangles_tp]
        if not (inside.min() < level < inside.max()):
            return []
        figure = Figure()
        FigureCanvasAgg(figure)
        used, triangles = np.unique(self.triangles_tp, return_inverse=True)
        triangulation = Triangulation(*self.points_px[used].T, triangles.reshape(-1, 3))
        found = figure.add_subplot().tricontour(triangulation, value_p[used], levels=[level]).allsegs[0]
        lines = [np.asarray(line, dtype=float) for line in found]
        return [line[np.r_[True, (np.diff(line, axis=0) != 0.0).any(axis=1)]] for line in lines]

    def area_above(self, level: float) -> float:
        """Area where the function is above a level."""
        value_tp = np.sort(self._apart(level)[self.triangles_tp], axis=1)
        a, b, c = np.moveaxis(self.points_px[self.triangles_tp], 1, 0)
        low, middle, high = value_tp.T
        part = (low > level).astype(float)
        one = (middle < level) & (high > level)  # the corner above is cut off; else that below
        two = (low < level) & (middle > level)
        part[one] = (high[one] - level) ** 2 / ((high - middle) * (high - low))[one]
        part[two] = 1.0 - (level - low[two]) ** 2 / ((middle - low) * (high - low))[two]
        return float(0.5 * (_cross(b - a, c - a) * part).sum())

    def solids(self, level: float) -> Any:
        """Where the function is above a level: a shapely MultiPolygon, whose parts touch in points at most.

        Raises:
            InputError: nothing is.
        """
        import shapely

        lines = self.lines(level)
        if not lines:
            inside = self.value_p[self.triangles_tp]
            if inside.min() > level - ON_LEVEL:
                return polygons_of(self.design)
            raise InputError(
                f"nothing is solid at level {level:g}: the densities reach {inside.max():.3g} at most; use a lower "
                "level, or a design of a larger volume"
            )
        pieces = [*noded(self.points_px[self.edges_ev], lines), *lines]
        faces = shapely.get_parts(shapely.polygonize([shapely.LineString(piece) for piece in pieces]))
        places = shapely.get_coordinates(shapely.point_on_surface(faces))
        shapely.prepare(self.design)
        chosen = np.flatnonzero(shapely.contains_xy(self.design, places))
        solid = chosen[self.above(places[chosen], level)]
        return shapely.MultiPolygon(faces[solid].tolist())

    def level_of_volume(self) -> float:
        """Level within whose lines the area is the volume of the densities.

        Raises:
            InputError: there is none to a percent, as large parts have one density between 0 and 1.
        """
        from scipy.optimize import brentq

        if abs(self.area_above(HALF) - self.volume) <= 1e-9 * self.volume:
            return HALF
        low, high = BETWEEN
        more = self.area_above(low) > self.volume
        if more and self.area_above(high) < self.volume:
            level = float(brentq(lambda level: self.area_above(level) - self.volume, low, high, xtol=1e-10))
        else:
            level = high if more else low
        found = self.area_above(level)
        if abs(found - self.volume) > SAME_VOLUME * self.volume:
            raise InputError(
                f"no level from {low:g} to {high:g} has the volume of the densities, {self.volume:.6g}: they are grey "
                f"in large parts, and {found:.6g} is above {level:.4g}; give the level (0.5), or a design that is more "
                "clearly solid and void"
            )
        return level

    def _apart(self, level: float) -> Float:
        value_p: Float = np.where(np.abs(self.value_p - level) < ON_LEVEL, level + ON_LEVEL, self.value_p)
        return value_p


def density_field(mesh: PolygonMesh, density_c: Float | Sequence[float], design_c: Bool) -> DensityField:
    """Densities of cells as a continuous function.

    Args:
        mesh: the mesh of the design.
        density_c: (n_cells,) density of every cell, from 0 to 1; those of other cells are not read.
        design_c: (n_cells,) which cells are design.

    Raises:
        InputError: there is no design cell, or a density is missing or out of range; the message names the cell.
    """
    density = np.asarray(density_c, dtype=float)
    if density.shape != (mesh.n_cells,):
        raise InputError(f"densities have shape {density.shape} for {mesh.n_cells} cells: give one for each cell")
    cells = np.flatnonzero(design_c)
    if not len(cells):
        raise InputError("no cell is a design cell: name the regions that have densities")
    bad = cells[~np.isfinite(density[cells])]
    if len(bad):
        raise InputError(f"cell {bad[0]} has density {density[bad[0]]}: it must be a number from 0 to 1")
    for c in cells[[density[cells].argmin(), density[cells].argmax()]].tolist():
        require_within(f"density of cell {c}", float(density[c]), -ROUNDED, 1.0 + ROUNDED)

    design = np.asarray(design_c, dtype=bool)
    density = np.where(design, density, 0.0)
    edges, n_vertices = mesh.edges, mesh.n_vertices
    hubs, middles = n_vertices, n_vertices + mesh.n_cells  # where the numbers of both begin
    area_c, hub_cx = np.zeros(mesh.n_cells), np.zeros((mesh.n_cells, 2))
    mass_p, sum_p = np.zeros((2, middles + len(edges)))
    corners: list[tuple[Int, Int]] = []
    triangles: list[Int] = []
    for n_sides, group, loops in mesh.cells_by_size():
        use = design[group]
        group, loops = group[use], loops[use]
        if not len(group):
            continue
        polygons = mesh.points_vx[loops]
        area_c[group], hub_cx[group] = areas(polygons), centroids(polygons)
        sides = middles + edges.cell_edges[mesh.cell_offsets[group][:, None] + np.arange(n_sides)]
        around = np.stack([loops, sides], axis=2).reshape(len(group), -1)
        corners.append((group, around))
        np.add.at(mass_p, around, area_c[group][:, None])
        np.add.at(sum_p, around, (area_c[group] * density[group])[:, None])
    points = np.concatenate([mesh.points_vx, hub_cx, mesh.points_vx[edges.vertices_ev].mean(axis=1)])
    value_p = sum_p / np.where(mass_p > 0.0, mass_p, 1.0)
    value_p[hubs:middles] = density
    mixed = np.zeros(mesh.n_cells, dtype=bool)
    for group, around in corners:
        star = star_shaped(points[around])
        hub = np.repeat(hubs + group[star], around.shape[1])
        triangles.append(np.column_stack([hub, around[star].ravel(), np.roll(around[star], -1, axis=1).ravel()]))
        triangles += [loop[of] for loop in around[~star] for of in _triangles(points[loop])]
        above = value_p[np.column_stack([around, hubs + group])] > 0.5
        mixed[group] = above.any(axis=1) & ~above.all(axis=1)
    left, right = (np.append(design, False)[cells_e] for cells_e in mesh.cells_of_edges)
    return DensityField(
        points_px=points,
        triangles_tp=np.concatenate(triangles),
        value_p=value_p,
        edges_ev=edges.vertices_ev[left != right],
        volume=float(area_c @ density),
        design=union_of_cells(mesh, cells),
        area_c=area_c,
        mixed_c=mixed,
    )


def noded(edges_ekx: Float, lines: Sequence[Float], on: float = np.inf) -> Iterator[Float]:
    """Edges (2, 2) cut where open lines end, each at the edge nearest to it.

    Args:
        edges_ekx: (n_edges, 2, 2) ends of straight edges.
        lines: lines (n, 2); those that end where they begin are closed.
        on: ends farther from all edges than this are left out.
    """
    import shapely

    ends = np.array([end for line in lines if not is_closed(line) for end in (line[0], line[-1])]).reshape(-1, 2)
    at: dict[int, list[tuple[float, Float]]] = {}
    if len(ends):
        tree = shapely.STRtree(shapely.linestrings(edges_ekx))
        (which, edge), away = tree.query_nearest(shapely.points(ends), all_matches=False, return_distance=True)
        for n, e, distance in zip(which.tolist(), edge.tolist(), away.tolist(), strict=True):
            if distance <= on:
                start, arm = edges_ekx[e, 0], edges_ekx[e, 1] - edges_ekx[e, 0]
                at.setdefault(e, []).append((float((ends[n] - start) @ arm), ends[n]))
    for e, (start, end) in enumerate(edges_ekx):
        inner = [point for _, point in sorted(at.get(e, []), key=lambda each: each[0])]
        points = np.array([start, *inner, end])
        for first, second in itertools.pairwise(points):
            if (first != second).any():
                yield np.stack([first, second])


def is_closed(line: Float) -> bool:
    """Whether a line ends where it begins."""
    return bool((line[0] == line[-1]).all())


def union_of_cells(mesh: PolygonMesh, cells: Int) -> Any:
    """Union of some cells as a shapely geometry with all their vertices."""
    import shapely

    return shapely.coverage_union_all([shapely.Polygon(mesh.points_vx[mesh.cell(c)]) for c in cells.tolist()])


def polygons_of(geometry: Any) -> Any:
    """The polygons of a shapely geometry as a MultiPolygon, without its lines and points."""
    import shapely

    parts = shapely.get_parts(shapely.get_parts(geometry))
    return shapely.MultiPolygon([part for part in parts if part.geom_type == "Polygon" and not part.is_empty])


def _triangles(polygon_vx: Float) -> list[list[list[int]]]:
    """Corners of the triangles of a polygon that is not star-shaped about its middle."""
    pieces = delaunay_pieces(polygon_vx)
    return [[[piece[0], piece[n], piece[n + 1]] for n in range(1, len(piece) - 1)] for piece in pieces]


def _cross(a: Float, b: Float) -> Float:
    cross: Float = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross
