"""What the commands that do many runs have in common: their options, and how a comparison is done and shown."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.field_options import Decorator, with_options
from tmc_vem.support.errors import InputError, TmcError


def batch_options(out: str) -> Decorator:
    """Options of every command that does a batch of runs."""
    return with_options(
        [
            click.Option(["--out"], type=click.Path(path_type=Path), default=Path(out), show_default=True,
                         help="Where report and runs go."),
            click.Option(["--jobs"], type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1),
                         show_default=True, help="Runs at a time."),
            click.Option(["--quick"], is_flag=True, help="Coarse meshes."),
        ]
    )  # fmt: skip


def compare_study(study: Any, out: Path, jobs: int) -> None:
    """Do the runs of a study, write the report, and say where it is.

    Raises:
        InputError: it was started by mpirun, or no run gave a result.
        TmcError: some gave none.
    """
    from tmc_vem.cli.batch_progress import BatchMonitor
    from tmc_vem.study.compare import compare

    require_one_process()
    monitor = BatchMonitor()
    try:
        report, comparison = compare(study, out, command=command_line(), processes=jobs, observer=monitor)
    except KeyboardInterrupt:
        monitor.interrupted()
        raise
    finally:
        monitor.close()
    first = next(iter(comparison.quantities))
    for method in comparison.methods:
        click.echo(f"{method.name}, mesh-converged {first}: {method.limits.get(first) or 'none, see the report'}")
    click.echo(f"report: {report}")
    if comparison.failures:
        raise TmcError(f"{len(comparison.failures)} of {len(study.jobs())} runs gave no result; the report says why")


def command_line() -> str:
    """The command that runs, for reports: without the machine's path to it."""
    return shlex.join(["tmc-vem", *sys.argv[1:]])


def require_one_process() -> None:
    """Refuse to be started by mpirun.

    Raises:
        InputError: it was.
    """
    if int(os.environ.get("OMPI_COMM_WORLD_SIZE", os.environ.get("PMI_SIZE", "1"))) > 1:
        raise InputError("this command starts processes of its own: call it without mpirun, with --jobs")
