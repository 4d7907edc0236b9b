"""``tmc-vem sweep``: runs of a problem with all combinations of some values."""

from __future__ import annotations

import os
from pathlib import Path

import click

from tmc_vem.cli.batch_command import command_line, require_one_process
from tmc_vem.cli.columns import show_table
from tmc_vem.cli.field_options import with_options
from tmc_vem.cli.shared_options import change_option
from tmc_vem.support.assignments import parse_choices
from tmc_vem.support.errors import TmcError


@click.command("sweep")
@click.argument("problem", metavar="FILE.toml|BENCHMARK")
@with_options([change_option("VALUE,VALUE,...", "Values of one entry are separated by commas.")])
@click.option("--zip", "zipped", is_flag=True, help="First values together, second values together; not all with all.")
@click.option("--out", type=click.Path(path_type=Path), help="Where report and runs go. Default: runs/sweep-NAME.")
@click.option(
    "--jobs",
    type=click.IntRange(1, 256),
    default=min(2, os.cpu_count() or 1),
    show_default=True,
    help="Runs at a time.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON on stdout, and nothing else.")
def sweep(
    problem: str, changes: tuple[str, ...], zipped: bool, out: Path | None, jobs: int, as_json: bool
) -> None:  # fmt: skip
    """Run a problem with all combinations of some values.

    Prints a row for each combination with all probes at full load, and writes it as sweep.csv and sweep.json, with
    curves in a report that needs no other file (report.html), and all run directories. A run that fails is a row that
    says why. Runs that are there already with the same inputs, by the same program, are not repeated. Examples:

    \b
      tmc-vem sweep seal.toml --set regions.block.solid.mu=10,20,40 --set load.uy=-0.3,-0.4 --jobs 2
      tmc-vem sweep seal.toml --set mesh.size=0.1,0.05 --set solve.method=vem,fem --set mesh.cells=triangles
      tmc-vem sweep seal.toml --zip --set regions.seal.solid.K=20,40 --set regions.seal.solid.mu=1,2
      tmc-vem sweep box --set gamma=1e-4,1e-5 --set cells=[20,10]
    """
    from tmc_vem.cli.batch_progress import BatchMonitor
    from tmc_vem.study.sweep import sweep as run_all

    require_one_process()
    directory = out or Path("runs") / f"sweep-{Path(problem).stem}"
    monitor = BatchMonitor()
    try:
        found = run_all(
            problem, parse_choices(changes), directory, zipped=zipped, command=command_line(), processes=jobs,
            observer=monitor,
        )  # fmt: skip
    except KeyboardInterrupt:
        monitor.interrupted()
        raise
    finally:
        monitor.close()
    if as_json:
        click.echo(found.to_json(), nl=False)
    else:
        show_table(found.table())
        click.echo(f"report: {directory / 'report.html'}")
    if found.failures:
        raise TmcError(f"{len(found.failures)} of {len(found.rows)} runs gave no result; the table says why")
