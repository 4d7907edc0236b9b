"""What an input file of Abaqus or CalculiX defines: nodes, elements, sets and surfaces of parts, and instances."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from tmc_vem.mesh.files.inp_keywords import Keyword
from tmc_vem.mesh.files.inp_types import element_type
from tmc_vem.mesh.files.record import DECLARED, IMPLIED, MATERIAL
from tmc_vem.support.errors import InputError

SECTIONS = ("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION")
GENERATING = ("NGEN", "NFILL", "ELGEN", "NCOPY", "ELCOPY", "NMAP", "SYSTEM", "SUBMODEL", "SUPERELEMENT")


@dataclass
class SetOf:
    """A set of nodes or elements.

    Attributes:
        name: as it is first written.
        rank: see :class:`tmc_vem.mesh.files.record.Group`.
        internal: made by a program for its own use.
        entries: labels, names of other sets, or ranges, each with the instance it is of.
        of_elements: (sets of nodes) sets of elements whose nodes belong to it.
    """

    name: str
    rank: int = IMPLIED
    internal: bool = False
    entries: list[tuple[str | None, int | str | range]] = field(default_factory=list)
    of_elements: list[tuple[str | None, str]] = field(default_factory=list)


@dataclass
class Scope:
    """A part, an assembly, or a file without parts: labels and names count within it. Sets are by name in capitals."""

    name: str = ""
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, SetOf] = field(default_factory=dict)
    element_sets: dict[str, SetOf] = field(default_factory=dict)
    surfaces: dict[str, tuple[str, str, list[list[str]]]] = field(default_factory=dict)  # name, type, data
    materials: set[str] = field(default_factory=set)  # sets of elements that a section gives a material


@dataclass
class Instance:
    """A part at its place; ``data`` are the lines that move and turn it."""

    name: str
    part: str
    scope: Scope
    data: list[list[str]]


@dataclass
class Model:
    """All of a file."""

    main: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    instances: list[Instance] = field(default_factory=list)
    n_without_type: int = 0


def model_of(keywords: Iterable[Keyword]) -> Model:
    """The model that keywords define; those of loads, materials and steps are passed over.

    Raises:
        InputError: a line is not understood; the message names it.
    """
    model = Model()
    scope = model.main
    for keyword in keywords:
        name = keyword.name
        if name == "PART":
            called = keyword.get("NAME") or ""
            scope = model.parts.setdefault(called.upper(), Scope(called))
        elif name == "INSTANCE":
            called = keyword.get("NAME") or ""
            scope = Scope(called)
            model.instances.append(Instance(called, (keyword.get("PART") or "").upper(), scope, keyword.data))
        elif name in ("ENDPART", "ENDINSTANCE"):
            scope = model.main
        elif name in GENERATING:
            raise InputError(
                f"{keyword.where}: *{name} makes nodes or elements out of others and cannot be read: write a file that "
                "lists them all"
            )
        else:
            try:
                _add(scope, keyword)
            except (ValueError, OverflowError, IndexError) as error:
                raise InputError(f"{keyword.where}: *{name} is not understood: {error}") from None
    return model


def _add(scope: Scope, keyword: Keyword) -> None:
    name = keyword.name
    if name == "NODE":
        _add_nodes(scope, keyword)
    elif name == "ELEMENT":
        _add_elements(scope, keyword)
    elif name in ("NSET", "ELSET"):
        called = keyword.get(name)
        if called is None:
            raise ValueError(f"it lacks {name}=")
        sets = scope.node_sets if name == "NSET" else scope.element_sets
        found = sets.setdefault(called.upper(), SetOf(called))
        found.rank = max(found.rank, DECLARED)
        found.internal |= "INTERNAL" in keyword.parameters
        instance = keyword.get("INSTANCE")
        found.entries += [(instance, entry) for entry in _entries(keyword)]
        if name == "NSET" and (of := keyword.get("ELSET")):
            found.of_elements.append((instance, of))
    elif name == "SURFACE" and (called := keyword.get("NAME")):
        kind = (keyword.get("TYPE") or "ELEMENT").upper()
        scope.surfaces[called.upper()] = (called, kind, keyword.data)
    elif name in SECTIONS and (called := keyword.get("ELSET")):
        scope.materials.add(called.upper())


def _add_nodes(scope: Scope, keyword: Keyword) -> None:
    if keyword.get("SYSTEM") not in (None, "R", "r"):
        raise ValueError("coordinates of this SYSTEM cannot be read: write rectangular ones")
    labels = []
    for row in keyword.data:
        if not any(row):
            continue
        values = [float(word.replace("d", "e").replace("D", "e")) if word else 0.0 for word in row[1:4]]
        label, place = int(row[0]), tuple((values + [0.0] * 3)[:3])
        if scope.nodes.get(label, place) != place:
            raise ValueError(f"node {label} is at two places: parts with numbers of their own need *PART")
        scope.nodes[label] = (place[0], place[1], place[2])
        labels.append(label)
    if called := keyword.get("NSET"):
        scope.node_sets.setdefault(called.upper(), SetOf(called)).entries += [(None, label) for label in labels]


def _add_elements(scope: Scope, keyword: Keyword) -> None:
    kind = (keyword.get("TYPE") or "").upper()
    if not kind:
        raise ValueError("it lacks TYPE=")
    n_nodes = element_type(kind).n_nodes
    labels: list[int] = []
    waiting: list[int] = []
    for row in keyword.data:
        waiting += [int(word) for word in row if word]
        goes_on = len(row) > 1 and not row[-1] if not n_nodes else len(waiting) <= n_nodes
        if waiting and not goes_on:
            label, *nodes = waiting
            if n_nodes and len(nodes) != n_nodes:
                raise ValueError(f"element {label} of type {kind} has {len(nodes)} nodes instead of {n_nodes}")
            if label in scope.elements and scope.elements[label] != (kind, nodes):
                raise ValueError(f"element {label} is there twice: parts with numbers of their own need *PART")
            scope.elements[label] = kind, nodes
            labels.append(label)
            waiting = []
    if waiting:
        raise ValueError(f"element {waiting[0]} of type {kind} has {len(waiting) - 1} nodes instead of {n_nodes}")
    if called := keyword.get("ELSET"):
        scope.element_sets.setdefault(called.upper(), SetOf(called)).entries += [(None, label) for label in labels]


def _entries(keyword: Keyword) -> list[int | str | range]:
    """Labels, names of sets, or ranges."""
    if "GENERATE" in keyword.parameters:
        found: list[int | str | range] = []
        for row in keyword.data:
            numbers = [int(word) for word in row if word]
            if numbers:
                first, last, step = (numbers + [numbers[0], 1][len(numbers) - 1 :])[:3]
                found.append(range(first, last + 1, step))
        return found
    words = [word.strip('"') for row in keyword.data for word in row if word]
    return [int(word) if word.lstrip("+-").isdigit() else word for word in words]


def rank_of(scope: Scope, key: str) -> int:
    """Rank of a set of elements: highest if a section gives it a material."""
    return MATERIAL if key in scope.materials else scope.element_sets[key].rank
