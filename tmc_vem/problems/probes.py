"""What is measured at every load step besides the load and its reaction: plain data shared by both discretisations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import FORCE, LENGTH, NONE
from tmc_vem.support.validation import check_fields, require_choice, require_finite, shown
from tmc_vem.system.constraints import COMPONENTS, Condition, Prescribed

if TYPE_CHECKING:
    from tmc_vem.problems.base import RegionEnergy

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
class Known:
    """What is known of a problem without its mesh.

    Attributes:
        held: where a displacement component is prescribed, by name and number of the component.
        regions: names of the regions.
    """

    held: frozenset[tuple[str, int]]
    regions: tuple[str, ...]

    def require_region(self, name: str) -> None:
        """Check that a region is there.

        Raises:
            InputError: it is not.
        """
        if name not in self.regions:
            raise InputError(f"there is no region '{name}' (there are: {', '.join(self.regions)})")


@dataclass(frozen=True)
class Probe:
    """Something that is measured at every load step, as a frozen dataclass; its words in a message are ``str``.

    How each kind is read is in ``READERS`` of :mod:`tmc_vem.simulation.gauge`, how it is written in a problem file in
    ``KINDS`` of :mod:`tmc_vem.problems.probe_table`.
    """

    @property
    def kind(self) -> str:
        """Kind of quantity, as in :mod:`tmc_vem.support.units`."""
        raise NotImplementedError

    @property
    def places(self) -> tuple[Place, ...]:
        """Points whose displacement it needs."""
        return ()

    def check(self, known: Known) -> None:
        """Check what can be known without a mesh.

        Raises:
            InputError: what it refers to is not there; the message does not name the probe.
        """

    def examine(self, mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
        """Check the rest on the whole mesh, before it is distributed.

        Raises:
            InputError: what it refers to is not there; the message does not name the probe.
        """


@dataclass(frozen=True)
class Displacement(Probe):
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
class Position(Probe):
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
class Gap(Probe):
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
class Reaction(Probe):
    """Force that holds a named point or edges.

    Attributes:
        component: ``ux`` or ``uy``; a displacement that is prescribed there.
        at: name of the point or edges.
    """

    component: str
    at: str
    kind: ClassVar[str] = FORCE

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("reaction", self.component, COMPONENTS)

    def check(self, known: Known) -> None:
        """Check that something is held there."""
        if (self.at, COMPONENTS[self.component]) not in known.held:
            held = {f"{next(c for c, n in COMPONENTS.items() if n == i)} at {where}" for where, i in known.held}
            raise InputError(
                f"{self.component} is not prescribed at '{self.at}', so nothing holds it; prescribed are "
                f"{', '.join(sorted(held)) or 'none'}"
            )

    def __str__(self) -> str:
        return f"reaction to {self.component} at {self.at}"


@dataclass(frozen=True)
class MeanJ(Probe):
    """Mean of J over a region: its deformed area over its area."""

    region: str
    kind: ClassVar[str] = NONE

    def __post_init__(self) -> None:
        check_fields(self)

    def check(self, known: Known) -> None:
        """Check that the region is there."""
        known.require_region(self.region)

    def __str__(self) -> str:
        return f"mean of J over {self.region}"


def check_probes(probes: Mapping[str, Probe], prescribed: Sequence[Condition], regions: Sequence[str]) -> None:
    """Check the names of probes, and that what they refer to is there, as far as that is known without a mesh.

    Raises:
        InputError: a name is reserved or has characters that a column should not have; a reaction is asked for where
            nothing is prescribed; a region is unknown; or 'gap', which reports go by, is no distance.
    """
    held = frozenset((condition.where, i) for condition in prescribed for i in _components(condition))
    known = Known(held, tuple(regions))
    for name, probe in probes.items():
        check_name(name)
        if name == GAP and not isinstance(probe, Gap):
            raise InputError(f"probes: {GAP}: reports take it for a distance of two points; choose another name")
        try:
            probe.check(known)
        except InputError as error:
            raise InputError(f"probes: {name}: {error}") from None


def examine_probes(probes: Mapping[str, Probe], mesh: PolygonMesh, regions: Mapping[str, RegionEnergy]) -> None:
    """Check the rest on the whole mesh.

    Raises:
        InputError: what a probe refers to is not there.
    """
    for name, probe in probes.items():
        try:
            probe.examine(mesh, regions)
        except InputError as error:
            raise InputError(f"probes: {name}: {error}") from None


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
