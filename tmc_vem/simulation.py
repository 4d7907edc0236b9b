"""Run a problem: mesh, kernels, discretisation, load stepping, results. The command line is a thin layer over this."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tmc_vem.errors import InputError, TmcError
from tmc_vem.fem.settings import FemSettings
from tmc_vem.problems.base import Problem, RegionEnergy
from tmc_vem.results import PICTURE, RunDirectory, RunResult, StepRecord
from tmc_vem.timing import Timer
from tmc_vem.vem.element import ElementSettings

METHODS = ("vem", "fem")


@dataclass(frozen=True)
class RunOptions:
    """How a problem is discretised and solved.

    Attributes:
        method: 'vem' for virtual elements, 'fem' for Lagrange elements in dolfinx.
        element: order, projection degree and quadrature of the virtual elements.
        fem: order, quadrature and interior penalty of the Lagrange elements.
        steps: equal load steps, or None for automatic ones.
        largest_step: largest automatic step, as a fraction of the load.
        snapshots: load steps that are written as VTU files, evenly spread over the load.
        overwrite: replace an earlier run in the output directory.
    """

    method: str = "vem"
    element: ElementSettings = field(default_factory=ElementSettings)
    fem: FemSettings = field(default_factory=FemSettings)
    steps: int | None = None
    largest_step: float = 0.1
    snapshots: int = 10
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"unknown method '{self.method}': choose one of {', '.join(METHODS)}")
        if not 0 <= self.snapshots <= 10_000:
            raise InputError(f"snapshots = {self.snapshots}: use 0 to 10000")
        if not 0.0 < self.largest_step <= 1.0:
            raise InputError(f"largest step = {self.largest_step:g}: use a fraction of the load, above 0 and up to 1")


class Monitor:
    """Hears about a run as it goes on; the command line's progress display is one. All methods may be overridden."""

    def started(self, problem: Problem, n_cells: int, n_dofs: int) -> None:
        """The system is set up."""

    def iterated(self, iteration: int, residual: float) -> None:
        """A Newton iteration is done, counted from the start of the run."""

    def stepped(self, record: StepRecord) -> None:
        """A load step has converged."""

    def finished(self, result: RunResult) -> None:
        """The run is over."""


def run(
    problem: Problem,
    out: str | Path | None = None,
    options: RunOptions | None = None,
    *,
    comm: Any = None,
    monitor: Monitor | None = None,
) -> RunResult:
    """Solve a problem up to full load.

    Args:
        problem: what to solve, for example ``Box()``.
        out: run directory for results, fields and a picture; None keeps the result in memory only.
        options: discretisation and load stepping.
        comm: MPI communicator, all ranks by default.
        monitor: hears about progress; called on rank 0 only.

    Returns:
        The result on every rank. If the load could not be applied in full, ``complete`` is False, ``reason`` says why,
        and everything that converged is kept.

    Raises:
        InputError: the problem, the options or the output directory are wrong; nothing is written then.
        CodegenError: an energy's kernel cannot be made.
    """
    from mpi4py import MPI

    from tmc_vem.output import SnapshotWriter, gather_fields
    from tmc_vem.provenance import versions
    from tmc_vem.solve.newton import NewtonSolver
    from tmc_vem.solve.stepping import LoadStepper, SteppingOptions

    options = options or RunOptions()
    comm = MPI.COMM_WORLD if comm is None else comm
    on_root = comm.rank == 0
    monitor = monitor if monitor is not None and on_root else Monitor()
    timer = Timer()
    stepping = SteppingOptions(
        steps=options.steps,
        largest=options.largest_step,
        first=min(SteppingOptions.first, options.largest_step),
        smallest=min(SteppingOptions.smallest, options.largest_step),
    )

    with timer("set-up"):
        directory = _on_root(comm, lambda: RunDirectory(out, overwrite=options.overwrite)) if out is not None else None
        system = discretise(problem, options, comm)
        solver = NewtonSolver(system, timer=timer)
        gap_points = _reference_gap(problem, system)
        if directory is not None and on_root:
            directory.start()
        comm.barrier()
        snapshots = None
        if directory is not None and options.snapshots:
            loads = tuple((n + 1) / options.snapshots for n in range(options.snapshots))
            snapshots = SnapshotWriter(system, directory.path, loads)
    n_cells, n_dofs = system.n_cells_global, system.n_dofs
    monitor.started(problem, n_cells, n_dofs)

    history: list[StepRecord] = []
    iterations = 0

    def on_iteration(iteration: Any) -> None:
        nonlocal iterations
        iterations += 1
        monitor.iterated(iterations, iteration.residual)

    def on_step(step: Any, u: Any) -> None:
        load_condition = problem.load()
        evaluation = step.newton.evaluation
        with timer("output"):
            record = StepRecord(
                step=step.number,
                load=step.load,
                displacement=step.load * load_condition.value,
                gap=_gap(problem, system, gap_points, u),
                reaction=system.reaction(solver.residual, load_condition.where, load_condition.component),
                iterations=len(step.newton.iterations),
                cut_backs=step.cut_backs,
                wasted_iterations=step.wasted_iterations,
                min_j={name: values.min_j for name, values in evaluation.regions.items()},
                energy={name: values.energy for name, values in evaluation.regions.items()},
                negative_pivots=step.newton.negative_pivots,
                jumped=step.jumped,
                seconds=timer.report()["total"],
            )
            history.append(record)
            if directory is not None and on_root:
                directory.add_step(record)
            if snapshots is not None:
                snapshots.offer(step.number, step.load, u)
            monitor.stepped(record)

    solver.on_iteration = on_iteration
    u = system.create_vector()
    outcome = LoadStepper(solver, stepping, on_step).run(u)

    if directory is not None:
        with timer("output"):
            fields = gather_fields(system, u)
            if fields is not None:
                from tmc_vem.report.figures import draw_deformed

                draw_deformed(fields, directory.path / PICTURE, title=_title(problem, history))
    result = RunResult(
        inputs=run_inputs(problem, options),
        versions=versions(comm.size),
        complete=outcome.complete,
        reason=outcome.reason,
        load=outcome.load,
        n_cells=n_cells,
        n_dofs=n_dofs,
        newton_iterations=sum(r.iterations + r.wasted_iterations for r in history) + outcome.failed_iterations,
        cut_backs=sum(r.cut_backs for r in history) + outcome.failed_attempts,
        projection_degrees={str(degree): count for degree, count in system.projection_degrees().items()},
        seconds=timer.report(),
        history=history,
        directory=None if directory is None else directory.path,
    )
    if directory is not None and on_root:
        directory.write_result(result)
    monitor.finished(result)
    return result


