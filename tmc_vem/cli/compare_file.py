"""``tmc-vem compare FILE.toml``: virtual and finite elements on several meshes of a problem file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.batch_command import batch_options, compare_study
from tmc_vem.cli.field_options import setting, with_options
from tmc_vem.cli.run_file import FileGroup
from tmc_vem.cli.shared_options import change_option, limit_options
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.assignments import parse_changes
from tmc_vem.support.errors import InputError
from tmc_vem.system.fem_settings import FemSettings

# Sizes of cells relative to that of the file, by default and with --quick.
RELATIVE, QUICK = (2.0, 1.5, 1.0), (3.0, 2.25, 1.5)


class CompareGroup(FileGroup):
    """Commands that compare both methods on a benchmark or a problem file."""

    def of_file(self, path: str) -> click.Command:
        """The command that compares both methods on a problem file."""
        return comparison_command(path)


def comparison_command(path: str) -> click.Command:
    """Command that compares both methods on a problem file.

    Its callback raises:
        InputError: bad input, or no run gave a result.
        TmcError: some runs gave none.
    """

    def compare(
        changes: tuple[str, ...], mesh_sizes: tuple[str, ...], out: Path, jobs: int, quick: bool, **given: Any
    ) -> None:
        from tmc_vem.simulation.problem_file import read_problem
        from tmc_vem.study.compare import file_study

        problem, settings = read_problem(path, parse_changes(changes))
        mesh = problem.table.mesh
        factors = mesh.possible(QUICK if quick else RELATIVE)
        sizes = three("--mesh-size", _sizes(mesh_sizes)) or [factor * mesh.nominal for factor in factors]
        compare_study(file_study(problem, sizes, settings, **given), out, jobs)

    help_text = f"""Compare virtual and finite elements on several meshes of the problem that {path} describes.

    Sizes in [mesh] refine, and cells across narrow places, go with the size of the cells. Finite elements get
    triangles where the file has Voronoi cells. Steps, elements and output are those of the file's [solve] table.
    Examples:

    \b
      tmc-vem compare {path} --mesh-size 0.1,0.07,0.05
      tmc-vem compare {path} --set load.uy=-0.1 --quick
    """
    size = click.Option(
        ["--mesh-size", "mesh_sizes"], multiple=True, metavar="SIZE,SIZE,...",
        help="Size of cells; give three or more. Default: 2, 1.5 and 1 times that of the file; with --quick 3, 2.25 "
        "and 1.5 times. Where the size is a formula, what it is multiplied with. With fit = true all are smaller if "
        "larger cells would not fit.",
    )  # fmt: skip
    of_elements = [
        setting(FemSettings, "order", optional=True),
        setting(RunOptions, "steps", optional=True),
        setting(FemSettings, "interior_penalty", before="fem:", optional=True,
                after="Default: that of the file, or penalty."),
        *limit_options(),
    ]  # fmt: skip
    decorate = with_options([change_option(), size, *of_elements])
    decorated = batch_options(f"runs/compare-{Path(path).stem}")(decorate(compare))
    params = list(reversed(vars(decorated)["__click_params__"]))
    return click.Command(path, callback=compare, params=params, help=help_text)


def three(option: str, given: tuple[Any, ...]) -> tuple[Any, ...]:
    """Different values of an option, from small to large; three or more, or none.

    Raises:
        InputError: there are one or two.
    """
    chosen = tuple(sorted(set(given)))
    if 0 < len(chosen) < 3:
        raise InputError(f"{len(chosen)} meshes: convergence shows on three or more, so give {option} three times")
    return chosen


def _sizes(texts: tuple[str, ...]) -> tuple[float, ...]:
    """Sizes of cells from texts with commas.

    Raises:
        InputError: one is no number.
    """
    words = [word for text in texts for word in text.replace(",", " ").split()]
    try:
        return tuple(float(word) for word in words)
    except ValueError:
        raise InputError(f"--mesh-size {' '.join(texts)} is no list of sizes, for example 0.1,0.07,0.05") from None
