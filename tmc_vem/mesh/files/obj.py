"""Wavefront OBJ: faces of any number of sides; groups, materials or objects are regions.

Named points and edges, which OBJ does not know, are in comments of the files that this program writes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tmc_vem.mesh.files.cell_data import unquoted
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.mesh.files.text import lines_of, shown_line
from tmc_vem.support.errors import InputError

OWN = "# polygon mesh; groups are regions"
# of a file in which a name ends with a backslash, after which a line would go on in the next
QUOTED = "percent-encoded names"


def read(path: Path, reading: Reading) -> Record:
    """Read a .obj file.

    Raises:
        InputError: a line is not understood, or there are no faces.
    """
    points: list[list[float]] = []
    loops: list[list[int]] = []
    by_group: dict[str, list[int]] = {}
    by_object: dict[str, list[int]] = {}
    marks: list[tuple[str, str]] = []
    edges: list[list[int]] = []
    group, thing, has_groups = "", "", False
    plain_name: Callable[[str], str] = str
    for n, line in lines_of(path, continued="\\"):
        word, rest = ([*line.split(None, 1), "", ""])[:2]
        plain = rest.split("#")[0]
        try:
            if word == "v":
                values = [float(value) for value in plain.split()]
                if len(values) < 2:
                    raise ValueError("a vertex needs x and y")
                points.append(([*values, 0.0])[:3])
            elif word in ("f", "fo"):
                loops.append([_vertex(entry, len(points)) for entry in plain.split()])
                by_group.setdefault(group, []).append(len(loops) - 1)
                by_object.setdefault(thing, []).append(len(loops) - 1)
            elif word == "l":
                chain = [_vertex(entry, len(points)) for entry in plain.split()]
                edges += [list(pair) for pair in itertools.pairwise(chain)]
            elif word in ("g", "usemtl"):
                group, has_groups = rest.strip(), True
            elif word == "o":
                thing = rest.strip()
            elif word == "#" and rest.startswith(("region ", "point ", "edges ")):
                kind, mark = rest.split(" ", 1)
                marks.append((kind, mark))
            elif line == f"{OWN}; {QUOTED}":
                plain_name = unquoted
        except ValueError as error:
            raise InputError(f"line {n}: '{shown_line(line)}' is not understood: {error}") from None
    if not loops:
        raise InputError("it has no faces")
    found = by_group if has_groups else by_object
    listed = [name for kind, name in marks if kind == "region"]
    found = {name: found[name] for name in dict.fromkeys([*listed, *found]) if found.get(name)}
    record = Record(
        np.array(points, dtype=float).reshape(-1, 3), [np.array(loop, dtype=np.int64) for loop in loops],
        [Group(np.array(cells), plain_name(name)) for name, cells in found.items() if name],
    )  # fmt: skip
    if edges:
        record.edges.append(Group(np.array(edges), "lines"))
    for kind, mark in marks:
        _add(record, kind, mark, plain_name)
    return record


def _vertex(entry: str, n_points: int) -> int:
    number = int(entry.split("/")[0])
    if number == 0:
        raise ValueError("vertices count from 1")
    return number - 1 if number > 0 else n_points + number


def _add(record: Record, kind: str, mark: str, plain_name: Callable[[str], str]) -> None:
    """A named point or named edges from a comment; those of others are passed over."""
    try:
        if kind == "point":
            vertex, name = mark.split(" ", 1)
            record.nodes.append(Group(np.array([int(vertex) - 1]), plain_name(name)))
        elif kind == "edges":
            listed, name = mark.split(" ", 1)
            pairs = np.array([pair.split("-") for pair in listed.split(",")], dtype=np.int64) - 1
            record.edges.append(Group(pairs.reshape(-1, 2), plain_name(name)))
    except (ValueError, OverflowError):
        return
    members = (record.nodes if kind == "point" else record.edges)[-1:] if kind != "region" else []
    for group in members:
        if (group.members < 0).any() or (group.members >= len(record.points)).any():
            raise InputError(f"{kind} '{group.name}' are at a vertex that is not there; there are {len(record.points)}")
