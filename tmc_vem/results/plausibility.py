"""What a user should know about a result before quoting it: thresholds, and the sentences that a run prints.

A run that reaches its load is not yet right: bodies may pass each other, the medium may carry the load or be as good as
inverted. An error says that the numbers are not those of the problem; a warning, that they need a second look. What is
said is judged by its effect on the numbers that are reported. docs/guide/failures.md defines the measures,
docs/solver.md lists the thresholds, which are matters of judgement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tmc_vem.results.contact.contact import Overlap
from tmc_vem.results.energy_balance import energy_balance
from tmc_vem.results.limit import GammaLimit
from tmc_vem.results.records import StepRecord, is_spring

ERROR, WARNING = "error", "warning"
LARGE_GAMMA = 1e-2
# Part of the reaction that the medium may take, before contact and at the end: it is off by about as much.
MEDIUM_REACTION = 0.05
# The medium counts as not yet squeezed while J stays above this in all of it.
UNSQUEEZED = 0.5
SMALLEST_SOLID_J, SMALLEST_MEDIUM_J = 0.2, 1e-6
# Shear over pressure that a layer of medium has without friction, over J: 3 k / (2 + k^2) at its largest, k^2 = 2.
PARASITIC = 1.0607
# Part of the coefficient of friction that it may have.
PARASITIC_FRICTION = 0.05
FEW = 4  # loads that are named
SAME = 1e-9  # relative difference of parameters that are equal


@dataclass(frozen=True)
class Finding:
    """Something doubtful: ``severity`` is 'error' or 'warning', ``text`` a sentence."""

    severity: str
    text: str


@dataclass(frozen=True)
class Evidence:
    """What a run is judged by.

    Attributes:
        inputs: parameters of the run.
        history: its converged steps.
        checks: what the deformed solids look like at the end, see
            :class:`tmc_vem.results.contact.contact.ContactReport`.
        media: names of the regions that are third medium and nothing else.
        size: of the domain.
        complete: whether the last step is the end of the path, so that its reaction is the one that is quoted.
        designs: names of design regions, in which a solid is in medium: what they resist with is no fault of a medium.
    """

    inputs: Mapping[str, Any]
    history: Sequence[StepRecord]
    checks: Mapping[str, Any]
    media: Sequence[str]
    size: float
    complete: bool = True
    designs: Sequence[str] = ()

    @property
    def last(self) -> StepRecord | None:
        """The last converged step."""
        return self.history[-1] if self.history else None

    @property
    def quoted(self) -> int:
        """Number of the step whose reaction is quoted: the last one with the largest load, from 0."""
        most = max(abs(record.load) for record in self.history)
        return max(n for n, record in enumerate(self.history) if abs(record.load) >= (1.0 - SAME) * most)

    def squeezed(self, record: StepRecord) -> bool:
        """Whether the medium is squeezed somewhere."""
        return any(record.min_j[name] < UNSQUEEZED for name in (*self.media, *self.designs))

    def in_medium(self, record: StepRecord) -> float:
        """Energy of the medium."""
        return sum(record.energy[name] for name in self.media)

    def into_friction(self, record: StepRecord) -> float:
        """Work that has gone into friction so far."""
        return sum(values["work"] for values in record.friction.values())


Rule = Callable[[Evidence], Iterable[Finding]]


def findings_of(evidence: Evidence) -> list[Finding]:
    """All that is doubtful, the weightiest first: errors before warnings, each in the order of ``RULES``."""
    return by_weight(finding for rule in RULES for finding in rule(evidence))


def by_weight(findings: Iterable[Finding]) -> list[Finding]:
    """Errors before warnings; else the order stays."""
    return sorted(findings, key=lambda finding: finding.severity != ERROR)


def overlap(evidence: Evidence) -> Iterable[Finding]:
    """Solids that overlap by more than is tolerated."""
    checks = evidence.checks
    depth, area = checks.get("penetration_depth") or 0.0, checks.get("overlap_area") or 0.0
    if Overlap(area, depth).exceeds(evidence.size):
        yield Finding(ERROR, f"{checks['summary']}: use smaller cells there or more medium around sharp corners")


def other_parameters(evidence: Evidence) -> Iterable[Finding]:
    """A last state that belongs to another medium than the problem's."""
    last = evidence.last
    for name, value, wanted in differing_parameters(last, evidence.inputs) if last else ():
        yield Finding(ERROR, f"the last state has {name} = {value:.4g}, not {wanted:.4g}: it was not yet brought back")


def instability(evidence: Evidence) -> Iterable[Finding]:
    """A last state that is an equilibrium but no minimum."""
    last = evidence.last
    if last and last.negative_pivots:
        yield Finding(
            WARNING, f"the last state is unstable ({last.negative_pivots} negative pivots): there may be others"
        )


