"""What a mesh file says, alike for all formats: points, cells by their corners, groups of cells, edges and points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Ranks of groups: of several with exactly the same cells, the one of the highest rank names the region.
IMPLIED, DECLARED, MATERIAL = 0, 1, 2


@dataclass
class Group:
    """A named or numbered set of a file.

    Attributes:
        members: cells (n,), edges as nodes (n, 2), or nodes (n,).
        name: in the file; None if it has a number only.
        number: of a physical group or a value of cell data; None if it has a name only.
        rank: see above.
    """

    members: Int
    name: str | None = None
    number: int | None = None
    rank: int = DECLARED

    def label(self, kind: str) -> str:
        """Its name, or one made of its kind ('region', 'curve', 'point') and number."""
        return self.name if self.name is not None else f"{kind}_{self.number}"


@dataclass
class Record:
    """The content of a mesh file.

    Attributes:
        points: (n, 2) or (n, 3) coordinates.
        loops: nodes at the corners of every cell, in order around it in either direction.
        regions: groups of cells; a cell may be in several or none.
        edges: groups of edges.
        nodes: groups of nodes; several nodes along sides of cells stand for these sides.
        middles: nodes in the middle of sides, or inside of cells, of higher order; no cell keeps them.
        notes: what the user should know about how the file was read.
        data: numbers of the cells (n_cells,) by name, of files that have some.
    """

    points: Float
    loops: list[Int]
    regions: list[Group] = field(default_factory=list)
    edges: list[Group] = field(default_factory=list)
    nodes: list[Group] = field(default_factory=list)
    middles: Int = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    notes: list[str] = field(default_factory=list)
    data: dict[str, Float] = field(default_factory=dict)


@dataclass(frozen=True)
class Reading:
    """How a file is to be read, where there is a choice.

    Attributes:
        names: for groups, by their number or their name in the file.
        region_data: cell data whose values are the regions' numbers (VTU, VTK, UGRID, MAT).
        cracks: ``"join"`` refuses a mesh with vertices on the same place; ``"keep"`` takes them for cracks.
        cell_data: names of cell data that the mesh keeps (the same formats).
    """

    names: dict[str, str] = field(default_factory=dict)
    region_data: str | None = None
    cracks: str = "join"
    cell_data: tuple[str, ...] = ()


def count_kinds(kinds: Sequence[str]) -> str:
    """'3 of type a, 1 of type b', the kinds in order of their first appearance."""
    return ", ".join(f"{kinds.count(kind)} of type {kind}" for kind in dict.fromkeys(kinds))


def refuse_kinds(kinds: Sequence[str], solids: Sequence[str] = ()) -> None:
    """Refuse cells that are no plane cells, or of a type that is not known: none is ever left out.

    Raises:
        InputError: there are any.
    """
    if solids:
        raise InputError(f"it has solid cells ({count_kinds(solids)}): give a mesh of plane cells")
    if kinds:
        raise InputError(f"cells that cannot be read: {count_kinds(kinds)}; plane cells are, of any order")
