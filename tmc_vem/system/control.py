"""Where a problem stands: a point of the path of loads and parameters that it is taken along."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Control:
    """A point of the path: all that what is prescribed may depend on.

    The coordinate along the path is not among it. Where a branch ends, the solver goes on detours, and to another path
    with a stiffer medium: the same load is reached at other coordinates there.

    Attributes:
        load: load factor.
        parameters: values of energy parameters that differ from those of the problem, by name; one of a single region
            is called as :func:`parameter_of` says.
    """

    load: float
    parameters: Mapping[str, float] = field(default_factory=dict)


def parameter_of(region: str, name: str) -> str:
    """What a parameter of one region's energy is called: ``medium.gamma``."""
    return f"{region}.{name}"
