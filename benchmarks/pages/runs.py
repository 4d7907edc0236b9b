"""What was measured is kept, so that a refresh that was cut off goes on and a second one has nothing to do.

A measurement is a function of plain arguments that returns plain values. It is found again as long as the libraries,
the file of the function and all that this imports, directly or not, are the same.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from pages.sources import digest
from tmc_vem.results.records import RESULT
from tmc_vem.simulation.provenance import versions
from tmc_vem.study.batch import Job, Observer, Outcome, run_batch
from tmc_vem.study.paper.target import Results
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import write_atomically

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("python", "petsc", "numpy", "fenics-dolfinx", "machine")


class Measure(Protocol):
    """Calls a function of plain arguments, or knows what it has returned."""

    def __call__(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """Value of the function, as json has it: tuples are lists."""


class Batch(Protocol):
    """Does the runs of the paper's tables and figures."""

    def __call__(self, jobs: Iterable[Job]) -> Results:
        """Results by the names of the jobs."""


def directly(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Measure without keeping anything."""
    return function(*arguments, **named)


class Kept:
    """Measurements in files, one each.

    Args:
        directory: gets a directory for every state of sources and libraries.
        again: measure what is there, too.
        say: hears a line about every measurement that is made.
    """

    def __init__(self, directory: Path, *, again: bool = False, say: Callable[[str], None] = lambda _: None) -> None:
        self.directory, self.again, self.say = directory, again, say
        self.made: set[Path] = set()

    def __call__(self, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        """See :class:`Measure`."""
        given = {"arguments": list(arguments), "named": named}
        text = json.dumps(given, sort_keys=True)
        name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        path = self.directory / state(function) / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
        if path.exists() and not (self.again and path not in self.made):
            return json.loads(path.read_text())["value"]
        label = f"{name} {', '.join(_plain(value) for value in [*arguments, *named.values()])}"
        start = time.monotonic()
        value = function(*arguments, **named)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps({"function": name, **given, "value": value}) + "\n")
        self.made.add(path)
        self.say(f"{label}: {time.monotonic() - start:.1f} s")
        return json.loads(json.dumps(value))


def _plain(value: Any, most: int = 30) -> str:
    """An argument in a few letters."""
    if isinstance(value, tuple):
        return " x ".join(map(str, value))
    text = f"{value:g}" if isinstance(value, float) else " ".join(str(value).split())
    return text if len(text) <= most else f"{text[:most]}..."


def state(function: Callable[..., Any]) -> str:
    """Hash of all that a measurement depends on but for its arguments."""
    return _state(str(Path(sys.modules[function.__module__].__file__ or "")))


@cache
def _state(file: str) -> str:
    known = versions()
    libraries = json.dumps({name: known.get(name) for name in LIBRARIES})
    return hashlib.sha256(f"{libraries} {digest(Path(file))}".encode()).hexdigest()[:12]


class KeptRuns:
    """Runs in the directory of ``tmc-vem reproduce``, which are not repeated either.

    Args:
        directory: of the run directories.
        processes: runs at a time.
        again: repeat the runs that are there, too.
        say: hears a line about every run that ends.
    """

    def __init__(
        self, directory: Path, *, processes: int = 1, again: bool = False, say: Callable[[str], None] = lambda _: None
    ) -> None:
        self.directory, self.processes, self.again, self.say = directory, processes, again, say
        self.made: set[str] = set()

    def __call__(self, jobs: Iterable[Job]) -> Results:
        """See :class:`Batch`.

        Raises:
            InputError: a run gave no result.
        """
        wanted = list({job.name: job for job in jobs}.values())
        for job in wanted:
            if self.again and job.name not in self.made and (self.directory / job.name / RESULT).exists():
                (self.directory / job.name / RESULT).unlink()
            self.made.add(job.name)
        outcomes = run_batch(wanted, self.directory, processes=self.processes, observer=_Lines(self.say, len(wanted)))
        failed = [outcome for outcome in outcomes if outcome.result is None]
        if failed:
            raise InputError(f"{failed[0].job.label} gave no result: {failed[0].error}")
        return {outcome.job.name: outcome.result for outcome in outcomes if outcome.result}


class _Lines(Observer):
    """A line for every run that ends."""

    def __init__(self, say: Callable[[str], None], n_jobs: int) -> None:
        self.say, self.n_jobs = say, n_jobs

    def finished(self, outcome: Outcome, n_done: int, seconds_left: float | None) -> None:
        """A run is over."""
        left = "" if seconds_left is None else f", about {seconds_left / 60:.0f} min left"
        self.say(f"{outcome.job.label}: {n_done} of {self.n_jobs}{left}")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown table."""
    lines = ["| " + " | ".join(row) + " |" for row in (head, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def percent(value: float, digits: int = 2) -> str:
    """Signed percentage of a fraction; what rounds to zero has no sign of its own."""
    return f"{round(100.0 * value, digits) + 0.0:+.{digits}f} %"
