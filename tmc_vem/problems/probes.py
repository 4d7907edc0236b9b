"""What is measured at every load step besides the load and its reaction: plain data shared by both discretisations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from tmc_vem.support.errors import InputError
from tmc_vem.support.units import FORCE, LENGTH, NONE
from tmc_vem.support.validation import check_fields, require_choice, require_finite, shown
from tmc_vem.system.constraints import COMPONENTS, Condition, Prescribed

# The name of a point of the mesh, or coordinates of the reference configuration, which need not be those of a node.
Place = str | tuple[float, float]
AXES = {"x": 0, "y": 1}
GAP = "gap"
# Columns of the history that are no probes, and what the names of others begin with.
RESERVED = ("step", "load", "displacement", "reaction", "iterations", "cut_backs", "wasted_iterations",
            "negative_pivots", "jumped", "seconds", "time", "load_force", "load_work", "limit_of")  # fmt: skip
RESERVED_STARTS = ("min_j_", "energy_", "parameter_")
_NAME = re.compile(r"[^\W\d][\w-]*")


@dataclass(frozen=True)
class Displacement:
    """Displacement component of a point.

    Attributes:
        component: ``ux`` or ``uy``.
        at: where.
    """

    component: str
    at: Place
    kind: ClassVar[str] = LENGTH

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("displacement", self.component, COMPONENTS)
        _check_place(self.at)

    @property
    def places(self) -> tuple[Place, ...]:
        """Points it needs."""
        return (self.at,)

    def __str__(self) -> str:
        return f"{self.component} of {_said(self.at)}"


@dataclass(frozen=True)
class Position:
    """Coordinate of a point in the deformed state.

    Attributes:
        axis: ``x`` or ``y``.
        at: where the point is in the reference configuration.
    """

    axis: str
    at: Place
    kind: ClassVar[str] = LENGTH

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("position", self.axis, AXES)
        _check_place(self.at)

    @property
    def places(self) -> tuple[Place, ...]:
        """Points it needs."""
        return (self.at,)

    def __str__(self) -> str:
        return f"{self.axis} of {_said(self.at)}, deformed"


@dataclass(frozen=True)
class Gap:
    """Distance of two points in the deformed state, negative where surfaces have crossed.

    The sign counts where outlines of solids cross: the distance is negative if the second point lies behind the surface
    of the first one, that is against the outward normal of the solid's deformed outline there, and did not in the
    reference state. At a corner the normal is the mean of those of both sides. If the first point is not on an outline,
    the second one's normal is taken; if neither is, there is no sign.

    Raises:
        InputError: it is that of a point and itself.
    """

    first: Place
    second: Place
    kind: ClassVar[str] = LENGTH

    def __post_init__(self) -> None:
        check_fields(self)
        _check_place(self.first)
        _check_place(self.second)
        if self.first == self.second:
            raise InputError(
                f"the gap of {_said(self.first)} and itself is 0 always: name points on the two surfaces that approach"
            )

    @property
    def places(self) -> tuple[Place, ...]:
        """Points it needs."""
        return self.first, self.second

    def __str__(self) -> str:
        return f"distance of {_said(self.first)} and {_said(self.second)}"


@dataclass(frozen=True)
class Reaction:
    """Force that holds a named point or edges.

    Attributes:
        component: ``ux`` or ``uy``; a displacement that is prescribed there.
        at: name of the point or edges.
    """

    component: str
    at: str
    kind: ClassVar[str] = FORCE
    places: ClassVar[tuple[Place, ...]] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("reaction", self.component, COMPONENTS)

    def __str__(self) -> str:
        return f"reaction to {self.component} at {self.at}"


@dataclass(frozen=True)
class MeanJ:
    """Mean of J over a region: its deformed area over its area."""

    region: str
    kind: ClassVar[str] = NONE
    places: ClassVar[tuple[Place, ...]] = ()

    def __post_init__(self) -> None:
        check_fields(self)

    def __str__(self) -> str:
        return f"mean of J over {self.region}"


Probe = Displacement | Position | Gap | Reaction | MeanJ


def check_probes(probes: Mapping[str, Probe], prescribed: Sequence[Condition], regions: Sequence[str]) -> None:
    """Check the names of probes, and that what they refer to is there, as far as that is known without a mesh.

    Raises:
        InputError: a name is reserved or has characters that a column should not have; a reaction is asked for where
            nothing is prescribed; a region is unknown; or 'gap', which reports go by, is no distance.
    """
    held = {(condition.where, i) for condition in prescribed for i in _components(condition)}
    for name, probe in probes.items():
        check_name(name)
        if name == GAP and not isinstance(probe, Gap):
            raise InputError(f"probes: {GAP}: reports take it for a distance of two points; choose another name")
        if isinstance(probe, Reaction) and (probe.at, COMPONENTS[probe.component]) not in held:
            known = {f"{next(c for c, n in COMPONENTS.items() if n == i)} at {where}" for where, i in held}
            raise InputError(
                f"probes: {name}: {probe.component} is not prescribed at '{probe.at}', so nothing holds it; prescribed "
                f"are {', '.join(sorted(known)) or 'none'}"
            )
        if isinstance(probe, MeanJ) and probe.region not in regions:
            raise InputError(f"probes: {name}: there is no region '{probe.region}' (there are: {', '.join(regions)})")


def _components(condition: Condition) -> tuple[int, ...]:
    """Components of the force that holds what a condition prescribes."""
    return (condition.component,) if isinstance(condition, Prescribed) else tuple(COMPONENTS.values())


def check_name(name: str) -> None:
    """Check that a probe may have this name.

    Raises:
        InputError: it is that of another column, or has characters that do not belong into one.
    """
    if name in RESERVED or name.startswith(RESERVED_STARTS):
        raise InputError(f"probes: {name}: history.csv has a column of that name already; choose another name")
    if not _NAME.fullmatch(name):
        raise InputError(f"probes: {shown(name)}: use letters, digits, _ and - for a name, a letter first")


def as_plain(probe: Probe) -> dict[str, Any]:
    """A probe as plain values for result files."""
    return {"probe": type(probe).__name__, **asdict(probe)}


def _check_place(place: Place) -> None:
    if not isinstance(place, str):
        for value in place:
            require_finite("coordinate of a point", value)


def _said(place: Place) -> str:
    return place if isinstance(place, str) else f"({place[0]:g}, {place[1]:g})"
