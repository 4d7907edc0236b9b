"""The tables of a problem file that say what acts: loads, each of one kind and with a history, and springs."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import require_finite, require_positive, shown
from tmc_vem.system.constraints import (
    ACROSS,
    COMPONENTS,
    PROPORTIONAL,
    Amplitude,
    Condition,
    Prescribed,
    PrescribedAcross,
    PrescribedRotation,
)
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, Force, PointForce, Spring, Traction
from tmc_vem.system.histories import History

XY = tuple[float, float]
Load = Condition | Force
# What a load can be, and what else each kind needs.
KINDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys((*COMPONENTS, *ACROSS), ("at",)),
    "rotation": ("at", "about"),
    "force": ("at",),
    "traction": ("at",),
    "body_force": ("regions",),
    "acceleration": ("regions", "density"),
    "cavity_pressure": ("at",),
    "pressure": ("at",),
}
COMPANIONS = ("at", "about", "regions", "density")
_NAME = re.compile(r"[^\W\d][\w-]*")


@dataclass(frozen=True)
class LoadTable:
    """Something that moves or loads the body: one of the kinds, where, and how it grows.

    Attributes:
        at: name of a point, a group of points or edges.
        ux, uy: displacement component at full load.
        normal, tangential: displacement across a straight edge, out of the body, or along it, the body on the left.
        rotation: angle in degrees by which points or edges are turned about the point ``about``, counter-clockwise.
        about: x, y of that point.
        force: components of a dead force at each point.
        traction: components of a dead force per reference length of edges.
        body_force: components of a dead force per reference area of ``regions``.
        acceleration: components of a force per mass in ``regions``, of mass ``density`` per reference area.
        regions: names of regions.
        density: mass per reference area.
        cavity_pressure: pressure in a closed cavity, whose whole boundary the edges are.
        pressure: pressure on an open chain of edges, along their normal wherever they go.
        history: times and what the load is multiplied with there, ``[[0, 0], [1, 1]]``; in proportion to the time by
            default, up to 1 if another load has a history.
        name: what it is called in results.
    """

    at: str | None = None
    ux: float | None = None
    uy: float | None = None
    normal: float | None = None
    tangential: float | None = None
    rotation: float | None = None
    about: XY | None = None
    force: XY | None = None
    traction: XY | None = None
    body_force: XY | None = None
    acceleration: XY | None = None
    regions: tuple[str, ...] | None = None
    density: float | None = None
    cavity_pressure: float | None = None
    pressure: float | None = None
    history: tuple[XY, ...] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        kind, needs = self.kind, KINDS[self.kind]
        if self.name is not None:
            check_load_name(self.name)
        for companion in COMPANIONS:
            given = getattr(self, companion) is not None
            if given != (companion in needs):
                raise InputError(f"{kind} {'has no use for' if given else 'lacks'} '{companion}'")
        if self.regions == ():
            raise InputError("regions: there is none")
        value = getattr(self, kind)
        for number in value if isinstance(value, tuple) else (value,):
            require_finite(kind, number, _WHAT.get(kind, ""))
        if self.density is not None:
            require_positive("density", self.density, "mass per area, for a force per mass")
        if self.history is not None:
            History(self.history)
        if kind not in COMPONENTS:
            self.require_something()

    def require_something(self) -> None:
        """Check that the load is not 0.

        Raises:
            InputError: it is.
        """
        value = getattr(self, self.kind)
        if not any(value if isinstance(value, tuple) else (value,)):
            raise InputError(
                f"{self.kind} = {shown(value)} does nothing: leave the load out; what holds a displacement is a "
                "[[support]]"
            )

    @property
    def kind(self) -> str:
        """Which kind of load it is.

        Raises:
            InputError: it is not exactly one.
        """
        given = [name for name in KINDS if getattr(self, name) is not None]
        if given == list(COMPONENTS):
            raise InputError(
                "give one of ux and uy; further components belong to [[support]], or to a [[load]] of their own"
            )
        if len(given) != 1:
            more = "; each is a [[load]] of its own" if given else ""
            raise InputError(f"give one of {', '.join(KINDS)}, not {' and '.join(given) or 'none'}{more}")
        return given[0]

    def amplitude(self, default: Amplitude = PROPORTIONAL) -> Amplitude:
        """How it grows over the run."""
        return default if self.history is None else History(self.history)

    def load(self, name: str, default: Amplitude = PROPORTIONAL) -> Load:
        """The load.

        Args:
            name: what it is called; a displacement that is reported without a name has none.
            default: how it grows if the table does not say it.
        """
        kind, amplitude, at = self.kind, self.amplitude(default), self.at or ""
        if kind in COMPONENTS:
            return Prescribed(at, COMPONENTS[kind], getattr(self, kind), amplitude, name)
        if kind in ACROSS:
            return PrescribedAcross(at, kind, getattr(self, kind), amplitude, name)
        if kind == "rotation":
            assert self.rotation is not None
            assert self.about is not None
            return PrescribedRotation(at, self.about, self.rotation, amplitude, name)
        if kind in ("body_force", "acceleration"):
            x, y = getattr(self, kind)
            mass = 1.0 if self.density is None else self.density
            return BodyForce(name, self.regions or (), (mass * x, mass * y), amplitude)
        return _AT_A_PLACE[kind](name, at, getattr(self, kind), amplitude)


_AT_A_PLACE: dict[str, Callable[..., Force]] = {
    "force": PointForce,
    "traction": Traction,
    "cavity_pressure": CavityPressure,
    "pressure": FollowerPressure,
}
_WHAT = {
    **dict.fromkeys((*COMPONENTS, *ACROSS), "a displacement"),
    "rotation": "an angle in degrees",
    "force": "a component of the force",
    "traction": "a component of the force per length",
    "body_force": "a component of the force per area",
    "acceleration": "a component of the force per mass",
    "cavity_pressure": "a force per length",
    "pressure": "a force per length",
}


@dataclass(frozen=True)
class SpringTable:
    """Linear springs from points or edges to ground, without force in the reference state.

    Attributes:
        at: name of a point, a group of points or edges.
        stiffness: along x and y; force per length for each point, that per reference length for edges.
        name: what they are called in results.
    """

    at: str
    stiffness: XY
    name: str | None = None

    def __post_init__(self) -> None:
        if self.name is not None:
            check_load_name(self.name)
        for axis, value in zip("xy", self.stiffness, strict=True):
            require_finite("stiffness", value, f"along {axis}")
            if value < 0.0:
                raise InputError(f"stiffness = {value:g} along {axis} must be 0 or more")
        if not any(self.stiffness):
            raise InputError("stiffness is 0 along x and y: leave the spring out")

    def spring(self, name: str) -> Spring:
        """The springs.

        Args:
            name: what they are called.
        """
        return Spring(name, self.at, self.stiffness)


def check_load_name(name: str) -> None:
    """Check that a load or spring may have this name.

    Raises:
        InputError: it has characters that do not belong into the heading of a column.
    """
    if not _NAME.fullmatch(name):
        raise InputError(f"name = {shown(name)}: use letters, digits, _ and - for a name, a letter first")
