"""Which test executes which line: every test file once under coverage, kept until the file changes.

The record of a test file has the durations of its tests and, for each, the lines of each source as bits of a number,
with a hash of the source as it was. Sources may change afterwards: :mod:`mutation.nearness` finds the same lines again.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from coverage import CoverageData
from coverage.exceptions import DataError

from mutation import plugin
from mutation.trees import PACKAGES, STORE, Tree

RECORDS = STORE / "map"
SOURCES = STORE / "sources"
LONGEST = 1800.0  # seconds for a test file under measurement
EVERYDAY = ("-m", "not slow and not paper", "-p", "mutation.plugin", "-p", "no:cacheprovider", "-p", "no:xdist", "-q")
_CONFIGURATION = """[run]
parallel = true
data_file = {data}
context = ${{{test}-}}
source =
    {sources}
disable_warnings = no-data-collected, module-not-measured, module-not-imported
"""


@dataclass(frozen=True)
class Record:
    """What was measured of a test file.

    Attributes:
        hash: of its text.
        seconds: of processors, for each test that passed, by name, without wide fixtures.
        fixtures: seconds that wide fixtures of each test take, by name of the test and of the fixture.
        sources: hash of each source.
        lines: by test and source, a hexadecimal number in which bit n is set if line n was executed.
    """

    hash: str
    seconds: dict[str, float]
    fixtures: dict[str, dict[str, float]]
    sources: dict[str, str]
    lines: dict[str, dict[str, str]]

    def write(self, path: Path) -> None:
        """Store as JSON."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(asdict(self)))

    @classmethod
    def read(cls, path: Path) -> Record:
        """Read from JSON."""
        return cls(**json.loads(path.read_text()))


def digest(text: str) -> str:
    """Name of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def measured_text(name: str) -> str:
    """Text of a source as it was when it was measured."""
    return (SOURCES / name).read_text()


def record_path(test_file: str) -> Path:
    """Where the record of a test file is."""
    return RECORDS / f"{test_file.replace('/', '.')}.json"


def test_files(root: Path) -> list[str]:
    """All test files."""
    return sorted(path.relative_to(root).as_posix() for path in (root / "tests").rglob("test_*.py"))


def stale(root: Path, files: Iterable[str]) -> list[str]:
    """Test files without a record of their present text."""
    return [
        file
        for file in files
        if not record_path(file).is_file() or Record.read(record_path(file)).hash != digest((root / file).read_text())
    ]


def measure(tree: Tree, files: Sequence[str]) -> list[Record]:
    """Run test files under coverage in one process and record each."""
    with tempfile.TemporaryDirectory(prefix="measure-") as scratch:
        folder = Path(scratch)
        log, configuration = folder / "log", folder / "coveragerc"
        log.touch()
        sources = "\n    ".join(str(tree.path / package) for package in PACKAGES)
        configuration.write_text(_CONFIGURATION.format(data=folder / "data", test=plugin.TEST, sources=sources))
        variables = {"COVERAGE_PROCESS_START": str(configuration), plugin.LOG: str(log), plugin.TEST: ""}
        tree.run(["-m", "pytest", *EVERYDAY, *files], variables=variables, stop=lambda seconds: seconds > LONGEST)
        seconds, fixtures, users = _read_log(log)
        contexts = _read_data(sorted(folder.glob("data.*")), tree.path)
    lines: dict[str, dict[str, int]] = {test: {} for test in seconds}
    for context, executed in contexts.items():
        for test in users.get(context, [context]):
            for source, bits in executed.items():
                if test in lines:
                    lines[test][source] = lines[test].get(source, 0) | bits
    records = []
    for file in files:
        own = [test for test in seconds if test.partition("::")[0] == file]
        names = {source for test in own for source in lines[test]}
        record = Record(
            hash=digest((tree.path / file).read_text()),
            seconds={test: seconds[test] for test in own},
            fixtures={test: fixtures[test] for test in own},
            sources={name: _keep(tree.path / name) for name in sorted(names)},
            lines={test: {name: f"{bits:x}" for name, bits in lines[test].items()} for test in own},
        )
        record.write(record_path(file))
        records.append(record)
    return records


def _read_log(log: Path) -> tuple[dict[str, float], dict[str, dict[str, float]], dict[str, list[str]]]:
    """Durations of tests that passed and of the wide fixtures of each, and the tests that use each fixture."""
    events = [json.loads(line) for line in log.read_text().splitlines()]
    made = {event["name"]: round(event["seconds"], 3) for event in events if event["event"] == "fixture"}
    failed: set[str] = set()
    seconds: dict[str, float] = defaultdict(float)
    fixtures: dict[str, dict[str, float]] = {}
    users: dict[str, list[str]] = defaultdict(list)
    for event in events:
        test = event["test"]
        match event["event"]:
            case "start":
                for name in event["fixtures"]:
                    users[f"{plugin.FIXTURE}{name}"].append(test)
                fixtures[test] = {name: made[name] for name in event["fixtures"] if name in made}
            case "fixture":
                seconds[test] -= event["seconds"]
            case "end":
                seconds[test] += event["seconds"]
            case _ if event["outcome"] != "passed":
                failed.add(test)
    kept = {test: round(max(value, 0.0), 4) for test, value in seconds.items() if test not in failed and test}
    return kept, fixtures, users


def _read_data(files: Iterable[Path], root: Path) -> dict[str, dict[str, int]]:
    """Executed lines as bits, by context and source."""
    found: dict[str, dict[str, int]] = defaultdict(dict)
    for file in files:
        data = CoverageData(basename=str(file))
        try:
            data.read()
            python = [measured for measured in data.measured_files() if measured.endswith(".py")]  # no templates
            executed = {measured: data.contexts_by_lineno(measured) for measured in python}
        except DataError:  # of a process that was killed while it wrote
            continue
        for measured, lines in executed.items():
            name = Path(measured).relative_to(root).as_posix()
            for line, contexts in lines.items():
                for context in contexts:
                    found[context][name] = found[context].get(name, 0) | 1 << line
    return found


def _keep(source: Path) -> str:
    """Store the text of a source under its hash."""
    text = source.read_text()
    SOURCES.mkdir(parents=True, exist_ok=True)
    (SOURCES / digest(text)).write_text(text)
    return digest(text)
