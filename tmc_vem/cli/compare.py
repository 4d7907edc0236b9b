"""``tmc-vem compare PROBLEM``: virtual and finite elements on several meshes, as a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.batch_command import batch_options, compare_study
from tmc_vem.cli.compare_file import CompareGroup, three
from tmc_vem.cli.field_options import Decorator, setting, with_options
from tmc_vem.cli.shared_options import (
    angle_medium_options,
    chosen_limit,
    chosen_medium,
    limit_options,
    medium_options,
    penalty_option,
)
from tmc_vem.simulation.options import RunOptions
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element_settings import ElementSettings

FACTORS, QUICK_FACTORS = (1, 2, 4), (1, 2, 3)


@click.group("compare", cls=CompareGroup)
def compare_group() -> None:
    """Compare virtual and finite elements on several meshes.

    The problem is one of the benchmarks below, or a problem file of your own:

    \b
      tmc-vem compare box --quick
      tmc-vem compare demos/problems/blocks.toml --mesh-size 0.2,0.15,0.1

    Writes a report that needs no other file (report.html), the same as Markdown, runs.csv, figures as SVG and PNG, and
    all run directories. Runs that are there already with the same inputs, by the same program, are not repeated.
    """


def study_options(penalty: str) -> Decorator:
    """Options of discretisation and load stepping that all comparisons share; virtual elements are the paper's."""
    penalty_of_fem = penalty_option(penalty, before="fem:")
    order, steps = setting(FemSettings, "order"), setting(RunOptions, "steps")
    return with_options([order, steps, penalty_of_fem, *limit_options()])


def factor_option(cells: str) -> Decorator:
    """Option for the meshes of structured problems."""
    text = f"Mesh of {cells} cells; give three or more. Default: 1, 2, 4; with --quick 1, 2, 3."
    return click.option("--factor", "factors", type=click.IntRange(1), multiple=True, metavar="N", help=text)


size_option = click.option(
    "--size", "sizes", type=float, multiple=True, help="Size of cells; give three or more. Default: see the report."
)


@compare_group.command("box")
@medium_options()
@click.option("--uy", type=float, default=-1.0, show_default=True, help="Displacement of the middle of the top.")
@factor_option("20 N x 5 N")
@study_options("none")
@batch_options("runs/compare-box")
def box(uy: float, factors: tuple[int, ...], out: Path, jobs: int, quick: bool, **options: Any) -> None:
    """Self-contact within a box (section 5.1 of Xu & Wriggers). Examples:

    \b
      tmc-vem compare box --quick --out runs/compare
      tmc-vem compare box --gamma 1e-4 --factor 2 --factor 4 --factor 8
      tmc-vem compare box --quick --regulariser my_reg.py:f --param kappa=0.1
    """
    from tmc_vem.study.compare import box_study

    compare_study(box_study(chosen_medium(options), uy, _factors(factors, quick), _methods(options)), out, jobs)


@compare_group.command("cbox")
@angle_medium_options(gamma=1e-5, alpha_r=1.0)
@click.option("--uy", type=float, default=-0.5, show_default=True, help="Displacement of the upper right corner.")
@factor_option("10 N x 5 N")
@study_options("none")
@batch_options("runs/compare-cbox")
def cbox(uy: float, factors: tuple[int, ...], out: Path, jobs: int, quick: bool, **options: Any) -> None:
    """Self-contact of the C-box (section 5.2 of Xu & Wriggers). Example:

    \b
      tmc-vem compare cbox --quick
    """
    from tmc_vem.study.compare import cbox_study

    compare_study(cbox_study(chosen_medium(options), uy, _factors(factors, quick), _methods(options)), out, jobs)


@compare_group.command("punch")
@angle_medium_options(gamma=1e-4, alpha_r=1.0)
@click.option("--uy", type=float, default=-1.3, show_default=True, help="Displacement of the punch's top.")
@click.option("--stiffness", type=float, default=1.0, show_default=True, help="Of the punch; the paper: 1 and 100.")
@size_option
@study_options("penalty")
@batch_options("runs/compare-punch")
def punch(
    uy: float, stiffness: float, sizes: tuple[float, ...], out: Path, jobs: int, quick: bool, **options: Any
) -> None:
    """Round punch pressed into a block (section 5.3 of Xu & Wriggers). Example:

    \b
      tmc-vem compare punch --quick
    """
    from tmc_vem.problems import Punch
    from tmc_vem.study.compare import voronoi_study

    medium = chosen_medium(options)
    chosen = three("--size", sizes) or ((0.25, 0.2, 0.15) if quick else (0.2, 0.14, 0.1))
    study = voronoi_study(
        lambda size: Punch(size=size, stiffness=stiffness, medium=medium, uy=uy), medium, chosen, _methods(options)
    )
    compare_study(study, out, jobs)


@compare_group.command("bodies")
@angle_medium_options(gamma=1e-4, alpha_r=10.0)
@click.option("--uy", type=float, default=0.25, show_default=True, help="How far the half discs move to the beam.")
@click.option("--case", type=int, default=1, show_default=True, help="1: half discs guided; 2: free in x.")
@size_option
@study_options("penalty")
@batch_options("runs/compare-bodies")
def bodies(uy: float, case: int, sizes: tuple[float, ...], out: Path, jobs: int, quick: bool, **options: Any) -> None:
    """A beam between seven half discs (section 5.4 of Xu & Wriggers). Example:

    \b
      tmc-vem compare bodies --quick
    """
    from tmc_vem.problems import Bodies
    from tmc_vem.study.compare import voronoi_study

    medium = chosen_medium(options)
    chosen = three("--size", sizes) or ((0.15, 0.125, 0.1) if quick else (0.12, 0.085, 0.06))
    study = voronoi_study(
        lambda size: Bodies(case=case, size=size, medium=medium, uy=uy), medium, chosen, _methods(options)
    )
    compare_study(study, out, jobs)


def _factors(given: tuple[int, ...], quick: bool) -> tuple[int, ...]:
    return three("--factor", given) or (QUICK_FACTORS if quick else FACTORS)


def _methods(options: dict[str, Any]) -> dict[str, RunOptions]:
    order, steps, limit = options["order"], options["steps"], chosen_limit(options)
    fem = FemSettings(order=order, interior_penalty=options["interior_penalty"])
    return {
        "vem": RunOptions("vem", element=ElementSettings(order), steps=steps, **limit),
        "fem": RunOptions("fem", fem=fem, steps=steps, **limit),
    }
