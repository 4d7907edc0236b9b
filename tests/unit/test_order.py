"""The order of the test files in 'make test'."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from conftest import LONG, pytest_collection_modifyitems

ROOT = Path(__file__).parents[2]


def test_files_that_take_long_exist() -> None:
    assert [name for name in LONG if not (ROOT / name).is_file()] == []
    assert len(set(LONG)) == len(LONG)


def test_they_come_first_in_processes_that_share_the_tests() -> None:
    names = ["tests/a.py::a", f"{LONG[1]}::b", "tests/a.py::c", f"{LONG[1]}::a[x::y]", f"{LONG[0]}::a"]
    for config, order in ((SimpleNamespace(workerinput={}), [4, 1, 3, 0, 2]), (SimpleNamespace(), range(5))):
        items = [SimpleNamespace(nodeid=name) for name in names]
        pytest_collection_modifyitems(config, items)
        assert [item.nodeid for item in items] == [names[n] for n in order]
