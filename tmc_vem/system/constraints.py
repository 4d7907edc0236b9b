"""Prescribed displacements of a problem: plain data shared by both discretisations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from tmc_vem.system.control import Control

COMPONENTS = {"ux": 0, "uy": 1}


def is_called(point: str, where: str) -> bool:
    """Whether a point goes by a name: it is its own, or that of a group whose points are NAME#1, NAME#2 and so on."""
    group, mark, number = point.rpartition("#")
    return point == where or (bool(mark) and group == where and number.isdigit())


class Amplitude(Protocol):
    """What a prescribed displacement is multiplied with, as a function of the position on the path."""

    def at(self, position: Control) -> float:
        """The factor there."""

    def per_load(self, position: Control) -> float:
        """Its derivative with respect to the load factor, with everything else as it is."""


@dataclass(frozen=True)
class Proportional:
    """The load factor itself."""

    def at(self, position: Control) -> float:
        """The load factor."""
        return position.load

    def per_load(self, position: Control) -> float:
        """1."""
        return 1.0


PROPORTIONAL = Proportional()


@dataclass(frozen=True)
class Prescribed:
    """Displacement component that is prescribed at a named point or along named edges.

    Attributes:
        where: name of a point, of a group of points, or of a set of edges.
        component: 0 for u_x, 1 for u_y.
        value: displacement where the amplitude is 1: at load factor 1.
        amplitude: how it grows along the path; in proportion to the load factor by default.
    """

    where: str
    component: int
    value: float = 0.0
    amplitude: Amplitude = PROPORTIONAL

    def at(self, position: Control) -> float:
        """The displacement at a position on the path."""
        return self.amplitude.at(position) * self.value

    def per_load(self, position: Control) -> float:
        """Its derivative with respect to the load factor."""
        return self.amplitude.per_load(position) * self.value
