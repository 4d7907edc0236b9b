"""Faults that no test needs to see, each with the reason, from a file that is kept with the tests."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mutation.sample import find
from mutation.site import Mutant

EXPLAINED = "tests/mutants-explained.toml"
_KEYS = ("file", "before", "after", "reason")


@dataclass(frozen=True)
class Explained:
    """A fault and why it is none.

    Attributes:
        file: the source.
        before, after: the lines that it changes, without indentation.
        reason: in words.
    """

    file: str
    before: str
    after: str
    reason: str

    @property
    def key(self) -> tuple[str, str, str]:
        """As :attr:`~mutation.site.Mutant.key`."""
        return self.file, self.before, self.after


def read(path: Path) -> list[Explained]:
    """All entries.

    Raises:
        ValueError: an entry has not exactly the keys that it needs.
    """
    entries = tomllib.loads(path.read_text()).get("mutant", [])
    for n, entry in enumerate(entries, start=1):
        if sorted(entry) != sorted(_KEYS):
            raise ValueError(f"{path.name}: entry {n} needs {', '.join(_KEYS)}; it has {', '.join(entry)}")
    return [Explained(**{key: entry[key].strip() for key in _KEYS}) for entry in entries]


def obsolete(root: Path, entries: Iterable[Explained]) -> list[Explained]:
    """Entries whose fault no source can have any more."""
    entries = list(entries)
    known = find(root, (entry.key for entry in entries))
    return [entry for entry in entries if entry.key not in known]


def reason(mutant: Mutant, entries: Iterable[Explained]) -> str | None:
    """Why a fault is none."""
    return next((entry.reason for entry in entries if entry.key == mutant.key), None)
