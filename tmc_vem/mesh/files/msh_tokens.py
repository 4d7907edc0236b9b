"""The numbers of a section of a .msh file, one after the other, from text or bytes."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]


class Tokens(Protocol):
    """Numbers, in the order of the file."""

    binary: bool

    def count(self) -> int:
        """The number at the start of a section of version 2, which is text in binary files as well."""

    def rest(self) -> list[int]:
        """All whole numbers that are left."""

    def ints(self, n: int) -> Int:
        """The next ``n`` whole numbers, of 4 bytes in a binary file."""

    def sizes(self, n: int) -> Int:
        """The next ``n`` whole numbers, of 8 bytes in a binary file."""

    def floats(self, n: int) -> Float:
        """The next ``n`` numbers."""

    def records(self, n: int, fields: str) -> list[NDArray[np.generic]]:
        """Columns of the next ``n`` rows, each of fields 'i' (as ints), 's' (as sizes) and 'd' (as floats)."""

    def check_end(self) -> None:
        """Refuse a section that has more."""


def tokens_of(section: bytes, order: str | None, name: str) -> Tokens:
    """Numbers of a section.

    Args:
        section: its content.
        order: of bytes, ``"<"`` or ``">"``, or None for text.
        name: for messages.
    """
    return _Text(section, name) if order is None else _Bytes(section, order, name)


class _Text:
    binary = False

    def __init__(self, section: bytes, name: str) -> None:
        self.words, self.at, self.name = section.split(), 0, name

    def _take(self, n: int, kind: type) -> NDArray[np.generic]:
        words = self.words[self.at : self.at + n] if n >= 0 else []
        if n < 0 or len(words) != n:
            raise InputError(f"${self.name} announces more than it has: it is cut off or damaged")
        self.at += n
        try:
            return np.array(words).astype(kind) if n else np.empty(0, kind)
        except (ValueError, OverflowError) as error:
            raise InputError(f"${self.name}: a number cannot be read: {error}") from None

    def count(self) -> int:
        return int(self.ints(1)[0])

    def rest(self) -> list[int]:
        numbers: list[int] = self._take(len(self.words) - self.at, np.int64).tolist()
        return numbers

    def ints(self, n: int) -> Int:
        return self._take(n, np.int64)  # type: ignore[return-value]

    sizes = ints

    def floats(self, n: int) -> Float:
        return self._take(n, np.float64)  # type: ignore[return-value]

    def records(self, n: int, fields: str) -> list[NDArray[np.generic]]:
        if n < 0:
            raise InputError(f"${self.name} announces {n} rows")
        width = len(fields)
        words = self.words[self.at : self.at + n * width]
        if len(words) != n * width:
            raise InputError(f"${self.name} announces more than it has: it is cut off or damaged")
        self.at += n * width
        try:
            return [
                np.array(words[k::width]).astype(np.float64 if kind == "d" else np.int64) if n
                else np.empty(0, np.float64 if kind == "d" else np.int64)
                for k, kind in enumerate(fields)
            ]  # fmt: skip
        except (ValueError, OverflowError) as error:
            raise InputError(f"${self.name}: a number cannot be read: {error}") from None

    def check_end(self) -> None:
        if self.at != len(self.words):
            raise InputError(f"${self.name} has more than it announces: {len(self.words) - self.at} numbers are left")


class _Bytes:
    binary = True

    def __init__(self, section: bytes, order: str, name: str) -> None:
        self.section, self.order, self.at, self.name = section, order, 0, name

    def _take(self, n: int, kind: str) -> NDArray[np.generic]:
        dtype = np.dtype(self.order + kind)
        size = n * dtype.itemsize
        data = self.section[self.at : self.at + size] if n >= 0 else b""
        if n < 0 or len(data) != size:
            raise InputError(f"${self.name} announces more than it has: it is cut off or damaged")
        self.at += size
        return np.frombuffer(data, dtype)

    def count(self) -> int:
        line, newline, _ = self.section[self.at :].partition(b"\n")
        try:
            n = int(line)
        except ValueError:
            n = -1
        if n < 0 or not newline:
            raise InputError(f"${self.name} does not say how many it has")
        self.at += len(line) + 1
        return n

    def rest(self) -> list[int]:
        numbers: list[int] = self.ints((len(self.section) - self.at) // 4).tolist()
        return numbers

    def ints(self, n: int) -> Int:
        return self._take(n, "i4").astype(np.int64)

    def sizes(self, n: int) -> Int:
        return self._take(n, "i8").astype(np.int64)

    def floats(self, n: int) -> Float:
        return self._take(n, "f8").astype(np.float64)

    def records(self, n: int, fields: str) -> list[NDArray[np.generic]]:
        kinds = {"i": "i4", "s": "i8", "d": "f8"}
        dtype = np.dtype([(str(k), self.order + kinds[kind]) for k, kind in enumerate(fields)])
        size = n * dtype.itemsize
        data = self.section[self.at : self.at + size] if n >= 0 else b""
        if n < 0 or len(data) != size:
            raise InputError(f"${self.name} announces more than it has: it is cut off or damaged")
        self.at += size
        rows = np.frombuffer(data, dtype)
        return [rows[str(k)].astype(np.float64 if kind == "d" else np.int64) for k, kind in enumerate(fields)]

    def check_end(self) -> None:
        if self.section[self.at :].strip(b"\r\n \0"):
            raise InputError(f"${self.name} has more than it announces: {len(self.section) - self.at} bytes are left")
