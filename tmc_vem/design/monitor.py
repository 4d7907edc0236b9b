"""Who hears about a search for a design while it goes on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.optimise import DesignStep
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.design_run import DesignRun


class DesignMonitor:
    """Hears about a search as it goes on; the command line's progress display is one. All methods may be overridden."""

    def started(self, problem: OwnProblem, evaluator: Evaluator, n_dofs: int, on_record: int) -> None:
        """The load cases are set up; so many evaluations are on record."""

    def iterated(self) -> None:
        """A Newton iteration is done."""

    def designed(self, step: DesignStep, row: Mapping[str, Any]) -> None:
        """A design was evaluated, or is on record; ``row`` is that of history.csv."""

    def saying(self, sentence: str) -> None:
        """What is done after the search."""

    def aborted(self) -> None:
        """The search stops with an error."""

    def finished(self, run: DesignRun) -> None:
        """The search is over, and everything is written."""
