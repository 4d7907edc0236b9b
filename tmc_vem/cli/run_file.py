"""``tmc-vem run FILE.toml``: a problem file instead of a benchmark's name."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import click

SUFFIX = ".toml"
# options that the file decides unless they are given
DECIDED = ("method", "steps", "snapshots", "checkpoint_every", "max_iterations", "max_seconds", "allow_overlap")


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
        from tmc_vem.cli.run import execute
        from tmc_vem.simulation.problem_file import read_problem

        problem, settings = read_problem(path)
        given = {name: options[name] for name in DECIDED if options[name] is not None}
        if options["triangulated"]:
            given["triangulated"] = True
        execute(problem, dataclasses.replace(settings, overwrite=options["overwrite"], **given), options)

    options: list[click.Parameter] = [
        click.Option(["--method"], type=click.Choice(["vem", "fem"]), help="Virtual or Lagrange elements."),
        click.Option(["--steps"], type=int, help="Equal load steps."),
        click.Option(["--allow-overlap"], is_flag=True, default=None, help="Go on where solids overlap, to study it."),
        click.Option(["--max-iterations"], type=int, help="Stop after this many Newton iterations; resume goes on."),
        click.Option(["--max-seconds"], type=float, help="Stop after this wall time; resume goes on."),
        click.Option(["--out"], type=click.Path(path_type=Path), help="Run directory. Default: nothing is written."),
        click.Option(["--overwrite"], is_flag=True, help="Replace an earlier run in the run directory."),
        click.Option(["--checkpoint-every"], type=int, help="Load steps; 0 for none."),
        click.Option(["--snapshots"], type=int, help="Load steps written for ParaView."),
        click.Option(["--triangulated"], is_flag=True, help="Write them once more, cut into triangles."),
        click.Option(["--json", "as_json"], is_flag=True, help="Print result.json on stdout, and nothing else."),
        click.Option(["--quiet"], is_flag=True, help="No progress display and no summary."),
        click.Option(["--petsc"], default="", metavar="OPTIONS", help="PETSc options."),
    ]
    help_text = f"""Solve the problem that {path} describes.

    Method, load stepping and output are those in the file's [solve] table unless they are given here. The schema of
    problem files is in docs/guide/problem-files.md.
    """
    return click.Command(path, callback=run, params=options, help=help_text)
