"""A search for a design from the problem to its directory: evaluations on disk as they are made, pictures, a report."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.design.directory import DesignDirectory
from tmc_vem.design.monitor import DesignMonitor
from tmc_vem.design.optimise import DesignResult, DesignStep, Optimisation
from tmc_vem.design.outcome import Outcome
from tmc_vem.design.record import Record
from tmc_vem.design.rows import row_of
from tmc_vem.design.snapshots import DesignSnapshots
from tmc_vem.design.states import read_states, restore, write_states
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.design_run import DesignRun
from tmc_vem.results.lock import DirectoryLock
from tmc_vem.results.unfinished import how_to_go_on
from tmc_vem.simulation.checkpoint import DURABLE, Checkpoint
from tmc_vem.simulation.interrupt import Interrupted, StopRequest, stop_requests
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import run_inputs
from tmc_vem.simulation.problem_file import solved_table
from tmc_vem.simulation.provenance import versions
from tmc_vem.simulation.words import reported
from tmc_vem.solve.budget import Budget, OutOfBudget
from tmc_vem.solve.newton import Iteration
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import ConvergenceError, InputError
from tmc_vem.support.parallel import from_root, on_root
from tmc_vem.support.toml_text import toml_text

Float = NDArray[np.float64]

HEADER = "# The problem of this design as it was solved: 'tmc-vem optimise' on this file does the same again.\n"
EVERY = 10  # designs from one that is written for ParaView to the next


def optimise(
    problem: OwnProblem,
    out: str | Path | None = None,
    options: RunOptions | None = None,
    *,
    comm: Comm | None = None,
    monitor: DesignMonitor | None = None,
    resume: bool = False,
    command: Mapping[str, Any] | None = None,
    every: int = EVERY,
    animation: bool = True,
    final: bool = True,
) -> DesignRun:
    """Search for the best design of a problem with a table ``[design]``.

    Args:
        problem: of a problem file.
        out: directory for everything that is found; None keeps the result in memory only.
        options: discretisation and load stepping of the load cases, as in ``[solve]``.
        comm: MPI communicator, all ranks by default.
        monitor: hears about progress; called on rank 0 only.
        resume: go on from what is in ``out``; problem and options must be those that it was made with, but for
            ``design.iterations``.
        command: what the command line was asked, kept so that ``tmc-vem resume`` can ask it again.
        every: evaluations from one design that is written for ParaView to the next; 0 for none but the best.
        animation: write the designs as an animated picture.
        final: solve the best design once more as a run of its own, with its curves.

    Returns:
        The result on every rank.

    Raises:
        InputError: the problem has no design, the first design cannot be evaluated, or the directory is wrong.
        Interrupted: Ctrl-C or SIGTERM; everything that was evaluated is in the directory.
        ConvergenceError: the time that was allowed is used up; everything that was evaluated is in the directory.
        TmcError: the disk is full.
    """
    options = options or RunOptions()
    comm = MPI.COMM_WORLD if comm is None else comm
    if resume and out is None:
        raise InputError("there is nothing to resume without a directory")
    if every < 0:
        raise InputError(f"every = {every}: write every n-th design, or 0 for none but the best")
    directory: DesignDirectory | None = None
    if out is not None:
        directory = from_root(comm, lambda: DesignDirectory(out, overwrite=options.overwrite or resume))
    session = _Session(problem, options, directory, comm, monitor, every)
    return session.go(resume=resume, command=command, animation=animation, final=final)


class _Session:
    """A search that is prepared, its directory, and who hears of it."""

    def __init__(
        self, problem: OwnProblem, options: RunOptions, directory: DesignDirectory | None, comm: Comm,
        monitor: DesignMonitor | None, every: int,
    ) -> None:  # fmt: skip
        self._began, self._before = time.monotonic(), 0.0
        self.problem, self.options, self.directory, self.comm = problem, options, directory, comm
        self.monitor = monitor if monitor is not None and comm.rank == 0 else DesignMonitor()
        self.search = Optimisation(problem, options, comm)
        self.inputs = run_inputs(problem, options)
        self._snapshots: DesignSnapshots | None = None
        if directory is not None:
            self._snapshots = DesignSnapshots(directory.path, self.search.evaluator, problem, every)
        self._is_durable, self._durable_until = True, 0.0

    @property
    def compared(self) -> dict[str, Any]:
        """The inputs that a search must have to go on: another number of evaluations is no other search."""
        plain = {name: value for name, value in self.inputs.items() if name != "set"}
        return {**plain, "design": {name: v for name, v in plain["design"].items() if name != "iterations"}}

    def go(self, *, resume: bool, command: Mapping[str, Any] | None, animation: bool, final: bool) -> DesignRun:
        """Go through the search, and write what it found; see :func:`optimise`."""
        directory, comm = self.directory, self.comm
        lock = on_root(comm, directory.lock) if directory is not None else None
        try:
            self._begin(lock, resume, command)
            result = self._searched()
            seconds = self._before + time.monotonic() - self._began
            outcome = Outcome(self.problem, self.options, self.search, result, self.inputs, comm)
            with self._written():
                run = outcome.write(directory, self._snapshots, seconds, animation=animation, final=final)
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
        self.monitor.finished(run)
        return run

    # -- parts -----------------------------------------------------------------------------------------------------

    def _begin(self, lock: DirectoryLock | None, resume: bool, command: Mapping[str, Any] | None) -> None:
        search, directory, comm = self.search, self.directory, self.comm
        evaluator = search.evaluator
        system = next(iter(evaluator.cases.values())).system
        records: list[Record] = []
        if directory is not None and resume:
            checkpoint: Checkpoint = from_root(comm, lambda: read_states(directory.path, self.compared))
            n_variables, n = evaluator.parametrisation.n_variables, int(checkpoint.facts["evaluation"])
            records = from_root(comm, lambda: directory.records(n_variables, n))
            most = self.search.table.iterations
            if n > most:
                raise InputError(
                    f"{directory.path} has {n} evaluations, more than iterations = {most}: give {n} or more"
                )
            if len(records) < n:
                raise InputError(
                    f"{directory.path} has {len(records)} good evaluations, but the last states are those of number "
                    f"{n}: start anew with --overwrite"
                )
            self._before = sum(record.worth.seconds for record in records)
            restore(checkpoint, evaluator.cases)
            search.go_on(records)
        elif directory is not None:
            on_root(comm, lambda: directory.begin_search(command, self._text()))
        if directory is not None:
            on_root(comm, directory.begin_rows)
            facts = {
                "inputs": self.inputs,
                "versions": versions(comm.size),
                "n_cells": system.n_cells_global,
                "n_dofs": system.n_dofs,
            }
            on_root(comm, lambda: directory.begin(facts, locked=lock is not None and lock.held))
            search.on_evaluation = self._evaluated
        if self._snapshots is not None:
            self._snapshots.restore(len(records))
        self.monitor.started(self.problem, evaluator, system.n_dofs, len(records))

    def _searched(self) -> DesignResult:
        budget = Budget(None, self.options.max_seconds, self.comm)
        with stop_requests(self.comm) as stop:
            for case in self.search.evaluator.cases.values():
                case.on_iteration = self._on_iteration(stop, budget)
            return self.search.go(self._designed)

    def _on_iteration(self, stop: StopRequest, budget: Budget) -> Any:
        def on_iteration(_: Iteration, __: int) -> None:
            self.monitor.iterated()
            stop.check()
            try:
                budget.spend()
            except OutOfBudget as limit:  # that of the search, not of a load case
                how = how_to_go_on(self.directory.path) if self.directory is not None else ""
                raise ConvergenceError(f"{limit}{'; ' if how else ''}{how}") from None

        return on_iteration

    def _evaluated(self, number: int, record: Record) -> None:
        """Write an evaluation, and the states that it leaves, in this order: without the states it is made again."""
        directory, comm = self.directory, self.comm
        assert directory is not None
        durable = comm.bcast(time.monotonic() >= self._durable_until)
        with self._written():
            on_root(comm, lambda: directory.add(number, record, durable=durable))
            write_states(
                directory.path, comm, self.search.evaluator.cases, self.compared, number, durable=durable,
                keep=self._is_durable,
            )  # fmt: skip
        self._is_durable = durable
        if durable:
            self._durable_until = time.monotonic() + DURABLE

    def _designed(self, step: DesignStep) -> None:
        row = row_of(step, self.search.evaluator)
        directory = self.directory
        with self._written():
            if directory is not None:
                on_root(self.comm, lambda: directory.add_row(row))
            if self._snapshots is not None and step.fresh:
                self._snapshots.offer(step)
        self.monitor.designed(step, row)

    def _written(self) -> Any:
        from contextlib import nullcontext

        return nullcontext() if self.directory is None else reported(self.directory.path)

    def _text(self) -> str:
        return HEADER + toml_text(solved_table(self.problem, self.options))

    def _end_early(self, error: BaseException) -> None:
        self.monitor.aborted()
        if self.directory is not None and self.comm.rank == 0:
            self.directory.interrupted(str(error) or type(error).__name__)
