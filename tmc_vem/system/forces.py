"""Forces on a problem, and springs that hold it: plain data shared by both discretisations.

Every one has a potential, ``amplitude`` times what it is at amplitude 1, and so is the gradient of something: the
solver needs that. Forces are per thickness 1 of the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_finite
from tmc_vem.system.constraints import PROPORTIONAL, Amplitude
from tmc_vem.system.control import Control

Pair = tuple[float, float]


@dataclass(frozen=True)
class Constant:
    """1 wherever on the path."""

    def at(self, position: Control) -> float:
        """1."""
        return 1.0

    def per_load(self, position: Control) -> float:
        """0."""
        return 0.0


CONSTANT = Constant()


def _pair(name: str, what: str, values: Sequence[float]) -> Pair:
    """Two numbers, as a tuple.

    Raises:
        InputError: they are not two, or not finite.
    """
    numbers = tuple(values)
    if len(numbers) != 2:
        raise InputError(f"{name}: {what} has {len(numbers)} components: give two, along x and y")
    for axis, value in zip("xy", numbers, strict=True):
        require_finite(f"{name}: {what} along {axis}", value)
    return float(numbers[0]), float(numbers[1])


@dataclass(frozen=True)
class PointForce:
    """Dead force at a named point.

    Attributes:
        name: what it is called in results and messages.
        where: name of a point, or of a group of points: at each of them.
        force: components at amplitude 1.
        amplitude: how it grows along the path; in proportion to the load factor by default.

    Raises:
        InputError: the force is not two finite numbers.
    """

    name: str
    where: str
    force: Pair
    amplitude: Amplitude = field(default=PROPORTIONAL)

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", _pair(self.name, "force", self.force))


@dataclass(frozen=True)
class Traction:
    """Dead force along named edges.

    Attributes:
        name: what it is called in results and messages.
        where: name of the edges.
        traction: components at amplitude 1, per reference length.
        amplitude: how it grows along the path; in proportion to the load factor by default.

    Raises:
        InputError: the traction is not two finite numbers.
    """

    name: str
    where: str
    traction: Pair
    amplitude: Amplitude = field(default=PROPORTIONAL)

    def __post_init__(self) -> None:
        object.__setattr__(self, "traction", _pair(self.name, "traction", self.traction))


@dataclass(frozen=True)
class BodyForce:
    """Dead force in regions.

    Attributes:
        name: what it is called in results and messages.
        regions: names of the regions.
        force: components at amplitude 1, per reference area.
        amplitude: how it grows along the path; in proportion to the load factor by default.

    Raises:
        InputError: the force is not two finite numbers, or there is no region.
    """

    name: str
    regions: tuple[str, ...]
    force: Pair
    amplitude: Amplitude = field(default=PROPORTIONAL)

    def __post_init__(self) -> None:
        regions = (self.regions,) if isinstance(self.regions, str) else tuple(self.regions)
        if not regions:
            raise InputError(f"{self.name}: a body force needs one region or more")
        object.__setattr__(self, "regions", regions)
        object.__setattr__(self, "force", _pair(self.name, "force", self.force))


@dataclass(frozen=True)
class CavityPressure:
    """Pressure in a closed cavity, with the potential ``-pressure * (area enclosed now - area at the start)``.

    Attributes:
        name: what it is called in results and messages.
        where: name of the edges, which are the whole boundary of the cavity, one closed loop or several.
        pressure: at amplitude 1, force per length now; it pushes out of the cavity.
        amplitude: how it grows along the path; in proportion to the load factor by default.

    Raises:
        InputError: the pressure is not a finite number.
    """

    name: str
    where: str
    pressure: float
    amplitude: Amplitude = field(default=PROPORTIONAL)

    def __post_init__(self) -> None:
        require_finite(f"{self.name}: pressure", self.pressure)


@dataclass(frozen=True)
class FollowerPressure:
    """Pressure on an open chain of edges, along their normal wherever they go.

    Attributes:
        name: what it is called in results and messages.
        where: name of the edges, which belong to one cell each. At both ends of the chain, a displacement component
            must be prescribed such that the pressure has a potential.
        pressure: at amplitude 1, force per length now; it pushes against the cells.
        amplitude: how it grows along the path; in proportion to the load factor by default.

    Raises:
        InputError: the pressure is not a finite number.
    """

    name: str
    where: str
    pressure: float
    amplitude: Amplitude = field(default=PROPORTIONAL)

    def __post_init__(self) -> None:
        require_finite(f"{self.name}: pressure", self.pressure)


@dataclass(frozen=True)
class Spring:
    """Linear springs to ground, without force in the reference state.

    Attributes:
        name: what it is called in results and messages.
        where: name of a point, of a group of points, or of edges.
        stiffness: along x and y, zero or more: of every point force per length, of edges that per reference length.
        amplitude: what the stiffness is multiplied with; 1 by default.

    Raises:
        InputError: the stiffness is not two finite numbers that are not negative.
    """

    name: str
    where: str
    stiffness: Pair
    amplitude: Amplitude = field(default=CONSTANT)

    def __post_init__(self) -> None:
        stiffness = _pair(self.name, "stiffness", self.stiffness)
        if min(stiffness) < 0.0:
            raise InputError(f"{self.name}: stiffness {min(stiffness):g} is negative: use zero or more")
        object.__setattr__(self, "stiffness", stiffness)


Force = PointForce | Traction | BodyForce | CavityPressure | FollowerPressure | Spring
