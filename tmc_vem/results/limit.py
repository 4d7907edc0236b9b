"""What a run says about gamma to 0: limits of what is reported with their uncertainties, or why there is none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from tmc_vem.problems.probes import GAP
from tmc_vem.results.extrapolation import EXPONENT, PER_DECADE, Estimate, estimate, ratio_of, withheld
from tmc_vem.results.records import OF, StepRecord
from tmc_vem.support.validation import shown

REACTION = "reaction"
WORK = "work"  # a quantity that is summed along the path
CLOSE = 1e-9  # relative difference of parameters that are equal


@dataclass(frozen=True)
class LimitValue:
    """The limit of one value.

    Attributes:
        value: for gamma to 0; None if it is withheld.
        uncertainty: half the width of the interval around it in which the limit is expected in nine of ten cases.
        ratio: of the last two changes over a decade of gamma.
        reason: why the value is withheld; None if it is not.
        at: the values themselves at :attr:`GammaLimit.gammas`, as far as they were reached; not a number where there
            was none, as of a pair of outlines that did not face each other.
    """

    value: float | None
    uncertainty: float | None
    ratio: float | None
    reason: str | None = None
    at: Sequence[float] = ()

    def __str__(self) -> str:
        return "withheld" if self.value is None else with_uncertainty(self.value, self.uncertainty or 0.0)


@dataclass(frozen=True)
class LimitPoint:
    """Limits at one load of the path.

    Attributes:
        step, load, displacement: of the load step from which gamma was lowered.
        values: limits by the names of what is reported.
    """

    step: int
    load: float
    displacement: float
    values: Mapping[str, LimitValue]


@dataclass(frozen=True)
class GammaLimit:
    """Limits for gamma to 0 at the end of the path.

    Attributes:
        gammas: values of gamma, a decade apart, the problem's first; of the medium with the largest if there are some.
        expected_ratio: of two changes over a decade, in an established contact: 10^(3/5).
        values: limits by the names of what is reported, the reaction first.
        by_medium: values of gamma in each medium, where they differ.
        path: limits at loads along the path, its end among them, if these were asked for.
        newton_iterations: that lowering gamma took.
    """

    gammas: Sequence[float]
    expected_ratio: float
    values: Mapping[str, LimitValue]
    by_medium: Mapping[str, Sequence[float]] = field(default_factory=dict)
    path: Sequence[LimitPoint] = ()
    newton_iterations: int = 0

    @property
    def withheld(self) -> dict[str, str]:
        """Reasons by the names of the values that are withheld."""
        return {name: entry.reason or "" for name, entry in self.values.items() if entry.value is None}

    def as_dict(self) -> dict[str, Any]:
        """Plain values for result.json."""
        plain = asdict(self)
        return {name: value for name, value in plain.items() if name != "by_medium" or value}

    @staticmethod
    def from_dict(data: Any) -> GammaLimit:
        """What :meth:`as_dict` has made.

        Raises:
            TypeError: it is nothing of the kind.
        """
        try:
            return GammaLimit(
                gammas=tuple(float(gamma) for gamma in data["gammas"]),
                expected_ratio=float(data["expected_ratio"]),
                values=_values(data["values"]),
                by_medium={name: tuple(map(float, gammas)) for name, gammas in data.get("by_medium", {}).items()},
                path=tuple(LimitPoint(**{**point, "values": _values(point["values"])}) for point in data["path"]),
                newton_iterations=int(data["newton_iterations"]),
            )
        except (KeyError, AttributeError, ValueError, TypeError):
            raise TypeError(f"limit = {shown(data)} has the wrong form") from None


def _values(data: Mapping[str, Any]) -> dict[str, LimitValue]:
    def at(entry: Mapping[str, Any]) -> tuple[float, ...]:
        return tuple(math.nan if value is None else value for value in entry["at"])

    return {name: LimitValue(**{**entry, "at": at(entry)}) for name, entry in data.items()}


@dataclass(frozen=True)
class Lowering:
    """By how much gamma was lowered.

    Attributes:
        gammas: values of gamma by what they are called as parameters of a path, at the beginning.
        factors: what all of them are multiplied with, from 1 on, ``PER_DECADE`` a decade.
        media: regions of these gammas where there are several.
    """

    gammas: Mapping[str, float]
    factors: Sequence[float]
    media: Mapping[str, str] = field(default_factory=dict)

    def at(self, factor: float) -> dict[str, float]:
        """Parameters where gamma is multiplied with a factor."""
        return {name: factor * gamma for name, gamma in self.gammas.items()}

    def decades(self, gamma: float) -> list[float]:
        """What becomes of a value of gamma, a decade apart."""
        return [float(f"{gamma * factor:.12g}") for factor in self.factors[::PER_DECADE]]

    def is_at(self, record: StepRecord, factor: float) -> bool:
        """Whether a record belongs to a factor."""
        wanted = self.at(factor)
        return all(math.isclose(record.parameters.get(name, 0.0), wanted[name], rel_tol=CLOSE) for name in wanted)


def limit_at_end(
    lowering: Lowering,
    history: Sequence[StepRecord],
    lowered: Sequence[StepRecord],
    done: Mapping[int, str],
    *,
    along_path: bool,
    doubt: str = "",
    newton_iterations: int = 0,
) -> GammaLimit:
    """The limits of a run.

    Args:
        lowering: by how much gamma was lowered.
        history: load steps.
        lowered: states beside them with lower gamma.
        done: for each step from which gamma was lowered, why not to the end; empty where it was.
        along_path: whether limits along the path are wanted.
        doubt: why nothing of the last state can be believed, if there is a reason.
        newton_iterations: that lowering gamma took.
    """

    def limits(start: StepRecord, doubt: str = "") -> dict[str, LimitValue]:
        below = [record for record in lowered if record.limit_of == start.step]
        before = [record for record in history if record.step <= start.step]
        why = doubt or _why_not(start, before, below, done.get(start.step, "gamma was not lowered at this load"))
        return limits_of(lowering, start, below, why)

    largest = max(lowering.gammas.values())
    several = {region: lowering.decades(lowering.gammas[name]) for name, region in lowering.media.items()}
    last = history[-1] if history else None
    return GammaLimit(
        gammas=lowering.decades(largest),
        expected_ratio=10.0**EXPONENT,
        values=limits(last, doubt) if last else {},
        by_medium=several,
        path=[LimitPoint(r.step, r.load, r.displacement, limits(r)) for r in history if r.step in done]
        if along_path
        else (),
        newton_iterations=newton_iterations,
    )


def limits_of(
    lowering: Lowering, start: StepRecord, below: Sequence[StepRecord], why_not: str = ""
) -> dict[str, LimitValue]:
    """Limits of everything that is reported with the problem's gamma.

    Args:
        lowering: by how much gamma was lowered.
        start: the load step with the problem's gamma.
        below: states with lower gamma at its load.
        why_not: a reason to withhold all of them.
    """
    reached = [start]
    for factor in lowering.factors[1:]:
        reached += [record for record in below if lowering.is_at(record, factor)][:1]
    measured = [reported(record) for record in reached]
    found = {}
    for name in measured[0]:
        values = [each.get(name, math.nan) for each in measured]
        at = tuple(values[::PER_DECADE])
        of_all = _ratio(values) if len(values) == len(lowering.factors) else None
        if why_not:
            made = withheld(why_not, of_all)
        elif name.rpartition(OF)[2] == WORK:
            made = withheld("it is summed along the path, and known of the first gamma alone", of_all)
        else:
            made = estimate(values)
        found[name] = _limit_value(made, at)
    return found


def reported(record: StepRecord) -> dict[str, float]:
    """What limits are made of: the gap and the reaction first."""
    gap = {} if record.gap is None else {GAP: record.gap}
    return {REACTION: record.reaction, **gap, **record.reported}


def with_uncertainty(value: float, uncertainty: float) -> str:
    """``0.025534 +- 0.000012``, with two digits of the uncertainty."""
    if not uncertainty > 0.0:
        return f"{value:.6g} ± 0"
    digits = 1 - math.floor(math.log10(uncertainty))
    largest = max(abs(value), uncertainty)
    if 1e-4 <= largest < 1e6 and digits >= 0:
        return f"{value:.{digits}f} ± {uncertainty:.{digits}f}"
    power = math.floor(math.log10(largest))
    shift, digits = 10.0**-power, max(digits + power, 0)
    return f"({value * shift:.{digits}f} ± {uncertainty * shift:.{digits}f})e{power:+03d}"


def _limit_value(made: Estimate, at: Sequence[float]) -> LimitValue:
    return LimitValue(made.value, made.uncertainty, made.ratio, made.reason, at)


def _ratio(values: Sequence[float]) -> float | None:
    return ratio_of(values) if all(math.isfinite(value) for value in values) else None


def _why_not(start: StepRecord, before: Sequence[StepRecord], below: Sequence[StepRecord], stopped: str) -> str:
    """Why nothing of one load can be believed, or nothing."""
    jump = next((record for record in before if record.jumped), None)
    if jump is not None:
        return f"the run jumped to another branch at load {jump.load:.4g}: which one belongs to gamma = 0 is not known"
    if stopped:
        return f"gamma could not be lowered to the end: {stopped}"
    if start.negative_pivots:
        return f"the state is unstable ({start.negative_pivots} negative pivots): the medium may have buckled"
    for record in below:
        at = ", ".join(f"{name} = {value:.2g}" for name, value in record.parameters.items())
        if record.jumped:
            return f"a step to {at} jumped to another branch"
        if record.negative_pivots:
            return (
                f"the state at {at} is unstable ({record.negative_pivots} negative pivots): the medium may have buckled"
            )
    return ""