def jumps(evidence: Evidence) -> Iterable[Finding]:
    """Steps to another branch."""
    loads = [f"{record.load:.4g}" for record in evidence.history if record.jumped]
    if loads:
        more = f" and {len(loads) - FEW} more" if len(loads) > FEW else ""
        at = f"{', '.join(loads[:FEW])}{more}"
        yield Finding(
            WARNING, f"the equilibrium branch ended and the run jumped to another one at load {at}{_lost(evidence)}"
        )


def _lost(evidence: Evidence) -> str:
    """What the jumps lost, relative to all work; nothing for old runs."""
    balance = energy_balance(evidence.history)
    largest = max((sum(record.energy.values()) for record in evidence.history), default=0.0)
    if balance is None or not largest > 0.0:
        return ""
    return f"; {balance.lost:.2g} of energy was lost, where {largest:.2g} is stored at most"


def friction_behind(evidence: Evidence) -> Iterable[Finding]:
    """A step in which friction was farther behind than was asked for."""
    found, wanted = evidence.checks.get("friction_error"), evidence.inputs.get("friction_error")
    if found and wanted and found["largest"] > wanted * (1.0 + SAME):
        equal = evidence.inputs.get("load_steps")
        remedy = "take more steps" if equal else "take a smaller friction_error, or equal steps (--steps)"
        yield Finding(
            WARNING,
            f"friction was {found['largest']:.2g} of the largest friction behind in the step to load "
            f"{found['load']:.4g}, not {wanted:g}: {remedy}",
        )


def friction_behind_below(evidence: Evidence) -> Iterable[Finding]:
    """The same with lower gamma, from which limits are made."""
    found, wanted = evidence.checks.get("friction_error_lowered"), evidence.inputs.get("friction_error")
    if found and wanted and found["largest"] > wanted * (1.0 + SAME):
        yield Finding(
            WARNING,
            f"with lower gamma friction was up to {found['largest']:.2g} of the largest friction behind in a step, not "
            f"{wanted:g}: limits are that uncertain as well",
        )


def medium_before_contact(evidence: Evidence) -> Iterable[Finding]:
    """The medium's part of the reaction while nothing touches, relative to the reaction that is quoted."""
    before = None
    for record in evidence.history:
        if record.parameters or evidence.squeezed(record):
            break
        before = record
    if before is None or not (evidence.media and evidence.complete):
        return
    total = sum(before.energy.values())
    quoted = evidence.history[evidence.quoted]
    if not (total > 0.0 and quoted.reaction):
        return
    parasitic = evidence.in_medium(before) / total * abs(before.reaction)
    share = parasitic / abs(quoted.reaction)
    if share > MEDIUM_REACTION:
        yield Finding(
            WARNING,
            f"before contact (load {before.load:.3g}) the medium alone gives {_percent(share)} of the final reaction "
            f"({parasitic:.2g} of {abs(quoted.reaction):.3g}; more than {MEDIUM_REACTION:.0%} counts): "
            "use a smaller gamma",
        )


def medium_in_contact(evidence: Evidence) -> Iterable[Finding]:
    """The part of the quoted reaction that works on the medium instead of the bodies; a force that acts is known."""
    if not (evidence.history and evidence.media and evidence.complete):
        return
    n = evidence.quoted
    now, before = evidence.history[n], evidence.history[n - 1] if n else None
    if not evidence.squeezed(now) or now.jumped or _is_pushed(now):
        return
    if before is None:
        work, medium = sum(now.energy.values()) + evidence.into_friction(now), evidence.in_medium(now)
    elif before.parameters != now.parameters or before.displacement == now.displacement:
        return
    else:
        work = sum(now.energy.values()) - sum(before.energy.values())
        work += evidence.into_friction(now) - evidence.into_friction(before)
        medium = evidence.in_medium(now) - evidence.in_medium(before)
    share = medium / work if work > 0.0 else 0.0
    if share > MEDIUM_REACTION:
        yield Finding(
            WARNING,
            f"{_percent(min(share, 1.0))} of the final reaction squeezes the medium and not the bodies (more than "
            f"{MEDIUM_REACTION:.0%} counts; it is off by about as much): use a smaller gamma or alpha_r, "
            "or cite the limit that extrapolate_gamma gives",
        )


def _is_pushed(record: StepRecord) -> bool:
    """Whether forces act, other than those of springs."""
    return not all(is_spring(measures) for measures in record.forces.values())


def stiffer_medium(evidence: Evidence) -> Iterable[Finding]:
    """Steps that were taken with a stiffer medium than the last one."""
    last = evidence.last
    if last is None or "continuation" in evidence.inputs:
        return
    stiff = [record for record in evidence.history if record.parameters and record.parameters != last.parameters]
    if stiff:
        loads = f"{stiff[0].load:.4g} to {stiff[-1].load:.4g}"
        yield Finding(
            WARNING, f"steps at loads {loads} have a stiffer medium, as the branch ended (parameter_* in history.csv)"
        )


