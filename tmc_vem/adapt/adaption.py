"""A run on a mesh that is adapted first: rounds on one rank, then the whole path with the last mesh on all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tmc_vem.adapt.rounds import Finished, Prepared, Rounds, Standing
from tmc_vem.adapt.solved import NotReached, let_go
from tmc_vem.adapt.store import KEPT, RoundStore, has_run
from tmc_vem.problems.base import Problem
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.adaptivity import Adaptivity
from tmc_vem.results.directory import RunDirectory
from tmc_vem.results.plausibility import WARNING, Finding
from tmc_vem.results.records import ADAPTED_PICTURE
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import how_to_go_on
from tmc_vem.simulation import simulation
from tmc_vem.simulation.adapt_settings import AdaptSettings
from tmc_vem.simulation.adaptable import fitted, require_adaptable, targets_of
from tmc_vem.simulation.adapted import on_mesh
from tmc_vem.simulation.interrupt import Interrupted, stop_requests, stopping_at_once
from tmc_vem.simulation.monitor import Monitor
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import run_inputs
from tmc_vem.simulation.problem_file import problem_text
from tmc_vem.simulation.provenance import versions
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import from_root


def adapted_run(
    problem: Problem,
    out: str | Path | None,
    options: RunOptions,
    *,
    comm: Comm | None,
    monitor: Monitor | None,
    resume: bool,
    command: Mapping[str, Any] | None,
) -> RunResult:
    """Adapt the mesh, and solve the problem on it; :func:`tmc_vem.adapt.run.run` says what the arguments are.

    Raises:
        InputError, CodegenError, Interrupted: as for that.
    """
    world: Comm = MPI.COMM_WORLD if comm is None else comm
    if resume and out is None:
        raise InputError("there is nothing to resume without a run directory")
    require_adaptable(problem, options)
    monitor = monitor if monitor is not None and world.rank == 0 else Monitor()
    path = None if out is None else Path(out)
    with stop_requests(world) as stop:  # other ranks wait; the one that works raises at once
        finished, why_not = from_root(
            world, lambda: _Adaption(problem, path, options, monitor, command, world.size).finish(resume=resume)
        )
        stop.check()
    let_go()
    plain = replace(options, adapt=AdaptSettings(), overwrite=True)
    on: Problem = (
        from_root(world, lambda: fitted(problem)[0])
        if finished is None
        else on_mesh(problem, finished.mesh, options.adapt)
    )
    begun = path is not None and resume and from_root(world, lambda: has_run(path, adapted=finished is not None))
    last = simulation.prepare(
        on, out, plain, comm=world, monitor=monitor, resume=begun, command=command, keep=KEPT if finished else ()
    )  # fmt: skip
    if finished is None:
        last.recorder.findings.append(Finding(WARNING, f"the mesh was not adapted: {why_not}"))
        return last.go()
    of = options.adapt
    last.recorder.adaptivity = Adaptivity(of.names, of.relative, finished.rounds, finished.reached, finished.reason)
    if not finished.reached:
        text = f"the estimated errors are not all within {of.tolerance}: {finished.reason}"
        last.recorder.findings.append(Finding(WARNING, text))
    adaptivity = last.recorder.adaptivity
    if path is not None and (doubt := from_root(world, lambda: _drawn(path, adaptivity))):
        last.recorder.findings.append(Finding(WARNING, doubt))
    return last.go()


def _drawn(path: Path, adaptivity: Adaptivity) -> str:
    """Draw the meshes; why there is no picture, if there is none."""
    from tmc_vem.report.adapted_meshes import draw_meshes_file

    try:
        draw_meshes_file(path, adaptivity, path / ADAPTED_PICTURE)
    except InputError as error:
        return f"{ADAPTED_PICTURE} was not drawn: {error}"
    except OSError as error:
        return f"{ADAPTED_PICTURE} could not be written: {error.strerror or error}"
    return ""


class _Adaption:
    """All rounds of a run, on rank 0.

    Args:
        problem, path, options, monitor, command: of the run.
        ranks: how many.
    """

    def __init__(
        self, problem: Problem, path: Path | None, options: RunOptions, monitor: Monitor,
        command: Mapping[str, Any] | None, ranks: int,
    ) -> None:  # fmt: skip
        self._problem, self._path, self._options = problem, path, options
        self._monitor, self._command, self._ranks = monitor, command, ranks
        self._inputs = run_inputs(problem, options)

    def finish(self, *, resume: bool) -> tuple[Finished | None, str]:
        """What the rounds lead to; or None, and why there were none.

        Raises:
            InputError: something is wrong with the problem or the directory, which is as it was.
            Interrupted: Ctrl-C or SIGTERM; it says how to go on.
        """
        store = RoundStore(self._path, self._problem, self._options, self._inputs, self._monitor)
        rounds = Rounds(self._problem, self._options, targets_of(self._problem, self._options), store, self._monitor)
        if self._path is None:
            with stopping_at_once():
                return self._go(rounds, store, None)
        directory = RunDirectory(self._path, overwrite=self._options.overwrite or resume)
        if resume and not how_to_go_on(self._path):
            raise InputError(f"{self._path} has no checkpoint to go on from: run it again with --overwrite")
        standing = store.restored() if resume else None
        if isinstance(standing, Finished):
            return standing, ""
        first = rounds.prepared() if standing is None else None  # what is wrong is found before anything is removed
        lock = directory.lock()
        try:
            with stopping_at_once():
                if not resume:
                    own = self._problem
                    text = problem_text(own, self._options) if isinstance(own, OwnProblem) else None
                    directory.start(self._command, text)
                directory.begin({"inputs": self._inputs, "versions": versions(self._ranks)}, locked=lock.held)
                return self._go(rounds, store, standing, first)
        except Interrupted as stop:
            error = Interrupted(stop.number, how_to_go_on(self._path))
            directory.interrupted(str(error))
            raise error from None
        except BaseException as error:
            directory.interrupted(str(error) or type(error).__name__)
            raise
        finally:
            lock.release()

    def _go(
        self, rounds: Rounds, store: RoundStore, standing: Standing | None, first: Prepared | None = None
    ) -> tuple[Finished | None, str]:
        try:
            begun = rounds.begin(first) if standing is None else standing
        except NotReached as error:
            return None, str(error)
        finished = rounds.go(begun)
        store.finished(finished)
        return finished, ""
