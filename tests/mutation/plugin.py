"""What pytest does differently in a mutation run: it takes chosen tests in an order, and says what each one did.

Loaded with ``-p mutation.plugin`` in a copy of the tree. With coverage measuring, every line is noted with the test
that executed it; processes that a test starts are told its name in a variable. What a fixture of a whole module or
session does is noted under the fixture, and counts for all tests that use it.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

LOG = "TMC_MUTATION_LOG"  # file that gets a line of JSON for everything that happens
ORDER = "TMC_MUTATION_ORDER"  # file with the names of the tests to run, one a line; without it all run
TEST = "TMC_MUTATION_TEST"  # name of the running test, for measured processes
FIXTURE = "fixture:"  # begins the name under which lines of wide fixtures are noted


def pytest_configure(config: pytest.Config) -> None:
    """Raises: pytest.Exit, the packages under test are not those of this copy."""
    import tmc_vem

    if not Path(str(tmc_vem.__file__)).is_relative_to(config.rootpath):
        pytest.exit(f"{tmc_vem.__file__} is not of the copy {config.rootpath}", returncode=4)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the chosen tests, in their order."""
    if ORDER not in os.environ:
        return
    place = {name: n for n, name in enumerate(Path(os.environ[ORDER]).read_text().splitlines())}
    chosen = sorted((item for item in items if item.nodeid in place), key=lambda item: place[item.nodeid])
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in place])
    items[:] = chosen


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note what the test executes under its name."""
    names = sorted(getattr(item, "fixturenames", ()))
    _say(event="start", test=item.nodeid, fixtures=names, time=time.time())
    _note_under(item.nodeid)
    before = work()
    yield
    _note_under("")
    _say(event="end", test=item.nodeid, seconds=work() - before)


@pytest.hookimpl(hookwrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any], request: pytest.FixtureRequest) -> Iterator[None]:
    """Note what a wide fixture executes under its name."""
    if fixturedef.scope == "function":
        yield
        return
    before, start = os.environ.get(TEST, ""), work()
    _note_under(f"{FIXTURE}{fixturedef.argname}")
    yield
    _note_under(before)
    _say(event="fixture", name=fixturedef.argname, test=before, seconds=work() - start)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Say how a phase of a test went."""
    _say(event=report.when, test=report.nodeid, outcome=report.outcome)


def work() -> float:
    """Seconds of processors that this process and those that it has waited for have had: the same on a busy machine."""
    return sum(os.times()[:4])


def _note_under(context: str) -> None:
    os.environ[TEST] = context
    try:
        from coverage import Coverage
    except ImportError:  # only measuring needs it
        return
    current = Coverage.current()
    if current is not None:
        current.switch_context(context)


def _say(**event: object) -> None:
    if LOG in os.environ:
        with open(os.environ[LOG], "a") as log:
            log.write(json.dumps(event) + "\n")
