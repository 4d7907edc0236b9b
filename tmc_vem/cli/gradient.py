"""``tmc-vem gradient``: derivatives of results by numbers of a problem, of a run that is made or of a run directory."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tmc_vem.cli.columns import show_table
from tmc_vem.cli.field_options import setting, with_options
from tmc_vem.cli.shared_options import change_option, petsc_option
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.assignments import parse_changes
from tmc_vem.support.errors import InputError

if TYPE_CHECKING:
    from tmc_vem.problems.base import Problem
    from tmc_vem.sensitivity.at_end import Sensitivities
    from tmc_vem.sensitivity.table import SensitivityTable


@click.command("gradient")
@click.argument("source", metavar="FILE.toml|BENCHMARK|RUN_DIR")
@click.option(
    "--of", "results", multiple=True, required=True, metavar="NAME",
    help="A result: a probe, reaction, energy, compliance, contact.BODY.force_x, p_norm.von_mises.REGION, ... May be "
    "given several times.",
)  # fmt: skip
@click.option(
    "--by", "numbers", multiple=True, required=True, metavar="NAME",
    help="A number of the problem, as in --set: regions.block.solid.E, load.uy; or REGION.PARAMETER of an energy "
    "alone. May be given several times.",
)  # fmt: skip
@with_options([change_option(), setting(RunOptions, "method", optional=True)])
@click.option("--per-cell", is_flag=True, help="Derivatives by the numbers in every cell: a VTU file and a picture.")
@click.option(
    "--out", type=click.Path(path_type=Path), metavar="FILE.vtu",
    help="Where --per-cell writes; the picture goes beside it. Default: NAME-gradient.vtu in this directory.",
)  # fmt: skip
@click.option("--check", is_flag=True, help="Run the problem twice more for each number, and compare with differences.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON on stdout, and nothing else.")
@click.option("--quiet", is_flag=True, help="No progress display.")
@with_options([petsc_option()])
def gradient(
    source: str, results: tuple[str, ...], numbers: tuple[str, ...], changes: tuple[str, ...], method: str | None,
    per_cell: bool, out: Path | None, check: bool, as_json: bool, quiet: bool, petsc: str,
) -> None:  # fmt: skip
    """Derivatives of results by numbers of a problem, at the end of a run.

    A problem file or a benchmark is solved first; of a run directory the last checkpoint is taken, and nothing is
    solved. Printed are the result, the derivative, and by how many percent the result changes with one percent more of
    the number. Examples:

    \b
      tmc-vem gradient demos/problems/seal.toml --of contact.block-seal.force --by regions.seal.solid.mu
      tmc-vem gradient box --of gap --of reaction --by material.mu --by medium.gamma --by uy --check
      tmc-vem gradient runs/seal --of reaction --by regions.seal.solid.mu --per-cell --out seal.vtu
    """
    if out is not None:
        _check_out(out, per_cell)
    from tmc_vem.cli.execute import start_petsc

    start_petsc(petsc, clean_stdout=as_json)
    from mpi4py import MPI

    from tmc_vem.sensitivity.at_end import SensitivityWarning
    from tmc_vem.sensitivity.per_cell import write_per_cell

    results, numbers = tuple(dict.fromkeys(results)), tuple(dict.fromkeys(numbers))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SensitivityWarning)  # they are in the table
        found, options, cautions = _found(
            source, results, numbers, changes, method, in_cells=per_cell, silent=quiet or as_json
        )
        table = found.table(results, numbers)
        path = out or Path(f"{_stem(source)}-gradient.vtu")
        written = write_per_cell(found, results, numbers, path) if per_cell else None
        if check:
            from tmc_vem.sensitivity.differences import checked

            table = checked(table, found.problem, options, MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank:
        return
    files = [str(file) for file in written or ()]
    if as_json:
        sys.stdout.write(table.to_json({"cautions": list(cautions), "files": files}))
        return
    show_table(_as_shown(table))
    for sentence in dict.fromkeys((*table.doubts, *cautions)):
        click.echo(f"warning: {sentence}")
    for file in files:
        click.echo(file)


def _found(
    source: str, results: tuple[str, ...], numbers: tuple[str, ...], changes: tuple[str, ...], method: str | None, *,
    in_cells: bool, silent: bool,
) -> tuple[Sensitivities, RunOptions, tuple[str, ...]]:  # fmt: skip
    """Derivatives at the end of what a source names, the options of its run, and what is to be said about that."""
    import dataclasses

    from mpi4py import MPI

    from tmc_vem.cli.progress import ConsoleMonitor
    from tmc_vem.sensitivity.at_end import of_directory, solved
    from tmc_vem.simulation.monitor import Monitor
    from tmc_vem.study.sweep import BENCHMARKS, SUFFIX, maker

    if Path(source).is_dir():
        given = [name for name, value in (("--set", changes), ("--method", method)) if value]
        if given:
            raise InputError(f"{given[0]} is for what is solved, and {source} has been: leave it out")
        problem, options = _of_run(Path(source))
        return of_directory(source, problem, options), options, ()
    if not source.endswith(SUFFIX) and source not in BENCHMARKS:
        raise InputError(
            f"'{source}' is no run directory, and neither a problem file, NAME{SUFFIX}, nor a benchmark "
            f"({', '.join(BENCHMARKS)})"
        )
    problem, options = maker(source)(parse_changes(changes))
    options = dataclasses.replace(options, method=method or options.method)
    monitor = Monitor() if silent or MPI.COMM_WORLD.rank else ConsoleMonitor()
    result, found = solved(problem, options, results, numbers, in_cells=in_cells, monitor=monitor)
    return found, options, (*result.errors, *result.warnings)


def _of_run(directory: Path) -> tuple[Problem, RunOptions]:
    """Problem and options of a run directory: of the problem file in it, or what its command had asked for.

    Raises:
        InputError: it is no run directory, or one of a benchmark that was run from Python.
    """
    from tmc_vem.cli.execute import ASIDE
    from tmc_vem.cli.resume import read_command
    from tmc_vem.cli.run import run_group
    from tmc_vem.results.records import PROBLEM
    from tmc_vem.results.run_result import refuse_search
    from tmc_vem.results.unfinished import COMMAND
    from tmc_vem.sensitivity.at_end import problem_of

    refuse_search(directory)
    if (directory / PROBLEM).is_file() or not (directory / COMMAND).is_file():
        return problem_of(directory)
    name, parameters = read_command(directory)
    context = click.get_current_context()
    command = run_group.get_command(context, name)
    if command is None or command.callback is None:
        raise InputError(f"{directory / COMMAND} asks for the problem '{name}', which does not exist")
    found: list[tuple[Any, Any]] = []
    context.meta[ASIDE] = lambda problem, options: found.append((problem, options))
    context.invoke(command, **parameters)
    return found[0]


def _as_shown(table: SensitivityTable) -> Any:
    from tmc_vem.report.page import Table
    from tmc_vem.report.tables import number

    is_checked = any(entry.difference is not None for entry in table.entries)
    head = ["result", "value", "number", "value", "derivative", "elasticity"]
    rows = [
        [
            entry.of, f"{number(entry.value)} {entry.units[0]}".rstrip(),
            entry.by, f"{entry.number:g} {entry.units[1]}".rstrip(),
            f"{number(entry.derivative, 7)} {entry.units[2]}".rstrip(),
            "–" if entry.elasticity is None else f"{entry.elasticity:.4g}",
            *([number(entry.difference, 7), "–" if entry.deviation is None else f"{entry.deviation:.1e}"]
              if is_checked else []),
        ]
        for entry in table.entries
    ]  # fmt: skip
    caption = f"{table.problem}, load factor {table.load:.4g}"
    return Table(caption, [*head, *(["central difference", "differs by"] if is_checked else [])], rows)


def _stem(source: str) -> str:
    return Path(source).resolve().name if Path(source).is_dir() else Path(source).stem


def _check_out(out: Path, per_cell: bool) -> None:
    """Check where derivatives per cell go, before anything is solved.

    Raises:
        InputError: nothing goes there, it is no name of a VTU file, or the directory is not there.
    """
    if not per_cell:
        raise InputError(f"--out {out} is where --per-cell writes: give that too, or redirect --json")
    if out.suffix != ".vtu":
        raise InputError(f"--out {out}: derivatives per cell are written as .vtu, with a picture beside it")
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: there is no directory {out.parent}")
