"""Time by phase of a run."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager


class Timer:
    """Adds up wall time by phase; nested phases count for the innermost only."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._stack: list[str] = []
        self._since = self.started = time.perf_counter()

    @contextmanager
    def __call__(self, phase: str) -> Iterator[None]:
        """Count the time of the ``with`` block for a phase."""
        self._switch()
        self._stack.append(phase)
        try:
            yield
        finally:
            self._switch()
            self._stack.pop()

    def pause(self) -> None:
        """Count nothing until :meth:`go_on`; between two phases, not within one."""
        self._switch()

    def go_on(self) -> None:
        """Count again; the time since the pause has not passed."""
        before, self._since = self._since, time.perf_counter()
        self.started += self._since - before

    def _switch(self) -> None:
        now = time.perf_counter()
        if self._stack:
            self.seconds[self._stack[-1]] += now - self._since
        self._since = now

    def report(self) -> dict[str, float]:
        """Seconds by phase, with the total since the timer was made and what no phase counted."""
        total = time.perf_counter() - self.started
        phases = dict(self.seconds)
        return {**phases, "other": total - sum(phases.values()), "total": total}
