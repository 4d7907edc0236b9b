"""Arrays of cell data as groups: regions by value, and the marks that this program writes."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.record import Group, Record
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]
Data = Mapping[str, NDArray[np.generic]]

# Marks: what number a cell has, and which region, edges or point it is of.
ORDER, REGION, POINT, EDGES = "cell_number", "region:", "point:", "edges:"
# Cell data that are regions' numbers; the first that is there counts.
REGION_DATA = ("gmsh:physical", "region", "MaterialIds")
NONE = np.empty(0, dtype=np.int64)


def quoted(name: str) -> str:
    """A name as array names of VTK files are: without spaces, quotes and what is not ASCII."""
    keep = {chr(n) for n in range(33, 127)} - set('%"<>&')
    return "".join(ch if ch in keep else "".join(f"%{byte:02X}" for byte in ch.encode()) for ch in name)


def unquoted(name: str) -> str:
    """The name of which :func:`quoted` makes this one."""
    return unquote(name)


def add_groups(
    record: Record, data: Data, cells: Int, region_data: str | None, edges: tuple[Int, Int] = (NONE, NONE),
    nodes: tuple[Int, Int] = (NONE, NONE),
) -> None:  # fmt: skip
    """Put cells in order and into the groups that arrays tell.

    Args:
        record: has cells; gets groups, and the arrays of numbers.
        data: arrays by name, a value for every entry of the file.
        cells: entry of every cell.
        region_data: array to take regions from, or None for the usual ones.
        edges: entries of edges, and their nodes (n, 2).
        nodes: entries of single nodes, and these.

    Raises:
        InputError: the array is not there, or its values are not whole numbers.
    """
    arrays = {unquoted(name): np.asarray(values) for name, values in data.items()}
    if ORDER in arrays and arrays[ORDER].ndim == 1:
        stored = arrays[ORDER][cells]
        if np.array_equal(np.sort(stored), np.arange(len(cells))):
            order = np.argsort(stored)
            record.loops = [record.loops[c] for c in order]
            cells = cells[order]
    record.data = {
        name: values[cells].reshape(-1).astype(np.float64)
        for name, values in arrays.items()
        if values.size == len(values) and values.dtype.kind in "iufb"
    }
    for name, values in arrays.items():
        for prefix, entries, groups in (
            (REGION, cells, record.regions), (EDGES, edges[0], record.edges), (POINT, nodes[0], record.nodes),
        ):  # fmt: skip
            if name.startswith(prefix) and values.ndim == 1:
                marked = np.flatnonzero(values[entries])
                members = marked if prefix == REGION else (edges[1][marked] if prefix == EDGES else nodes[1][marked])
                if len(members):
                    groups.append(Group(members, name[len(prefix) :]))
    marks = any(name.startswith(REGION) for name in arrays)
    if region_data is not None and region_data not in arrays:
        known = ", ".join(arrays) or "none"
        raise InputError(f"region_data: there is no cell data '{region_data}' (there are: {known})")
    wanted = region_data or next((name for name in REGION_DATA if name in arrays), None)
    if wanted is not None and (region_data is not None or not marks):
        values = whole_numbers(arrays[wanted], wanted)
        record.regions = by_value(values[cells], zero=wanted != "gmsh:physical")
        for kind, (entries, members) in ((record.edges, edges), (record.nodes, nodes)):
            if wanted == "gmsh:physical":
                kind += [
                    Group(members[group.members], number=group.number)
                    for group in by_value(values[entries], zero=False)
                ]
    elif not marks:
        _offer(record, arrays, cells)


def by_value(values: Int, *, zero: bool) -> list[Group]:
    """A group for every value; in gmsh's numbers 0 stands for none."""
    return [
        Group(np.flatnonzero(values == value), number=int(value)) for value in np.unique(values) if zero or value != 0
    ]


def whole_numbers(values: NDArray[np.generic], name: str) -> Int:
    """Cell data as numbers of regions.

    Raises:
        InputError: they are not whole, or not one a cell.
    """
    flat = np.asarray(values).reshape(len(values), -1) if len(values) else np.zeros((0, 1))
    if flat.shape[1] != 1 or flat.dtype.kind not in "iufb":
        raise InputError(f"cell data '{name}' is no number a cell: it cannot tell regions")
    numbers = flat[:, 0]
    with np.errstate(invalid="ignore"):
        whole = numbers.astype(np.int64)
    wrong = np.flatnonzero(whole != numbers)
    if len(wrong):
        raise InputError(f"cell data '{name}' is {numbers[wrong[0]]} for cell {wrong[0]}: regions need whole numbers")
    return whole


def _offer(record: Record, arrays: Data, cells: Int) -> None:
    """Say which array may tell regions, if none of the usual ones is there."""
    for name, values in arrays.items():
        if values.ndim == 1 and values.dtype.kind in "iuf" and name != ORDER:
            found = np.unique(values[cells])
            n = len(found) if (np.round(found) == found).all() else 0
            if 1 < n <= 100 and n < len(cells):
                record.notes.append(
                    f"all cells are one region; cell data '{name}' has {n} values: region_data = \"{name}\" makes "
                    "regions of them"
                )
