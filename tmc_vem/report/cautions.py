"""What a reader must be told about: runs that stopped or warn themselves, solids that overlap, mixed versions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tmc_vem.report.page import Warnings
from tmc_vem.report.tables import stopped
from tmc_vem.results.contact.contact import check_contact
from tmc_vem.results.plausibility import ERROR, WARNING, Evidence, Finding, by_weight, findings_of, overlap
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.snapshots import read_fields, snapshots
from tmc_vem.results.unfinished import RUNNING, how_to_go_on
from tmc_vem.support.errors import InputError


def listed(findings: Iterable[Finding]) -> Warnings:
    """The findings as they stand in a report, errors first."""
    ordered = by_weight(findings)
    return Warnings(
        [finding.text for finding in ordered if finding.severity != ERROR],
        [finding.text for finding in ordered if finding.severity == ERROR],
    )


def of_failures(messages: Sequence[str]) -> list[Finding]:
    """Jobs that gave no result."""
    return [Finding(ERROR, message) for message in messages]


def of_runs(runs: Mapping[str, RunResult]) -> list[Finding]:
    """What the results alone say; the same sentence about several runs is said once."""
    said: dict[Finding, list[str]] = {}
    for name, run in runs.items():
        found = [Finding(ERROR, text) for text in run.errors] + [Finding(WARNING, text) for text in run.warnings]
        if run.unfinished:
            found += findings_of(Evidence(run.inputs, run.history, {}, run.media, 0.0, complete=False))
        if not run.complete:
            how = how_to_go_on(run.directory) if run.cut_short and run.directory is not None else ""
            text = f"{stopped(run)}; {how}" if how else stopped(run)
            found.insert(0, Finding(WARNING if run.unfinished == RUNNING else ERROR, text))
        for finding in found:
            said.setdefault(finding, []).append(name)
    findings = [Finding(finding.severity, f"{_some(names)}: {finding.text}") for finding, names in said.items()]
    return findings + _mixed(runs.values())


def _some(names: list[str]) -> str:
    """Names, not more than a few."""
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:2])} and {len(names) - 2} others"


def _mixed(runs: Iterable[RunResult]) -> list[Finding]:
    revisions = sorted({str(run.versions.get("revision")) for run in runs} - {"None"})
    if len(revisions) < 2:
        return []
    text = f"the runs were made by {len(revisions)} revisions of the program: {', '.join(revisions)}"
    return [Finding(WARNING, text)]


def of_contact(runs: Mapping[str, RunResult]) -> tuple[list[list[str]], list[Finding]]:
    """Rows (run, what the deformed solids look like) of the last written states, and where solids overlap."""
    rows, findings = [], []
    for name, run in runs.items():
        try:
            fields = read_fields(run, snapshots(run)[-1])
        except (InputError, IndexError) as error:
            findings.append(Finding(WARNING, f"{name} was not checked for interpenetration: {error}"))
            continue
        contact = check_contact(fields, order=int(run.inputs.get("order", 2)))
        rows.append([name, contact.summary()])
        if any(contact.summary() in sentence for sentence in (*run.errors, *run.warnings)):
            continue
        size = float(np.ptp(fields.polygons.points_nx, axis=0).max())
        seen = Evidence({}, (), {**contact.as_dict(), "summary": contact.summary()}, (), size)
        findings += [Finding(finding.severity, f"{name}: {finding.text}") for finding in overlap(seen)]
    return rows, findings
