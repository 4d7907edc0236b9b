"""The polygon mesh of what a file says: the rules that hold for all formats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.cell_data import ORDER
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.mesh.files.regions import regions_of
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Points count as in a plane if they are off it by no more than this fraction of their extent: single precision will do.
FLAT = 1e-6
AXES = "xyz"
HUGE = 1e100


def assemble(record: Record, reading: Reading) -> PolygonMesh:
    """The mesh, not yet validated: cells counter-clockwise, without nodes that no cell uses; adds to the notes.

    Raises:
        InputError: there are no cells, they are in no plane, or a cell is in groups that overlap.
    """
    if not record.loops:
        raise InputError("it has no plane cells")
    sizes = np.array([len(loop) for loop in record.loops], dtype=np.int64)
    few = np.flatnonzero(sizes < 3)
    if len(few):
        raise InputError(f"cell {few[0]} has {sizes[few[0]]} vertices; a polygon needs at least 3")
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    flat = np.concatenate(record.loops).astype(np.int64)
    outside = np.flatnonzero((flat < 0) | (flat >= len(record.points)))
    if len(outside):
        cell = int(np.searchsorted(offsets, outside[0], side="right")) - 1
        raise InputError(f"cell {cell} refers to vertex {flat[outside[0]]}; there are {len(record.points)} vertices")
    used = np.unique(flat)
    points = _in_plane(record.points, used, record.notes)
    number = np.full(len(record.points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    flat = _counter_clockwise(points[used], number[flat], offsets, record.notes)
    _note_unused(record, used)

    names = _Names(reading.names)
    labels = [names.of(group, "region") for group in record.regions]
    region_c, region_names, notes = regions_of(len(sizes), record.regions, labels)
    record.notes += notes
    sides = _Sides(flat, offsets, region_c, len(used))
    named_edges = _edges(record, names, number)
    named_points: dict[str, int] = {}
    for group in record.nodes:
        _add_nodes(names.of(group, "point"), group, number, sides, named_points, named_edges, record.notes)
    names.check(labels)
    return PolygonMesh(
        points[used], offsets, flat, region_c, tuple(region_names), named_points,
        {name: np.concatenate(pairs) for name, pairs in named_edges.items()}, _kept(record, reading), validate=False,
    )  # fmt: skip


def _kept(record: Record, reading: Reading) -> dict[str, Float]:
    """The cell data that are asked for.

    Raises:
        InputError: one is not there.
    """
    for name in reading.cell_data:
        if name not in record.data:
            known = ", ".join(name for name in record.data if name != ORDER) or "none"
            raise InputError(f"there is no cell data '{name}' with a number for every cell (there are: {known})")
    return {name: record.data[name] for name in reading.cell_data}


def _in_plane(points: Float, used: Int, notes: list[str]) -> Float:
    """Plane coordinates (n, 2): x and y, or the two of three that vary.

    Raises:
        InputError: all three do.
    """
    if not len(points):
        return points
    if not np.isfinite(points[used]).all():
        return points[:, :2]  # which vertex it is, is said later
    far = used[np.abs(points[used]).max(axis=1) > HUGE]
    if len(far):
        raise InputError(f"vertex {far[0]} is at {points[far[0]].tolist()}: coordinates beyond {HUGE:g} are none")
    if points.shape[1] == 2:
        return points
    extent = np.ptp(points[used], axis=0)
    for constant in (2, 1, 0):
        if extent[constant] <= FLAT * extent.max():
            others = [axis for axis in range(3) if axis != constant]
            if constant != 2:
                notes.append(
                    f"the mesh lies in the {AXES[others[0]]}{AXES[others[1]]} plane: they are taken as x and y"
                )
            return points[:, others]
    low, high = points[used, 2].min(), points[used, 2].max()
    raise InputError(f"it is not a plane mesh: z runs from {low:g} to {high:g}; turn it into the xy plane")


def _counter_clockwise(points: Float, flat: Int, offsets: Int, notes: list[str]) -> Int:
    """Corners of all cells with clockwise ones reversed from their first on."""
    turned, sizes = [], np.diff(offsets)
    flat = flat.copy()
    for size in np.unique(sizes[sizes >= 3]).tolist():
        cells = np.flatnonzero(sizes == size)
        entries = offsets[cells][:, None] + np.arange(size)
        area = areas(points[flat[entries]])
        wrong = np.flatnonzero(area < 0.0)
        flat[entries[wrong, 1:]] = flat[entries[wrong, :0:-1]]
        turned += cells[wrong].tolist()
    if turned:
        first = sorted(turned)
        many = f"{len(turned)} cells are" if len(turned) > 1 else "a cell is"
        notes.append(f"{many} clockwise and turned: {_first_of('cell', first)}")
    return flat


def _note_unused(record: Record, used: Int) -> None:
    unused = np.setdiff1d(np.arange(len(record.points)), np.union1d(used, record.middles))
    if len(unused):
        many = f"{len(unused)} vertices belong" if len(unused) > 1 else "a vertex belongs"
        record.notes.append(f"{many} to no cell and {'are' if len(unused) > 1 else 'is'} left out: "
                            f"{_first_of('vertex', unused.tolist())}")  # fmt: skip


def _first_of(what: str, numbers: Sequence[int]) -> str:
    more = f" and {len(numbers) - 3} more" if len(numbers) > 3 else ""
    return f"{what} {', '.join(map(str, numbers[:3]))}{more}"


class _Names:
    """Names of groups: those that the user gives by number or old name, else those of the file."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self.given = given
        self.used: set[str] = set()
        self.known: list[str] = []

    def of(self, group: Group, kind: str) -> str:
        label = group.label(kind)
        self.known.append(label if group.number is None else f"{group.number} ({kind} {group.label(kind)})")
        keys = [label]
        # a number is that of a region if there is one, else that of a curve or point
        if group.number is not None and str(group.number) not in self.used:
            keys.append(str(group.number))
        for key in keys:
            if key in self.given:
                self.used.add(key)
                return self.given[key]
        return label

    def check(self, labels: Sequence[str]) -> None:
        """Refuse names for what is not there."""
        missing = [key for key in self.given if key not in self.used]
        if missing:
            known = ", ".join(dict.fromkeys(self.known)) or "none"
            raise InputError(f"names: there is no group '{missing[0]}' (there are: {known})")


