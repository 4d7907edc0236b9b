"""``tmc-vem extract DIR``: the outlines of a design as a problem of their own, and what that gives."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tmc_vem.cli.columns import names_and_values, show_table
from tmc_vem.cli.execute import start_petsc
from tmc_vem.cli.field_options import setting, with_options
from tmc_vem.cli.shared_options import petsc_option
from tmc_vem.design.extract_options import ExtractOptions

if TYPE_CHECKING:
    from tmc_vem.design.outlined import Outlined

FIELDS = tuple(field.name for field in dataclasses.fields(ExtractOptions))


@click.command("extract")
@click.argument("directory", type=click.Path(path_type=Path), metavar="DIR")
@click.option("--run", is_flag=True, help="Solve the problem too, and compare with the design as densities.")
@with_options([setting(ExtractOptions, name) for name in FIELDS])
@click.option("--out", type=click.Path(path_type=Path), help="Where everything goes. Default: outlines in DIR.")
@click.option("--overwrite", is_flag=True, help="Replace earlier outlines there, and their run.")
@click.option("--json", "as_json", is_flag=True, help="Print outlines.json on stdout, and nothing else.")
@click.option("--quiet", is_flag=True, help="No progress display and no summary.")
@with_options([petsc_option()])
def extract(
    directory: Path, run: bool, out: Path | None, overwrite: bool, as_json: bool, quiet: bool, petsc: str, **chosen: Any
) -> None:
    """The outlines of a design as a problem of their own.

    DIR is a directory of 'tmc-vem optimise'. Its densities become solid parts with real void, third medium, between
    them, on a mesh whose edges are the outlines; loads, supports and probes are those of the design. What this problem
    gives is the number to trust. Examples:

    \b
      tmc-vem extract runs/cantilever --run
      tmc-vem extract runs/cantilever --level 0.5 --size 0.01 --out runs/fine
      tmc-vem run runs/cantilever/outlines/extracted.toml --order 3

    The directory holds extracted.toml, which 'tmc-vem run' solves, with its mesh extracted.vtu, a file of each where
    there are several load cases, outlines.png, outlines.json and report.html; with --run also run, the run of it.
    """
    options = ExtractOptions(**chosen)
    start_petsc(petsc, clean_stdout=as_json)
    from mpi4py import MPI

    from tmc_vem.cli.progress import ConsoleMonitor
    from tmc_vem.design.extract_run import extract as outlines_of
    from tmc_vem.report.tables import stopped
    from tmc_vem.support.errors import ConvergenceError

    on_root = MPI.COMM_WORLD.rank == 0
    monitor = None if quiet or as_json or not on_root else ConsoleMonitor()
    found = outlines_of(directory, out, options, run=run, overwrite=overwrite, monitor=monitor)
    if on_root and as_json:
        sys.stdout.write(json.dumps(found.as_dict(), indent=2) + "\n")
    elif on_root and not quiet:
        _show(found)
    for runs in (found.runs, found.designs):
        for each in runs.values():
            if not each.complete:
                raise ConvergenceError(f"{stopped(each)}; the comparison in {found.directory} is of the load before")


def _show(found: Outlined) -> None:
    from rich.console import Console

    from tmc_vem.design.extract_compare import comparison_table
    from tmc_vem.design.extract_page import summary

    rows = [("outlines", summary(found)), ("level", f"{found.extracted.outlines.level:.4g}")]
    rows += [("problem", str(path)) for path in found.problems.values()]
    rows.append(("report", str(found.directory / "report.html")))
    rows += [("note", text) for text in found.notes]
    Console().print(names_and_values(rows, {"note": "yellow"}), highlight=False)
    for case in found.compared:
        table = comparison_table(found.designs[case], found.runs[case], found.extracted)
        click.echo(f"{case}: {table.caption}" if case else table.caption)
        show_table(table)
