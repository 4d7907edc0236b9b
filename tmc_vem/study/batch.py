"""Sets of runs in processes: finished ones are found again by their inputs, interrupted ones are done anew.

A run of other sources of this program is not found again: what it says may no longer be what the program says.

Every run of a batch has a directory ``<label>-<hash of its inputs>``, so that a result is never replaced by one with
other inputs and batches may share a directory. Only a finished run has a ``result.json``; anything else found under
such a name is left over from a batch that was killed, and goes.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from tmc_vem.problems.base import Problem
from tmc_vem.results.lock import DirectoryLock
from tmc_vem.results.records import RESULT
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.plan import run_inputs
from tmc_vem.simulation.provenance import sources
from tmc_vem.study.batch_worker import MARK
from tmc_vem.support.errors import InputError

LOCK = ".lock"


@dataclass(frozen=True)
class Job:
    """A run to do.

    Attributes:
        label: start of the directory's name.
        problem, options: arguments of :func:`tmc_vem.simulation.simulation.run`.
        cost: expected work relative to the other jobs of the batch, for the estimate of the time left.
    """

    label: str
    problem: Problem
    options: RunOptions
    cost: float = 1.0

    @property
    def inputs(self) -> dict[str, Any]:
        """Inputs as they are in result.json."""
        plain: dict[str, Any] = json.loads(json.dumps(run_inputs(self.problem, self.options)))
        return plain

    @property
    def name(self) -> str:
        """Name of the run directory."""
        text = json.dumps(json.loads(json.dumps(self.inputs), parse_int=float), sort_keys=True)  # 10 and 10.0 are equal
        return f"{self.label}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


@dataclass(frozen=True)
class Outcome:
    """What became of a job: a result, complete or not, or the error that kept it from giving one."""

    job: Job
    result: RunResult | None
    error: str = ""
    reused: bool = False


class Observer:
    """Hears about a batch as it goes on; the command line's display is one. All methods may be overridden."""

    def started(self, n_jobs: int, n_reused: int) -> None:
        """The batch starts; some of its runs are there already."""

    def advanced(self, fraction: float, seconds_left: float | None, running: Sequence[str]) -> None:
        """A run has advanced; ``fraction`` of the expected work is done."""

    def finished(self, outcome: Outcome, n_done: int, seconds_left: float | None) -> None:
        """A run is over; ``n_done`` of all jobs are."""


def run_batch(
    jobs: Sequence[Job], directory: Path, *, processes: int = 2, observer: Observer | None = None
) -> list[Outcome]:
    """Do all jobs that are not done yet.

    Args:
        jobs: what to run; equal ones are done once.
        directory: run directories are made in it.
        processes: how many runs at a time.
        observer: hears about progress.

    Returns:
        The outcomes, in the order of the jobs. A job that fails does not keep the others from running.

    Raises:
        InputError: the directory cannot be used, or another batch is at work in it.
        KeyboardInterrupt: interrupted; finished runs stay, the others are stopped.
    """
    if processes < 1:
        raise InputError(f"{processes} processes: use 1 or more")
    observer = observer or Observer()
    with _locked(directory):
        by_name = {job.name: job for job in jobs}
        done = {name: outcome for name, job in by_name.items() if (outcome := _found(job, directory))}
        observer.started(len(by_name), len(done))
        todo = sorted((name for name in by_name if name not in done), key=lambda name: -by_name[name].cost)
        _Pool([by_name[name] for name in todo], directory, processes, observer, done).run()
    return [done[job.name] for job in jobs]


def _found(job: Job, directory: Path) -> Outcome | None:
    """Outcome of an earlier run with the same inputs, by the same program."""
    path = directory / job.name
    if not (path / RESULT).exists():
        return None
    try:
        result = RunResult.read(path)
    except InputError:
        return None
    same = result.inputs == job.inputs and result.versions.get("sources") == sources()
    return Outcome(job, result, reused=True) if same else None


@contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Keep other batches out of a directory; the lock goes with the process, even if it is killed."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        handle = (directory / LOCK).open("w")
    except OSError as error:
        raise InputError(f"cannot write to {directory}: {error.strerror}") from None
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(
                f"another tmc-vem is at work in {directory}: wait for it, or choose another --out"
            ) from None
        yield


def _clear(path: Path) -> None:
    """Remove what a batch that was killed has left.

    Raises:
        InputError: a run that does not belong to a batch is at work there.
    """
    if path.exists():
        lock = DirectoryLock(path)
        shutil.rmtree(path)
        lock.release()


