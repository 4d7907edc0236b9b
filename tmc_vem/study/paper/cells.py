"""Entries of tables that put the paper's values beside ours."""

from __future__ import annotations

from tmc_vem.report.page import Entry
from tmc_vem.report.tables import number, percent, reached
from tmc_vem.results.run_result import RunResult
from tmc_vem.study.paper.jobs import Cells
from tmc_vem.study.paper.values import Printed


def printed(cell: Printed) -> Entry:
    """A cell of the paper."""
    text = "does not converge" if cell.value is None else number(cell.value)
    return Entry(text, f"suspect: {cell.suspect}", "suspect") if cell.suspect else Entry(text)


def ours(run: RunResult | None) -> str | Entry:
    """Gap of a run."""
    if run is None:
        return Entry("failed", style="bad")
    return number(run.gap) if run.complete else Entry(reached(run), style="bad")


def ratio(value: float | None, cell: Printed) -> str | Entry:
    """A value of ours relative to a cell of the paper."""
    if value is None or cell.value is None:
        return "–"
    text = f"{value / cell.value:.3f}"
    return Entry(text, style="suspect") if cell.suspect else text


def judged(value: float | None, within: float) -> Entry:
    """Relative difference, marked by whether it is within a limit."""
    return Entry("–") if value is None else Entry(percent(value), style="good" if abs(value) <= within else "bad")


def mesh_name(cells: Cells) -> str:
    """Cells in x and y."""
    return f"{cells[0]} x {cells[1]}"
