"""gmsh's mesh files (.msh), versions 2, 4.0 and 4.1, as text or binary, partitioned ones too.

All physical groups of an entity count, of surfaces, curves and points. Format: https://gmsh.info/doc/texinfo/gmsh.html
#MSH-file-format, and for 4.0 the manual of gmsh 4.0.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.msh_tokens import Tokens, tokens_of
from tmc_vem.mesh.files.record import Group, Reading, Record, refuse_kinds
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Entity = tuple[int, int]  # dimension and tag

# type of element: dimension, corners (points of lines and points too), nodes
TYPES = {
    15: (0, 1, 1), 1: (1, 2, 2), 8: (1, 2, 3), 26: (1, 2, 4), 27: (1, 2, 5), 28: (1, 2, 6), 62: (1, 2, 7),
    63: (1, 2, 8), 64: (1, 2, 9), 65: (1, 2, 10), 66: (1, 2, 11), 2: (2, 3, 3), 9: (2, 3, 6), 20: (2, 3, 9),
    21: (2, 3, 10), 22: (2, 3, 12), 23: (2, 3, 15), 24: (2, 3, 15), 25: (2, 3, 21), 42: (2, 3, 28), 43: (2, 3, 36),
    44: (2, 3, 45), 45: (2, 3, 55), 46: (2, 3, 66), 52: (2, 3, 18), 53: (2, 3, 21), 54: (2, 3, 24), 55: (2, 3, 27),
    56: (2, 3, 30), 3: (2, 4, 4), 10: (2, 4, 9), 16: (2, 4, 8), 36: (2, 4, 16), 37: (2, 4, 25), 38: (2, 4, 36),
    39: (2, 4, 12), 40: (2, 4, 16), 41: (2, 4, 20), 47: (2, 4, 49), 48: (2, 4, 64), 49: (2, 4, 81), 50: (2, 4, 100),
    51: (2, 4, 121), 57: (2, 4, 24), 58: (2, 4, 28), 59: (2, 4, 32), 60: (2, 4, 36), 61: (2, 4, 40), 4: (3, 4, 4),
    5: (3, 8, 8), 6: (3, 6, 6), 7: (3, 5, 5), 11: (3, 4, 10), 12: (3, 8, 27), 13: (3, 6, 18), 14: (3, 5, 14),
    17: (3, 8, 20), 18: (3, 6, 15), 19: (3, 5, 13), 29: (3, 4, 20), 30: (3, 4, 35), 31: (3, 4, 56), 92: (3, 8, 64),
    93: (3, 8, 125),
}  # fmt: skip


@dataclass
class _File:
    """What sections of the file say, with nodes by their tags."""

    names: dict[Entity, str] = field(default_factory=dict)  # of physical groups
    groups: dict[Entity, list[int]] = field(default_factory=dict)  # physical groups of every entity
    tags: list[Int] = field(default_factory=list)
    points: list[Float] = field(default_factory=list)
    # type, physical groups and nodes (n, n_nodes) of elements
    elements: list[tuple[int, tuple[int, ...], Int]] = field(default_factory=list)


def read(path: Path, reading: Reading) -> Record:
    """Read a .msh file.

    Raises:
        InputError: it is not one, is of a version that cannot be read, is damaged, or has cells that are not plane.
    """
    content = path.read_bytes()
    sections = dict(_sections(content))
    if "MeshFormat" not in sections:
        raise InputError("it does not start with $MeshFormat: it is no mesh of gmsh from version 2 on")
    head, _, rest = sections["MeshFormat"].strip().partition(b"\n")
    words = head.split()
    try:
        version, binary, size = float(words[0]), int(words[1]), int(words[2])
    except (ValueError, IndexError):
        raise InputError(f"its format '{head.decode('latin-1')[:40]}' is not understood") from None
    if not (2.0 <= version < 3.0 or version in (4.0, 4.1)) or size != 8:
        raise InputError(
            f"its format {version:g} cannot be read: save it as MSH 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)"
        )
    order = ">" if binary and rest[:4] == (1).to_bytes(4, "big") else "<"

    def tokens(name: str) -> Tokens:
        if name not in sections:
            raise InputError(f"it has no ${name}: it is cut off, or no mesh was made before it was saved")
        return tokens_of(sections[name], order if binary else None, name)

    found = _File(names=_physical_names(sections.get("PhysicalNames", b"")))
    if version < 3.0:
        _read_2(found, tokens)
    else:
        _read_4(found, tokens, sections, version)
    return _record(found)


def _sections(content: bytes) -> Iterator[tuple[str, bytes]]:
    """Names and contents of the sections; of several with a name, dict() keeps the last."""
    at = content.find(b"$")
    while at >= 0:
        end = content.find(b"\n", at)
        if end < 0:
            return
        name = content[at + 1 : end].strip()
        closing = content.find(b"$End" + name, end)
        if closing < 0:
            raise InputError(f"${name.decode('latin-1')[:40]} has no end: the file is cut off")
        yield name.decode("latin-1"), content[end + 1 : closing]
        at = content.find(b"$", closing + 4 + len(name))


def _physical_names(section: bytes) -> dict[Entity, str]:
    try:
        text = section.decode("utf-8")
    except UnicodeDecodeError:
        text = section.decode("latin-1")
    names = {}
    for line in text.splitlines()[1:]:
        head, quote, rest = line.partition('"')
        words = head.split()
        if not quote or len(words) != 2:
            if line.strip():
                raise InputError(f"the physical name '{line.strip()[:40]}' is not understood")
            continue
        try:
            names[int(words[0]), abs(int(words[1]))] = rest.rpartition('"')[0] if '"' in rest else rest.strip()
        except ValueError:
            raise InputError(f"the physical name '{line.strip()[:40]}' is not understood") from None
    return names


# -- version 2 ---------------------------------------------------------------------------------------------------------


def _read_2(found: _File, tokens: Callable[[str], Tokens]) -> None:
    nodes = tokens("Nodes")
    tags, *coordinates = nodes.records(nodes.count(), "iddd")
    nodes.check_end()
    found.tags.append(np.asarray(tags, dtype=np.int64))
    found.points.append(np.stack([np.asarray(x, dtype=float) for x in coordinates], axis=1))
    elements = tokens("Elements")
    for kind, group, rows in _runs(_rows_2(elements, elements.count())):
        found.elements.append((kind, (group,) if group else (), np.array(rows, dtype=np.int64)))
    elements.check_end()


def _rows_2(elements: Tokens, n: int) -> Iterator[tuple[int, int, list[int]]]:
    """Type, physical group and nodes of every element: text has a head for each, a binary file for several."""
    if not elements.binary:
        words, at = elements.rest(), 0
        for _ in range(n):
            _, kind, n_tags = words[at : at + 3] if at + 3 <= len(words) else (0, 0, 0)
            first = at + 3 + max(n_tags, 0)
            at = first + _type(kind)[2]
            if at > len(words):
                raise InputError(f"$Elements announces {n} elements and ends before: it is cut off or damaged")
            yield kind, abs(words[first - n_tags]) if n_tags > 0 else 0, words[first:at]
        if at != len(words):
            raise InputError(f"$Elements has more than the {n} elements that it announces")
        return
    while n > 0:
        kind, n_here, n_tags = elements.ints(3).tolist()
        if n_here < 1 or n_tags < 0:
            raise InputError("$Elements is damaged: a block has no elements")
        width = 1 + n_tags + _type(kind)[2]
        for row in elements.ints(n_here * width).reshape(n_here, width).tolist():
            yield kind, abs(row[1]) if n_tags else 0, row[1 + n_tags :]
        n -= n_here


def _runs(rows: Iterator[tuple[int, int, list[int]]]) -> Iterator[tuple[int, int, list[list[int]]]]:
    """Elements of equal type and group that follow each other."""
    for (kind, group), same in itertools.groupby(rows, key=lambda row: row[:2]):
        yield kind, group, [nodes for _, _, nodes in same]


def _type(kind: int) -> tuple[int, int, int]:
    if kind not in TYPES:
        raise InputError(f"elements of gmsh's type {kind} cannot be read; plane cells are, of any order")
    return TYPES[kind]


# -- version 4 ---------------------------------------------------------------------------------------------------------


def _read_4(found: _File, tokens: Callable[[str], Tokens], sections: Mapping[str, bytes], version: float) -> None:
    for name in ("Entities", "PartitionedEntities"):
        if name in sections:
            _entities(found, tokens(name), version, name.startswith("P"))
    nodes = tokens("Nodes")
    n_blocks = int(nodes.sizes(4 if version > 4.05 else 2)[0])
    for _ in range(n_blocks):
        first, second, parametric = nodes.ints(3).tolist()
        n = int(nodes.sizes(1)[0])
        dimension = first if version > 4.05 else second
        more = dimension if parametric and 0 <= dimension <= 3 else 0
        if version > 4.05:
            found.tags.append(nodes.sizes(n))
            found.points.append(nodes.floats(n * (3 + more)).reshape(n, 3 + more)[:, :3])
        else:
            tags, *coordinates = nodes.records(n, "iddd" + "d" * more)
            found.tags.append(np.asarray(tags, dtype=np.int64))
            found.points.append(np.stack([np.asarray(x, dtype=float) for x in coordinates[:3]], axis=1))
    nodes.check_end()
    elements = tokens("Elements")
    n_blocks = int(elements.sizes(4 if version > 4.05 else 2)[0])
    for _ in range(n_blocks):
        first, second, kind = elements.ints(3).tolist()
        n = int(elements.sizes(1)[0])
        dimension, _, n_nodes = _type(kind)
        tag = second if version > 4.05 else first
        width = 1 + n_nodes
        rows = elements.sizes(n * width) if version > 4.05 else elements.ints(n * width)
        groups = tuple(found.groups.get((dimension, tag), ()))
        found.elements.append((kind, groups, rows.reshape(n, width)[:, 1:]))
    elements.check_end()


def _entities(found: _File, entities: Tokens, version: float, partitioned: bool) -> None:
    """Physical groups of all entities."""
    if partitioned:
        entities.sizes(1)
        n_ghosts = int(entities.sizes(1)[0])
        entities.ints(2 * n_ghosts)
    counts = entities.sizes(4).tolist()
    for dimension, n in enumerate(counts):
        for _ in range(n):
            tag = int(entities.ints(1)[0])
            parent = dimension
            if partitioned:
                parent = int(entities.ints(2)[0])
                entities.ints(int(entities.sizes(1)[0]))
            entities.floats(3 if dimension == 0 and version > 4.05 else 6)
            groups = np.abs(entities.ints(int(entities.sizes(1)[0]))).tolist()
            # borders of parts have the groups of what they cut, which are not of their own dimension
            found.groups[dimension, tag] = list(dict.fromkeys(groups)) if parent == dimension else []
            if dimension > 0:
                entities.ints(int(entities.sizes(1)[0]))


# -- the record --------------------------------------------------------------------------------------------------------


def _repeated(found: _File) -> bool:
    """Whether a cell is there more than once."""
    for corners in (3, 4):
        kinds = [nodes[:, :corners] for kind, _, nodes in found.elements if _type(kind)[:2] == (2, corners)]
        rows = np.sort(np.concatenate([*kinds, np.empty((0, corners), dtype=np.int64)]), axis=1)
        rows = rows[np.lexsort(rows.T)]
        if (rows[1:] == rows[:-1]).all(axis=1).any():
            return True
    return False


def _record(found: _File) -> Record:
    tags = np.concatenate([*found.tags, np.empty(0, dtype=np.int64)])
    points = np.concatenate([*found.points, np.zeros((0, 3))])
    order = np.argsort(tags, kind="stable")
    ordered = tags[order]
    twice = np.flatnonzero(np.diff(ordered) == 0)
    if len(twice):
        raise InputError(f"node {ordered[twice[0]]} is there twice")

    def numbers(nodes: Int) -> Int:
        at = np.searchsorted(ordered, nodes)
        at[at == len(ordered)] = 0
        unknown = nodes[ordered[at] != nodes] if len(ordered) else nodes.ravel()
        if len(unknown):
            raise InputError(f"an element has the node {unknown[0]}, which is not there")
        result: Int = order[at]
        return result

    members: dict[Entity, list[Int]] = {}
    loops: list[Int] = []
    middles = [np.empty(0, dtype=np.int64)]
    known: dict[tuple[int, ...], tuple[int, set[int]]] = {}  # cell and groups by its nodes
    solids: list[str] = []
    repeated = _repeated(found)
    for kind, groups, nodes in found.elements:
        dimension, n_corners, _ = _type(kind)
        if dimension == 3:
            solids += [f"gmsh {kind}"] * len(nodes)
            continue
        local = numbers(nodes)
        if dimension < 2:
            for group in groups:
                members.setdefault((dimension, group), []).append(local[:, : dimension + 1])
            middles.append(local[:, dimension + 1 :].ravel())
            continue
        middles.append(local[:, n_corners:].ravel())
        if not repeated:
            cells = len(loops) + np.arange(len(local))
            loops += list(local[:, :n_corners])
            for group in groups:
                members.setdefault((2, group), []).append(cells)
            continue
        for loop in local[:, :n_corners]:
            # version 2 repeats a cell for every further group that it is in
            cell, there = known.setdefault(tuple(sorted(loop.tolist())), (len(loops), set()))
            if cell == len(loops) or there & set(groups) or not groups:
                cell = len(loops)
                loops.append(loop)
            there |= set(groups)
            for group in groups:
                members.setdefault((2, group), []).append(np.array([cell]))
    refuse_kinds([], solids)
    record = Record(points, loops, middles=np.unique(np.concatenate(middles)))
    for (dimension, number), parts in sorted(members.items()):
        joined = np.concatenate(parts)
        nodes = joined if dimension == 1 else joined.ravel()
        kinds = (record.nodes, record.edges, record.regions)
        kinds[dimension].append(Group(nodes, found.names.get((dimension, number)), number))
    return record
