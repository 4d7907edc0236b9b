"""Tables of contact: forces of the medium on bodies, and what there is to say of outlines that face each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tmc_vem.report.page import Table
from tmc_vem.report.tables import number
from tmc_vem.results.contact.pairs import OF_BODY, OF_PAIR, is_pair
from tmc_vem.results.records import heading
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.units import Units

BODIES = "Forces of the medium on the bodies, and their moments about the origin."
PAIRS = (
    "Outlines that face each other: the force is that on the first body, the centre that of contact. Widths are 0 "
    "while the gap is open."
)


def contact_tables(result: RunResult) -> list[Table]:
    """Contact at the last step; none where no solid is in medium."""
    units = Units(**result.inputs.get("units", {}))
    contact = {"body": (BODIES, OF_BODY), "pair": (PAIRS, OF_PAIR)}
    found = []
    for what, (caption, kinds) in contact.items():
        mine = {name: values for name, values in result.contact.items() if is_pair(values) == (what == "pair")}
        head = [what, *(heading(name, units.of(kind) if units.declared else "") for name, kind in kinds.items())]
        if mine:
            found.append(Table(caption, [name.replace("_", " ") for name in head], _rows(mine, kinds)))
    return found


def _rows(contact: Mapping[str, Mapping[str, float]], quantities: Iterable[str]) -> list[list[str]]:
    return [[name, *(number(values.get(quantity), 4) for quantity in quantities)] for name, values in contact.items()]
