"""Where a fault may be put into a source, and the fault itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Site:
    """A stretch of a source that a fault replaces.

    Attributes:
        file: path from the root of the tree.
        start, end: first character, and the one after the last.
        options: texts of which one takes its place.
        operator: the kind of fault.
    """

    file: str
    start: int
    end: int
    options: tuple[str, ...]
    operator: str

    def mutant(self, text: str, option: str) -> Mutant:
        """The fault that puts ``option`` here."""
        mutated = text[: self.start] + option + text[self.end :]
        first = text.count("\n", 0, self.start)
        last = text.count("\n", 0, self.end)
        more = option.count("\n") - text.count("\n", self.start, self.end)
        before = "\n".join(line.strip() for line in text.splitlines()[first : last + 1])
        after = "\n".join(line.strip() for line in mutated.splitlines()[first : last + 1 + more])
        return Mutant(self.file, first + 1, self.operator, before, after, self.start, self.end, option)


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Attributes:
        file: path from the root of the tree.
        line: number of its first line.
        operator: the kind of fault.
        before, after: the lines that it changes, without indentation.
        start, end, new: what is replaced, and by what.
    """

    file: str
    line: int
    operator: str
    before: str
    after: str
    start: int
    end: int
    new: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is known by when lines move."""
        return self.file, self.before, self.after

    def apply(self, text: str) -> str:
        """The source with the fault."""
        return text[: self.start] + self.new + text[self.end :]


def mutants(sites: Iterator[Site], text: str) -> Iterator[Mutant]:
    """All faults at sites of one source."""
    for site in sites:
        for option in site.options:
            yield site.mutant(text, option)