def discretise(problem: Problem, options: RunOptions, comm: Any) -> Any:
    """The discretised system of a problem; kernels or forms are compiled if they are not in the cache.

    Raises:
        InputError: mesh and problem do not fit, or the method is 'fem' and dolfinx is missing.
        CodegenError: an energy's kernel cannot be made.
    """
    if options.method == "fem":
        from tmc_vem.fem.system import FemSystem

        return FemSystem(comm, problem.make_mesh, problem.regions(), problem.prescribed(), options.fem)

    from tmc_vem.mesh.distribute import distribute
    from tmc_vem.vem.system import RegionKernel, VemSystem

    kernels = {name: RegionKernel(*compile_region(region)) for name, region in problem.regions().items()}
    return VemSystem(distribute(comm, problem.make_mesh), kernels, problem.prescribed(), options.element)


def compile_region(region: RegionEnergy) -> tuple[Any, Any]:
    """Kernel of a region's energy and its parameter array."""
    from codegen.kernel import compile_energy

    energy = region.energy
    kernel = compile_energy(energy.density, energy.name, energy.parameters, energy.description)
    return kernel, kernel.parameter_array(region.values)


def _on_root(comm: Any, make: Callable[[], RunDirectory]) -> RunDirectory:
    """Make something on rank 0; all ranks get it, or its error."""
    made: RunDirectory | TmcError | None = None
    if comm.rank == 0:
        try:
            made = make()
        except TmcError as error:
            made = error
    made = comm.bcast(made)
    if isinstance(made, TmcError):
        raise made
    assert made is not None
    return made


def _reference_gap(problem: Problem, system: Any) -> Any:
    gap = problem.gap()
    return None if gap is None else system.point_coordinates((gap.first, gap.second))


def _gap(problem: Problem, system: Any, reference: Any, u: Any) -> float | None:
    gap = problem.gap()
    if gap is None:
        return None
    first, second = reference + system.point_displacements(u, (gap.first, gap.second))
    return float(np.hypot(*(first - second)))


def run_inputs(problem: Problem, options: RunOptions) -> dict[str, Any]:
    """The inputs as a run directory records them; two runs with equal ones give equal results."""
    return {**problem.inputs(), **_method_inputs(options)}


def _method_inputs(options: RunOptions) -> Mapping[str, Any]:
    if options.method == "fem":
        discretisation = asdict(options.fem)
    else:
        element = options.element
        discretisation = {
            "order": element.order,
            "projection_degree": "spectral test" if element.degree is None else element.degree,
            "quadrature": element.quadrature_degree,
        }
    return {
        "method": options.method,
        **discretisation,
        "load_steps": "automatic" if options.steps is None else options.steps,
        "largest_step": options.largest_step,
    }


def _title(problem: Problem, history: list[StepRecord]) -> str:
    if not history:
        return f"{problem.name}, undeformed"
    last = history[-1]
    gap = "" if last.gap is None else f", gap {last.gap:.4g}"
    return f"{problem.name} at {problem.load().where} displacement {last.displacement:g}{gap}"
