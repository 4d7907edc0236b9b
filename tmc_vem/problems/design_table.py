"""The table ``[design]`` of a problem file: what a design is made for, within which limits, and how it is looked for.

It is data only: ``tmc-vem run`` solves the problem with the stiffness that its design regions have, whatever stands
here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tmc_vem.support.errors import InputError
from tmc_vem.support.settings import about, described
from tmc_vem.support.validation import check_fields, require_finite, require_positive, require_within, shown

LAWS = ("simp", "ramp")
FILTERS = ("cone", "helmholtz", "none")
VOLUME = "volume"
METHODS = ("mma", "ccsaq", "oc")
WORST_CASE = 100
_NAME = re.compile(r"[A-Za-z][\w-]*", re.ASCII)


@described
@dataclass(frozen=True)
class InterpolationTable:
    """From the density of a cell to its stiffness."""

    law: str = field(
        default="ramp",
        metadata=about("SIMP, x^p, or RAMP, x / (1 + q (1 - x)), whose slope at 0 is none.", choices=LAWS),
    )
    p: float = field(default=3.0, metadata=about("Exponent of SIMP, from 1 on."))
    q: float = field(default=8.0, metadata=about("Parameter of RAMP, 0 for a stiffness in proportion to the density."))

    def __post_init__(self) -> None:
        check_fields(self)
        require_within("p", self.p, 1.0, 10.0)
        require_within("q", self.q, 0.0, 100.0)


@described
@dataclass(frozen=True)
class FilterTable:
    """What makes densities smooth over a length, so that a design does not depend on the mesh."""

    kind: str = field(default="cone", metadata=about("Weighted mean, or a Helmholtz equation.", choices=FILTERS))
    radius: float | None = field(default=None, metadata=about("Radius, a length.", none="three cells of the mesh"))

    def __post_init__(self) -> None:
        check_fields(self)
        if self.radius is not None:
            require_positive("radius", self.radius, "of the filter, a length of some cells")


@described
@dataclass(frozen=True)
class ProjectionTable:
    """What drives filtered densities to 0 and 1, in stages of increasing steepness beta."""

    first: float = field(default=1.0, metadata=about("beta at the beginning; 1 hardly projects."))
    largest: float = field(default=16.0, metadata=about("beta at the end."))
    every: int = field(default=25, metadata=about("Most iterations with one beta."))
    eta: float = field(default=0.5, metadata=about("Density that is the threshold."))

    def __post_init__(self) -> None:
        check_fields(self)
        require_positive("first", self.first, "the first beta of the projection")
        require_within("largest", self.largest, self.first, 1e4, "the last beta of the projection")
        require_within("eta", self.eta, 0.01, 0.99)
        if self.every < 1:
            raise InputError(f"every = {self.every}: give 1 iteration with one beta or more")


@dataclass(frozen=True)
class PassiveTable:
    """Part of the design regions that is not designed: one of ``box`` and ``circle``, or both for where they meet.

    Attributes:
        is_: ``"solid"`` or ``"void"``; ``is`` in problem files.
        box: x0, y0, x1, y1 of two opposite corners; cells belong to it with their centroid.
        circle: x, y of the centre, and the radius.
    """

    is_: str
    box: tuple[float, float, float, float] | None = None
    circle: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.is_ not in ("solid", "void"):
            raise InputError(f"is = '{self.is_}': a passive part is solid or void")
        if self.box is None and self.circle is None:
            raise InputError("a passive part needs a box or a circle")


@dataclass(frozen=True)
class LimitTable:
    """Limit of a result at full load.

    Attributes:
        of: the result, as in ``minimise``; by default the name of the limit itself.
        at_most, at_least: the limit; one of them.
    """

    of: str = ""
    at_most: float | None = None
    at_least: float | None = None

    def __post_init__(self) -> None:
        if (self.at_most is None) == (self.at_least is None):
            raise InputError("give one of at_most and at_least")
        require_finite("limit", self.bound)

    @property
    def bound(self) -> float:
        """The limit."""
        bound = self.at_most if self.at_most is not None else self.at_least
        assert bound is not None
        return bound

    @property
    def sign(self) -> float:
        """1 for a largest value, -1 for a smallest."""
        return 1.0 if self.at_most is not None else -1.0


@dataclass(frozen=True)
class CaseTable:
    """A load case: the problem with some entries changed; all have the mesh and the regions of the file.

    Attributes:
        name: of the case.
        set: entries and their values, as ``--set`` names them: ``{ "load.force" = [0, -1] }``.
        weight: of its objective in the sum.
    """

    name: str
    set: Mapping[str, Any] = field(default_factory=dict)
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise InputError(
                f"cases: {shown(self.name)}: use letters, digits, _ and - for a name, a letter first: files have it too"
            )
        require_positive("weight", self.weight, "of a load case")


@described
@dataclass(frozen=True)
class DesignTable:
    """What ``tmc-vem optimise`` does with the design regions of a problem."""

    minimise: str = field(
        default="",
        metadata=about(
            "Result that is made small: compliance, a probe, reaction, ...; the sum over all load cases. Or volume."
        ),
    )
    maximise: str = field(default="", metadata=about("Result that is made large, instead."))
    volume: float | None = field(
        default=None, metadata=about("Largest volume, a fraction of that of the design regions.", none="no limit")
    )
    limits: Mapping[str, LimitTable] = field(default_factory=dict, metadata=about("Limits of other results, by name."))
    cases: tuple[CaseTable, ...] = field(default=(), metadata=about("Load cases; by default the problem itself alone."))
    interpolation: InterpolationTable = field(
        default_factory=InterpolationTable, metadata=about("Density to stiffness.")
    )
    filter: FilterTable = field(default_factory=FilterTable, metadata=about("Filter of densities."))
    projection: ProjectionTable | None = field(
        default=None, metadata=about("Projection of filtered densities.", none="none is done")
    )
    symmetry: Mapping[str, float] = field(
        default_factory=dict, metadata=about("Lines of symmetry: { x = 1 } mirrors about x = 1.")
    )
    passive: tuple[PassiveTable, ...] = field(default=(), metadata=about("Parts that stay solid or void."))
    method: str = field(
        default="mma",
        metadata=about("MMA or CCSAQ of NLopt, or oc, optimality criteria, for a volume alone.", choices=METHODS),
    )
    iterations: int = field(default=100, metadata=about("Most evaluations of a design."))
    tolerance: float = field(
        default=0.01, metadata=about("It has converged when an iteration changes no variable by more.")
    )
    start: float | None = field(
        default=None, metadata=about("Density of all cells at the beginning.", none="that of the volume")
    )
    noise: float = field(default=0.0, metadata=about("Random change of it, up to this amount either way."))
    seed: int = field(default=0, metadata=about("Of the random change."))

    def __post_init__(self) -> None:
        check_fields(self)
        if bool(self.minimise) == bool(self.maximise):
            raise InputError('give one of minimise and maximise, such as minimise = "compliance"')
        if self.volume is not None:
            require_within("volume", self.volume, 1e-6, 1.0, "a fraction of the design regions")
        if self.by_volume and (self.maximise or not self.limits):
            raise InputError(
                "volume is what the design regions have of solid: it can be made small within limits, for example "
                'minimise = "volume" with limits = { reaction = { at_least = 1 } }'
            )
        if self.start is not None:
            require_within("start", self.start, 0.0, 1.0, "a density")
        elif self.volume is None:
            raise InputError("there is no volume to start from: give start, the density of all cells at the beginning")
        require_within("noise", self.noise, 0.0, 1.0, "of densities")
        require_within("tolerance", self.tolerance, 0.0, 1.0)
        if self.iterations < 1:
            raise InputError(f"iterations = {self.iterations}: give 1 or more")
        if len(self.cases) > WORST_CASE:
            raise InputError(f"{len(self.cases)} load cases are more than {WORST_CASE}")
        names = [case.name for case in self.cases]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise InputError(f"two load cases are called '{twice[0]}': give each a name of its own")
        for axis in self.symmetry:
            if axis not in ("x", "y"):
                raise InputError(f"symmetry: '{axis}' is no axis: mirror about x or y, symmetry = {{ x = 1 }}")

    @property
    def objective(self) -> str:
        """Name of the result that is made small or large."""
        return self.minimise or self.maximise

    @property
    def by_volume(self) -> bool:
        """Whether the volume itself is the objective, whatever the loads do."""
        return self.objective == VOLUME

    @property
    def sign(self) -> float:
        """What it is multiplied with to be made small."""
        return 1.0 if self.minimise else -1.0
