"""``tmc-vem run FILE.toml``: a problem file instead of a benchmark's name."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import click

from tmc_vem.cli.execute import execute
from tmc_vem.cli.shared_options import file_options, with_given
from tmc_vem.support.assignments import parse_changes

SUFFIX = ".toml"


class FileGroup(click.Group):
    """Commands by name, and one for every problem file."""

    def of_file(self, path: str) -> click.Command:
        """The command of a problem file."""
        raise NotImplementedError

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A benchmark, or the problem in a file."""
        return self.of_file(cmd_name) if cmd_name.endswith(SUFFIX) else super().get_command(ctx, cmd_name)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        """Benchmarks, and files."""
        from click.shell_completion import CompletionItem

        return [*super().shell_complete(ctx, incomplete), CompletionItem(incomplete, type="file")]


class RunGroup(FileGroup):
    """Commands that run a benchmark or a problem file."""

    def of_file(self, path: str) -> click.Command:
        """The command that solves the problem in a file."""
        return problem_command(path)


def problem_command(path: str, changes: Mapping[str, Any] | None = None) -> click.Command:
    """Command that solves the problem in a file.

    Args:
        path: the file.
        changes: those that are made in it already; for the record.

    Its callback raises:
        InputError, CodegenError: bad input.
        ConvergenceError: the full load was not reached; what converged is in the run directory.
    """

    def run(**options: Any) -> None:
        from tmc_vem.simulation.problem_file import read_problem

        problem, settings = read_problem(path, parse_changes(options["changes"]))
        if changes:
            problem = dataclasses.replace(problem, changes=changes)
        execute(problem, with_given(settings, options), options)

    help_text = f"""Solve the problem that {path} describes.

    Method, load stepping and output are those in the file's [solve] table unless they are given here; --set gives any
    other entry of the file another value. The schema of problem files is in docs/guide/problem-files.md. Examples:

    \b
      tmc-vem check {path}
      tmc-vem run {path} --set mesh.size=0.05 --out runs/finer
      tmc-vem run {path} --set "regions.block.shape=frame - hole"
      tmc-vem run {path} --method fem --order 3 --path '0 1 0'
    """
    return click.Command(path, callback=run, params=file_options(), help=help_text)
