"""A lock on a run directory: two runs that write into one directory would spoil both."""

from __future__ import annotations

import fcntl
import os
import socket
import time
from pathlib import Path
from typing import Any

from tmc_vem.support.errors import InputError

LOCK = "run.lock"
# Who looks whether a run goes on holds its lock for an instant: seconds to wait for that, and how often.
INSTANT, ATTEMPTS = 0.02, 5


def is_held(directory: Path) -> bool | None:
    """Whether a process holds the lock of a run directory; None where that cannot be found out."""
    try:
        with (directory / LOCK).open() as handle:
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    except BlockingIOError:
        return True
    except FileNotFoundError:
        return False
    except OSError:  # no locks on this file system, or no permission
        return None


class DirectoryLock:
    """Held by a run for as long as it writes; the kernel lets go of it when the process ends, however it ends.

    On Linux, flock on NFS is a lock of the server and so holds between machines too. Where a file system has no locks
    at all, ``held`` is False and nothing is guarded.

    Args:
        directory: an existing run directory.

    Raises:
        InputError: another process holds the lock; the message says which.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / LOCK
        self.held = False
        self._handle: Any = None
        while not self._take():
            pass

    def _take(self) -> bool:
        """Lock the file; False if it was removed by its last holder in the meantime."""
        handle = self.path.open("a+")
        try:
            _lock(handle)
        except BlockingIOError:
            handle.seek(0)
            holder = handle.read(200).strip() or "another process"
            handle.close()
            raise InputError(
                f"output directory {self.path.parent} is in use by {holder}: wait for it, or choose another"
            ) from None
        except OSError:  # no locks on this file system
            handle.close()
            self.path.unlink(missing_ok=True)
            return True
        if not self._is_current(handle):
            handle.close()
            return False
        handle.truncate(0)
        handle.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        handle.flush()
        self._handle, self.held = handle, True
        return True

    def _is_current(self, handle: Any) -> bool:
        try:
            return os.fstat(handle.fileno()).st_ino == self.path.stat().st_ino
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let go and remove the file."""
        if self._handle is not None:
            self.path.unlink(missing_ok=True)
            self._handle.close()
            self._handle, self.held = None, False


def _lock(handle: Any) -> None:
    """Lock a file for this process alone.

    Raises:
        BlockingIOError: another process holds the lock.
        OSError: there are no locks on this file system.
    """
    for attempt in range(ATTEMPTS):
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if attempt == ATTEMPTS - 1:
                raise
            time.sleep(INSTANT)
