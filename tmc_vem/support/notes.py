"""Notes: what a user should know about how an input was taken, in one line each.

In Python they are warnings of class :class:`tmc_vem.support.errors.Note`. The command line hears them itself, as UFL
turns all warnings into entries of a log once it is imported.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tmc_vem.support.errors import Note

_listeners: list[Callable[[str], None]] = []


def say(message: str, stacklevel: int = 2) -> None:
    """Give a note to who listens; without anyone, as a warning from ``stacklevel`` calls above."""
    if _listeners:
        _listeners[-1](message)
    else:
        warnings.warn(message, Note, stacklevel=stacklevel + 1)


@contextmanager
def heard_by(listener: Callable[[str], None]) -> Iterator[None]:
    """Notes go to a function until the block ends."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.pop()
