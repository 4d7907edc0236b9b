"""Tables of contact: forces of the medium on bodies, and what there is to say of outlines that face each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tmc_vem.problems.contact_quantities import OF_BODY, OF_FRICTION, OF_PAIR, is_pair
from tmc_vem.report.page import Table
from tmc_vem.report.tables import number, percent
from tmc_vem.results.records import heading
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.units import Units

BODIES = "Forces of the medium on the bodies, and their moments about the origin."
PAIRS = (
    "Outlines that face each other: the force is that on the first body, the centre that of contact. Widths are 0 "
    "while the gap is open."
)
RUBBING = (
    "Friction: the force of the shear on the body, or on the first one of a pair; shear over pressure, all of it and "
    "that of friction alone, without the medium's own; the part of the largest shear that sticks; the largest slip. "
    "Empty without contact."
)


def contact_tables(result: RunResult) -> list[Table]:
    """Contact at the last step; none where no solid is in medium."""
    units = Units(**result.inputs.get("units", {}))
    shares = result.checks.get("regulariser_share", {})
    bodies = {name: values for name, values in result.contact.items() if not is_pair(values)}
    pairs = {name: values for name, values in result.contact.items() if is_pair(values)}
    found = []
    if bodies:
        found.append(Table(BODIES, ["body", *_headings(OF_BODY, units)], _rows(bodies, OF_BODY, {})))
    if pairs:
        share = ["regulariser's share of pressure"] if shares else []
        found.append(Table(PAIRS, ["pair", *_headings(OF_PAIR, units), *share], _rows(pairs, OF_PAIR, shares)))
    rubbing = {name: values for name, values in result.contact.items() if "friction" in values}
    if rubbing:
        found.append(Table(RUBBING, ["body or pair", *_headings(OF_FRICTION, units)], _rows(rubbing, OF_FRICTION, {})))
    return found


def _headings(kinds: Mapping[str, str], units: Units) -> list[str]:
    return [heading(name.replace("_", " "), units.of(kind) if units.declared else "") for name, kind in kinds.items()]


def _rows(
    contact: Mapping[str, Mapping[str, float]], quantities: Iterable[str], shares: Mapping[str, float]
) -> list[list[str]]:
    rows = []
    for name, values in contact.items():
        last = [percent(shares.get(name))] if shares else []
        rows.append([name, *(number(values.get(quantity), 4) for quantity in quantities), *last])
    return rows
