"""A limit on the work of a run: Newton iterations and wall time."""

from __future__ import annotations

import time

from tmc_vem.support.distributed import Comm


class OutOfBudget(Exception):
    """The work that was allowed is done; what converged is kept."""


class Budget:
    """Counts Newton iterations and time since it was made, and ends the work when there is no more of either.

    Args:
        iterations: most Newton iterations, those of failed attempts included; None for no limit.
        seconds: most wall time; None for no limit.
        comm: communicator whose first rank's clock counts for all.

    Attributes:
        spent: iterations so far.
        used_up: whether a limit has ended the work.
    """

    def __init__(self, iterations: int | None = None, seconds: float | None = None, comm: Comm | None = None) -> None:
        self._iterations, self._seconds, self._comm = iterations, seconds, comm
        self._begin = time.monotonic()
        self.spent = 0
        self.used_up = False

    def spend(self) -> None:
        """One more iteration has been done; called on all ranks.

        Raises:
            OutOfBudget: it was the last one.
        """
        self.spent += 1
        if self._iterations is not None and self.spent >= self._iterations:
            self._end(f"{self._iterations} Newton iterations")
        if self._seconds is not None:
            late = time.monotonic() - self._begin >= self._seconds
            if self._comm is not None:
                late = self._comm.bcast(late)
            if late:
                self._end(f"{self._seconds:g} seconds")

    def _end(self, limit: str) -> None:
        self.used_up = True
        raise OutOfBudget(f"the limit of {limit} is used up")
