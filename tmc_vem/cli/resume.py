"""``tmc-vem resume``: go on with a run that was stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.execute import RESUME
from tmc_vem.cli.field_options import with_options
from tmc_vem.cli.run import run_group
from tmc_vem.cli.run_file import SUFFIX, problem_command
from tmc_vem.cli.shared_options import display_options
from tmc_vem.results.lock import is_held
from tmc_vem.results.records import DESIGN, PROBLEM
from tmc_vem.results.unfinished import COMMAND, how_to_go_on
from tmc_vem.support.assignments import parse_changes
from tmc_vem.support.errors import InputError


@click.command("resume")
@click.argument("directory", type=click.Path(path_type=Path))
@with_options(display_options())
@click.option("--max-iterations", type=int, help="Stop after this many more Newton iterations. Default: no limit.")
@click.option("--max-seconds", type=float, help="Stop after this wall time. Default: no limit.")
@click.option("--iterations", type=int, help="Of a search for a design: most evaluations, now and before together.")
@click.pass_context
def resume(
    ctx: click.Context,
    directory: Path,
    as_json: bool,
    quiet: bool,
    max_iterations: int | None,
    max_seconds: float | None,
    iterations: int | None,
) -> None:
    """Go on with a run, or a search for a design, from its last checkpoint.

    DIRECTORY is the run directory of a run that was interrupted, killed, or stopped before the full load, or that of
    'tmc-vem optimise'. The result is that of an uninterrupted run, and the number of ranks may be another:

    \b
      mpirun -n 2 tmc-vem resume runs/box
      tmc-vem resume runs/optimise-cantilever --iterations 200

    Where the problem file is no longer there, the run goes on with the copy of it in the run directory.
    """
    if is_search(directory):
        if max_iterations is not None:
            raise InputError("--max-iterations is for runs; a search for a design has --iterations and --max-seconds")
        given = {"as_json": as_json, "quiet": quiet, "max_seconds": max_seconds, "iterations": iterations}
        return _resume_search(directory, given)
    if iterations is not None:
        raise InputError(f"--iterations is for searches of 'tmc-vem optimise'; {directory} is a run")
    name, parameters = read_command(directory)
    _require_checkpoint(
        directory,
        ", and for the next time with checkpoints (--checkpoint-every 1 writes one after every load step)",
    )
    command = run_group.get_command(ctx, name)
    if name.endswith(SUFFIX) and not Path(name).exists() and (directory / PROBLEM).exists():
        command = problem_command(str(directory / PROBLEM), parse_changes(parameters.get("changes", ())))
        parameters["changes"] = ()
    if command is None or command.callback is None:
        raise InputError(f"{directory / COMMAND} asks for the problem '{name}', which does not exist")
    parameters |= {"out": directory, "as_json": as_json, "quiet": quiet}
    parameters |= {"max_iterations": max_iterations, "max_seconds": max_seconds}
    known = {parameter.name for parameter in command.params}
    unknown = sorted(set(parameters) - known)
    if unknown:
        raise InputError(f"{directory / COMMAND} has the unknown option '{unknown[0]}'")
    ctx.meta[RESUME] = True
    ctx.invoke(command, **parameters)


def is_search(directory: Path) -> bool:
    """Whether a directory is that of a search for a design."""
    return (directory / DESIGN).is_file()


def _resume_search(directory: Path, given: dict[str, Any]) -> None:
    """Go on with a search for a design.

    Raises:
        InputError: it goes on, or has no checkpoint.
    """
    from tmc_vem.cli.optimise import search

    name, parameters = read_command(directory)
    _require_checkpoint(directory)
    changes = parse_changes(parameters.get("changes", ()))
    if not Path(name).exists():
        name, changes = str(directory / DESIGN), {}
    if given["iterations"] is None:
        given["iterations"] = parameters.get("iterations")
    search(name, changes, {**parameters, **given, "out": directory}, again=True)


def _require_checkpoint(directory: Path, more: str = "") -> None:
    """Check that a run, or a search, has stopped and can go on.

    Raises:
        InputError: it has not, or cannot.
    """
    if is_held(directory):
        raise InputError(f"the run in {directory} goes on: there is nothing to resume")
    if not how_to_go_on(directory):
        raise InputError(f"{directory} has no checkpoint to go on from: run it again with --overwrite{more}")


def read_command(directory: Path) -> tuple[str, dict[str, Any]]:
    """Problem and options that a run directory was made with.

    Raises:
        InputError: it is not a run directory of the command line.
    """
    path = directory / COMMAND
    try:
        data = json.loads(path.read_text())
        parameters = {key: tuple(v) if isinstance(v, list) else v for key, v in data["options"].items()}
        return str(data["problem"]), parameters
    except OSError as error:
        raise InputError(
            f"{directory} cannot be resumed: {error.strerror} ({path}); "
            "a run from Python goes on with run(..., resume=True)"
        ) from None
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{path} is damaged ({error}): start the run anew") from None
