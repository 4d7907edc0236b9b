"""Run a problem: mesh, kernels, discretisation, load stepping, results. The command line is a thin layer over this."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, RegionEnergy, media_of
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.records import RunResult
from tmc_vem.results.unfinished import how_to_go_on
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.solve.path import ControlPath
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.memory import reuse_freed
from tmc_vem.support.parallel import on_every_rank, on_root
from tmc_vem.support.timing import Timer
from tmc_vem.support.validation import check_fields, require_choice, require_finite, require_known, require_positive
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Discretisation
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.vem.spaces.element import ElementSettings

METHODS = ("vem", "fem")
# How long a branch may be, in units of the load, with fields written along all of it.
LONGEST_BRANCH = 10
# Work of a medium's cell relative to a solid's: second derivatives make its tangent 3 times as dear.
MEDIUM_COST = 2.5
CONTINUED = ("gamma", "alpha_r")


@dataclass(frozen=True)
class RunOptions:
    """How a problem is discretised and solved.

    Attributes:
        method: 'vem' for virtual elements, 'fem' for Lagrange elements in dolfinx.
        element: order, projection degree and quadrature of the virtual elements.
        fem: order, quadrature and interior penalty of the Lagrange elements.
        steps: equal load steps, or None for automatic ones.
        largest_step: largest automatic step, as a fraction of the load.
        solver: linear solver, 'direct', 'reproducible', 'iterative' or a file of PETSc options.
        path: load factors to go through one after another: (0, 1, 0) loads and unloads.
        output_loads: load factors to hit exactly and write, besides those of the path.
        continuation: values of the medium's gamma or alpha_r that the first leg of the path is gone with; at its end
            they are brought to those of the problem step by step, and the rest of the path follows.
        allow_overlap: take converged states in which solids overlap, which are refused else.
        follow: follow the equilibrium branch through limit points by its length, the load going back there, instead of
            jumping to another branch.
        max_iterations: Newton iterations after which the run ends, or None; failed attempts count.
        max_seconds: wall time after which the run ends, or None.
        snapshots: load steps that are written as VTU files, evenly spread over the load.
        triangulated: write them once more with cells cut into triangles, in which all filters of VTK are exact.
        checkpoint_every: converged load steps between checkpoints in the output directory; 0 for none.
        overwrite: replace an earlier run in the output directory.
    """

    method: str = "vem"
    element: ElementSettings = field(default_factory=ElementSettings)
    fem: FemSettings = field(default_factory=FemSettings)
    steps: int | None = None
    largest_step: float = 0.1
    solver: str = "direct"
    path: tuple[float, ...] = (0.0, 1.0)
    output_loads: tuple[float, ...] = ()
    continuation: Mapping[str, float] = field(default_factory=dict)
    follow: bool = False
    allow_overlap: bool = False
    max_iterations: int | None = None
    max_seconds: float | None = None
    snapshots: int = 10
    triangulated: bool = False
    checkpoint_every: int = 1
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        require_choice("method", self.method, METHODS)
        if not 0 <= self.snapshots <= 10_000:
            raise InputError(f"snapshots = {self.snapshots}: use 0 to 10000")
        if self.checkpoint_every < 0:
            raise InputError(f"checkpoint every {self.checkpoint_every} steps: use 1 or more, or 0 for none")
        if not 0.0 < self.largest_step <= 1.0:
            raise InputError(f"largest step = {self.largest_step:g}: use a fraction of the load, above 0 and up to 1")
        if self.path[:1] != (0.0,):
            raise InputError(f"load path {' '.join(f'{load:g}' for load in self.path)} must begin with 0")
        for load in self.output_loads:
            require_finite("output load", load)
            low, high = min(self.path), max(self.path)
            if not low <= load <= high:
                raise InputError(f"output load {load:g} is not on the load path, which goes from {low:g} to {high:g}")
        require_known(self.continuation, CONTINUED, "continuation")
        for name, value in self.continuation.items():
            require_positive(f"continuation from {name}", value, "it is where the parameter starts from")
        for name in ("path", "output_loads", "continuation", "steps"):
            if self.follow and getattr(self, name) != getattr(RunOptions(), name):
                raise InputError(f"follow does not go with {name}: the load is not prescribed along the branch")
        for name in ("max_iterations", "max_seconds"):
            if getattr(self, name) is not None:
                require_positive(name, getattr(self, name), "or leave it out for no limit")


def run(
    problem: Problem,
    out: str | Path | None = None,
    options: RunOptions | None = None,
    *,
    comm: Comm | None = None,
    monitor: Monitor | None = None,
    resume: bool = False,
    command: Mapping[str, Any] | None = None,
) -> RunResult:
    """Solve a problem up to full load.

    Args:
        problem: what to solve, for example ``Box()``.
        out: run directory for results, fields and a picture; None keeps the result in memory only.
        options: discretisation and load stepping.
        comm: MPI communicator, all ranks by default.
        monitor: hears about progress; called on rank 0 only.
        resume: go on from the checkpoint in ``out``; problem and options must be those it was made with.
        command: what the command line was asked, kept in the run directory so that ``tmc-vem resume`` can ask it again.

    Returns:
        The result on every rank. If the load could not be applied in full, ``complete`` is False, ``reason`` says why,
        and everything that converged is kept.

    Raises:
        InputError: the problem, the options or the output directory are wrong; nothing is written then.
        CodegenError: an energy's kernel cannot be made.
        Interrupted: Ctrl-C or SIGTERM; the last checkpoint is in the run directory.
    """
    from mpi4py import MPI

    from tmc_vem.problems.examine import examine, known_cause
    from tmc_vem.results.plausibility import WARNING, Finding
    from tmc_vem.simulation.gauge import Gauge
    from tmc_vem.simulation.interrupt import Interrupted, stop_requests
    from tmc_vem.simulation.overlap import OverlapWatch
    from tmc_vem.simulation.recorder import Recorder
    from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
    from tmc_vem.solve.budget import Budget
    from tmc_vem.solve.newton import Iteration, NewtonSolver
    from tmc_vem.solve.stepping import LoadStepper, SteppingOptions

    options = options or RunOptions()
    comm = MPI.COMM_WORLD if comm is None else comm
    monitor = monitor if monitor is not None and comm.rank == 0 else Monitor()
    timer = Timer()
    stepping = SteppingOptions(
        steps=options.steps,
        largest=options.largest_step,
        first=min(SteppingOptions.first, options.largest_step),
        smallest=min(SteppingOptions.smallest, options.largest_step),
    )
    path = control_path(problem, options)
    if resume and out is None:
        raise InputError("there is nothing to resume without a run directory")

    directory: RunDirectory | None = None
    lock = None
    with timer("set-up"):
        if out is not None:
            directory = comm.bcast(on_root(comm, lambda: RunDirectory(out, overwrite=options.overwrite or resume)))
        hints: list[str] = []
        loads = (*options.path, *options.output_loads)
        system = discretise(problem, options, comm, lambda mesh: hints.extend(examine(problem, mesh, loads)))
        hints = comm.bcast(hints)
        require_finite_start(system, problem)
        gauge = Gauge(problem, system)
        watch = OverlapWatch(
            system, media_of(problem), order_of(options), tolerated=options.allow_overlap,
            cause=lambda place: comm.bcast(on_root(comm, lambda: known_cause(problem, place, loads))),
        )  # fmt: skip
        solver = NewtonSolver(system, timer=timer, solver=options.solver, admission=watch)
    if directory is not None:
        lock = on_root(comm, directory.lock)
    try:
        with timer("set-up"):
            if directory is not None and comm.rank == 0 and not resume:
                directory.start(command)
            comm.barrier()
            recorder = Recorder(
                problem, system, gauge, run_inputs(problem, options), directory, _snapshot_times(path, options),
                options.checkpoint_every, monitor, timer, watch, triangulated=options.triangulated,
            )  # fmt: skip
            if directory is not None and lock is not None and not lock.held:
                text = f"the file system of {directory.path} has no locks: only one run may write there"
                recorder.findings.append(Finding(WARNING, text))
            recorder.findings += [Finding(WARNING, text) for text in hints]
            u = system.create_vector()
            states, position = recorder.restore(u) if resume else (None, None)
            recorder.begin(locked=lock is not None and lock.held)
        monitor.end = path.end
        monitor.started(problem, system.n_cells_global, system.n_dofs)
        monitor.warned(hints)
        budget = Budget(options.max_iterations, options.max_seconds, comm)
        with stop_requests(comm) as stop:

            def on_iteration(iteration: Iteration, done: int) -> None:
                monitor.iterated(done, iteration.residual)
                stop.check()
                budget.spend()

            stepper: LoadStepper | ArcLengthStepper
            if options.follow:
                arc = ArcOptions(largest=options.largest_step, first=min(ArcOptions.first, options.largest_step))
                stepper = ArcLengthStepper(solver, arc, recorder.record, on_iteration)
            else:
                stepper = LoadStepper(
                    solver, stepping, recorder.record, path, _gamma(problem), recorder.step_failed, on_iteration
                )
            try:
                outcome = stepper.run(u, states, position)
            except TmcError:
                monitor.aborted()
                raise
        result = recorder.finish(outcome, u, options.solver, cut_short=budget.used_up)
    except Interrupted as stop:
        how = how_to_go_on(directory.path) if directory is not None else ""
        _end_early(directory, comm, stop)
        raise Interrupted(stop.number, how) from None
    except BaseException as error:
        _end_early(directory, comm, error)
        raise
    finally:
        if lock is not None:
            lock.release()
    monitor.finished(result)
    return result


def _end_early(directory: RunDirectory | None, comm: Comm, error: BaseException) -> None:
    """Say in the run directory why there will be no result."""
    if directory is not None and comm.rank == 0:
        directory.interrupted(str(error) or type(error).__name__)


def control_path(problem: Problem, options: RunOptions) -> ControlPath:
    """The path of loads and continued parameters that the options ask for.

    Raises:
        InputError: a load is repeated or not usable, or the problem has no medium whose parameters could be continued.
    """
    if not options.continuation or len(options.path) < 2:
        return ControlPath([Control(load) for load in options.path], options.output_loads)
    media = [region.values for region in problem.regions().values() if region.is_medium]
    end: dict[str, float] = {}
    for name in options.continuation:
        values = {region[name] for region in media}
        if len(values) != 1:
            raise InputError(f"continuation in {name} needs one value of it in the medium, got {len(values)}")
        end[name] = values.pop()
    first, second, *rest = options.path
    begin = {name: options.continuation[name] for name in end}
    corners = [Control(first, begin), Control(second, begin), Control(second, end), *(Control(x, end) for x in rest)]
    return ControlPath(corners, options.output_loads)


def _snapshot_times(path: ControlPath, options: RunOptions) -> list[float]:
    """Where fields are written: evenly along the path, and where it must be hit exactly."""
    if not options.snapshots:
        return []
    pieces = options.snapshots * (LONGEST_BRANCH if options.follow else 1)
    return sorted({path.end * (n + 1) / options.snapshots for n in range(pieces)} | set(path.stops))


def order_of(options: RunOptions) -> int:
    """Polynomial degree along the sides of cells."""
    return options.fem.order if options.method == "fem" else options.element.order


def _gamma(problem: Problem) -> dict[str, float]:
    """gamma of the medium, if there is one value of it; the load stepper may raise it for a while."""
    values = {region.values["gamma"] for region in problem.regions().values() if "gamma" in region.values}
    return {"gamma": values.pop()} if len(values) == 1 else {}


def discretise(
    problem: Problem, options: RunOptions, comm: Comm, on_mesh: Callable[[PolygonMesh], object] | None = None
) -> Discretisation:
    """The discretised system of a problem; kernels or forms are compiled if they are not in the cache.

    Args:
        problem: what to discretise.
        options: how.
        comm: MPI communicator.
        on_mesh: called on rank 0 with the whole mesh before it is distributed; what it raises is raised on all ranks.

    Raises:
        InputError: mesh and problem do not fit, or the method is 'fem' and dolfinx is missing.
        CodegenError: an energy's kernel cannot be made.
    """

    def make_mesh() -> PolygonMesh:
        mesh = problem.make_mesh()
        if on_mesh is not None:
            on_mesh(mesh)
        return mesh

    if options.method == "fem":
        from tmc_vem.fem.system import FemSystem

        return FemSystem(comm, make_mesh, problem.regions(), problem.prescribed(), options.fem)

    from tmc_vem.mesh.spread.distribute import distribute
    from tmc_vem.vem.blocks import RegionKernel
    from tmc_vem.vem.system import VemSystem

    kernels = on_every_rank(
        comm, lambda: {name: RegionKernel(*compile_region(region)) for name, region in problem.regions().items()}
    )
    costs = {name: MEDIUM_COST for name, region in problem.regions().items() if region.is_medium}
    mesh = distribute(comm, make_mesh, costs)
    reuse_freed()
    return VemSystem(mesh, kernels, problem.prescribed(), options.element)


def require_finite_start(system: Discretisation, problem: Problem) -> None:
    """Check that energies and stresses can be computed before anything is deformed.

    Raises:
        InputError: they cannot; load stepping would only say that it found no way to begin.
    """
    u, residual = system.create_vector(), system.create_vector()
    evaluation = system.residual(u, residual)
    bad = [f"the energy of region '{name}'" for name, of in evaluation.regions.items() if not math.isfinite(of.energy)]
    if not bad and not math.isfinite(residual.norm()):
        bad = ["the stress, that is the derivative of the energy,"]
    if bad:
        checked = "'tmc-vem codegen FILE.py:FUNCTION --check' checks an energy of your own"
        fault = _fault(problem)
        why = f"{fault}; " if fault else ""
        raise InputError(f"{bad[0]} is no finite number in the undeformed state: {why}{checked}")


def _fault(problem: Problem) -> str:
    """What is wrong with a region's energy at F = I, in words; empty if that does not show."""
    from codegen.reference import fault_at_reference
    from codegen.trace import trace

    for name, region in problem.regions().items():
        energy = region.energy
        fault = fault_at_reference(trace(energy.density, energy.name, energy.parameters), region.values)
        if fault:
            return f"region '{name}': {fault}"
    return ""


