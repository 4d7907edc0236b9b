"""Reproduce the paper's tables and figures: the runs in one batch, a page for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tmc_vem.report import cautions
from tmc_vem.report.page import Page, Section
from tmc_vem.report.tables import provenance, runs_csv
from tmc_vem.report.write import write_page
from tmc_vem.study.batch import Observer, run_batch
from tmc_vem.study.paper import body_figures, box_figures, table2, table3
from tmc_vem.study.paper.target import Results, Target
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import write_atomically

TARGETS: dict[str, Target] = {**table2.TARGETS, **table3.TARGETS, **box_figures.TARGETS, **body_figures.TARGETS}
ALL = "all"


def reproduce(
    names: Sequence[str],
    out: Path,
    *,
    quick: bool = False,
    command: str,
    processes: int = 2,
    observer: Observer | None = None,
) -> list[Path]:
    """Do the runs that are not done yet and write a page for each table or figure.

    Args:
        names: of ``TARGETS``, or 'all'.
        out: gets ``<name>.html``, ``<name>.md``, ``<name>.csv``, figures, and the run directories in ``runs``.
        quick: coarse meshes.
        command: the command line, for the pages.
        processes: runs at a time.
        observer: hears about progress.

    Returns:
        Paths of the HTML pages.

    Raises:
        InputError: a name is unknown, or the output directory cannot be used.
    """
    unknown = [name for name in names if name not in TARGETS and name != ALL]
    if unknown:
        raise InputError(f"the paper has no '{unknown[0]}' here: choose {', '.join([*TARGETS, ALL])}")
    wanted = list(TARGETS) if ALL in names else list(dict.fromkeys(names))
    jobs = {job.name: job for name in wanted for job in TARGETS[name].jobs(quick).values()}
    outcomes = run_batch(list(jobs.values()), out / "runs", processes=processes, observer=observer)
    results = {outcome.job.name: outcome.result for outcome in outcomes if outcome.result}
    failures = {outcome.job.name: outcome.error for outcome in outcomes if outcome.error}
    return [_page(name, results, failures, out, quick=quick, command=command) for name in wanted]


def _page(name: str, results: Results, failures: dict[str, str], out: Path, *, quick: bool, command: str) -> Path:
    target = TARGETS[name]
    jobs = target.jobs(quick)
    runs = {label: results[job.name] for label, job in jobs.items() if job.name in results}
    messages = [f"{label} gave no result: {failures[job.name]}" for label, job in jobs.items() if job.name in failures]
    findings = [*cautions.of_failures(messages), *cautions.of_runs(runs)]
    page = Page(
        f"{target.title}{' (coarse)' if quick else ''}",
        f"{target.lead} After Xu & Wriggers, CMAME 450 (2026) 118611.",
        [
            *target.sections(results, quick),
            Section("Warnings", [cautions.listed(findings)]),
            Section("How to repeat this", provenance(runs, command)),
        ],
    )
    write_atomically_in(out, f"{name}.csv", runs_csv(runs))
    return write_page(page, out, name)


def write_atomically_in(directory: Path, name: str, text: str) -> None:
    """Write a file into a directory that may not exist yet."""
    directory.mkdir(parents=True, exist_ok=True)
    write_atomically(directory / name, text)
