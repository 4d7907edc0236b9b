"""``tmc-vem reproduce``: the paper's tables and figures beside ours."""

from __future__ import annotations

from pathlib import Path

import click

from tmc_vem.cli.batch_command import batch_options, command_line, require_one_process


@click.command("reproduce")
@click.argument("what", nargs=-1, required=True, metavar="WHAT...")
@batch_options("runs/reproduce")
def reproduce(what: tuple[str, ...], out: Path, jobs: int, quick: bool) -> None:
    """Reproduce table2, table3, fig4, fig5, fig7, fig8, fig10, fig11, fig13, fig14, or all of them.

    Each becomes a page that needs no other file, the same as Markdown, and a CSV of its runs. Runs that are there
    already are not repeated, so an interrupted command goes on where it was. Examples:

    \b
      tmc-vem reproduce table2 --quick
      tmc-vem reproduce table2 table3 fig4 fig5 --jobs 2
      tmc-vem reproduce all
    """
    from tmc_vem.cli.batch_progress import BatchMonitor
    from tmc_vem.study.paper.reproduce import reproduce as run_all

    require_one_process()
    monitor = BatchMonitor()
    try:
        pages = run_all(what, out, quick=quick, command=command_line(), processes=jobs, observer=monitor)
    except KeyboardInterrupt:
        monitor.interrupted()
        raise
    finally:
        monitor.close()
    for page in pages:
        click.echo(f"report: {page}")
