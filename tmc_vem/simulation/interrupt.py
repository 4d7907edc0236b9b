"""Stopping a run on a signal: at the next point where all ranks are together, with the last checkpoint on disk."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import TmcError


class Interrupted(TmcError):
    """The run was asked to stop. The exit code is 128 plus the signal's number: 130 for Ctrl-C, 143 for SIGTERM."""

    def __init__(self, number: int, how_to_go_on: str = "") -> None:
        advice = f"; {how_to_go_on}" if how_to_go_on else ""
        super().__init__(f"stopped by {signal.Signals(number).name}{advice}")
        self.number, self.how_to_go_on = number, how_to_go_on
        self.exit_code = 128 + number

    def __reduce__(self) -> tuple[type[Interrupted], tuple[int, str]]:
        """It travels to other ranks as what it was made of."""
        return Interrupted, (self.number, self.how_to_go_on)


class StopRequest:
    """Remembers a signal until all ranks can act on it together."""

    def __init__(self, comm: Comm) -> None:
        self._comm = comm
        self._number = 0

    def check(self) -> None:
        """Raise on every rank if any of them was asked to stop; called on all ranks.

        Raises:
            Interrupted: a rank has received SIGINT or SIGTERM.
        """
        number = max(self._comm.allgather(self._number))
        if number:
            raise Interrupted(number)

    def _remember(self, number: int, _frame: FrameType | None) -> None:
        if self._number:  # asked twice: do not wait
            raise KeyboardInterrupt
        self._number = number


@contextmanager
def stop_requests(comm: Comm) -> Iterator[StopRequest]:
    """Catch SIGINT and SIGTERM for the length of a run (in the main thread; elsewhere nothing is caught)."""
    request = StopRequest(comm)
    with _handled_by(request._remember):
        yield request


@contextmanager
def stopping_at_once() -> Iterator[None]:
    """SIGINT and SIGTERM raise wherever this process is, for work that no other rank takes part in.

    In the main thread; elsewhere nothing is caught. What is written must be written whole or not at all.

    Raises:
        Interrupted: at the signal.
    """

    def stop(number: int, _frame: FrameType | None) -> None:
        raise Interrupted(number)

    with _handled_by(stop):
        yield


@contextmanager
def _handled_by(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call a handler, in the main thread."""
    before: dict[int, Any] = {}
    try:
        for each in (signal.SIGINT, signal.SIGTERM):
            before[each] = signal.signal(each, handler)
    except ValueError:  # not the main thread
        pass
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)
