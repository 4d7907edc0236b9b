"""Run a problem from the command line: start PETSc, show progress and result, and say how it ended."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import click

from tmc_vem.support.errors import InputError
from tmc_vem.support.petsc_start import start

PROGRAM = "tmc-vem"
ASIDE = "tmc_vem.aside"  # key in a context's meta: what takes problem and options instead of a run
RESUME = "tmc_vem.resume"  # key in a context's meta: the run goes on from its checkpoint


def execute(problem: Any, settings: Any, options: dict[str, Any]) -> None:
    """Run a problem and show the result as ``out``, ``json``, ``quiet`` and ``petsc`` in the options ask.

    Raises:
        InputError, CodegenError: bad input.
        ConvergenceError: the full load was not reached; what converged is in the run directory.
    """
    aside = click.get_current_context(silent=True)
    if aside is not None and ASIDE in aside.meta:
        aside.meta[ASIDE](problem, settings)
        return
    start_petsc(options["petsc"], clean_stdout=options["as_json"])
    from mpi4py import MPI

    from tmc_vem.adapt.run import run
    from tmc_vem.report.tables import stopped
    from tmc_vem.results.unfinished import how_to_go_on
    from tmc_vem.simulation.monitor import Monitor
    from tmc_vem.support.errors import ConvergenceError

    silent = options["quiet"] or options["as_json"]
    on_root = MPI.COMM_WORLD.rank == 0
    monitor = Monitor()
    if on_root and not silent:  # what draws on a terminal takes time to load
        from tmc_vem.cli.progress import ConsoleMonitor, print_summary

        monitor = ConsoleMonitor()
    context = click.get_current_context()
    result = run(
        problem,
        options["out"],
        settings,
        monitor=monitor,
        resume=context.meta.get(RESUME, False),
        command=asked(context),
    )
    if on_root:
        if options["as_json"]:
            sys.stdout.write(result.to_json())
        elif not silent:
            print_summary(result)
    if not result.complete:
        kept = f"; steps up to there are in {result.directory}" if result.directory and result.history else ""
        how = how_to_go_on(result.directory) if result.directory and result.cut_short else ""
        raise ConvergenceError(f"{stopped(result)}{kept}{'; ' if how else ''}{how}")


def asked(context: click.Context) -> dict[str, Any]:
    """Problem and options as plain values, for a later ``tmc-vem resume``."""
    plain = {name: str(value) if isinstance(value, Path) else value for name, value in context.params.items()}
    return {"problem": context.command.name, "options": plain}


def _petsc_words(options: str) -> list[str]:
    """The words of a string of PETSc options.

    Raises:
        InputError: quotes are not closed, or there is a word that is neither an option nor its value.
    """
    import shlex

    try:
        words = shlex.split(options)
    except ValueError as error:
        raise InputError(f"--petsc '{options}': {str(error).lower()}") from None
    is_option = [re.match("-[A-Za-z]", word) is not None for word in words]
    for word, here, before in zip(words, is_option, [False, *is_option], strict=False):
        if not here and not before:
            raise InputError(f"--petsc '{options}': '{word}' is not an option, such as '-tmc_ksp_rtol 1e-10'")
    return words


def start_petsc(options: str, clean_stdout: bool) -> None:
    """Start PETSc; its list of unused options, which newer versions print at the end, may be suppressed.

    Raises:
        InputError: PETSc is missing or of no use, or the options are not written as options.
    """
    words = _petsc_words(options)
    # where Python was started with -c, argv[0] would be an option to PETSc
    start([PROGRAM, *words, *(["-options_left", "0"] if clean_stdout else [])])
