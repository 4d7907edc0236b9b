"""``tmc-vem compare PROBLEM``: virtual and finite elements on several meshes, as a report."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.run import medium_options, parse_parameters
from tmc_vem.errors import InputError

FACTORS, QUICK_FACTORS = (1, 2, 4), (1, 2, 3)


@click.group("compare")
def compare_group() -> None:
    """Compare virtual and finite elements on several meshes.

    Writes a report that needs no other file (report.html), the same as Markdown, runs.csv, figures as SVG and PNG, and
    all run directories. Runs that are there already with the same inputs are not repeated.
    """


def batch_options(out: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options of every command that does a batch of runs."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        options = [
            click.option("--out", type=click.Path(path_type=Path), default=Path(out), show_default=True,
                         help="Where report and runs go."),
            click.option("--jobs", type=click.IntRange(1, 256), default=min(2, os.cpu_count() or 1), show_default=True,
                         help="Runs at a time."),
            click.option("--quick", is_flag=True, help="Coarse meshes."),
        ]  # fmt: skip
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


@compare_group.command("box")
@medium_options
@click.option("--uy", type=float, default=-1.0, show_default=True, help="Displacement of the middle of the top.")
@click.option(
    "--factor", "factors", type=int, multiple=True, metavar="N",
    help="Mesh of 20 N x 5 N cells; give three or more. Default: 1, 2, 4; with --quick 1, 2, 3.",
)  # fmt: skip
@click.option("--order", type=int, default=2, show_default=True, help="Order k of the elements: 2 or 3.")
@click.option("--steps", type=int, help="Equal load steps. Default: automatic steps.")
@click.option(
    "--interior-penalty", type=click.Choice(["none", "penalty", "full"]), default="none", show_default=True,
    help="fem: jumps of the gradient between elements of the medium.",
)  # fmt: skip
@batch_options("runs/compare-box")
def box(
    uy: float, factors: tuple[int, ...], order: int, steps: int | None, interior_penalty: str, out: Path, jobs: int,
    quick: bool, **options: Any,
) -> None:  # fmt: skip
    """Self-contact within a box (section 5.1 of Xu & Wriggers). Examples:

    \b
      tmc-vem compare box --quick --out runs/compare
      tmc-vem compare box --gamma 1e-4 --alpha-r 1 --factor 2 --factor 4 --factor 8
    """
    from tmc_vem.compare import box_study
    from tmc_vem.fem.settings import FemSettings
    from tmc_vem.problems import Medium
    from tmc_vem.simulation import RunOptions
    from tmc_vem.vem.element import ElementSettings

    chosen = tuple(sorted(set(factors))) or (QUICK_FACTORS if quick else FACTORS)
    if len(chosen) < 3:
        raise InputError(f"{len(chosen)} meshes: convergence shows on three or more, for example --factor 1 2 4 each")
    medium = Medium(
        gamma=options["gamma"],
        alpha_r=options["alpha_r"],
        beta=options["beta"],
        regulariser=options["regulariser"],
        parameters=parse_parameters(options["parameters"]),
    )
    settings = {
        "vem": RunOptions("vem", element=ElementSettings(order), steps=steps),
        "fem": RunOptions("fem", fem=FemSettings(order=order, interior_penalty=interior_penalty), steps=steps),
    }
    _compare(box_study(medium, uy, chosen, settings), out, jobs)


def _compare(study: Any, out: Path, jobs: int) -> None:
    from tmc_vem.cli.batch_progress import BatchMonitor
    from tmc_vem.compare import compare

    require_one_process()
    monitor = BatchMonitor()
    try:
        report, comparison = compare(study, out, command=command_line(), processes=jobs, observer=monitor)
    except KeyboardInterrupt:
        monitor.interrupted()
        raise
    finally:
        monitor.close()
    for method in comparison.methods:
        click.echo(f"{method.name}: {method.converged or 'no mesh-converged gap'}")
    click.echo(f"report: {report}")


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
