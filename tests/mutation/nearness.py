"""The tests near a fault: those that executed its line when they were measured, quick and specific ones first."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from mutation.measure import Record, digest, measured_text, record_path
from mutation.places import Places, in_functions, lines_of, words_of_tests
from mutation.site import Mutant

BUDGET = 90.0  # seconds of tests for a fault, as measured
MODULE = 20.0  # seconds of further tests that execute anything of its module
FIRST, SECOND = 3.0, 20.0  # seconds of tests that come before all others, and before the rest
OVERHEAD = 0.05  # seconds of a test beside its own duration
NAMED = 5.0  # how much likelier a test file that is called like a module sees its faults
# Python whose functions call the C of a folder: what runs them runs it.
CALLERS = {
    "tmc_vem/vem/kernel": ("tmc_vem/vem/kernel/cells.py", "tmc_vem/vem/kernel/batch.py"),
    "tmc_vem/vem/facets": ("tmc_vem/vem/facets/compiled.py", "tmc_vem/vem/facets/batch.py"),
    "codegen": ("codegen/kernel.py",),
}


@dataclass(frozen=True)
class Measured:
    """A measured test.

    Attributes:
        name: pytest's.
        seconds: of processors that it takes under coverage, without wide fixtures.
        fixtures: seconds of the wide fixtures that it uses, by name.
        lines: executed lines by source, as bits.
        record: of its file.
    """

    name: str
    seconds: float
    fixtures: dict[str, float]
    lines: dict[str, int]
    record: Record

    @property
    def file(self) -> str:
        """File of the test."""
        return self.name.partition("::")[0]

    @property
    def function(self) -> str:
        """Name of the function."""
        return self.name.rpartition("::")[2].partition("[")[0]

    @property
    def alone(self) -> float:
        """Seconds that it takes if nothing is shared."""
        return self.seconds + sum(self.fixtures.values())

    @cached_property
    def breadth(self) -> int:
        """Number of lines of all sources that it executes."""
        return sum(bits.bit_count() for bits in self.lines.values()) or 1


class Nearness:
    """The measured tests of a tree.

    Args:
        root: the tree.
        files: test files with records.
    """

    def __init__(self, root: Path, files: Iterable[str]) -> None:
        self.root = root
        self.tests: dict[str, Measured] = {}
        for file in files:
            record = Record.read(record_path(file))
            for name, seconds in record.seconds.items():
                bits = {source: int(value, 16) for source, value in record.lines[name].items()}
                self.tests[name] = Measured(name, seconds, record.fixtures.get(name, {}), bits, record)

    def near(self, mutant: Mutant) -> list[Measured]:
        """Tests for a fault in the order in which to run them; what takes too long is left out."""
        chosen: dict[str, Measured] = {}
        made: set[tuple[str, str]] = set()
        for group, budget in self._groups(mutant):
            spent = 0.0
            for test in sorted(group, key=lambda test: self._cost(test, mutant.file)):
                more = _added(test, made)
                if test.name not in chosen and (spent + more <= budget or not chosen):
                    chosen[test.name] = test
                    spent += more
                    made |= {(test.file, name) for name in test.fixtures}
        return in_turns(chosen.values())

    def longest(self, file: str) -> float:
        """Seconds of the longest test of a file, with all that it shares with others."""
        return max((test.alone for test in self.tests.values() if test.file == file), default=0.0)

    def _groups(self, mutant: Mutant) -> Iterator[tuple[list[Measured], float]]:
        """Tests that may see it, in groups, each with the seconds that it may take."""
        direct = list(self._of_lines(mutant))
        yield self._naming(mutant), BUDGET
        yield direct, BUDGET
        files = {test.file for test in direct}
        yield [test for test in self.tests.values() if test.file in files and _named(test, mutant.file)], BUDGET
        # what is cached, or executed at the first import, is noted under another test than the one that looks at it
        module = list(self._executing(mutant.file, range(1, len(lines_of(self.root / mutant.file)) + 1)))
        yield module, MODULE
        if not direct and not module:
            stem = Path(mutant.file).stem
            yield [test for test in self.tests.values() if _mentions(self.root / test.file, stem)], BUDGET

    def _of_lines(self, mutant: Mutant) -> Iterator[Measured]:
        """Tests that execute what the fault is in."""
        if not mutant.file.endswith(".py"):
            callers = next(files for folder, files in CALLERS.items() if mutant.file.startswith(folder))
            for caller in callers[:1]:
                yield from self._executing(caller, in_functions(self.root / caller))
            return
        places = Places.of(self.root / mutant.file)
        number = mutant.line + mutant.before[: _offset(mutant)].count("\n")
        if number not in places.inside:
            yield from self._using(mutant.file, places.names(number), places.function(number))
            return
        found = list(self._executing(mutant.file, [number]))
        yield from found or self._executing(mutant.file, places.statement(number))

    def _naming(self, mutant: Mutant) -> list[Measured]:
        """Tests that mention what a line outside functions gives a value."""
        if not mutant.file.endswith(".py"):
            return []
        places = Places.of(self.root / mutant.file)
        names = places.names(mutant.line) if mutant.line not in places.inside else set()
        module = Path(mutant.file).stem
        return [
            test
            for test in self.tests.values()
            if names & words_of_tests(self.root / test.file).get(test.function, frozenset())
            and _mentions(self.root / test.file, module)
        ]

    def _using(self, file: str, names: set[str], function: range) -> Iterator[Measured]:
        """Tests that execute a line with one of these names, or of this function."""
        seen: set[str] = set()
        groups = [(file, list(function))] if function else []
        if names:
            word = re.compile(rf"\b({'|'.join(sorted(names))})\b")
            for other in sorted({source for test in self.tests.values() for source in test.lines}):
                if other.endswith(".py") and (self.root / other).is_file():
                    inside = in_functions(self.root / other)
                    lines = lines_of(self.root / other)
                    groups.append((other, [n for n in inside if word.search(lines[n - 1])]))
        for other, numbers in groups:
            for test in self._executing(other, numbers):
                if test.name not in seen:
                    seen.add(test.name)
                    yield test

    def _executing(self, file: str, numbers: Iterable[int]) -> Iterator[Measured]:
        """Tests that executed lines with these numbers of the present text."""
        wanted = frozenset(numbers)
        if not wanted or not (self.root / file).is_file():
            return
        text = (self.root / file).read_text()
        for test in self.tests.values():
            bits = test.lines.get(file, 0)
            if bits and bits & _mask(test.record.sources[file], text, wanted):
                yield test

    def _cost(self, test: Measured, file: str) -> float:
        """Seconds over how likely it sees a fault in a source: which part of what it runs that is."""
        sources = [file] if file.endswith(".py") else [name for files in CALLERS.values() for name in files]
        share = sum(test.lines.get(source, 0).bit_count() for source in sources) / test.breadth
        return (test.alone + 2 * OVERHEAD) / max(share, 1e-3) / (NAMED if _named(test, file) else 1.0)


def cost(tests: Iterable[Measured]) -> float:
    """Seconds that tests take together."""
    spent, made = 0.0, set[tuple[str, str]]()
    for test in tests:
        spent += _added(test, made)
        made |= {(test.file, name) for name in test.fixtures}
    return spent


def _added(test: Measured, made: set[tuple[str, str]]) -> float:
    """Seconds that one more test takes, when some fixtures are made already."""
    return test.seconds + OVERHEAD + sum(more for name, more in test.fixtures.items() if (test.file, name) not in made)


def in_turns(tests: Iterable[Measured]) -> list[Measured]:
    """The same tests, those of a file together in each of three turns: fixtures of a file are made once in a turn."""
    turns: tuple[dict[str, list[Measured]], ...] = ({}, {}, {})
    spent = 0.0
    for test in tests:
        spent += test.alone + OVERHEAD
        turn = turns[(spent > FIRST) + (spent > SECOND)]
        turn.setdefault(test.file, []).append(test)
    return [test for turn in turns for group in turn.values() for test in group]


@cache
def _mask(measured: str, text: str, wanted: frozenset[int]) -> int:
    """Bits of lines in the text that was measured, for lines of the present one; new lines count as the one before."""
    if measured == digest(text):
        return sum(1 << number for number in wanted)
    before = _old_numbers(measured, text)
    return sum(1 << number for number in {before[number] for number in wanted if number in before})


@cache
def _old_numbers(measured: str, text: str) -> dict[int, int]:
    old, new = measured_text(measured).splitlines(), text.splitlines()
    numbers: dict[int, int] = {}
    for _, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        for n in range(c, d):
            numbers[n + 1] = min(a + n - c, b - 1) + 1 if b > a else max(a, 1)
    return numbers


def _offset(mutant: Mutant) -> int:
    """Where the lines of a fault begin to differ."""
    same = (n for n, (a, b) in enumerate(zip(mutant.before, mutant.after, strict=False)) if a != b)
    return next(same, 0)


def _named(test: Measured, file: str) -> bool:
    return Path(file).stem in Path(test.file).stem.split("_") or Path(file).stem in Path(test.file).stem


@cache
def _mentions(path: Path, stem: str) -> bool:
    return re.search(rf"\b{re.escape(stem)}\b", path.read_text()) is not None
