"""Abaqus' and CalculiX' input files (.inp): element sets are regions, node sets, line elements and surfaces are names.

Parts have numbers of their own, and instances put them in their places; flat files have neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.inp_keywords import keywords_of
from tmc_vem.mesh.files.inp_model import Instance, Model, Scope, SetOf, model_of, rank_of
from tmc_vem.mesh.files.inp_types import element_type, is_axisymmetric
from tmc_vem.mesh.files.record import Group, Reading, Record, refuse_kinds
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Label = tuple[int, int]  # place and label


@dataclass
class _Place:
    """A part where an instance puts it, or what the file or its assembly defines itself."""

    number: int
    instance: str
    scope: Scope
    nodes: dict[int, int] = field(default_factory=dict)  # node of the record by label


def read(path: Path, reading: Reading) -> Record:
    """Read a .inp file.

    Raises:
        InputError: it is damaged, has elements that are not plane or not known, or a set is not there.
    """
    model = model_of(keywords_of(path))
    builder = _Builder(model)
    return builder.record()


class _Builder:
    def __init__(self, model: Model) -> None:
        self.model = model
        self.places = [_Place(0, "", model.main)]
        coordinates = [_coordinates(model.main)]
        for instance in model.instances:
            for scope in (self._part(instance), instance.scope):
                if scope is not instance.scope or scope.nodes or scope.elements:
                    self.places.append(_Place(len(self.places), instance.name.upper(), scope))
                    coordinates.append(_moved(_coordinates(scope), instance))
        if not model.instances:
            for part in model.parts.values():
                self.places.append(_Place(len(self.places), part.name.upper(), part))
                coordinates.append(_coordinates(part))
        start = 0
        for place in self.places:
            place.nodes = {label: start + n for n, label in enumerate(place.scope.nodes)}
            start += len(place.nodes)
        self.points = np.concatenate(coordinates)
        self.loops: list[Int] = []
        self.middles: list[int] = []
        self.cells: dict[Label, int] = {}
        self.lines: dict[Label, list[int]] = {}
        self.notes: list[str] = []
        self._elements()

    def _part(self, instance: Instance) -> Scope:
        if instance.part not in self.model.parts:
            raise InputError(f"instance '{instance.name}' is of part '{instance.part}', which is not there")
        return self.model.parts[instance.part]

    def _elements(self) -> None:
        unknown: list[str] = []
        solids: list[str] = []
        left_out: list[str] = []
        axisymmetric: list[str] = []
        for place in self.places:
            for label, (kind, labels) in place.scope.elements.items():
                found = element_type(kind)
                if found.kind in ("unknown", "solid", "none"):
                    {"unknown": unknown, "solid": solids, "none": left_out}[found.kind].append(kind)
                    continue
                try:
                    nodes = [place.nodes[node] for node in labels]
                except KeyError as error:
                    raise InputError(f"element {label} has node {error.args[0]}, which is not there") from None
                if found.kind == "cell":
                    self.cells[place.number, label] = len(self.loops)
                    self.loops.append(np.array(nodes[: found.n_corners], dtype=np.int64))
                    self.middles += nodes[found.n_corners :]
                    if is_axisymmetric(kind):
                        axisymmetric.append(kind)
                else:
                    self.lines[place.number, label] = [nodes[0], nodes[-1]]  # the middle is in between
                    self.middles += nodes[1:-1]
        refuse_kinds(unknown, solids)
        for kinds, what in ((left_out, "are no cells and left out"), (axisymmetric, "are taken as plane cells")):
            for kind in dict.fromkeys(kinds):
                self.notes.append(f"elements of type {kind} {what} ({kinds.count(kind)})")

    def record(self) -> Record:
        record = Record(self.points, self.loops, middles=np.array(self.middles, dtype=np.int64), notes=self.notes)
        with_cells = set()
        for name, key, scope, places in self._sets("element_sets"):
            members = [
                label for place in places for label in self._labels(scope.element_sets[key], place, "element_sets")
            ]
            cells = sorted({self.cells[label] for label in members if label in self.cells})
            lines = [self.lines[label] for label in members if label in self.lines]
            if cells:
                with_cells.add(name.upper())
                record.regions.append(Group(np.array(cells), name, rank=rank_of(scope, key)))
            if lines:
                record.edges.append(Group(np.array(lines), name))
        for name, key, scope, places in self._sets("surfaces"):
            self._surface(record, name, *scope.surfaces[key][1:], places)
        taken = {group.name for group in record.edges} | with_cells
        for name, key, scope, places in self._sets("node_sets"):
            labels = [label for place in places for label in self._labels(scope.node_sets[key], place, "node_sets")]
            nodes = np.array(self._nodes(labels), dtype=np.int64)
            if len(nodes) and name not in taken and name.upper() not in with_cells:
                record.nodes.append(Group(nodes, name))
        return record

    def _sets(self, kind: str) -> list[tuple[str, str, Scope, list[_Place]]]:
        """Name, key, scope and places of every set that is for users; names that several parts have get the part's."""
        scopes: dict[int, tuple[Scope, list[_Place]]] = {}
        for place in self.places:
            scopes.setdefault(id(place.scope), (place.scope, []))[1].append(place)
        found = []
        parts_with: dict[str, int] = {}
        for scope, places in scopes.values():
            for key, entry in getattr(scope, kind).items():
                name = entry[0] if kind == "surfaces" else entry.name
                if kind == "surfaces" or not (entry.internal or name.startswith(("_", "ASSEMBLY__"))):
                    found.append((name, key, scope, places))
                    parts_with[key] = parts_with.get(key, 0) + 1
        return [
            (f"{scope.name}.{name}" if scope.name and parts_with[key] > 1 else name, key, scope, places)
            for name, key, scope, places in found
        ]

    def _labels(self, found: SetOf, place: _Place, kind: str, depth: int = 0) -> list[Label]:
        """Labels of the members of a set, as seen from a place."""
        if depth > 50:
            raise InputError(f"set '{found.name}' contains itself")
        labels: list[Label] = []
        for instance, entry in found.entries:
            for there in self._where(instance, place, found.name):
                known = there.scope.nodes if kind == "node_sets" else there.scope.elements
                if isinstance(entry, int):
                    labels += [(there.number, entry)] if entry in known else []
                elif isinstance(entry, range):
                    labels += [(there.number, n) for n in (entry if len(entry) < len(known) else known)
                               if n in known and n in entry]  # fmt: skip
                else:
                    labels += self._named(entry, there, kind, depth, found.name)
        for instance, entry in found.of_elements:
            for there in self._where(instance, place, found.name):
                for number, label in self._named(entry, there, "element_sets", depth, found.name):
                    labels += [(number, node) for node in self.places[number].scope.elements[label][1]]
        return labels

    def _where(self, instance: str | None, place: _Place, name: str) -> list[_Place]:
        if not instance:
            return [place]
        there = [other for other in self.places if other.instance == instance.upper()]
        if not there:
            raise InputError(f"set '{name}' is of instance '{instance}', which is not there")
        return there

    def _named(self, entry: str, place: _Place, kind: str, depth: int, of: str) -> list[Label]:
        """Members of a set by its name, or of ``INSTANCE.SET`` and ``INSTANCE.LABEL``."""
        sets = getattr(place.scope, kind)
        if entry.upper() in sets:
            return self._labels(sets[entry.upper()], place, kind, depth + 1)
        instance, dot, rest = entry.rpartition(".")
        if dot and any(other.instance == instance.upper() for other in self.places):
            inner = SetOf(of, entries=[(instance, int(rest) if rest.isdigit() else rest)])
            return self._labels(inner, place, kind, depth + 1)
        raise InputError(f"set '{of}' contains the set '{entry}', which is not there")

    def _nodes(self, labels: list[Label]) -> list[int]:
        return [self.places[number].nodes[label] for number, label in labels if label in self.places[number].nodes]

    def _surface(self, record: Record, name: str, kind: str, data: list[list[str]], places: list[_Place]) -> None:
        """Sides of elements as named edges, nodes as a group; cutting surfaces and the like are passed over."""
        if kind not in ("ELEMENT", "NODE"):
            return
        pairs: list[list[int]] = []
        nodes: list[int] = []
        for place in places:
            for row in data:
                if not row or not row[0]:
                    continue
                what, side = row[0].strip('"'), row[1].upper() if len(row) > 1 else ""
                entry: int | str = int(what) if what.isdigit() else what
                members = self._labels(SetOf(name, entries=[(None, entry)]), place,
                                       "node_sets" if kind == "NODE" else "element_sets")  # fmt: skip
                if kind == "NODE":
                    nodes += self._nodes(members)
                elif len(side) == 2 and side[0] in "SE" and side[1].isdigit():
                    for label in members:
                        if label in self.cells:
                            loop = self.loops[self.cells[label]].tolist()
                            s = int(side[1]) - 1
                            if 0 <= s < len(loop):
                                pairs.append([loop[s], loop[(s + 1) % len(loop)]])
        if pairs:
            record.edges.append(Group(np.array(pairs), name))
        if nodes:
            record.nodes.append(Group(np.array(nodes), name))


def _coordinates(scope: Scope) -> Float:
    return np.array(list(scope.nodes.values()), dtype=float).reshape(-1, 3)


def _moved(points: Float, instance: Instance) -> Float:
    """Points moved, then turned by an angle in degrees about the axis through two points.

    Raises:
        InputError: the data lines are not understood.
    """
    from scipy.spatial.transform import Rotation

    try:
        rows = [[float(word) if word else 0.0 for word in row] for row in instance.data if any(row)]
    except ValueError as error:
        raise InputError(f"instance '{instance.name}': its place is not understood: {error}") from None
    for row in rows:
        if len(row) <= 3:
            points = points + (row + [0.0] * 3)[:3]
        elif len(row) == 7:
            first, second = np.array(row[:3]), np.array(row[3:6])
            length = np.linalg.norm(second - first)
            if not length > 0.0:
                raise InputError(f"instance '{instance.name}': the axis it is turned about has no length")
            turn = Rotation.from_rotvec(np.radians(row[6]) * (second - first) / length)
            points = first + turn.apply(points - first) if len(points) else points
        else:
            raise InputError(f"instance '{instance.name}': its place needs 3 numbers, or 7 to turn it, not {len(row)}")
    return points
