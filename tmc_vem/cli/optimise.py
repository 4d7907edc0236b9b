"""``tmc-vem optimise FILE.toml``: the best design of a problem file with a table ``[design]``."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.execute import asked, start_petsc
from tmc_vem.cli.field_options import with_options
from tmc_vem.cli.shared_options import change_option, display_options, petsc_option
from tmc_vem.problems.design_table import METHODS
from tmc_vem.support.assignments import parse_changes
from tmc_vem.support.errors import InputError

EVERY = 10


@click.command("optimise")
@click.argument("file", metavar="FILE.toml")
@with_options([change_option()])
@click.option("--iterations", type=int, help="Most evaluations of a design; that of [design] by default.")
@click.option("--method", type=click.Choice(METHODS), help="Of the search; that of [design] by default.")
@click.option(
    "--out", type=click.Path(path_type=Path), help="Where everything goes. Default: runs/optimise-NAME of NAME.toml."
)
@click.option("--overwrite", is_flag=True, help="Replace an earlier search there.")
@click.option("--resume", is_flag=True, help="Go on with the search there; 'tmc-vem resume DIR' does so too.")
@click.option("--max-seconds", type=float, help="Stop after this wall time; resume goes on. Default: no limit.")
@click.option(
    "--every",
    type=int,
    default=EVERY,
    show_default=True,
    help="Evaluations from one design written for ParaView to the next; 0 for none but the best.",
)
@click.option("--no-animation", is_flag=True, help="No animated picture of the designs.")
@click.option("--no-final", is_flag=True, help="Do not run the best design once more, with its curves over the load.")
@with_options([*display_options(), petsc_option()])
def optimise(file: str, **options: Any) -> None:
    """Find the design that a problem file asks for.

    The table [design] says what is made small or large, within which limits; regions with a solid and a medium are
    designed. Load cases are solved as [solve] says. A line is printed for every design. Stopped by Ctrl-C or a kill,
    the search goes on where it was. Examples:

    \b
      tmc-vem optimise cantilever.toml --out runs/cantilever
      tmc-vem optimise cantilever.toml --set design.volume=0.3 --iterations 200
      tmc-vem resume runs/cantilever
      tmc-vem run runs/cantilever/final.toml
      tmc-vem extract runs/cantilever --run

    The directory holds result.json, report.html, history.csv, stiffness.npz with final.toml, which 'tmc-vem run'
    solves, final (that run), design.vtu and design.pvd for ParaView, pictures, and every evaluation with its gradient.
    """
    search(file, parse_changes(options["changes"]), options)


def search(file: str, changes: Mapping[str, Any], options: Mapping[str, Any], *, again: bool = False) -> None:
    """Search as the options ask, and show the result.

    Args:
        file: the problem file.
        changes: other values for its entries.
        options: of the command.
        again: go on with the search in the directory, which knows already what was asked.

    Raises:
        InputError: bad input.
        ConvergenceError: no design satisfies the limits; what was found is in the directory.
    """
    start_petsc(options["petsc"], clean_stdout=options["as_json"])
    from mpi4py import MPI

    from tmc_vem.cli.design_progress import ConsoleDesignMonitor, print_design
    from tmc_vem.design.monitor import DesignMonitor
    from tmc_vem.design.session import optimise as run
    from tmc_vem.simulation.problem_file import read_problem
    from tmc_vem.support.errors import ConvergenceError

    given = {"design.iterations": options["iterations"], "design.method": options["method"]}
    changes = {**changes, **{name: value for name, value in given.items() if value is not None}}
    problem, settings = read_problem(file, changes)
    if problem.table.design is None:
        raise InputError(
            f'{file} has no table [design]: add one, such as [design] minimise = "compliance", volume = 0.4'
        )
    if options["max_seconds"] is not None:
        settings = dataclasses.replace(settings, max_seconds=options["max_seconds"])
    on_root = MPI.COMM_WORLD.rank == 0
    silent = options["quiet"] or options["as_json"] or not on_root
    monitor: DesignMonitor = DesignMonitor() if silent else ConsoleDesignMonitor()
    resume = again or bool(options["resume"])
    found = run(
        problem, options["out"] or Path("runs") / f"optimise-{Path(file).stem}",
        dataclasses.replace(settings, overwrite=options["overwrite"]), monitor=monitor, resume=resume,
        command=None if again else {**asked(click.get_current_context()), "problem": file}, every=options["every"],
        animation=not options["no_animation"], final=not options["no_final"],
    )  # fmt: skip
    if on_root:
        if options["as_json"]:
            sys.stdout.write(found.to_json())
        elif not options["quiet"]:
            print_design(found)
    if not found.feasible:
        raise ConvergenceError(f"{found.sentence} What was found is in {found.directory}")
