"""``tmc-vem run FILE.toml``: a problem file instead of a benchmark's name."""

from __future__ import annotations

import dataclasses
from typing import Any

import click

from tmc_vem.cli.execute import execute
from tmc_vem.cli.shared_options import DECIDED, file_options

SUFFIX = ".toml"


class RunGroup(click.Group):
    """Commands by name, and one for every problem file."""

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A benchmark, or the problem in a file."""
        return problem_command(cmd_name) if cmd_name.endswith(SUFFIX) else super().get_command(ctx, cmd_name)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        """Benchmarks, and files."""
        from click.shell_completion import CompletionItem

        return [*super().shell_complete(ctx, incomplete), CompletionItem(incomplete, type="file")]


def problem_command(path: str) -> click.Command:
    """Command that solves the problem in a file.

    Its callback raises:
        InputError, CodegenError: bad input.
        ConvergenceError: the full load was not reached; what converged is in the run directory.
    """

    def run(**options: Any) -> None:
        from tmc_vem.simulation.problem_file import read_problem

        problem, settings = read_problem(path)
        # a flag is None or True; run directories of earlier versions ask to resume with False where it was not given
        given = {name: options[name] for name in DECIDED if options[name] is not None and options[name] is not False}
        execute(problem, dataclasses.replace(settings, overwrite=options["overwrite"], **given), options)

    help_text = f"""Solve the problem that {path} describes.

    Method, load stepping and output are those in the file's [solve] table unless they are given here. The schema of
    problem files is in docs/guide/problem-files.md.
    """
    return click.Command(path, callback=run, params=file_options(), help=help_text)
