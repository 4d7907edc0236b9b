"""Runs of one problem with several values of some entries: as a table, as CSV and JSON, and as a page with curves."""

from __future__ import annotations

import csv
import io
import json
import numbers
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tmc_vem.report import cautions, plots, tables
from tmc_vem.report.page import Block, Entry, Page, Picture, Section, Table, Text, picture
from tmc_vem.report.tables import number, reached, stopped, with_unit
from tmc_vem.results.records import finite
from tmc_vem.results.run_result import RunResult

REACTION = "reaction"


@dataclass(frozen=True)
class Row:
    """A combination of values, and what became of its run.

    Attributes:
        values: by name of the entry.
        result: of the run, complete or not.
        error: why there is none.
        name: of the run directory; empty if nothing could be run.
    """

    values: Mapping[str, Any]
    result: RunResult | None
    error: str = ""
    name: str = ""

    @property
    def complete(self) -> bool:
        """Whether the full load was reached."""
        return self.result is not None and self.result.complete

    @property
    def why(self) -> str:
        """Why the full load was not reached; empty if it was."""
        return self.error if self.result is None else ("" if self.result.complete else stopped(self.result))

    def final(self, quantity: str) -> float | None:
        """A probe or the reaction at full load; None if the run did not get there."""
        if self.result is None or not self.result.complete:
            return None
        return self.result.reaction if quantity == REACTION else self.result.probes.get(quantity)


@dataclass(frozen=True)
class Sweep:
    """All rows.

    Attributes:
        title: of the page.
        command: with which it was made.
        axes: entries with several values, by name.
        rows: one for each combination.
    """

    title: str
    command: str
    axes: Sequence[str]
    rows: Sequence[Row]

    @property
    def short(self) -> dict[str, str]:
        """What the axes are called in tables: their last keys, as far as these differ."""
        last = {axis: re.split(r"[.\"']+", axis.strip("\"'"))[-1] for axis in self.axes}
        return {axis: word if list(last.values()).count(word) == 1 else axis for axis, word in last.items()}

    @property
    def runs(self) -> dict[str, RunResult]:
        """Results by what their combinations are called."""
        return {self.label(row): row.result for row in self.rows if row.result is not None}

    @property
    def quantities(self) -> list[str]:
        """Gap, other probes and reaction."""
        probes = dict.fromkeys(name for run in self.runs.values() for name in run.probes)
        return [*probes, REACTION]

    @property
    def failures(self) -> list[str]:
        """Combinations without a result, and why."""
        return [f"{self.label(row)} gave no result: {row.error}" for row in self.rows if row.result is None]

    def label(self, row: Row, without: str = "") -> str:
        """What a combination is called, ``mu = 10, uy = -0.3``; an axis may be left out."""
        return ", ".join(f"{self.short[axis]} = {said(row.values[axis])}" for axis in self.axes if axis != without)

    def table(self) -> Table:
        """A row for each combination."""
        quantities = self.quantities
        shown: list[list[str | Entry]] = []
        for row in self.rows:
            result = row.result
            shown.append(
                [
                    *(said(row.values[axis]) for axis in self.axes),
                    Entry("no result" if result is None else reached(result), style="" if row.complete else "bad"),
                    *(number(row.final(quantity)) for quantity in quantities),
                    number(min(result.min_j.values(), default=None) if result else None),
                    str(result.newton_iterations) if result else "–",
                    tables.seconds(result.seconds["total"] if result else None),
                    Entry(row.why, style="long"),
                ]
            )
        head = [
            *self.short.values(), "load", *(with_unit(quantity, self.runs, quantity) for quantity in quantities),
            "smallest J", "Newton iterations", "time (s)", "why not",
        ]  # fmt: skip
        return Table("Probes and reaction at full load; a dash where a run did not get there.", head, shown)

    def as_dicts(self) -> list[dict[str, Any]]:
        """The rows as plain values, with all digits."""
        found = []
        for row in self.rows:
            result = row.result
            entry = {
                "set": dict(row.values),
                "complete": row.complete,
                "load": result.load if result else None,
                **{quantity: row.final(quantity) for quantity in self.quantities},
                "min_j": dict(result.min_j) if result else {},
                "newton_iterations": result.newton_iterations if result else None,
                "seconds": result.seconds["total"] if result else None,
                "directory": f"runs/{row.name}" if row.name else None,
                "why": row.why,
            }
            found.append(finite(entry))
        return found

    def to_json(self) -> str:
        """The rows as JSON."""
        return json.dumps(self.as_dicts(), indent=2) + "\n"

    def to_csv(self) -> str:
        """The rows as CSV, a column for each entry of :meth:`as_dicts`."""
        rows = []
        for entry in self.as_dicts():
            flat = {f"set {name}": value for name, value in entry.pop("set").items()}
            of_regions = {f"min_j_{name}": value for name, value in entry.pop("min_j").items()}
            rows.append({**flat, **entry, **of_regions})
        text = io.StringIO()
        writer = csv.DictWriter(text, list(dict.fromkeys(key for row in rows for key in row)), restval="")
        writer.writeheader()
        writer.writerows({key: "" if value is None else value for key, value in row.items()} for row in rows)
        return text.getvalue()


def said(value: Any) -> str:
    """A value in tables and names."""
    if isinstance(value, bool | str):
        return str(value).lower() if isinstance(value, bool) else value
    return f"{value:.6g}" if isinstance(value, float) else json.dumps(value)


def sweep_page(sweep: Sweep) -> Page:
    """The report."""
    runs = sweep.runs
    findings = [*cautions.of_failures(sweep.failures), *cautions.of_runs(runs)]
    sections = [
        Section("Result", [sweep.table(), cautions.listed(findings)]),
        Section("Against the values", _final(sweep)),
        Section(
            "Loading",
            [
                picture(plots.gap_and_reaction(runs), "loading", "Gap and reaction during loading."),
                *plots.probe_pictures(runs),
                picture(plots.smallest_j(runs), "smallest-j", "Smallest J during loading."),
            ],
        ),
        Section("Solution", [tables.effort(runs)]),
        Section("How to repeat this", tables.provenance(runs, sweep.command)),
    ]
    lead = f"{len(sweep.rows)} combinations of {', '.join(sweep.axes)}. Everything on this page comes from the run " \
        "directories beside it."  # fmt: skip
    return Page(sweep.title, lead, sections)


def _final(sweep: Sweep) -> list[Block]:
    pictures: list[Picture] = []
    for n, axis in enumerate(sweep.axes):
        if all(_is_number(row.values[axis]) for row in sweep.rows):
            lines = final_lines(sweep, axis)
            if lines:
                pictures += plots.final_values(lines, sweep.short[axis], f"final-{n + 1}")
    return list(pictures) or [Text("No entry with numbers has runs that reach full load.")]


def final_lines(sweep: Sweep, axis: str) -> dict[str, dict[str, list[tuple[float, float]]]]:
    """Final values against an entry: by heading of the value and by the values of the other entries, the points."""
    found: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for quantity in sweep.quantities:
        for row in sweep.rows:
            value = row.final(quantity)
            if value is not None:
                lines = found.setdefault(with_unit(quantity, sweep.runs, quantity), {})
                lines.setdefault(sweep.label(row, axis), []).append((float(row.values[axis]), value))
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)