def inverted(evidence: Evidence) -> Iterable[Finding]:
    """Cells in which J is not positive between the quadrature points."""
    count = evidence.checks.get("inverted_cells") or {}
    if count:
        cells = " and ".join(f"{n} cell{'s' if n > 1 else ''} of '{name}'" for name, n in count.items())
        since = evidence.checks.get("inverted_from")
        seen = "" if since is None else f" (seen first at load {since:.4g})"
        yield Finding(
            WARNING,
            f"J < 0 between the quadrature points in {cells}{seen}: a corner may go through the medium there; use "
            "smaller cells, or round it",
        )


def jacobians(evidence: Evidence) -> Iterable[Finding]:
    """Cells that are as good as inverted, solids first."""
    last = evidence.last
    media = {*evidence.media, *evidence.designs}
    for name, value in sorted(last.min_j.items(), key=lambda item: item[0] in media) if last else ():
        limit = SMALLEST_MEDIUM_J if name in media else SMALLEST_SOLID_J
        if value < limit:
            yield Finding(
                WARNING, f"smallest J in region '{name}' is {value:.2g}, below {limit:g}: use smaller cells there"
            )


def large_gamma(evidence: Evidence) -> Iterable[Finding]:
    """A medium that is a body of its own."""
    for value in dict.fromkeys(wanted_parameters(evidence.inputs, "gamma")):
        if value > LARGE_GAMMA:
            yield Finding(
                WARNING,
                f"gamma = {value:g} is above {LARGE_GAMMA:g}: the medium acts as a body of its own; use 1e-3 or less",
            )


def parasitic_friction(evidence: Evidence) -> Iterable[Finding]:
    """A medium whose own friction is not small against that which was asked for."""
    last = evidence.last
    for name, values in last.friction.items() if last else ():
        wanted, J = coefficient_of(evidence.inputs, name), values.get("contact_j")
        if wanted and J is not None and PARASITIC * J / wanted > PARASITIC_FRICTION:
            own = PARASITIC * J
            yield Finding(
                WARNING,
                f"the medium '{name}' has a friction of its own of up to {own:.2g} ({PARASITIC:.2f} J, with J = "
                f"{J:.2g} in contact), {_percent(own / wanted)} of friction = {wanted:g} (more than "
                f"{PARASITIC_FRICTION:.0%} counts): use a smaller gamma, "
                "or cite friction_coefficient, which is without it",
            )


def limit_findings(limit: GammaLimit) -> list[Finding]:
    """Limits for gamma to 0 that are withheld, those with the same reason together."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in limit.withheld.items():
        by_reason.setdefault(reason, []).append(name)
    found = []
    for reason, names in by_reason.items():
        more = f" and {len(names) - FEW} more" if len(names) > FEW else ""
        text = f"no limit for gamma to 0 of {', '.join(names[:FEW])}{more}: {reason}"
        found.append(Finding(WARNING, text))
    return found


# the order is that of their weight
RULES: tuple[Rule, ...] = (
    overlap, other_parameters, instability, jumps, medium_before_contact, medium_in_contact, stiffer_medium, inverted,
    jacobians, parasitic_friction, large_gamma, friction_behind,
    friction_behind_below,
)  # fmt: skip


def wanted_parameters(inputs: Mapping[str, Any], name: str) -> list[float]:
    """Values of a medium's parameter that a problem asks for, in all its media."""
    media = [inputs.get("medium"), *(region.get("medium") for region in _tables(inputs.get("regions")))]
    return [float(medium[name]) for medium in media if isinstance(medium, Mapping) and name in medium]


def coefficient_of(inputs: Mapping[str, Any], region: str) -> float | None:
    """Coefficient of friction of a medium as it was asked for; None if the inputs do not say."""
    of_region = inputs.get("regions", {})
    table = of_region.get(region) if isinstance(of_region, Mapping) else None
    medium = table.get("medium") if isinstance(table, Mapping) else inputs.get("medium")
    friction = medium.get("friction") if isinstance(medium, Mapping) else None
    return None if friction is None else float(friction)


def differing_parameters(record: StepRecord, inputs: Mapping[str, Any]) -> list[tuple[str, float, float]]:
    """Parameters (name, value, the problem's value) of a step that are not those of the problem."""
    found = []
    for name, value in record.parameters.items():
        wanted = wanted_parameters(inputs, name)
        if wanted and not any(abs(value - w) <= SAME * abs(w) for w in wanted):
            found.append((name, value, wanted[0]))
    return found


def _tables(tables: Any) -> list[Mapping[str, Any]]:
    return [table for table in tables.values() if isinstance(table, Mapping)] if isinstance(tables, Mapping) else []


def _percent(share: float) -> str:
    """A share above a limit of a few percent, never the limit itself."""
    return f"{share:.1%}" if share < 0.1 else f"{share:.0%}"
