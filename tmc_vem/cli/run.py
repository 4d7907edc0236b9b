"""``tmc-vem run PROBLEM``: one command a problem."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from tmc_vem.cli.execute import execute
from tmc_vem.cli.run_file import RunGroup
from tmc_vem.cli.shared_options import (
    angle_medium_options,
    chosen_medium,
    chosen_options,
    medium_options,
    method_options,
)


@click.group("run", cls=RunGroup)
def run_group() -> None:
    """Solve a problem and write results, fields and a picture.

    The problem is one of the benchmarks below, or a problem file of your own:

    \b
      tmc-vem run box --out runs/box
      tmc-vem run demos/problems/seal.toml --out runs/seal

    Every run directory holds result.json (inputs, versions, gap, reaction, smallest J, iterations, times),
    history.csv (a row a load step), fields.pvd for ParaView and deformed.png.
    """


@run_group.command("box")
@click.option(
    "--cells", type=int, nargs=2, default=(40, 10), show_default=True, help="Cells in x and y over the 2 x 0.5 box."
)
@click.option(
    "--mesh",
    "cell_kind",
    type=click.Choice(["quadrilaterals", "voronoi"]),
    default="quadrilaterals",
    show_default=True,
    help="Kind of cells.",
)
@click.option("--refine-medium", default=1, show_default=True, help="Divide edges of the medium; hanging nodes.")
@click.option("--uy", type=float, default=-1.0, show_default=True, help="Displacement of the middle of the top.")
@medium_options()
@method_options()
def box(cells: tuple[int, int], cell_kind: str, refine_medium: int, uy: float, **options: Any) -> None:
    """Self-contact within a box (section 5.1 of Xu & Wriggers).

    The middle of the top is pushed down until the flanges touch; the gap between them and the reaction at the
    load are printed. Examples:

    \b
      tmc-vem run box --alpha-r 1 --gamma 1e-5 --cells 40 10 --out runs/box
      tmc-vem run box --alpha-r 0.1 --gamma 1e-6 --json > box.json
      tmc-vem run box --regulariser my_reg.py:bending --param kappa=0.1
      mpirun -n 2 tmc-vem run box --cells 80 20 --out runs/box-80
    """
    from tmc_vem.problems import Box

    def problem(medium: Any) -> Box:
        return Box(cells=cells, uy=uy, medium=medium, medium_refinement=refine_medium, cell_kind=cell_kind)

    solve(problem, options)


@run_group.command("cbox")
@click.option("--cells", type=int, nargs=2, default=(20, 10), show_default=True, help="Cells in x and y over 1 x 0.5.")
@click.option(
    "--mesh",
    "solid_cells",
    type=click.Choice(["polygons", "quadrilaterals"]),
    help="Cells of the solid; the medium has quadrilaterals. Default: polygons, with --method fem quadrilaterals.",
)
@click.option("--refine-medium", default=1, show_default=True, help="Divide edges of the medium; the paper: 1 and 2.")
@click.option("--uy", type=float, default=-0.5, show_default=True, help="Displacement of the upper right corner.")
@angle_medium_options(gamma=1e-5, alpha_r=1.0)
@method_options()
def cbox(cells: tuple[int, int], solid_cells: str | None, refine_medium: int, uy: float, **options: Any) -> None:
    """Self-contact of the C-box (section 5.2 of Xu & Wriggers).

    The tip of the upper arm is pushed down onto the lower arm. Examples:

    \b
      tmc-vem run cbox --refine-medium 2 --out runs/cbox
      tmc-vem run cbox --uy -1 --alpha-r 20 --out runs/cbox-20
    """
    from tmc_vem.problems import CBox

    chosen = solid_cells or ("quadrilaterals" if options["method"] == "fem" else "polygons")
    solve(lambda medium: CBox(cells, refine_medium, chosen, medium, uy=uy), options)


@run_group.command("punch")
@click.option("--size", type=float, default=0.1, show_default=True, help="Size of cells.")
@click.option("--stiffness", type=float, default=1.0, show_default=True, help="Of the punch; the paper: 1 and 100.")
@click.option("--gap0", type=float, default=0.6, show_default=True, help="Initial gap below the punch.")
@click.option("--uy", type=float, default=-1.3, show_default=True, help="Displacement of the punch's top.")
@angle_medium_options(gamma=1e-4, alpha_r=1.0)
@method_options()
def punch(size: float, stiffness: float, gap0: float, uy: float, **options: Any) -> None:
    """Round punch pressed into a block (section 5.3 of Xu & Wriggers), on Voronoi cells or, with --method fem, on
    triangles of the same size (then best with --interior-penalty penalty). Examples:

    \b
      tmc-vem run punch --uy -1.3 --out runs/punch
      tmc-vem run punch --uy -1.3 --stiffness 100 --out runs/punch-stiff
    """
    from tmc_vem.problems import Punch

    solve(lambda medium: _with_cells(Punch(size, stiffness, gap0, medium, uy=uy), options), options)


@run_group.command("bodies")
@click.option("--case", type=int, default=1, show_default=True, help="1: half discs guided; 2: free in x.")
@click.option("--size", type=float, default=0.1, show_default=True, help="Size of cells.")
@click.option("--discs", type=int, default=7, show_default=True, help="Number of half discs.")
@click.option("--gap0", type=float, default=0.1, show_default=True, help="Initial gap between beam and half discs.")
@click.option("--uy", type=float, default=0.25, show_default=True, help="How far the half discs move to the beam.")
@angle_medium_options(gamma=1e-4, alpha_r=10.0)
@method_options()
def bodies(case: int, size: float, discs: int, gap0: float, uy: float, **options: Any) -> None:
    """A beam between seven half discs (section 5.4 of Xu & Wriggers), on Voronoi cells or, with --method fem, on
    triangles of the same size (then best with --interior-penalty penalty). Examples:

    \b
      tmc-vem run bodies --case 1 --out runs/bodies-1
      tmc-vem run bodies --case 2 --out runs/bodies-2
    """
    from tmc_vem.problems import Bodies

    solve(lambda medium: _with_cells(Bodies(case, size, discs, gap0, medium, uy=uy), options), options)


def _with_cells(problem: Any, options: dict[str, Any]) -> Any:
    """A problem of Voronoi cells on cells that the method can use, as in ``tmc-vem compare``."""
    from tmc_vem.simulation.triangulated import Triangulated

    return Triangulated(problem, problem.size) if options["method"] == "fem" else problem


def solve(make_problem: Callable[[Any], Any], options: dict[str, Any]) -> None:
    """Make the problem, run it, and show the result as the options ask.

    Raises:
        InputError, CodegenError: bad input.
        ConvergenceError: the full load was not reached; what converged is in the run directory.
    """
    problem = make_problem(chosen_medium(options))
    execute(problem, chosen_options(options), options)
