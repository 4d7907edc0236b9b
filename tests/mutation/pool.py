"""Workers, each with a copy of the tree: measuring test files, and judging faults."""

from __future__ import annotations

import queue
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

from mutation.judge import Judge, Outcome
from mutation.measure import Record, measure
from mutation.nearness import Nearness
from mutation.site import Mutant
from mutation.trees import STORE, Tree

TOGETHER = 20_000  # characters of test files that are measured in one process
Task = TypeVar("Task")
Result = TypeVar("Result")


class Pool:
    """Copies of the tree as it is now.

    Args:
        root: the tree.
        folder: where the copies go.
        workers: how many work at the same time.
    """

    def __init__(self, root: Path, folder: Path, workers: int) -> None:
        self.root = Tree.of(root, folder / "root", STORE / "cache" / "root").path  # nobody changes this one
        self._trees = [Tree.of(root, folder / f"tree{n}", STORE / "cache" / str(n)) for n in range(workers)]

    def measure(self, files: Iterable[str], done: Callable[[Sequence[str], list[Record]], None]) -> None:
        """Measure test files, the largest first, some small ones in one process."""
        groups: list[list[str]] = []
        room = 0
        for file in sorted(files, key=lambda file: -(self.root / file).stat().st_size):
            room -= (self.root / file).stat().st_size
            if room < 0:
                groups.append([])
                room = TOGETHER - (self.root / file).stat().st_size
            groups[-1].append(file)
        self._share([partial(measure, tree) for tree in self._trees], groups, done)

    def judge(self, faults: Iterable[Mutant], nearness: Nearness, done: Callable[[Mutant, Outcome], None]) -> None:
        """Judge faults."""
        good: set[str] = set()
        self._share([Judge(tree, nearness, good).judge for tree in self._trees], faults, done)

    def _share(
        self, workers: Iterable[Callable[[Task], Result]], tasks: Iterable[Task], done: Callable[[Task, Result], None]
    ) -> None:
        """Give tasks to whoever is free; ``done`` is called in one thread at a time.

        Raises:
            Exception: the first of any worker, after the tasks that had begun.
        """
        waiting: queue.SimpleQueue[Task] = queue.SimpleQueue()
        for task in tasks:
            waiting.put(task)
        one_at_a_time = threading.Lock()
        failures: list[BaseException] = []

        def work(worker: Callable[[Task], Result]) -> None:
            while not failures:
                try:
                    task = waiting.get_nowait()
                except queue.Empty:
                    return
                try:
                    result = worker(task)
                    with one_at_a_time:
                        done(task, result)
                except BaseException as error:
                    failures.append(error)

        threads = [threading.Thread(target=work, args=(worker,), daemon=True) for worker in workers]
        for thread in threads:
            thread.start()
        try:
            for thread in threads:
                thread.join()
        except BaseException as error:  # the user interrupts
            failures.insert(0, error)
            for tree in self._trees:
                tree.interrupt()
            for thread in threads:
                thread.join()
        if failures:
            raise failures[0]


@contextmanager
def pool(root: Path, workers: int) -> Iterator[Pool]:
    """A pool in a temporary folder."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        yield Pool(root, Path(folder), workers)
