"""What surrounds a design: passive regions, borders between regions, places where something is held or acts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.design.outline import noded, polygons_of, union_of_cells
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import is_called

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Place = tuple[float, float]

# Places are one, and on a line, up to this fraction of the mesh's extent.
ON = 1e-7
# Outlines end at least this far from corners, and pass through named points that are as near, in cells.
MARGIN = 0.6
# A border turns where the angle between its edges is larger than that of this cosine.
STRAIGHT = np.cos(np.radians(30.0))


@dataclass(frozen=True)
class Domain:
    """A mesh of a design as geometry.

    Attributes:
        mesh: the mesh.
        design: names of its design regions.
        solid: names of passive regions that are solid; the others are medium.
        held: names of points and edges where something is held.
        loaded: names of those where a force acts.

    Raises:
        InputError: there is no such region, point or edge.
    """

    mesh: PolygonMesh
    design: tuple[str, ...]
    solid: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    loaded: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in (*self.design, *self.solid):
            if name not in self.mesh.region_names:
                raise InputError(f"there is no region '{name}' (there are: {', '.join(self.mesh.region_names)})")
        for name in (*self.held, *self.loaded):
            _ = self.place(name)

    @cached_property
    def regions(self) -> Mapping[str, Any]:
        """Every region as a shapely MultiPolygon."""
        mesh = self.mesh
        cells = {name: np.flatnonzero(mesh.region_c == r) for r, name in enumerate(mesh.region_names)}
        return {name: polygons_of(union_of_cells(mesh, chosen)) for name, chosen in cells.items() if len(chosen)}

    @cached_property
    def room(self) -> Any:
        """All design regions together."""
        return self._together(self.design)

    @cached_property
    def solids(self) -> Any:
        """All passive solids together."""
        return self._together(self.solid)

    @cached_property
    def media(self) -> Any:
        """All passive media together."""
        return self._together([name for name in self.regions if name not in (*self.design, *self.solid)])

    @cached_property
    def tolerance(self) -> float:
        """Length below which places are one."""
        return ON * float(np.ptp(self.mesh.points_vx, axis=0).max())

    @cached_property
    def borders_ev(self) -> Int:
        """(n, 2) vertices of the edges between regions, and around the mesh."""
        left, right = (np.append(self.mesh.region_c, -1)[cells_e] for cells_e in self.mesh.cells_of_edges)
        borders: Int = self.mesh.edges.vertices_ev[left != right]
        return borders

    @cached_property
    def corners(self) -> frozenset[int]:
        """Vertices of borders that stay where they are: where a border turns, branches or changes its name, and points
        with a name."""
        mesh, names = self.mesh, self._names_of_edges()
        at: dict[int, list[int]] = {}
        for a, b in self.borders_ev.tolist():
            at.setdefault(a, []).append(b)
            at.setdefault(b, []).append(a)
        found = set(mesh.named_points.values()) & at.keys()
        for v, others in at.items():
            if len(others) != 2:
                found.add(v)
                continue
            (a, b) = others
            to, back = mesh.points_vx[a] - mesh.points_vx[v], mesh.points_vx[v] - mesh.points_vx[b]
            named = [names.get((min(v, o), max(v, o)), frozenset()) for o in others]
            if named[0] != named[1] or to @ back < STRAIGHT * np.hypot(*to) * np.hypot(*back):
                found.add(v)
        return frozenset(found)

    @cached_property
    def turns(self) -> Float:
        """(n, 2) corners at which the borders around the design regions turn."""
        ends = {(x, y) for run in self.runs for x, y in run[[0, -1]].tolist()}
        found: Float = np.array([place for place in sorted(ends) if not self.is_straight_at(place)]).reshape(-1, 2)
        return found

    @cached_property
    def runs(self) -> list[Float]:
        """Borders around the design regions from corner to corner, as points (n, 2); closed if there is no corner."""
        design = [n for n, name in enumerate(self.mesh.region_names) if name in self.design]
        region_c = np.append(self.mesh.region_c, -1)
        left, right = (np.isin(region_c[cells_e], design) for cells_e in self.mesh.cells_of_edges)
        ends = self.mesh.edges.vertices_ev[left != right]
        return [self.mesh.points_vx[run] for run in chains(ends, self.corners)]

    def pieces(self, lines: Sequence[Float]) -> list[Any]:
        """Polygons that lines (n, 2) within the design regions, which end at borders, cut the whole mesh into."""
        import shapely

        cut = noded(self.mesh.points_vx[self.borders_ev], lines)
        whole = shapely.union_all([shapely.LineString(line) for line in [*cut, *lines]])
        faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(whole)))
        inside = [region for region in self.regions.values() for region in region.geoms]
        tree = shapely.STRtree(inside)
        found = np.unique(tree.query(shapely.point_on_surface(faces), predicate="intersects")[0])
        of_mesh: list[Any] = faces[found].tolist()
        return of_mesh

    def region_of(self, piece: Any) -> str:
        """The region that a piece belongs to."""
        import shapely

        place = shapely.point_on_surface(piece)
        return min(self.regions, key=lambda name: float(self.regions[name].distance(place)))

    @cached_property
    def run_lines(self) -> Any:
        """The same as an array of shapely LineStrings."""
        import shapely

        return np.array([shapely.LineString(run) for run in self.runs])

    def is_straight_at(self, place: Place) -> bool:
        """Whether a border goes straight on at a place."""
        x = np.asarray(place)
        ends = [run[[1, 0]] if np.hypot(*(run[0] - x)) <= self.tolerance else run[[-2, -1]] for run in self.runs]
        arms = [end[0] - end[1] for end in ends if np.hypot(*(end[1] - x)) <= self.tolerance]
        if len(arms) != 2:
            return False
        return bool(-arms[0] @ arms[1] >= STRAIGHT * np.hypot(*arms[0]) * np.hypot(*arms[1]))

    def place(self, name: str) -> Any:
        """Points or edges of a name as a shapely geometry.

        Raises:
            InputError: there are none.
        """
        import shapely

        mesh = self.mesh
        if name in mesh.named_edges:
            return shapely.MultiLineString(list(mesh.points_vx[mesh.named_edges[name]]))
        vertices = [v for point, v in mesh.named_points.items() if is_called(point, name)]
        if not vertices:
            known = ", ".join([*mesh.named_points, *mesh.named_edges]) or "none"
            raise InputError(f"'{name}' is neither a point nor edges of the mesh (there are: {known})")
        return shapely.MultiPoint(mesh.points_vx[vertices])

    def ends_of_edges(self, name: str) -> list[Place]:
        """Places where edges of a name begin or end; none if it is a point's."""
        if name not in self.mesh.named_edges:
            return []
        vertices, counts = np.unique(self.mesh.named_edges[name], return_counts=True)
        return [(x, y) for x, y in self.mesh.points_vx[vertices[counts == 1]].tolist()]

    def touches(self, solid: Any, name: str, slack: float = 0.0) -> bool:
        """Whether a place is on a solid: a point in or on it, or off it by some slack; edges along it."""
        place = self.place(name)
        if place.geom_type == "MultiPoint":
            return bool(solid.distance(place) <= 10.0 * self.tolerance + slack)
        return self.contact(solid, place)

    def require_touched(self, parts: Sequence[Any], slack: float = 0.0) -> None:
        """Check that something solid is held, if anything is, and that all forces act on something solid.

        Raises:
            InputError: they do not.
        """

        def away(name: str) -> float:
            return float(min(part.distance(self.place(name)) for part in parts))

        remedy = "make the cells there solid in the design (a passive region), or use a lower level"
        if self.held and not any(self.touches(part, name, slack) for part in parts for name in self.held):
            nearest = min(self.held, key=away)
            raise InputError(
                f"the solid is not connected to a support: '{nearest}' is nearest, {away(nearest):.3g} away from "
                f"anything solid; {remedy}"
            )
        for name in self.loaded:
            if not any(self.touches(part, name, slack) for part in parts):
                raise InputError(
                    f"load: nothing is solid at '{name}', the nearest solid is {away(name):.3g} away: {remedy}"
                )

    def contact(self, one: Any, other: Any) -> bool:
        """Whether two geometries share more than points."""
        if one.is_empty or other.is_empty or one.distance(other) > self.tolerance:
            return False
        line = one.boundary if one.geom_type.endswith("Polygon") else one
        around = other.buffer(self.tolerance, quad_segs=1)
        return bool(line.intersection(around).length > 20.0 * self.tolerance)

    def _together(self, names: Iterable[str]) -> Any:
        import shapely

        return polygons_of(shapely.coverage_union_all([self.regions[name] for name in names if name in self.regions]))

    def _names_of_edges(self) -> Mapping[tuple[int, int], frozenset[str]]:
        found: dict[tuple[int, int], frozenset[str]] = {}
        for name, pairs in self.mesh.named_edges.items():
            for a, b in np.sort(np.asarray(pairs), axis=1).tolist():
                found[a, b] = found.get((a, b), frozenset()) | {name}
        return found


