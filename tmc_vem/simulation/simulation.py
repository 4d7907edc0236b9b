"""A run from the problem to its result: everything up to the first load step, and then the steps.

The command line is a thin layer over this. PETSc is loaded when a run is prepared, not before, so that whoever wants to
start it with options of his own can.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tmc_vem.problems.base import Problem, media_of, with_friction
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import how_to_go_on
from tmc_vem.simulation.discretised import discretise, require_finite_start
from tmc_vem.simulation.end_of_run import EndOfRun
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import PATH, RunOptions
from tmc_vem.simulation.plan import control_path, loads_of, order_of, run_inputs, snapshot_times
from tmc_vem.simulation.problem_file import can_be_written, problem_text
from tmc_vem.support.distributed import Comm, Vec
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.support.parallel import from_root, on_root
from tmc_vem.support.timing import Timer
from tmc_vem.system.discretisation import Discretisation

if TYPE_CHECKING:
    from tmc_vem.results.limit import Lowering
    from tmc_vem.results.lock import DirectoryLock
    from tmc_vem.simulation.descent import Descents
    from tmc_vem.simulation.interrupt import StopRequest
    from tmc_vem.simulation.recorder import Recorder
    from tmc_vem.simulation.repeats import Repeats
    from tmc_vem.solve.arclength import ArcLengthStepper, ArcOptions
    from tmc_vem.solve.budget import Budget
    from tmc_vem.solve.friction_steps import FrictionSteps
    from tmc_vem.solve.newton import Iteration, NewtonSolver
    from tmc_vem.solve.path import ControlPath
    from tmc_vem.solve.states import States
    from tmc_vem.solve.stepping import LoadStepper, OnStep, Step, StepperState, SteppingOptions, SteppingResult


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
    return prepare(problem, out, options, comm=comm, monitor=monitor, resume=resume, command=command).go()


def prepare(
    problem: Problem,
    out: str | Path | None = None,
    options: RunOptions | None = None,
    *,
    comm: Comm | None = None,
    monitor: Monitor | None = None,
    resume: bool = False,
    command: Mapping[str, Any] | None = None,
    keep: Sequence[str] = (),
) -> Simulation:
    """Everything of :func:`run` before its first load step: mesh, kernels, checks of the problem; nothing is written.

    Args:
        problem, out, options, comm, monitor, resume, command: those of :func:`run`.
        keep: names in the run directory that belong to this run already.

    Returns:
        What can be looked at, and goes when :meth:`Simulation.go` is called.

    Raises:
        InputError: the problem, the options or the output directory are wrong.
        CodegenError: an energy's kernel cannot be made.
    """
    from mpi4py import MPI

    from tmc_vem.problems.examine import examine, known_cause
    from tmc_vem.simulation.descent import lowering_of
    from tmc_vem.simulation.gauge import Gauge
    from tmc_vem.simulation.overlap import OverlapWatch
    from tmc_vem.simulation.recorder import Recorder
    from tmc_vem.solve.friction_steps import MOST_ITERATIONS
    from tmc_vem.solve.newton import NewtonOptions, NewtonSolver

    options = options or RunOptions()
    if options.adapt.names:
        raise InputError("a mesh that is adapted is not known before the run: use run, or leave adapt out")
    comm = MPI.COMM_WORLD if comm is None else comm
    monitor = monitor if monitor is not None and comm.rank == 0 else Monitor()
    timer = Timer()
    stepping = stepping_of(options, friction=bool(with_friction(problem)))
    path, lowering = control_path(problem, options), lowering_of(problem, options)
    if resume and out is None:
        raise InputError("there is nothing to resume without a run directory")

    directory: RunDirectory | None = None
    with timer("set-up"):
        if out is not None:
            directory = from_root(comm, lambda: RunDirectory(out, overwrite=options.overwrite or resume, keep=keep))
        hints: list[str] = []
        loads = (*loads_of(problem, options), *options.output_loads, *path.kinks)
        system = discretise(problem, options, comm, lambda mesh: hints.extend(examine(problem, mesh, loads)))
        hints = comm.bcast(hints)
        require_finite_start(system, problem)
        gauge = Gauge(problem, system)
        watch = OverlapWatch(
            system, media_of(problem), order_of(options), tolerated=options.allow_overlap,
            cause=lambda place: from_root(comm, lambda: known_cause(problem, place, loads)),
        )  # fmt: skip
        newton = NewtonOptions(max_iterations=MOST_ITERATIONS) if with_friction(problem) else NewtonOptions()
        solver = NewtonSolver(system, newton, timer, options.solver, watch)
        recorder = Recorder(
            problem, system, gauge, run_inputs(problem, options), directory, snapshot_times(path, options),
            options.checkpoint_every, monitor, timer, watch, triangulated=options.triangulated,
            stress_fields=options.field_names,
        )  # fmt: skip
    timer.pause()
    return Simulation(
        problem, options, system, tuple(hints), comm, directory, monitor, timer, path, stepping, solver, recorder,
        lowering, resume, command,
    )  # fmt: skip


@dataclass
class Simulation:
    """A run that is prepared: made by :func:`prepare` on all ranks, and gone through once by :meth:`go`.

    Attributes:
        problem: what is solved.
        options: how.
        system: its discretisation; vectors, residual and tangent are PETSc's, see
            :class:`tmc_vem.system.discretisation.Discretisation`.
        hints: sentences about known causes of trouble that the problem has, which the result will have as warnings.
        comm: MPI communicator.
        directory: where the run will be written, or None.
        monitor: hears about progress.
        timer: time by phase; what passes between preparation and :meth:`go` does not count.
        path: of the load, and of parameters that are continued.
        stepping: how the path is divided into steps.
        solver: solves at one load.
        recorder: what is recorded of converged steps.
        lowering: how gamma is lowered for the limits, if they are asked for.
        resume: whether to go on from the directory's checkpoint.
        command: what the command line was asked.
    """

    problem: Problem
    options: RunOptions
    system: Discretisation
    hints: tuple[str, ...]
    comm: Comm
    directory: RunDirectory | None
    monitor: Monitor
    timer: Timer
    path: ControlPath
    stepping: SteppingOptions
    solver: NewtonSolver
    recorder: Recorder
    lowering: Lowering | None = None
    resume: bool = False
    command: Mapping[str, Any] | None = None
    _has_gone: bool = field(default=False, init=False, repr=False)

    @property
    def n_cells(self) -> int:
        """Cells of the whole mesh."""
        return self.system.n_cells_global

    @property
    def n_dofs(self) -> int:
        """Displacement degrees of freedom, constrained ones included."""
        return self.system.n_dofs

    def go(self) -> RunResult:
        """Go through the load steps and write the result; called on all ranks together.

        Returns:
            The result on every rank, as :func:`run` returns it.

        Raises:
            InputError: it has gone before, the directory is in use or has got a run meanwhile, or its checkpoint does
                not belong to this problem.
            Interrupted: Ctrl-C or SIGTERM; the last checkpoint is in the run directory.
        """
        from tmc_vem.simulation.interrupt import Interrupted

        if self._has_gone:
            raise InputError("this run has gone through its load steps already: prepare it again")
        self.timer.go_on()
        directory = self.directory
        lock = on_root(self.comm, directory.lock) if directory is not None else None
        self._has_gone = True
        try:
            result = self._through_all_steps(lock)
        except Interrupted as stop:
            how = how_to_go_on(directory.path) if directory is not None else ""
            self._end_early(stop)
            raise Interrupted(stop.number, how) from None
        except BaseException as error:
            self._end_early(error)
            raise
        finally:
            if lock is not None:
                lock.release()
        self.monitor.finished(result)
        return result

    def _through_all_steps(self, lock: DirectoryLock | None) -> RunResult:
        from tmc_vem.simulation.interrupt import stop_requests
        from tmc_vem.solve.budget import Budget

        recorder, monitor = self.recorder, self.monitor
        with self.timer("set-up"):
            self._begin_directory(lock)
            u = self.system.create_vector()
            states, position = recorder.restore(u) if self.resume else (None, None)
            recorder.begin(locked=lock is not None and lock.held)
        monitor.end = self.path.end
        monitor.started(self.problem, self.n_cells, self.n_dofs)
        monitor.warned(self.hints)
        budget = Budget(self.options.max_iterations, self.options.max_seconds, self.comm)
        with stop_requests(self.comm) as stop:
            stepper, descents = self._stepper(stop, budget)
            try:
                outcome: SteppingResult = self._go_along(stepper, descents, u, states, position)
            except TmcError:
                monitor.aborted()
                raise
        result = recorder.finish(
            outcome, u, self.options.solver, cut_short=budget.used_up, lowering=self.lowering,
            along_path=self.options.extrapolate_gamma == PATH,
        )  # fmt: skip
        if result.last is None:
            return result
        return replace(result, end=EndOfRun.of(self.problem, self.options, self.system, u, result.last))

    def _go_along(
        self,
        stepper: LoadStepper | ArcLengthStepper,
        descents: Descents | Repeats | None,
        u: Vec,
        states: States | None,
        position: StepperState | None,
    ) -> SteppingResult:
        """Go to the end of the path, and lower gamma where that is asked for, first of all at the step that a resumed
        run was cut short in."""
        from tmc_vem.solve.budget import OutOfBudget
        from tmc_vem.solve.stepping import SteppingResult

        try:
            if descents is not None and states is not None:
                descents.offer(states.vectors[-1])
            outcome = stepper.run(u, states, position)
        except OutOfBudget as limit:
            return SteppingResult(self.recorder.history[-1].load, False, str(limit))
        try:
            if descents is not None and outcome.complete:
                descents.descend(u)
        except OutOfBudget as limit:
            return replace(outcome, complete=False, reason=f"{limit} while gamma was lowered")
        return outcome

    def _begin_directory(self, lock: DirectoryLock | None) -> None:
        """Empty the run directory, unless the run goes on, and take down what is to be said about run and problem."""
        from tmc_vem.results.plausibility import WARNING, Finding

        directory, findings = self.directory, self.recorder.findings
        if directory is not None and not self.resume:
            problem, text = self.problem, None
            if isinstance(problem, OwnProblem) and can_be_written(problem):
                text = problem_text(problem, self.options)
            on_root(self.comm, lambda: directory.start(self.command, text))
        if directory is not None and lock is not None and not lock.held:
            text = f"the file system of {directory.path} has no locks: only one run may write there"
            findings.append(Finding(WARNING, text))
        findings += [Finding(WARNING, text) for text in self.hints]

    def _stepper(
        self, stop: StopRequest, budget: Budget
    ) -> tuple[LoadStepper | ArcLengthStepper, Descents | Repeats | None]:
        """What goes along the path, and what lowers gamma beside it: they look for a stop after every iteration, and
        every converged step is recorded."""
        from tmc_vem.simulation.descent import Descents
        from tmc_vem.simulation.repeats import Repeats
        from tmc_vem.solve.arclength import ArcLengthStepper
        from tmc_vem.solve.stepping import LoadStepper

        solver, recorder = self.solver, self.recorder

        def on_iteration(iteration: Iteration, done: int) -> None:
            self.monitor.iterated(done, iteration.residual)
            stop.check()
            budget.spend()

        friction = friction_steps(self.problem, self.system, self.options)
        descents: Descents | Repeats | None = None
        if self.lowering is not None and friction.is_there:
            descents = Repeats(
                self.lowering, self.path, self.stepping, self.system, solver, recorder, budget, friction, on_iteration
            )
        elif self.lowering is not None:
            along_path, stops = self.options.extrapolate_gamma == PATH, self.path.stops
            descents = Descents(self.lowering, along_path, stops, self.path.end, solver, recorder, budget, on_iteration)

        on_step = recorder.record if descents is None else _then(recorder.record, descents)
        if self.options.follow:
            return ArcLengthStepper(solver, arc_of(self.options), on_step, on_iteration), descents
        gamma = {} if friction.is_there else gamma_of(self.problem)  # a stiffer medium would leave its friction behind
        stepper = LoadStepper(
            solver, self.stepping, on_step, self.path, gamma, recorder.step_failed, on_iteration, friction=friction
        )
        return stepper, descents

    def _end_early(self, error: BaseException) -> None:
        """Say in the run directory why there will be no result."""
        if self.directory is not None and self.comm.rank == 0:
            self.directory.interrupted(str(error) or type(error).__name__)


def _then(record: OnStep, descents: Descents | Repeats) -> OnStep:
    """Record a step, and lower gamma beside it where that is due."""

    def on_step(step: Step, states: States, position: StepperState) -> None:
        record(step, states, position)
        descents.offer(states.vectors[-1])

    return on_step


def stepping_of(options: RunOptions, *, friction: bool = False) -> SteppingOptions:
    """How the path is divided into steps.

    Args:
        options: of the run.
        friction: whether the problem has some.

    Raises:
        InputError: the number of steps is out of range.
    """
    from tmc_vem.solve.friction_steps import EXTRAPOLATION, TARGET_ITERATIONS
    from tmc_vem.solve.stepping import SteppingOptions

    return SteppingOptions(
        steps=options.steps,
        largest=options.largest_step,
        first=min(SteppingOptions.first, options.largest_step),
        smallest=min(SteppingOptions.smallest, options.largest_step),
        target_iterations=TARGET_ITERATIONS if friction else SteppingOptions.target_iterations,
        order=EXTRAPOLATION if friction else SteppingOptions.order,
    )


def friction_steps(problem: Problem, system: Discretisation, options: RunOptions) -> FrictionSteps:
    """What the load stepper asks about friction."""
    from tmc_vem.solve.friction_steps import FrictionSteps

    return FrictionSteps(system if with_friction(problem) else None, options.friction_error)


def arc_of(options: RunOptions) -> ArcOptions:
    """How a branch is divided into steps.

    Raises:
        InputError: the largest step is smaller than any that is taken.
    """
    from tmc_vem.solve.arclength import ArcOptions

    return ArcOptions(largest=options.largest_step, first=min(ArcOptions.first, options.largest_step))


def gamma_of(problem: Problem) -> dict[str, float]:
    """gamma of the medium, if there is one value of it; the load stepper may raise it for a while."""
    values = {region.values["gamma"] for region in problem.regions().values() if "gamma" in region.values}
    return {"gamma": values.pop()} if len(values) == 1 else {}
