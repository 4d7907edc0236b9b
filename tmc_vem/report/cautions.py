"""What a reader must be warned about: runs that stopped or warn themselves, solids that overlap, mixed versions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tmc_vem.errors import InputError
from tmc_vem.report.contact import check_contact
from tmc_vem.report.snapshots import read_fields, snapshots
from tmc_vem.report.tables import reached
from tmc_vem.results import RunResult

ROUNDING = 1e-6  # of the domain's size: overlaps below this are not worth a warning


def of_runs(runs: Mapping[str, RunResult]) -> list[str]:
    """Warnings from the results alone; the same sentence about several runs is said once."""
    said: dict[str, list[str]] = {}
    for name, run in runs.items():
        found = list(run.warnings)
        if not run.complete:
            found.insert(0, f"{reached(run)} of the load: {run.reason}")
        for sentence in found:
            said.setdefault(sentence, []).append(name)
    messages = [f"{_some(names)}: {sentence}" for sentence, names in said.items()]
    return messages + _mixed(runs.values())


def _some(names: list[str]) -> str:
    """Names, not more than a few."""
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:2])} and {len(names) - 2} others"


def _mixed(runs: Iterable[RunResult]) -> list[str]:
    revisions = sorted({str(run.versions.get("revision")) for run in runs} - {"None"})
    if len(revisions) < 2:
        return []
    return [f"the runs were made by {len(revisions)} revisions of the program: {', '.join(revisions)}"]


def of_contact(runs: Mapping[str, RunResult]) -> tuple[list[list[str]], list[str]]:
    """Rows (run, what the deformed solids look like) of the last written states, and warnings where solids overlap."""
    rows, messages = [], []
    for name, run in runs.items():
        try:
            fields = read_fields(run, snapshots(run)[-1])
        except (InputError, IndexError) as error:
            messages.append(f"{name} was not checked for interpenetration: {error}")
            continue
        contact = check_contact(fields, order=int(run.inputs.get("order", 2)))
        rows.append([name, contact.summary()])
        told = any(contact.summary() in sentence for sentence in run.warnings)
        if not told and (contact.penetration_depth > ROUNDING or contact.overlap_area > ROUNDING):
            messages.append(f"{name}: {contact.summary()}")
    return rows, messages
