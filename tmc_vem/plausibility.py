"""What a user should know about a result before quoting it: thresholds, and the sentences that a run prints.

A run that reaches its load is not yet right: the medium may carry the load, be as good as inverted, or let bodies pass.
The thresholds are matters of judgement; docs/solver.md gives the reasons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tmc_vem.results import StepRecord

LARGE_GAMMA = 1e-2
# Part of the external work that goes into the medium before it is squeezed: a force without contact.
PARASITIC_FORCE = 0.05
# The medium counts as not yet squeezed while J stays above this in all of it.
UNSQUEEZED = 0.5
# Part of the stored energy that is in the medium at the end.
MEDIUM_ENERGY = 0.05
SMALLEST_SOLID_J, SMALLEST_MEDIUM_J = 0.2, 1e-6
OVERLAP = 1e-6  # depth relative to the size of the domain, and area relative to its square


def warnings_of(
    inputs: Mapping[str, Any], history: Sequence[StepRecord], checks: Mapping[str, Any], media: Sequence[str],
    size: float,
) -> list[str]:  # fmt: skip
    """Sentences about what is doubtful in a run.

    Args:
        inputs: parameters of the run.
        history: its converged steps.
        checks: what the deformed solids look like at the end, see :class:`tmc_vem.report.contact.ContactReport`.
        media: names of the regions that are third medium.
        size: of the domain.
    """
    found = [*_of_inputs(inputs)]
    if history:
        found += [*_parasitic_force(history, media), *_energy(history[-1], media), *_jacobians(history[-1], media)]
        if history[-1].negative_pivots:
            found.append(
                f"the last state is unstable ({history[-1].negative_pivots} negative pivots): there may be others"
            )
        stiff = [record for record in history if record.parameters and record.parameters != history[-1].parameters]
        if stiff and "continuation" not in inputs:
            loads = f"{stiff[0].load:.4g} to {stiff[-1].load:.4g}"
            found.append(
                f"steps at loads {loads} have a stiffer medium, as the branch ended (parameter_* in history.csv)"
            )
        jumps = [f"{record.load:.4g}" for record in history if record.jumped]
        if jumps:
            found.append(f"the equilibrium branch ended and the run jumped to another one at load {', '.join(jumps)}")
    depth, area = checks.get("penetration_depth") or 0.0, checks.get("overlap_area") or 0.0
    if depth > OVERLAP * size or area > OVERLAP * size**2:
        found.append(f"{checks['summary']}: use smaller cells there or more medium around sharp corners")
    return found


def _of_inputs(inputs: Mapping[str, Any]) -> list[str]:
    gamma = inputs.get("medium", {}).get("gamma", 0.0)
    if gamma > LARGE_GAMMA:
        return [f"gamma = {gamma:g} is above {LARGE_GAMMA:g}: the medium acts as a body of its own; use 1e-3 or less"]
    return []


def _parasitic_force(history: Sequence[StepRecord], media: Sequence[str]) -> list[str]:
    """Work done on the medium per work done on all, up to the last step before the medium is squeezed."""
    before = None
    for record in history:
        if record.parameters or any(record.min_j[name] < UNSQUEEZED for name in media):
            break
        before = record
    if before is None or not media:
        return []
    total = sum(before.energy.values())
    share = sum(before.energy[name] for name in media) / total if total > 0.0 else 0.0
    if share <= PARASITIC_FORCE:
        return []
    return [
        f"the medium takes {_percent(share)} of the work before contact (load {before.load:.3g}; more than "
        f"{PARASITIC_FORCE:.0%} shows in the reaction): use a smaller gamma"
    ]


def _percent(share: float) -> str:
    """A share above a limit of a few percent, never the limit itself."""
    return f"{share:.1%}" if share < 0.1 else f"{share:.0%}"


def _energy(last: StepRecord, media: Sequence[str]) -> list[str]:
    total = sum(last.energy.values())
    share = sum(last.energy[name] for name in media) / total if total > 0.0 else 0.0
    if share <= MEDIUM_ENERGY:
        return []
    return [
        f"the medium holds {_percent(share)} of the energy (above {MEDIUM_ENERGY:.0%}): use a smaller gamma or alpha_r"
    ]


def _jacobians(last: StepRecord, media: Sequence[str]) -> list[str]:
    found = []
    for name, value in last.min_j.items():
        limit = SMALLEST_MEDIUM_J if name in media else SMALLEST_SOLID_J
        if value < limit:
            found.append(f"smallest J in region '{name}' is {value:.2g}, below {limit:g}: use smaller cells there")
    return found
