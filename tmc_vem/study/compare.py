"""Compare virtual and finite elements on several meshes: which runs there are, and the report made of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems import Bodies, Box, CBox, Medium, Punch
from tmc_vem.problems.base import Problem, forces_of, media_of
from tmc_vem.problems.cell_size import is_field
from tmc_vem.problems.own import OwnProblem
from tmc_vem.report.comparison import QUANTITIES, Comparison, Method, comparison_page
from tmc_vem.report.page import Picture, picture
from tmc_vem.report.problem_figure import draw_meshes, draw_problem
from tmc_vem.report.richardson import Extrapolation, extrapolate
from tmc_vem.report.tables import full_gap, runs_csv
from tmc_vem.report.write import write_page
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.triangulated import Triangulated
from tmc_vem.study.batch import Job, Observer, Outcome, run_batch
from tmc_vem.study.paper.values import table2
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import write_atomically
from tmc_vem.support.validation import shown

METHODS = ("vem", "fem")
COST = {"vem": 1.0, "fem": 2.0}


@dataclass(frozen=True)
class Level:
    """Mesh of a study.

    Attributes:
        name: for tables.
        size: mesh size relative to the others.
        problems: the problem with this mesh, by method.
    """

    name: str
    size: float
    problems: Mapping[str, Problem]


@dataclass(frozen=True)
class Study:
    """What is compared.

    Attributes:
        title: of the report.
        levels: meshes from coarse to fine.
        options: of the runs, by method.
        paper: values of the paper for these parameters.
    """

    title: str
    levels: Sequence[Level]
    options: Mapping[str, RunOptions]
    paper: Mapping[str, tuple[float | None, str]] = field(default_factory=dict)

    def jobs(self) -> dict[tuple[str, str], Job]:
        """Runs by method and mesh."""
        finest = self.levels[-1].size
        return {
            (method, level.name): Job(
                f"{level.problems[method].name}-{method}-{level.name.replace(' ', '')}",
                level.problems[method],
                options,
                cost=COST[method] * (finest / level.size) ** 2,
            )
            for method, options in self.options.items()
            for level in self.levels
        }


def box_study(
    medium: Medium, uy: float, factors: Sequence[int], options: Mapping[str, RunOptions], refinement: int = 1
) -> Study:
    """The box with 20 n x 5 n cells for each factor n."""
    levels = []
    for n in factors:
        if n < 1:
            raise InputError(f"mesh factor {n}: use 1 for 20 x 5 cells, 2 for 40 x 10, and so on")
        cells = (20 * n, 5 * n)
        problem = Box(cells=cells, medium=medium, uy=uy, medium_refinement=refinement)
        levels.append(Level(f"{cells[0]} x {cells[1]}", 1.0 / n, dict.fromkeys(METHODS, problem)))
    paper = {}
    cells_of_paper = table2().get((medium.alpha_r, medium.gamma)) if medium.alpha_r is not None else None
    if cells_of_paper and (uy, medium.beta, medium.regulariser) == (-1.0, 5.0, "huhu_lulu"):
        names = {"fem_fine": "FEM, fine mesh", "vem_mesh1": "VEM, mesh 1", "vem_mesh2": "VEM, mesh 2",
                 "vem_mesh3": "VEM, mesh 3"}  # fmt: skip
        paper = {names[column]: (cells_of_paper[column].value, cells_of_paper[column].suspect) for column in names}
    return Study(f"Box: VEM and FEM, {_named(medium)}", levels, options, paper)


def cbox_study(medium: Medium, uy: float, factors: Sequence[int], options: Mapping[str, RunOptions]) -> Study:
    """The C-box with 10 n x 5 n cells: polygons in the solid for virtual elements, quadrilaterals for finite ones.

    The column of medium beside the arms is 0.1 wide on all meshes. Polygons need three across the wall at least; there
    are 2 n + 1.
    """
    levels = []
    for n in factors:
        cells = (10 * n, 5 * n)
        box = CBox(cells=cells, medium=medium, uy=uy, polygons_across=2 * n + 1, column_cells=n)
        problems = {"vem": box, "fem": replace(box, solid_cells="quadrilaterals")}
        levels.append(Level(f"{cells[0]} x {cells[1]}", 1.0 / n, problems))
    return Study(f"C-box: VEM and FEM, {_named(medium)}", levels, options)


def voronoi_study(
    make: Callable[[float], Punch | Bodies], medium: Medium, sizes: Sequence[float], options: Mapping[str, RunOptions]
) -> Study:
    """Punch or several bodies: Voronoi cells for virtual elements, triangles of the same size for finite ones."""
    levels = []
    for size in sorted(sizes, reverse=True):
        problem = make(size)
        levels.append(Level(f"size {size:g}", size, {"vem": problem, "fem": Triangulated(problem, size)}))
    return Study(f"{levels[0].problems['vem'].name.title()}: VEM and FEM, {_named(medium)}", levels, options)


def file_study(
    problem: OwnProblem,
    sizes: Sequence[float],
    settings: RunOptions,
    *,
    order: int | None = None,
    steps: int | None = None,
    interior_penalty: str | None = None,
    extrapolate_gamma: bool | str | None = None,
    gamma_decades: int | None = None,
) -> Study:
    """A problem of one's own with cells of several sizes; triangles for finite elements where it has Voronoi cells.

    Args:
        problem: with a mesh from shapes.
        sizes: of cells; those of places with smaller cells go with them. Where the size varies from place to place,
            what it is multiplied with.
        settings: run options of both methods.
        order, steps, interior_penalty, extrapolate_gamma, gamma_decades: other than those of the settings; the
            interior penalty is that of finite elements.

    Raises:
        InputError: the mesh comes from a file, or a value is out of range.
    """
    mesh = problem.table.mesh
    if mesh.size is None:
        raise InputError(
            f"mesh: file = {shown(mesh.file)} has one size of cells: give several files to 'tmc-vem sweep', --set "
            "mesh.file=coarse.msh,fine.msh"
        )
    settings = replace(
        settings,
        steps=settings.steps if steps is None else steps,
        extrapolate_gamma=settings.extrapolate_gamma if extrapolate_gamma is None else extrapolate_gamma,
        gamma_decades=settings.gamma_decades if gamma_decades is None else gamma_decades,
    )
    element, fem = settings.element, settings.fem
    penalty = interior_penalty or ("penalty" if fem.interior_penalty == "none" else fem.interior_penalty)
    options = {
        "vem": replace(settings, method="vem", element=replace(element, order=order or element.order)),
        "fem": replace(
            settings, method="fem", fem=replace(fem, order=order or fem.order, interior_penalty=penalty)
        ),
    }  # fmt: skip
    levels = []
    for size in sorted(sizes, reverse=True):
        problems = {"vem": problem.with_size(size), "fem": problem.with_size(size, voronoi="triangles")}
        levels.append(Level(f"{size:g} x size" if is_field(mesh.size) else f"size {size:g}", size, problems))
    return Study(f"{problem.name}: VEM and FEM", levels, options)


def _named(medium: Medium) -> str:
    values = medium.as_dict()
    own = "".join(f", {name} = {value:g}" for name, value in values.get("parameters", {}).items())
    weight = f"alpha_r = {medium.alpha_r:g}" if medium.alpha is None else f"alpha = {medium.alpha:g}"
    return f"gamma = {medium.gamma:g}, {weight}, regulariser {values['regulariser']}{own}"


def compare(
    study: Study, out: Path, *, command: str, processes: int = 2, observer: Observer | None = None
) -> tuple[Path, Comparison]:
    """Do the runs of a study that are not done yet, and write the report.

    Args:
        study: what to compare.
        out: gets report.html, report.md, runs.csv, figures and the run directories in ``runs``.
        command: the command line, for the report.
        processes: runs at a time.
        observer: hears about progress.

    Returns:
        Path of report.html and what is in it.

    Raises:
        InputError: the output directory cannot be used, or no run gave a result.
    """
    jobs = study.jobs()
    outcomes = dict(zip(jobs, run_batch(list(jobs.values()), out / "runs", processes=processes, observer=observer),
                        strict=True))  # fmt: skip
    failures = [
        f"{outcome.job.label} gave no result: {outcome.error}" for outcome in outcomes.values() if outcome.error
    ]
    if not any(outcome.result for outcome in outcomes.values()):
        raise InputError(failures[0])
    comparison = Comparison(
        title=study.title,
        command=command,
        methods=[_method(method, study, outcomes) for method in study.options],
        paper=study.paper,
        pictures=_pictures(study),
        failures=failures,
    )
    write_atomically(out / "runs.csv", runs_csv(comparison.runs))
    return write_page(comparison_page(comparison), out), comparison


def converged(
    sizes: Sequence[float],
    results: Sequence[RunResult | None],
    quantity: Callable[[RunResult | None], float | None] = full_gap,
) -> Extrapolation | None:
    """Mesh-converged value from the three finest meshes, if all of them reach full load."""
    known = [value for result in results[-3:] if (value := quantity(result)) is not None]
    return extrapolate(sizes[-3:], known) if len(known) == 3 else None


def _method(method: str, study: Study, outcomes: Mapping[tuple[str, str], Outcome]) -> Method:
    results = {level.name: outcomes[method, level.name].result for level in study.levels}
    sizes = [level.size for level in study.levels]
    limits = {name: converged(sizes, list(results.values()), value_of) for name, value_of in QUANTITIES.items()}
    return Method(
        method.upper(),
        {name: result for name, result in results.items() if result},
        {name: limit for name, limit in limits.items() if limit},
    )


def _pictures(study: Study) -> list[Picture]:
    """The problem on its finest mesh, and the meshes; a mesh that cannot be made has failed as a run before."""
    meshes: dict[str, list[tuple[str, PolygonMesh]]] = {method: [] for method in study.options}
    for level in study.levels:
        for method in study.options:
            with suppress(InputError):
                meshes[method].append((level.name, level.problems[method].make_mesh()))
    shown = next(problem for level in reversed(study.levels) for problem in level.problems.values())
    finest = next(made[-1][1] for made in meshes.values() if made)
    media = media_of(shown)
    figure = draw_problem(finest, media, shown.prescribed(), shown.load(), shown.probes(), forces_of(shown))
    pictures = [picture(figure, "problem", f"Problem '{shown.name}' with its supports, load and gap.")]
    same = all(len(set(map(id, level.problems.values()))) == 1 for level in study.levels)
    for method, made in list(meshes.items())[: 1 if same else None]:
        whose = "both methods" if same else method.upper()
        named = [(f"{name}: {mesh.n_cells} cells", mesh) for name, mesh in made]
        if named:
            pictures.append(picture(draw_meshes(named, media), f"meshes-{method}", f"Meshes of {whose}.", inline="png"))
    return pictures
