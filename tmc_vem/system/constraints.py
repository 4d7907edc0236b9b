"""Prescribed displacements of a problem: plain data shared by both discretisations."""

from __future__ import annotations

from dataclasses import dataclass

COMPONENTS = {"ux": 0, "uy": 1}


def is_called(point: str, where: str) -> bool:
    """Whether a point goes by a name: it is its own, or that of a group whose points are NAME#1, NAME#2 and so on."""
    group, mark, number = point.rpartition("#")
    return point == where or (bool(mark) and group == where and number.isdigit())


@dataclass(frozen=True)
class Prescribed:
    """Displacement component that is prescribed at a named point or along named edges.

    Attributes:
        where: name of a point, of a group of points, or of a set of edges.
        component: 0 for u_x, 1 for u_y.
        value: displacement at load factor 1; it grows in proportion to the load factor.
    """

    where: str
    component: int
    value: float = 0.0
