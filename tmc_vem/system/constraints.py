"""Prescribed displacements of a problem: plain data shared by both discretisations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_choice, require_finite
from tmc_vem.system.control import Control

Float = NDArray[np.float64]
Pair = tuple[float, float]

COMPONENTS = {"ux": 0, "uy": 1}
ACROSS = ("normal", "tangential")


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
        name: of a load that is reported by name; empty for others.
        stages: names of the stages of a run in which it holds; empty for all.
    """

    where: str
    component: int
    value: float = 0.0
    amplitude: Amplitude = PROPORTIONAL
    name: str = ""
    stages: tuple[str, ...] = ()

    @property
    def axes(self) -> tuple[Pair, ...]:
        """Unit vectors along which displacements are prescribed."""
        return ((1.0, 0.0), (0.0, 1.0))[self.component : self.component + 1]

    def at(self, position: Control) -> float:
        """The displacement at a position on the path."""
        return self.amplitude.at(position) * self.value

    def per_load(self, position: Control) -> float:
        """Its derivative with respect to the load factor."""
        return self.amplitude.per_load(position) * self.value

    def along(self, position: Control, points_nx: Float) -> Float:
        """(1, n) displacements along the axes of points (n, 2) of the reference configuration."""
        return np.full((1, len(points_nx)), self.at(position))

    def along_per_load(self, position: Control, points_nx: Float) -> Float:
        """(1, n) their derivatives with respect to the load factor."""
        return np.full((1, len(points_nx)), self.per_load(position))

    def __str__(self) -> str:
        return f"{tuple(COMPONENTS)[self.component]} = {self.value:g} at '{self.where}'"


@dataclass(frozen=True)
class PrescribedAcross:
    """Displacement that is prescribed across or along a straight edge, whatever its direction.

    Attributes:
        where: name of a set of edges on one straight line.
        direction: ``normal``, out of the body, or ``tangential``: the normal turned by 90 degrees, so that the body
            lies on the left of it.
        value: displacement where the amplitude is 1; 0 is a roller on an incline, if it is normal.
        amplitude: how it grows along the path.
        name: of a load that is reported by name; empty for others.
        axis: the unit vector that is meant; None until it is known from a mesh, see
            :func:`tmc_vem.problems.directions.on_mesh`.

    Raises:
        InputError: the direction is neither, or the value is not finite.
    """

    where: str
    direction: str
    value: float = 0.0
    amplitude: Amplitude = PROPORTIONAL
    name: str = ""
    axis: Pair | None = None
    stages: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        require_choice("direction", self.direction, ACROSS)
        require_finite(self.direction, self.value, "a displacement")

    @property
    def axes(self) -> tuple[Pair, ...]:
        """The unit vector along which displacements are prescribed.

        Raises:
            InputError: it is not known yet.
        """
        if self.axis is None:
            raise InputError(f"the direction of the edges '{self.where}' is not known before there is a mesh")
        return (self.axis,)

    def at(self, position: Control) -> float:
        """The displacement at a position on the path."""
        return self.amplitude.at(position) * self.value

    def along(self, position: Control, points_nx: Float) -> Float:
        """(1, n) displacements along the axis of points (n, 2) of the reference configuration."""
        return np.full((1, len(points_nx)), self.at(position))

    def along_per_load(self, position: Control, points_nx: Float) -> Float:
        """(1, n) their derivatives with respect to the load factor."""
        return np.full((1, len(points_nx)), self.amplitude.per_load(position) * self.value)

    def __str__(self) -> str:
        return f"{self.direction} = {self.value:g} at '{self.where}'"


@dataclass(frozen=True)
class PrescribedRotation:
    """Edges or points that are turned as a rigid body about a point, by any angle.

    Attributes:
        where: name of a point, of a group of points, or of a set of edges.
        about: the point, in the reference configuration.
        degrees: angle where the amplitude is 1, counter-clockwise.
        amplitude: how the angle grows along the path.
        name: of a load that is reported by name; empty for others.

    Raises:
        InputError: a number is not finite.
    """

    where: str
    about: Pair
    degrees: float
    amplitude: Amplitude = PROPORTIONAL
    name: str = ""
    stages: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for axis, value in zip("xy", self.about, strict=True):
            require_finite(f"{axis} of about", value)
        require_finite("rotation", self.degrees, "an angle in degrees")

    @property
    def value(self) -> float:
        """The angle where the amplitude is 1."""
        return self.degrees

    @property
    def axes(self) -> tuple[Pair, ...]:
        """Unit vectors along which displacements are prescribed: both."""
        return ((1.0, 0.0), (0.0, 1.0))

    def at(self, position: Control) -> float:
        """The angle in degrees at a position on the path."""
        return self.amplitude.at(position) * self.degrees

    def along(self, position: Control, points_nx: Float) -> Float:
        """(2, n) displacements (R - I) (X - c) of points X (n, 2) of the reference configuration."""
        x, y = (points_nx - np.asarray(self.about)).T
        angle = np.radians(self.at(position))
        cosine, sine = -2.0 * np.sin(0.5 * angle) ** 2, np.sin(angle)  # cos - 1 without cancellation
        return np.stack([cosine * x - sine * y, sine * x + cosine * y])

    def along_per_load(self, position: Control, points_nx: Float) -> Float:
        """(2, n) their derivatives with respect to the load factor."""
        x, y = (points_nx - np.asarray(self.about)).T
        angle, rate = np.radians(self.at(position)), np.radians(self.amplitude.per_load(position) * self.degrees)
        sine, cosine = np.sin(angle), np.cos(angle)
        rates: Float = rate * np.stack([-sine * x - cosine * y, cosine * x - sine * y])
        return rates

    def __str__(self) -> str:
        return f"rotation = {self.degrees:g} degrees about ({self.about[0]:g}, {self.about[1]:g}) at '{self.where}'"


Condition = Prescribed | PrescribedAcross | PrescribedRotation
