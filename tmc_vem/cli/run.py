"""``tmc-vem run PROBLEM``: one command a problem; what all problems share stands here."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from tmc_vem.cli.run_file import RunGroup
from tmc_vem.support.errors import InputError

PROGRAM = "tmc-vem"
RESUME = "tmc_vem.resume"  # key in a context's meta: the run goes on from its checkpoint


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


def medium_options(
    command: Callable[..., Any],
    gamma: float = 1e-5,
    alpha_r: float = 1.0,
    regulariser: str = "huhu_lulu",
    beta: float = 5.0,
) -> Callable[..., Any]:
    """Options of the third medium."""

    def weight(context: click.Context, _: click.Parameter, given: float | None) -> float | None:
        """The default of this command, unless alpha is given instead."""
        return alpha_r if given is None and context.params.get("alpha") is None else given

    options = [
        click.option("--gamma", type=float, default=gamma, show_default=True, help="Stiffness relative to the solid."),
        click.option(
            "--alpha", type=float, is_eager=True,
            help="Weight of the regulariser without dimension, alpha_r = alpha mu h^2 with the initial width h of the "
            "gap, instead of --alpha-r: 2.5 suits any geometry and units.",
        ),
        click.option(
            "--alpha-r", type=float, callback=weight,
            help="Weight of the regulariser, a modulus times a length squared: another number in other units.  "
            f"[default: {alpha_r:g}]",
        ),
        click.option(
            "--regulariser", default=regulariser, show_default=True, metavar="NAME",
            help="huhu (6), huhu_lulu (9), angle (15), tangent (16), or your own: FILE.py:FUNCTION.",
        ),
        click.option("--param", "parameters", multiple=True, metavar="NAME=VALUE", help="Parameter of your own one."),
        click.option(
            "--beta", type=float, default=beta, show_default=True, help="Damping exp(-beta J); 0 for none."
        ),
    ]  # fmt: skip
    return _decorate(command, options)


def angle_medium_options(gamma: float, alpha_r: float) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Options of the third medium with the defaults of sections 5.2 to 5.4: regulariser (15), not damped."""
    return lambda command: medium_options(command, gamma, alpha_r, "angle", 0.0)