@dataclass
class _Worker:
    job: Job
    process: subprocess.Popen[bytes]
    log: IO[bytes]
    load: float = 0.0
    error: str = ""
    began: bool = False


@dataclass
class _Pool:
    """Processes at work and what they have reported.

    A process that dies before it has begun is started once more: starting Open MPI fails now and then where many
    processes begin and end.
    """

    todo: list[Job]
    directory: Path
    processes: int
    observer: Observer
    done: dict[str, Outcome]
    waiting: list[Job] = field(default_factory=list)
    again: list[Job] = field(default_factory=list)
    running: list[_Worker] = field(default_factory=list)
    events: queue.SimpleQueue[tuple[_Worker, dict[str, Any] | None]] = field(default_factory=queue.SimpleQueue)
    finished_cost: float = 0.0
    started: float = field(default_factory=time.monotonic)

    def run(self) -> None:
        self.total_cost = sum(job.cost for job in self.todo)
        self.waiting = list(self.todo)
        try:
            while self.waiting or self.running:
                while self.waiting and len(self.running) < self.processes:
                    worker = self._start(self.waiting.pop(0))
                    self.running += [worker] if worker else []
                if not self.running:
                    break
                worker, message = self.events.get()
                if message is None:
                    self._collect(worker)
                elif not worker.began:
                    worker.began = True
                else:
                    worker.load = message.get("load", worker.load)
                    worker.error = message.get("error", worker.error)
                    labels = [f"{w.job.label} {w.load:.0%}" for w in self.running]
                    self.observer.advanced(self._fraction(), self._seconds_left(), labels)
        finally:
            for worker in self.running:
                worker.process.kill()
                worker.process.wait()
                worker.log.close()

    def _start(self, job: Job) -> _Worker | None:
        """Start the process of a job; None if its directory is in use."""
        path = self.directory / job.name
        try:
            _clear(path)
        except InputError as error:
            self._finish(Outcome(job, None, str(error)))
            return None
        # a user's Ctrl-C must reach this process only, which then stops its workers
        environment = {**os.environ, "OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}
        log = tempfile.TemporaryFile()  # noqa: SIM115 (open as long as the process)
        process = subprocess.Popen(
            [sys.executable, "-m", "tmc_vem.study.batch_worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, start_new_session=True, env=environment,
        )  # fmt: skip
        worker = _Worker(job, process, log)
        assert process.stdin is not None
        with suppress(BrokenPipeError):  # it has died already, which _collect finds out
            process.stdin.write(pickle.dumps((job.problem, job.options, str(path))))
            process.stdin.flush()
        threading.Thread(target=self._listen, args=(worker,), daemon=True).start()
        return worker

    def _listen(self, worker: _Worker) -> None:
        assert worker.process.stdout is not None
        for line in worker.process.stdout:
            text = line.decode(errors="replace")
            if text.startswith(MARK):
                self.events.put((worker, json.loads(text.removeprefix(MARK))))
        self.events.put((worker, None))

    def _collect(self, worker: _Worker) -> None:
        code = worker.process.wait()
        self.running.remove(worker)
        outcome = _found(worker.job, self.directory)
        if outcome is None and not worker.began and worker.job not in self.again:
            worker.log.close()
            self.again.append(worker.job)
            self.waiting.insert(0, worker.job)
            return
        if outcome is None:
            worker.log.seek(0)
            lines = worker.log.read().decode(errors="replace").strip().splitlines()
            default = f"ended with code {code}" if code else "its result has other inputs: was the program changed?"
            reason = worker.error or (lines[-1] if lines and code else default)
            outcome = Outcome(worker.job, None, reason)
        else:
            outcome = Outcome(worker.job, outcome.result)
        worker.log.close()
        self._finish(outcome)

    def _finish(self, outcome: Outcome) -> None:
        self.done[outcome.job.name] = outcome
        self.finished_cost += outcome.job.cost
        self.observer.finished(outcome, len(self.done), self._seconds_left())

    def _fraction(self) -> float:
        running = sum(worker.job.cost * worker.load for worker in self.running)
        return (self.finished_cost + running) / self.total_cost

    def _seconds_left(self) -> float | None:
        fraction = self._fraction()
        return (time.monotonic() - self.started) * (1.0 / fraction - 1.0) if fraction > 0.02 else None
