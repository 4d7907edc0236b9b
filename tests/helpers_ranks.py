"""One of two ranks for tests in one process."""

from __future__ import annotations

from typing import Any


class Ranks:
    """What one of two ranks hears; the other has raised an error, or nothing."""

    def __init__(self, rank: int, root: Any = None, other: Any = None) -> None:
        self.rank, self.size, self._root, self._other = rank, 2, root, other
        self.sent: list[Any] = []

    def bcast(self, value: Any, root: int = 0) -> Any:
        self.sent.append(value)
        return value if self.rank == root else self._root

    def allgather(self, value: Any) -> list[Any]:
        self.sent.append(value)
        return [value, self._other] if self.rank == 0 else [self._other, value]
