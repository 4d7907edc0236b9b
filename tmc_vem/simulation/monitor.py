"""Who hears about a run while it goes on."""

from __future__ import annotations

from collections.abc import Sequence

from tmc_vem.problems.base import Problem
from tmc_vem.results.adaptivity import Round
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult


class Monitor:
    """Hears about a run as it goes on; the command line's progress display is one. All methods may be overridden.

    Attributes:
        end: coordinate of the end of the load path (1 for a load that rises to its full value), known before
            :meth:`started`; a step's is ``record.coordinate``.
    """

    end: float = 1.0

    def started(self, problem: Problem, n_cells: int, n_dofs: int) -> None:
        """The system is set up."""

    def warned(self, sentences: Sequence[str]) -> None:
        """What is said about the problem before it is solved; it stands among the warnings of the result, too."""

    def iterated(self, iteration: int, residual: float) -> None:
        """A Newton iteration is done, counted from the start of the run."""

    def stepped(self, record: StepRecord) -> None:
        """A load step has converged."""

    def lowered(self, record: StepRecord) -> None:
        """A state with lower gamma has converged beside the last load step."""

    def adapted(self, round_: Round, of: Sequence[str]) -> None:
        """A round of solving, estimating and refining is over."""

    def aborted(self) -> None:
        """The run stops with an error."""

    def finished(self, result: RunResult) -> None:
        """The run is over."""


class OnTheWay(Monitor):
    """Passes on what happens in a run that is only on the way to another one: all but its result.

    Args:
        monitor: who hears of it.
    """

    def __init__(self, monitor: Monitor) -> None:
        self._monitor = monitor

    def started(self, problem: Problem, n_cells: int, n_dofs: int) -> None:
        """The system is set up."""
        self._monitor.end = self.end
        self._monitor.started(problem, n_cells, n_dofs)

    def warned(self, sentences: Sequence[str]) -> None:
        """What is said about the problem before it is solved."""
        self._monitor.warned(sentences)

    def iterated(self, iteration: int, residual: float) -> None:
        """A Newton iteration is done."""
        self._monitor.iterated(iteration, residual)

    def stepped(self, record: StepRecord) -> None:
        """A load step has converged."""
        self._monitor.stepped(record)

    def aborted(self) -> None:
        """The run stops with an error."""
        self._monitor.aborted()
