"""Memory that the C library keeps after large temporary arrays are gone."""

from __future__ import annotations

import contextlib
import ctypes


def give_back() -> None:
    """Return freed memory to the system where the C library can (glibc); elsewhere nothing happens.

    Set-up frees as much as it keeps, in pieces between what stays; without this the factorisation cannot have it.
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
