"""``tmc-vem list DIR``: a table of runs with their inputs and results."""

from __future__ import annotations

import json
from pathlib import Path

import click

from tmc_vem.errors import InputError

# longer values make no column
WIDEST = 24


@click.command("list")
@click.argument("directory", type=click.Path(path_type=Path), default=Path("runs"))
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, and nothing else.")
@click.option("--csv", "as_csv", is_flag=True, help="Print every input and result as CSV, and nothing else.")
def list_runs(directory: Path, as_json: bool, as_csv: bool) -> None:
    """Show all runs below a directory with the inputs in which they differ, and their results. Examples:

    \b
      tmc-vem list runs
      tmc-vem list runs --csv > runs.csv
    """
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    from tmc_vem.report.overview import find_runs
    from tmc_vem.report.tables import differing, number, reached, runs_csv

    if as_json and as_csv:
        raise InputError("--json and --csv: choose one")
    runs, unreadable = find_runs(directory)
    for message in unreadable:
        click.echo(f"tmc-vem: {message}", err=True)
    if as_json:
        click.echo(json.dumps({name: json.loads(run.to_json()) for name, run in runs.items()}, indent=2))
        return
    if as_csv:
        click.echo(runs_csv(runs), nl=False)
        return
    if not runs:
        click.echo(f"no runs below {directory}")
        return
    differ, values = differing(runs)
    columns = [[row[n] for row in values.values()] for n in range(len(differ))]
    shown = [n for n, column in enumerate(columns) if "–" not in column and max(map(len, column)) <= WIDEST]
    names = [differ[n] for n in shown]
    table = Table(box=SIMPLE, pad_edge=False)
    for heading in ("run", *names, "load", "gap", "reaction", "dofs", "iterations", "time (s)"):
        table.add_column(heading, overflow="fold")
    for name, run in runs.items():
        inputs = [values[name][n] for n in shown]
        table.add_row(
            name, *inputs, reached(run), number(run.gap, 5), number(run.reaction, 5), str(run.n_dofs),
            str(run.newton_iterations), f"{run.seconds['total']:.1f}",
        )  # fmt: skip
    console = Console()
    if not console.is_terminal:
        console = Console(width=240)
    console.print(table)
