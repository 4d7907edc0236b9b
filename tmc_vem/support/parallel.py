"""Errors on one rank that must end the work of all: a rank that fails alone leaves the others waiting for ever."""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable
from typing import TypeVar

from tmc_vem.support.distributed import Comm

T = TypeVar("T")
PATIENCE = 20.0  # seconds


def on_root(comm: Comm, make: Callable[[], T]) -> T | None:
    """Result of ``make`` on rank 0, None elsewhere; what it raises there is raised on every rank."""
    result, error = _attempt(make) if comm.rank == 0 else (None, None)
    error = comm.bcast(error)
    if error is not None:
        raise error
    return result


def from_root(comm: Comm, make: Callable[[], T]) -> T:
    """Result of ``make``, called on rank 0, on every rank; what it raises there is raised on all."""
    return comm.bcast(on_root(comm, make))  # type: ignore[return-value]


def on_every_rank(comm: Comm, make: Callable[[], T]) -> T:
    """Result of ``make``, called on every rank; the error of the first rank that fails is raised on all.

    ``make`` must not communicate.
    """
    result, error = _attempt(make)
    for raised in comm.allgather(error):
        if raised is not None:
            raise raised
    return result  # type: ignore[return-value]


def leave_together(comm: Comm, code: int) -> None:
    """Return when all ranks have come here to end with an error; end them all if one does not come.

    Errors of our own are raised on all ranks. Should one of them slip out on some ranks only, the others would wait for
    ever in a call that those never make.
    """
    all_here = comm.Ibarrier()
    deadline = time.monotonic() + PATIENCE
    while not all_here.Test():
        if time.monotonic() > deadline:
            comm.Abort(code)
        time.sleep(0.01)


def _attempt(make: Callable[[], T]) -> tuple[T | None, Exception | None]:
    try:
        return make(), None
    except Exception as error:
        return None, _portable(error)


def _portable(error: Exception) -> Exception:
    """The error, or what it says, if it cannot travel to other ranks."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