def compile_region(region: RegionEnergy) -> tuple[Any, Any]:
    """Kernel of a region's energy and its parameter array."""
    from codegen.kernel import compile_energy

    energy = region.energy
    kernel = compile_energy(energy.density, energy.name, energy.parameters, energy.description)
    return kernel, kernel.parameter_array(region.values)


def run_inputs(problem: Problem, options: RunOptions) -> dict[str, Any]:
    """The inputs as a run directory records them; two runs with equal ones give equal results."""
    units = problem.units()
    return {**problem.inputs(), **({"units": asdict(units)} if units.declared else {}), **_method_inputs(options)}


def _method_inputs(options: RunOptions) -> Mapping[str, Any]:
    if options.method == "fem":
        discretisation = asdict(options.fem)
    else:
        element = options.element
        discretisation = {
            "order": element.order,
            "projection": element.projection,
            "projection_degree": "spectral test" if element.degree is None else element.degree,
            "quadrature": element.quadrature_degree,
            "rule": element.rule,
        }
    return {
        "method": options.method,
        **discretisation,
        "load_steps": "automatic" if options.steps is None else options.steps,
        "largest_step": options.largest_step,
        **({} if options.path == RunOptions.path else {"load_path": list(options.path)}),
        **({"output_loads": list(options.output_loads)} if options.output_loads else {}),
        **({"continuation": dict(options.continuation)} if options.continuation else {}),
        **({"follow": True} if options.follow else {}),
        **({"allow_overlap": True} if options.allow_overlap else {}),
    }
