"""Wall and processor time of the parts of a script, and the line of json that it ends with; nothing but Python."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Clock:
    """Time by part: ``{"wall": s, "cpu": s}``; processor time is that of all threads.

    Attributes:
        parts: what has been measured.
        started: when the clock was made, the first thing that a script does.
    """

    parts: dict[str, dict[str, float]] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    def started_up(self) -> None:
        """All is loaded: that was the part ``start-up``, with the interpreter's own in its processor time.

        What has been measured before is forgotten.
        """
        self.parts = {"start-up": {"wall": time.perf_counter() - self.started, "cpu": time.process_time()}}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add what happens inside to a part."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            part = self.parts.setdefault(name, {"wall": 0.0, "cpu": 0.0})
            part["wall"] += time.perf_counter() - wall
            part["cpu"] += time.process_time() - cpu


def say(found: Mapping[str, Any]) -> None:
    """The script's last line on standard output."""
    sys.stdout.flush()
    print("\n" + json.dumps(dict(found)), flush=True)
