"""One fault at a time: put it in, run the tests near it, and say what became of it."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from mutation import plugin
from mutation.measure import EVERYDAY
from mutation.nearness import Measured, Nearness, cost
from mutation.site import Mutant
from mutation.trees import Ended, Tree

CAP = 150.0  # seconds for all tests of a fault
HANGS = 20.0  # seconds that a test may take beside three times what the longest of its file took
SLOW = 2.5  # how much longer than measured the tests of a fault take that is seen by the time
KILLED, TIMEOUT, SURVIVED, UNTESTED = "killed", "timeout", "survived", "no tests"


@dataclass(frozen=True)
class Outcome:
    """What became of a fault.

    Attributes:
        status: killed, timeout (a test hangs, which is seen too), survived, or no tests.
        by: what saw it.
        seconds: all in all.
        ran: tests that were run.
        broken: tests that fail without the fault, and do not count.
    """

    status: str
    by: str
    seconds: float
    ran: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()

    @property
    def seen(self) -> bool:
        """Whether the tests saw it."""
        return self.status in (KILLED, TIMEOUT)


@dataclass
class Watch:
    """Reads what the tests say while they run, and ends them when one hangs or all take too long."""

    log: Path
    expected: Mapping[str, float]
    hangs: str = ""
    over: bool = False
    started: list[str] = field(default_factory=list)
    failed: str = ""
    _since: float = 0.0
    _read: int = 0

    def __call__(self, seconds: float) -> bool:
        """Whether to stop now."""
        self.read()
        patience = load()
        limit = 3 * self.expected.get(self.started[-1], 0.0) + HANGS if self.started else CAP
        if self.started and time.time() - self._since > patience * limit:
            self.hangs = self.started[-1]
        self.over = seconds > patience * CAP
        return bool(self.hangs) or self.over

    def read(self) -> None:
        """Take notice of what is new."""
        with self.log.open() as log:
            log.seek(self._read)
            new = log.read()
        whole = new[: new.rfind("\n") + 1]
        self._read += len(whole)
        for line in whole.splitlines():
            event = json.loads(line)
            if event["event"] == "start":
                self.started.append(event["test"])
                self._since = event["time"]
            elif event.get("outcome") == "failed" and not self.failed:
                self.failed = event["test"]


class Judge:
    """Runs tests in one copy of the tree.

    Args:
        tree: the copy, without faults.
        nearness: which tests to run.
        good: tests that are known to pass without faults, shared between judges.
    """

    def __init__(self, tree: Tree, nearness: Nearness, good: set[str]) -> None:
        self.tree, self.nearness, self._good = tree, nearness, good

    def judge(self, mutant: Mutant) -> Outcome:
        """Put a fault in, run the tests near it, and take it out."""
        start = time.monotonic()
        tests = self.nearness.near(mutant)
        broken: list[str] = []
        while tests:
            with self._faulty(mutant):
                ended, watch = self._run(tests)
            status, by = self._verdict(ended, watch, tests)
            if status == SURVIVED or by in self._good or self._passes_alone(by, tests):
                return Outcome(status, by, time.monotonic() - start, tuple(watch.started), tuple(broken))
            broken.append(by or "collecting the tests")
            tests = [] if not by else [test for test in tests if test.name != by]
        return Outcome(UNTESTED, "", time.monotonic() - start, (), tuple(broken))

    @contextmanager
    def _faulty(self, mutant: Mutant) -> Iterator[None]:
        text = (self.tree.path / mutant.file).read_text()
        self.tree.write(mutant.file, mutant.apply(text))
        try:
            yield
        finally:
            self.tree.write(mutant.file, text)

    def _run(self, tests: Sequence[Measured]) -> tuple[Ended, Watch]:
        """Run tests in their order up to the first that fails, with a copy of the caches that is thrown away."""
        files = list(dict.fromkeys(test.file for test in tests))
        with tempfile.TemporaryDirectory(prefix="mutant-") as scratch:
            folder = Path(scratch)
            order, log = folder / "order", folder / "log"
            order.write_text("\n".join(test.name for test in tests))
            log.touch()
            cache = folder / "cache"
            if self.tree.cache.exists():
                shutil.copytree(self.tree.cache, cache, copy_function=_link)
            watch = Watch(log, {test.name: self.nearness.longest(test.file) for test in tests})
            variables = {plugin.LOG: str(log), plugin.ORDER: str(order), "XDG_CACHE_HOME": str(cache)}
            command = ["-m", "pytest", *EVERYDAY, "-x", "--tb=line", "--hypothesis-seed=0", *files]
            ended = self.tree.run(command, variables=variables, stop=watch)
            watch.read()
        return ended, watch

    def _verdict(self, ended: Ended, watch: Watch, tests: Sequence[Measured]) -> tuple[str, str]:
        """Status, and what saw it."""
        last = watch.started[-1] if watch.started else ""
        if watch.failed:
            return KILLED, watch.failed
        if watch.hangs:
            return TIMEOUT, watch.hangs
        if ended.code is None:
            done = cost(test for test in tests if test.name in set(watch.started))
            return (TIMEOUT, last) if ended.seconds > load() * (SLOW * done + HANGS) else (SURVIVED, "")
        if ended.code == 0:
            return SURVIVED, ""
        return KILLED, last if ended.code < 0 else ""  # a crash in a test, or nothing that could be imported

    def _passes_alone(self, name: str, tests: Sequence[Measured]) -> bool:
        """Whether a test passes without the fault; without a name, whether the tests can be collected."""
        chosen = [test for test in tests if test.name == name] if name else list(tests[:1])
        ended, _ = self._run(chosen)
        good = ended.code == 0
        if good:
            self._good.update(test.name for test in chosen)
        return good


def load() -> float:
    """How many processes want each core, at least 1: so many times longer may everything take."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def _link(source: str, target: str) -> None:
    """A second name for a file: caches replace files, they do not write into them; locks are files of their own."""
    if source.endswith(".lock"):
        Path(target).touch()
        return
    try:
        os.link(source, target)
    except OSError:  # on another file system
        shutil.copy2(source, target)
