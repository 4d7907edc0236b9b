"""The polygon mesh: an immutable set of compressed arrays that every algorithm works on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.validate import check_polygons
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Edges:
    """Unique edges of a mesh and how its cells run along them.

    Attributes:
        vertices_ev: (n_edges, 2) end vertices in the edge's own direction.
        cell_edges: edge of every side, parallel to ``PolygonMesh.cell_vertices``: side s of a cell joins its vertices s
            and s + 1.
        forward: whether the cell runs along the side in the edge's own direction.
        n_cells_e: (n_edges,) how many cells share the edge, 1 on the boundary.
    """

    vertices_ev: Int
    cell_edges: Int
    forward: NDArray[np.bool_]
    n_cells_e: Int

    def __len__(self) -> int:
        return len(self.vertices_ev)


@dataclass(frozen=True)
class PolygonMesh:
    """Plane mesh of simple polygons, counter-clockwise, validated once when it is made.

    Attributes:
        points_vx: (n_vertices, 2) coordinates.
        cell_offsets: (n_cells + 1,) where the vertices of each cell start in ``cell_vertices``.
        cell_vertices: vertices of all cells, one cell after the other, counter-clockwise.
        region_c: (n_cells,) index into ``region_names``.
        region_names: names of the regions.
        named_points: vertices that have a name, for supports, loads and probes.
        named_edges: sets of edges by name, each an (n, 2) array of end vertices.
        cell_data: (n_cells,) numbers of cells by name, such as a modulus.
        validate: check every polygon; switch off only for parts of a mesh that was checked as a whole.

    Raises:
        InputError: a polygon is clockwise, intersects itself, repeats a vertex or has no area; two cells overlap along
            an edge; a vertex belongs to no cell; a region, name or index is out of range. The message names the cell.
    """

    points_vx: Float
    cell_offsets: Int
    cell_vertices: Int
    region_c: Int
    region_names: tuple[str, ...] = ("domain",)
    named_points: Mapping[str, int] = field(default_factory=dict)
    named_edges: Mapping[str, Int] = field(default_factory=dict)
    cell_data: Mapping[str, Float] = field(default_factory=dict)
    validate: bool = field(default=True, repr=False)

    def __post_init__(self) -> None:
        for name, dtype in (
            ("points_vx", np.float64),
            ("cell_offsets", np.int64),
            ("cell_vertices", np.int64),
            ("region_c", np.int64),
        ):
            object.__setattr__(self, name, _frozen(getattr(self, name), dtype))
        edges = {name: _frozen(pairs, np.int64).reshape(-1, 2) for name, pairs in self.named_edges.items()}
        object.__setattr__(self, "named_points", MappingProxyType(dict(self.named_points)))
        object.__setattr__(self, "named_edges", MappingProxyType(edges))
        data = {name: _frozen(values, np.float64) for name, values in self.cell_data.items()}
        object.__setattr__(self, "cell_data", MappingProxyType(data))
        if not self.validate:
            return
        self._check_arrays()
        check_polygons(self.points_vx, self.cell_offsets, self.cell_vertices)
        self._check_connectivity()

    def __reduce__(self) -> tuple[Any, ...]:
        """What is sent to other ranks: what was given; a mesh that has been validated is not validated again."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        named = {name: dict(plain[name]) for name in ("named_points", "named_edges", "cell_data")}
        return _again, ({**plain, **named, "validate": False},)

    @staticmethod
    def from_cells(
        points_vx: Float | Sequence[Sequence[float]],
        cells: Sequence[Sequence[int]],
        region_c: Sequence[int] | Int | None = None,
        region_names: Sequence[str] = ("domain",),
        named_points: Mapping[str, int] | None = None,
        named_edges: Mapping[str, Int] | None = None,
    ) -> PolygonMesh:
        """Mesh from a list of vertex lists.

        Raises:
            InputError: as for the class.
        """
        sizes = [len(cell) for cell in cells]
        return PolygonMesh(
            points_vx=np.asarray(points_vx, dtype=float).reshape(-1, 2),
            cell_offsets=np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]),
            cell_vertices=np.array([v for cell in cells for v in cell], dtype=np.int64),
            region_c=np.zeros(len(cells), dtype=np.int64) if region_c is None else np.asarray(region_c),
            region_names=tuple(region_names),
            named_points=dict(named_points or {}),
            named_edges=dict(named_edges or {}),
        )

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cell_offsets) - 1

    @property
    def n_vertices(self) -> int:
        """Number of vertices."""
        return len(self.points_vx)

    @cached_property
    def n_sides_c(self) -> Int:
        """(n_cells,) number of vertices of each cell."""
        return np.diff(self.cell_offsets)

    def cell(self, c: int) -> Int:
        """Vertices of cell ``c``, counter-clockwise."""
        return self.cell_vertices[self.cell_offsets[c] : self.cell_offsets[c + 1]]

    def cells(self) -> Iterator[Int]:
        """The cells' vertex arrays, one after the other."""
        return (self.cell(c) for c in range(self.n_cells))

    def cells_by_size(self) -> Iterator[tuple[int, Int, Int]]:
        """Groups of cells with equally many vertices: (n_sides, cells (n,), vertices (n, n_sides))."""
        for n_sides in np.unique(self.n_sides_c):
            cells = np.flatnonzero(self.n_sides_c == n_sides)
            yield int(n_sides), cells, self.cell_vertices[self.cell_offsets[cells][:, None] + np.arange(n_sides)]

    @cached_property
    def edges(self) -> Edges:
        """Unique edges; an edge's own direction runs from its smaller to its larger vertex."""
        start = self.cell_vertices
        end = self._next_vertices()
        low, high = np.minimum(start, end), np.maximum(start, end)
        keys, cell_edges, counts = np.unique(low * self.n_vertices + high, return_inverse=True, return_counts=True)
        vertices_ev = np.stack([keys // self.n_vertices, keys % self.n_vertices], axis=1)
        return Edges(vertices_ev, cell_edges, start == low, counts)

    @cached_property
    def cells_of_edges(self) -> tuple[Int, Int]:
        """(n_edges,) cells on the left and on the right of each edge in its own direction, -1 where there is none."""
        edges = self.edges
        cell_of_side = np.repeat(np.arange(self.n_cells), self.n_sides_c)
        left, right = np.full((2, len(edges)), -1)
        left[edges.cell_edges[edges.forward]] = cell_of_side[edges.forward]
        right[edges.cell_edges[~edges.forward]] = cell_of_side[~edges.forward]
        return left, right

    def named_vertex(self, name: str) -> int:
        """Vertex with this name.

        Raises:
            InputError: there is none.
        """
        try:
            return int(self.named_points[name])
        except KeyError:
            known = ", ".join(sorted(self.named_points)) or "none"
            raise InputError(f"the mesh has no named point '{name}' (it has: {known})") from None

    def find_vertex(self, x: float, y: float, tolerance: float = 1e-6) -> int:
        """Vertex nearest to (x, y), up to ``tolerance`` times the size of the mesh: of single precision, or rounded.

        Raises:
            InputError: no vertex is there; the message gives the nearest.
        """
        distance = np.hypot(*(self.points_vx - (x, y)).T)
        nearest = int(np.argmin(distance))
        if distance[nearest] > tolerance * np.ptp(self.points_vx, axis=0).max():
            px, py = self.points_vx[nearest]
            raise InputError(f"no node at {_place(x, y)}: the nearest is vertex {nearest} at {_place(px, py)}")
        return nearest

    def _next_vertices(self) -> Int:
        following = np.roll(self.cell_vertices, -1)
        following[self.cell_offsets[1:] - 1] = self.cell_vertices[self.cell_offsets[:-1]]
        return following

    def _check_arrays(self) -> None:
        if self.n_cells < 1:
            raise InputError("the mesh has no cells")
        if self.cell_offsets[0] != 0 or self.cell_offsets[-1] != len(self.cell_vertices):
            raise InputError(
                f"cell_offsets run from {self.cell_offsets[0]} to {self.cell_offsets[-1]}; they must run from 0 to "
                f"the number of entries of cell_vertices, {len(self.cell_vertices)}"
            )
        if self.points_vx.ndim != 2 or self.points_vx.shape[1] != 2:
            raise InputError(f"points need shape (n, 2), got {self.points_vx.shape}")
        bad = np.flatnonzero(~np.isfinite(self.points_vx).all(axis=1))
        if len(bad):
            raise InputError(f"vertex {bad[0]} has a coordinate that is not a finite number: {self.points_vx[bad[0]]}")
        small = np.flatnonzero(self.n_sides_c < 3)
        if len(small):
            raise InputError(f"cell {small[0]} has {self.n_sides_c[small[0]]} vertices; a polygon needs at least 3")
        outside = np.flatnonzero((self.cell_vertices < 0) | (self.cell_vertices >= self.n_vertices))
        if len(outside):
            cell = int(np.searchsorted(self.cell_offsets, outside[0], side="right")) - 1
            raise InputError(
                f"cell {cell} refers to vertex {self.cell_vertices[outside[0]]}; there are {self.n_vertices} vertices"
            )
        if len(self.region_c) != self.n_cells:
            raise InputError(f"{len(self.region_c)} region numbers for {self.n_cells} cells")
        wrong = np.flatnonzero((self.region_c < 0) | (self.region_c >= len(self.region_names)))
        if len(wrong):
            raise InputError(
                f"cell {wrong[0]} is in region {self.region_c[wrong[0]]}, but the regions are "
                f"0 to {len(self.region_names) - 1} ({', '.join(self.region_names)})"
            )
        for name, vertex in self.named_points.items():
            if not 0 <= vertex < self.n_vertices:
                raise InputError(f"named point '{name}' has no node: vertex {vertex} of {self.n_vertices}")

    def _check_connectivity(self) -> None:
        edges = self.edges
        crowded = np.flatnonzero(edges.n_cells_e > 2)
        if len(crowded):
            a, b = edges.vertices_ev[crowded[0]]
            raise InputError(f"{edges.n_cells_e[crowded[0]]} cells share the edge between vertices {a} and {b}; 2 can")
        # two cells on one edge must run along it in opposite directions, else they lie on the same side of it
        forward = np.bincount(edges.cell_edges, weights=edges.forward, minlength=len(edges))
        folded = np.flatnonzero((edges.n_cells_e == 2) & (forward != 1))
        if len(folded):
            sides = np.flatnonzero(edges.cell_edges == folded[0])
            first, second = np.searchsorted(self.cell_offsets, sides, side="right") - 1
            raise InputError(f"cells {first} and {second} overlap: they lie on the same side of the edge they share")
        unused = np.setdiff1d(np.arange(self.n_vertices), self.cell_vertices)
        if len(unused):
            raise InputError(f"vertex {unused[0]} belongs to no cell ({len(unused)} such vertices): remove it")
        known = set(map(tuple, edges.vertices_ev.tolist())) if self.named_edges else set()
        for name, pairs in self.named_edges.items():
            for a, b in np.sort(np.asarray(pairs).reshape(-1, 2), axis=1).tolist():
                if (a, b) not in known:
                    raise InputError(f"named edges '{name}': vertices {a} and {b} are not joined by an edge")


def _place(x: float, y: float) -> str:
    """Coordinates with all their digits, to be copied."""
    return f"({', '.join(repr(float(value)).removesuffix('.0') for value in (x, y))})"


def _frozen(values: object, dtype: type) -> NDArray[Any]:
    """A copy that nobody can write to: the caller's array may change later."""
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def _again(given: Mapping[str, Any]) -> PolygonMesh:
    return PolygonMesh(**given)
