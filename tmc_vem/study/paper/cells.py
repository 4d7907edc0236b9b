"""Entries of tables that put the paper's values beside ours."""

from __future__ import annotations

from tmc_vem.report.page import Cell
from tmc_vem.report.tables import number, percent, reached
from tmc_vem.results.run_result import RunResult
from tmc_vem.study.paper.jobs import Cells
from tmc_vem.study.paper.values import Cell as Printed


def printed(cell: Printed) -> Cell:
    """A cell of the paper."""
    text = "does not converge" if cell.value is None else number(cell.value)
    return Cell(text, f"suspect: {cell.suspect}", "suspect") if cell.suspect else Cell(text)


def ours(run: RunResult | None) -> str | Cell:
    """Gap of a run."""
    if run is None:
        return Cell("failed", style="bad")
    return number(run.gap) if run.complete else Cell(reached(run), style="bad")


def ratio(value: float | None, cell: Printed) -> str | Cell:
    """A value of ours relative to a cell of the paper."""
    if value is None or cell.value is None:
        return "–"
    text = f"{value / cell.value:.3f}"
    return Cell(text, style="suspect") if cell.suspect else text


def judged(value: float | None, within: float) -> Cell:
    """Relative difference, marked by whether it is within a limit."""
    return Cell("–") if value is None else Cell(percent(value), style="good" if abs(value) <= within else "bad")


def mesh_name(cells: Cells) -> str:
    """Cells in x and y."""
    return f"{cells[0]} x {cells[1]}"
