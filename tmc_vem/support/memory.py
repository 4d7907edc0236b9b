"""How the C library keeps the memory of arrays that come and go."""

from __future__ import annotations

import contextlib
import ctypes

# parameters of mallopt in glibc
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
MIB, NEVER = 2**20, -1


def reuse_freed() -> None:
    """Keep memory that arrays have left for the next ones (glibc); elsewhere nothing happens.

    By default glibc hands freed memory back to the system and asks for it again, page by page, for the next array: a
    third of the time of set-up, whose many arrays live for a fraction of a millisecond, and a sixth of that of a
    factorisation, which takes the same workspace every time. :func:`give_back` returns it when it will not be needed.
    Arrays of more than 32 MiB, the most that glibc allows here, come from the system and go back to it, unless MPI has
    changed that for memory it has registered.
    """
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(M_MMAP_THRESHOLD, 32 * MIB)
        library.mallopt(M_TRIM_THRESHOLD, NEVER)


def give_back() -> None:
    """Return freed memory to the system where the C library can (glibc); elsewhere nothing happens.

    Set-up frees memory in pieces between what stays; without this the factorisation cannot have it.
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