class _Sides:
    """The sides of the cells, and which of them are on outlines or between regions."""

    def __init__(self, flat: Int, offsets: Int, region_c: Int, n_vertices: int) -> None:
        following = np.roll(flat, -1)
        following[offsets[1:] - 1] = flat[offsets[:-1]]
        low, high = np.minimum(flat, following), np.maximum(flat, following)
        keys, first, inverse, counts = np.unique(
            low * n_vertices + high, return_index=True, return_inverse=True, return_counts=True
        )
        region_s = np.repeat(region_c, np.diff(offsets))
        mixed = np.zeros(len(keys), dtype=bool)
        mixed[inverse[region_s != region_s[first][inverse]]] = True
        self.pairs = np.stack([keys // n_vertices, keys % n_vertices], axis=1)
        self.on_outline = (counts == 1) | mixed
        self.used = np.unique(flat)

    def between(self, vertices: Int, n_vertices: int, exact: bool) -> Int:
        """Sides (n, 2) with both ends among the vertices; only those on outlines, if these reach all the vertices."""
        inside = np.zeros(n_vertices, dtype=bool)
        inside[vertices] = True
        chosen = inside[self.pairs].all(axis=1)
        outer = chosen & self.on_outline
        if not exact and len(np.unique(self.pairs[outer])) == len(vertices):
            chosen = outer
        found: Int = self.pairs[chosen]
        return found


def _edges(record: Record, names: _Names, number: Int) -> dict[str, list[Int]]:
    """Groups of edges without those that no cell is at, such as construction lines."""
    found: dict[str, list[Int]] = {}
    for group in record.edges:
        name = names.of(group, "curve")
        pairs = number[_within(group.members, len(number), f"named edges '{name}'").reshape(-1, 2)]
        there = (pairs >= 0).all(axis=1)
        if not there.all():
            which = "none" if not there.any() else f"{int((~there).sum())}"
            record.notes.append(
                f"named edges '{name}': {which} of {len(pairs)} edges "
                + ("is at a cell: left out" if which == "none" else "are at no cell and left out")
            )
        if there.any():
            found.setdefault(name, []).append(pairs[there])
    return found


def _within(nodes: Int, n_nodes: int, what: str) -> Int:
    """The nodes, which must be there."""
    outside = nodes[(nodes < 0) | (nodes >= n_nodes)]
    if len(outside):
        raise InputError(f"{what} refers to vertex {outside[0]}; there are {n_nodes} vertices")
    return nodes


def _add_nodes(
    name: str, group: Group, number: Int, sides: _Sides, named_points: dict[str, int],
    named_edges: dict[str, list[Int]], notes: list[str],
) -> None:  # fmt: skip
    """A group of one node is a named point; of several, the sides between them are named edges."""
    there = number[_within(group.members, len(number), f"'{name}'")]
    vertices = np.unique(there[there >= 0])
    if not len(vertices):
        if len(group.members):
            notes.append(f"named point '{name}' is at no cell: left out")
        return
    exact = name.startswith("edges:")  # written so by earlier versions
    name = name.removeprefix("edges:").removeprefix("point:")
    if len(vertices) == 1:
        named_points[name] = int(vertices[0])
        return
    if len(vertices) == len(sides.used):  # all of them: no edges in particular
        return
    pairs = sides.between(vertices, len(number), exact)
    alone = np.setdiff1d(vertices, pairs)
    if len(pairs):
        named_edges.setdefault(name, []).append(pairs)
    if len(alone):
        called = [f"{name}#{n + 1}" for n in range(len(alone))]
        named_points.update(dict(zip(called, alone.tolist(), strict=True)))
        which = "" if not len(pairs) else f", and edges '{name}'"
        notes.append(f"'{name}' has {len(alone)} nodes that no side joins: points {', '.join(called[:3])}"
                     f"{' ...' if len(alone) > 3 else ''}{which}")  # fmt: skip
