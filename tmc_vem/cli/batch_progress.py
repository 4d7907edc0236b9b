"""Progress of a batch on a terminal: a live bar with the time left, else a line a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from tmc_vem.report.tables import reached
from tmc_vem.study.batch import Observer, Outcome


class BatchMonitor(Observer):
    """Writes to stderr. ``unfinished`` says after an interrupt how many runs are still to do."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self._progress: Progress | None = None
        self._task: Any = None
        self.n_jobs = 0
        self.n_done = 0

    def started(self, n_jobs: int, n_reused: int) -> None:
        """Say how many runs there are and show the bar."""
        self.n_jobs, self.n_done = n_jobs, n_reused
        found = f", {n_reused} of them done before" if n_reused else ""
        self.console.print(f"{n_jobs} runs{found}", highlight=False)
        if self.console.is_terminal and n_reused < n_jobs:
            self._progress = Progress(
                BarColumn(bar_width=30), TextColumn("{task.percentage:3.0f} %"),
                TextColumn("{task.fields[state]}", markup=False),
                TimeElapsedColumn(), console=self.console, transient=True,
            )  # fmt: skip
            self._task = self._progress.add_task("runs", total=1.0, state="")
            self._progress.start()

    def advanced(self, fraction: float, seconds_left: float | None, running: Sequence[str]) -> None:
        """Advance the bar."""
        if self._progress:
            state = f"{self.n_done}/{self.n_jobs}{_left(seconds_left)}: {', '.join(running)}"
            self._progress.update(self._task, completed=fraction, state=state)

    def finished(self, outcome: Outcome, n_done: int, seconds_left: float | None) -> None:
        """Print a line for the run."""
        self.n_done = n_done
        result = outcome.result
        if result is None:
            text = f"failed: {outcome.error}"
        else:
            gap = "" if result.gap is None else f"gap {result.gap:.4e}, "
            text = f"{reached(result)}, {gap}{result.newton_iterations} iterations, {result.seconds['total']:.1f} s"
        line = f"[{n_done}/{self.n_jobs}] {outcome.job.label}: {text}{_left(seconds_left)}"
        self.console.print(line, highlight=False, markup=False, soft_wrap=True)
        if n_done == self.n_jobs:
            self.close()

    def close(self) -> None:
        """Remove the bar."""
        if self._progress:
            self._progress.stop()
            self._progress = None

    def interrupted(self) -> None:
        """Say what is kept."""
        self.close()
        self.console.print(
            f"{self.n_done} of {self.n_jobs} runs are done and kept; the same command does the others", highlight=False
        )


def _left(seconds: float | None) -> str:
    if not seconds:
        return ""
    return f", about {seconds:.0f} s left" if seconds < 90 else f", about {seconds / 60:.0f} min left"
