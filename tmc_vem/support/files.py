"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

TEMPORARY = ".unfinished-"


@contextmanager
def whole_file(path: Path, keep: Path | None = None, *, durable: bool = True) -> Iterator[Path]:
    """A temporary path beside ``path``, with its suffix, that takes its place when the block ends without an error.

    A reader, and whoever looks after the process was killed, sees the old file or the new one.

    Args:
        path: the file.
        keep: where the old one goes, if there is one.
        durable: wait until the disk has it, so that this is true of a power cut as well. Else a file that was written
            less than about half a minute before one may be empty.

    Raises:
        OSError: it could not be written, for example because the disk is full; the old file is as it was.
    """
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f"{TEMPORARY}{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        if durable:
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
        temporary.chmod(0o644)
        if keep is not None and path.exists():
            os.replace(path, keep)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_atomically(path: Path, text: str, *, durable: bool = True) -> None:
    """Write a text file so that a reader sees the old one or the new one, whole; see :func:`whole_file`."""
    with whole_file(path, durable=durable) as temporary:
        temporary.write_text(text)


def remove_unfinished(directory: Path) -> None:
    """Remove what a killed process has left half written."""
    for leftover in directory.rglob(f"{TEMPORARY}*"):
        leftover.unlink(missing_ok=True)