def chains(ends_ev: Int, breaks: Iterable[int]) -> list[list[int]]:
    """Vertices of the chains that edges form, from one of some vertices to the next; closed where there is none.

    Args:
        ends_ev: (n_edges, 2) vertices of the edges.
        breaks: vertices where chains end; those where other than two edges meet do so anyway.
    """
    at: dict[int, list[int]] = {}
    for e, (a, b) in enumerate(ends_ev.tolist()):
        at.setdefault(a, []).append(e)
        at.setdefault(b, []).append(e)
    stops = {v for v, edges in at.items() if len(edges) != 2} | (set(breaks) & at.keys())
    left = dict(enumerate(map(tuple, ends_ev.tolist())))
    found = []
    for start in [*sorted(stops), *sorted(at.keys() - stops)]:
        for first in at[start]:
            if first not in left:
                continue
            chain = [start]
            edge: int | None = first
            while edge is not None:
                a, b = left.pop(edge)
                chain.append(b if a == chain[-1] else a)
                here = chain[-1]
                edge = None if here in stops or here == start else next((e for e in at[here] if e in left), None)
            found.append(chain)
    return found


def vertex_places(mesh: PolygonMesh, names: Sequence[str]) -> list[Place]:
    """Coordinates of the named points that go by some names."""
    vertices = [v for point, v in mesh.named_points.items() if any(is_called(point, name) for name in names)]
    return [(x, y) for x, y in mesh.points_vx[sorted(set(vertices))].tolist()]