def method_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options of discretisation, load stepping and output."""
    options = [
        click.option("--steps", type=int, help="Equal load steps (the paper's box: 100). Default: automatic steps."),
        click.option(
            "--path", metavar="'LOADS'", default="0 1", show_default=True,
            help="Load factors to go through, e.g. '0 1 0 1' to load, unload and load again.",
        ),
        click.option(
            "--at", "output_loads", type=float, multiple=True, metavar="LOAD",
            help="Load factor to hit exactly and write; may be given several times.",
        ),
        click.option(
            "--continuation", multiple=True, metavar="NAME=VALUE",
            help="Load with this gamma or alpha_r, then bring it to the wanted value at full load. For small gamma, "
            "e.g. --gamma 1e-7 --continuation gamma=1e-4 (below that with --rule triangles). May be given for both.",
        ),
        click.option(
            "--follow", is_flag=True,
            help="Follow the branch through limit points, where the load goes back, instead of jumping to another.",
        ),
        click.option(
            "--allow-overlap", is_flag=True,
            help="Go on where solids overlap, for those who study it: such states are refused else.",
        ),
        click.option("--max-iterations", type=int, help="Stop after this many Newton iterations; resume goes on."),
        click.option("--max-seconds", type=float, help="Stop after this wall time; resume goes on."),
        click.option(
            "--method", type=click.Choice(["vem", "fem"]), default="vem", show_default=True,
            help="Virtual elements, or Lagrange elements in dolfinx for comparison.",
        ),
        click.option("--order", type=int, default=2, show_default=True, help="Order k of the elements: 2 or 3."),
        click.option(
            "--l", "degree", type=int,
            help="Degree l of the gradient's projection, for experts. Default: a spectral test of each cell shape.",
        ),
        click.option(
            "--projection", type=click.Choice(["auto", "full", "harmonic", "macro", "composite"]), default="auto",
            show_default=True,
            help="What vem projects gradients on. full: [P_l]^2 on all cells, as in the paper; auto: on cells without "
            "hanging nodes and many sides, else composite.",
        ),
        click.option(
            "--rule", type=click.Choice(["auto", "compressed", "triangles"]), default="auto", show_default=True,
            help="Quadrature of vem. triangles: points in all sub-triangles of a cell; compressed: the fewest points "
            "where one polynomial describes a cell; auto: few on triangles and quadrilaterals only.",
        ),
        click.option("--quadrature", type=int, help="Quadrature degree. Default: 2 k (vem), 4 (fem)."),
        click.option(
            "--interior-penalty", type=click.Choice(["none", "penalty", "full"]), default="none", show_default=True,
            help="fem: jumps of the gradient between elements of the medium.",
        ),
        click.option("--eta", type=float, default=10.0, show_default=True, help="fem: factor of the interior penalty."),
        click.option("--triangles", is_flag=True, help="fem: cut the quadrilaterals in two."),
        click.option("--out", type=click.Path(path_type=Path), help="Run directory. Default: nothing is written."),
        click.option("--overwrite", is_flag=True, help="Replace an earlier run in the run directory."),
        click.option("--checkpoint-every", type=int, default=1, show_default=True, help="Load steps; 0 for none."),
        click.option("--snapshots", type=int, default=10, show_default=True, help="Load steps written for ParaView."),
        click.option("--triangulated", is_flag=True, help="Write them once more, cut into triangles."),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout, and nothing else."),
        click.option("--quiet", is_flag=True, help="No progress display and no summary."),
        click.option(
            "--solver", default="direct", show_default=True, metavar="PRESET|FILE",
            help="Linear solver: direct; reproducible (same bits in every run on as many ranks); iterative; or FILE "
            "with PETSc options (prefix tmc_).",
        ),
        click.option("--petsc", default="", metavar="OPTIONS", help="PETSc options, e.g. '-tmc_mat_mumps_icntl_4 2'."),
    ]  # fmt: skip
    return _decorate(command, options)


def _decorate(command: Callable[..., Any], options: list[Callable[..., Any]]) -> Callable[..., Any]:
    for option in reversed(options):
        command = option(command)
    return command


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
@medium_options
@method_options
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
@method_options
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
@method_options
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
@method_options
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
    from tmc_vem.simulation.options import RunOptions

    problem = make_problem(chosen_medium(options))
    settings = RunOptions(
        method=options["method"],
        **method_settings(options),
        steps=options["steps"],
        solver=options["solver"],
        path=parse_path(options["path"]),
        output_loads=options["output_loads"],
        continuation=parse_parameters(options["continuation"], "--continuation"),
        follow=options["follow"],
        allow_overlap=options["allow_overlap"],
        max_iterations=options["max_iterations"],
        max_seconds=options["max_seconds"],
        snapshots=options["snapshots"],
        triangulated=options["triangulated"],
        checkpoint_every=options["checkpoint_every"],
        overwrite=options["overwrite"],
    )
    execute(problem, settings, options)


def chosen_medium(options: dict[str, Any]) -> Any:
    """The third medium of :func:`medium_options`.

    Raises:
        InputError: a value is out of range, or both alpha and alpha_r are given.
    """
    from tmc_vem.problems import Medium

    return Medium(
        gamma=options["gamma"],
        alpha_r=options["alpha_r"],
        alpha=options["alpha"],
        beta=options["beta"],
        regulariser=options["regulariser"],
        parameters=parse_parameters(options["parameters"]),
    )


def execute(problem: Any, settings: Any, options: dict[str, Any]) -> None:
    """Run a problem and show the result as ``out``, ``json``, ``quiet`` and ``petsc`` in the options ask.

    Raises:
        InputError, CodegenError: bad input.
        ConvergenceError: the full load was not reached; what converged is in the run directory.
    """
    _start_petsc(options["petsc"], clean_stdout=options["as_json"])
    from mpi4py import MPI

    from tmc_vem.cli.progress import ConsoleMonitor, print_summary
    from tmc_vem.report.tables import stopped
    from tmc_vem.results.unfinished import how_to_go_on
    from tmc_vem.simulation.monitor import Monitor
    from tmc_vem.simulation.simulation import run
    from tmc_vem.support.errors import ConvergenceError

    silent = options["quiet"] or options["as_json"]
    on_root = MPI.COMM_WORLD.rank == 0
    monitor: Monitor = Monitor() if silent or not on_root else ConsoleMonitor()
    context = click.get_current_context()
    result = run(
        problem,
        options["out"],
        settings,
        monitor=monitor,
        resume=context.meta.get(RESUME, False),
        command=_asked(context),
    )
    if on_root:
        if options["as_json"]:
            sys.stdout.write(result.to_json())
        elif not options["quiet"]:
            print_summary(result)
    if not result.complete:
        kept = f"; steps up to there are in {result.directory}" if result.directory and result.history else ""
        how = how_to_go_on(result.directory) if result.directory and result.cut_short else ""
        raise ConvergenceError(f"{stopped(result)}{kept}{'; ' if how else ''}{how}")


def _asked(context: click.Context) -> dict[str, Any]:
    """Problem and options as plain values, for a later ``tmc-vem resume``."""
    plain = {name: str(value) if isinstance(value, Path) else value for name, value in context.params.items()}
    return {"problem": context.command.name, "options": plain}


def method_settings(options: dict[str, Any]) -> dict[str, Any]:
    """Settings of the method in use, as arguments of :class:`tmc_vem.RunOptions`.

    Raises:
        InputError: a value is out of range, or an option belongs to the other method.
    """
    from tmc_vem.system.fem_settings import FemSettings
    from tmc_vem.vem.spaces.element import ElementSettings

    if options["method"] == "fem":
        if options["degree"] is not None:
            raise InputError("--l belongs to --method vem: finite elements project nothing")
        if options["projection"] != "auto":
            raise InputError("--projection belongs to --method vem: finite elements project nothing")
        if options["rule"] != "auto":
            raise InputError("--rule belongs to --method vem: finite elements have the rules of dolfinx")
        quadrature = {} if options["quadrature"] is None else {"quadrature": options["quadrature"]}
        return {
            "fem": FemSettings(
                order=options["order"],
                interior_penalty=options["interior_penalty"],
                eta=options["eta"],
                triangles=options["triangles"],
                **quadrature,
            )
        }
    if options["interior_penalty"] != "none" or options["triangles"]:
        raise InputError("--interior-penalty and --triangles belong to --method fem")
    element = ElementSettings(
        options["order"], options["degree"], options["quadrature"], options["projection"], options["rule"]
    )
    return {"element": element}


def parse_path(text: str) -> tuple[float, ...]:
    """Load factors separated by blanks or commas.

    Raises:
        InputError: one is not a number.
    """
    try:
        return tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"--path '{text}' is not a list of load factors, for example '0 1 0'") from None


def parse_parameters(texts: tuple[str, ...], option: str = "--param") -> dict[str, float]:
    """Values of ``NAME=VALUE`` options.

    Raises:
        InputError: one is not of that form.
    """
    values = {}
    for text in texts:
        name, separator, number = text.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            separator = ""
        if not separator or not name.strip():
            example = "kappa=0.1" if option == "--param" else "gamma=1e-4"
            raise InputError(f"{option} '{text}' is not NAME=VALUE, for example {example}")
    return values


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


def _start_petsc(options: str, clean_stdout: bool) -> None:
    """Start PETSc; its list of unused options, which newer versions print at the end, may be suppressed.

    Raises:
        InputError: petsc4py is missing, or the options are not written as options.
    """
    words = _petsc_words(options)
    try:
        import petsc4py
    except ImportError:
        raise InputError(
            "petsc4py is not available to this Python: install it ('apt-get install python3-petsc4py-real' on Debian) "
            "and make the environment with --system-site-packages"
        ) from None
    # where Python was started with -c, argv[0] would be an option to PETSc
    petsc4py.init([PROGRAM, *words, *(["-options_left", "0"] if clean_stdout else [])])
