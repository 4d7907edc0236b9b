"""``tmc-vem list DIR``: a table of runs with their inputs and results."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tmc_vem.results.design_run import DesignRun
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import printable

if TYPE_CHECKING:
    from tmc_vem.report.page import Table as PageTable

# longer values make no column
WIDEST = 24
# columns that a narrow terminal keeps, and the order in which others are kept; one that is not named comes last
RESULTS = ("load", "gap", "reaction", "doubts")
ERROR = "estimated error"  # of what meshes were adapted to
IMPORTANT = (
    *RESULTS, ERROR, "problem", "method", "cells", "gamma", "alpha_r", "regulariser", "uy", "iterations", "time (s)",
    "dofs",
)  # fmt: skip


@click.command("list")
@click.argument("directory", type=click.Path(path_type=Path), default=Path("runs"))
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, and nothing else.")
@click.option("--csv", "as_csv", is_flag=True, help="Print every input and result as CSV, and nothing else.")
def list_runs(directory: Path, as_json: bool, as_csv: bool) -> None:
    """Show all runs below a directory with the inputs in which they differ, and their results.

    Searches for designs have a table of their own. Examples:

    \b
      tmc-vem list runs
      tmc-vem list runs --csv > runs.csv
    """
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    from tmc_vem.cli.columns import WHOLE, plain, show_table
    from tmc_vem.report.adapted_tables import errors_in_few_words
    from tmc_vem.report.overview import find_designs, find_runs
    from tmc_vem.report.tables import count, differing, number, reached, runs_csv

    if as_json and as_csv:
        raise InputError("--json and --csv: choose one")
    runs, unreadable = find_runs(directory)
    for message in unreadable:
        click.echo(f"tmc-vem: {printable(message)}", err=True)
    if as_json:
        click.echo(json.dumps({name: json.loads(run.to_json()) for name, run in runs.items()}, indent=2))
        return
    if as_csv:
        click.echo(runs_csv(runs), nl=False)
        return
    designs, others = find_designs(directory)
    for message in others:
        click.echo(f"tmc-vem: {printable(message)}", err=True)
    if not runs and not designs:
        click.echo(f"no runs below {directory}")
        return
    if designs:
        show_table(_of_designs(designs))
    if not runs:
        return
    differ, values = differing(runs)
    columns = [Column(name, [row[n] for row in values.values()]) for n, name in enumerate(differ)]
    columns = [c for c in columns if "–" not in c.cells and max(map(len, c.cells)) <= WIDEST]
    doubts = [_doubts(run) for run in runs.values()]
    errors = [errors_in_few_words(run) for run in runs.values()]
    columns += [
        Column("load", [reached(run) for run in runs.values()]),
        Column("gap", [number(run.gap, 5) for run in runs.values()]),
        Column("reaction", [number(run.reaction, 5) for run in runs.values()]),
        *([Column(ERROR, errors)] if any(errors) else []),
        *([Column("doubts", doubts)] if any(doubts) else []),
        Column("dofs", [count(run.n_dofs) for run in runs.values()]),
        Column("iterations", [str(run.newton_iterations) for run in runs.values()]),
        Column("time (s)", [f"{run.seconds['total']:.1f}" for run in runs.values()]),
    ]
    console = Console()
    first = Column("run", list(runs))
    shown = columns if not console.is_terminal else fitting(columns, console.width - first.width)
    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column(plain(first.heading), overflow="fold")
    for column in shown:
        table.add_column(plain(column.heading), no_wrap=True)
    for row in zip(first.cells, *(column.cells for column in shown), strict=True):
        table.add_row(*map(plain, row))
    (console if console.is_terminal else Console(width=WHOLE)).print(table)
    if left_out := [column.heading for column in columns if column not in shown]:
        click.echo(f"not shown, the terminal is too narrow: {', '.join(left_out)}; --csv has all")


def _of_designs(designs: Mapping[str, DesignRun]) -> PageTable:
    """A row for every search for a design."""
    from tmc_vem.report.page import Table

    head = ("design", "problem", "objective", "volume", "feasible", "converged", "evaluations", "time (s)")
    rows = [
        [
            name, run.problem, f"{run.of} = {run.objective:.5g}", f"{run.volume:.4g}",
            "yes" if run.feasible else "NO", "yes" if run.converged else "no", str(run.evaluations),
            f"{run.seconds['total']:.1f}",
        ]
        for name, run in designs.items()
    ]  # fmt: skip
    return Table("Searches for a design.", head, rows)


def _doubts(run: RunResult) -> str:
    """How many errors and warnings a result has; nothing for none."""
    counts = ((len(run.errors), "error"), (len(run.warnings), "warning"))
    return ", ".join(f"{n} {word}{'' if n == 1 else 's'}" for n, word in counts if n)


@dataclass(frozen=True)
class Column:
    """Heading and cells of a table's column."""

    heading: str
    cells: list[str]

    @property
    def width(self) -> int:
        """Characters that it needs, with what is between it and the next."""
        return max(map(len, (self.heading, *self.cells))) + 3

    @property
    def rank(self) -> int:
        """Place in the order of importance."""
        leaf = self.heading.rpartition(".")[2]
        return IMPORTANT.index(leaf) if leaf in IMPORTANT else len(IMPORTANT)


def fitting(columns: Sequence[Column], width: int) -> list[Column]:
    """The most important columns that fit into a width, in their order; the results always."""
    kept: list[Column] = []
    for column in sorted(columns, key=lambda column: column.rank):
        if column.heading in RESULTS or sum(c.width for c in (*kept, column)) <= width:
            kept.append(column)
    return [column for column in columns if column in kept]
