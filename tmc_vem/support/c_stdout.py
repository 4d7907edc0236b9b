"""What libraries in C print on standard output, which belongs to whoever reads it: JSON, for example."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def c_stdout_on_stderr() -> Iterator[None]:
    """Whatever writes to this process' standard output without Python writes to standard error meanwhile.

    Where a stream is closed, nothing is done.
    """
    flush = ctypes.CDLL(None).fflush  # C keeps what it prints, and would print it afterwards
    if sys.stdout is not None:  # Python was started without one
        sys.stdout.flush()
    flush(None)
    try:
        kept = os.dup(1)
    except OSError:
        yield
        return
    try:
        os.dup2(2, 1)
        yield
    finally:
        flush(None)
        os.dup2(kept, 1)
        os.close(kept)
