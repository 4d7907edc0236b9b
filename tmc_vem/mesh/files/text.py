"""Text files as lines, whatever editor they come from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path


def text_of(path: Path) -> str:
    """The text, in UTF-8 with or without a byte order mark, in UTF-16 with one, else in Latin 1."""
    content = path.read_bytes()
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def lines_of(path: Path, continued: str = "") -> Iterator[tuple[int, str]]:
    """Number, from 1, and text of every line without spaces around it; one that ends with ``continued`` goes on."""
    before, first = "", 0
    n = 0
    for n, line in enumerate(text_of(path).replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        first = first or n
        stripped = line.strip()
        if continued and stripped.endswith(continued):
            before += stripped[: -len(continued)] + " "
            continue
        yield first, (before + stripped).strip()
        before, first = "", 0
    if before:
        yield first, before.strip()


def shown_line(line: str) -> str:
    """A line as messages show it."""
    return line if len(line) <= 60 else f"{line[:57]}..."
