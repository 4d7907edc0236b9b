"""Run directories that are damaged are refused in one line, or shown as far as they can be read; no traceback."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.cli.list import list_runs
from tmc_vem.report.animation import states_of
from tmc_vem.report.run_page import run_page
from tmc_vem.report.write import to_markdown
from tmc_vem.results.run_result import RunResult
from tmc_vem.results.unfinished import BEGUN, process_facts
from tmc_vem.support.errors import InputError

DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "rubbish": lambda _: bytes(range(256)),
    "zeros": lambda content: content[:-30] + bytes(30),
    "deep": lambda _: b"[" * 100_000,
    "list": lambda _: b"[]",
    "null": lambda _: b"null",
    "long": lambda content: b'"' + b"a" * 200_000 + b'"\n' + content,
}
WRONG: tuple[Any, ...] = (None, "x", [], [None], {"a": None}, float("inf"), 1e400)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "box"
    run(Box(cells=(20, 5), uy=-0.02, medium=Medium(gamma=1e-4)), out, RunOptions(steps=2, snapshots=1))
    return out


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole, tmp_path / "box")
    return tmp_path / "box"


def listed(directory: Path, *options: str) -> str:
    """Output of the list of a directory; errors of its runs are no errors of the list."""
    done = CliRunner().invoke(list_runs, [str(directory), *options], catch_exceptions=False)
    assert done.exit_code == 0
    return done.output


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", ["result.json", "history.csv"])
def test_results(name: str, damage: str, copy: Path) -> None:
    (copy / name).write_bytes(DAMAGES[damage]((copy / name).read_bytes()))
    with pytest.raises(InputError, match=str(copy)):
        RunResult.read(copy)
    assert str(copy) in listed(copy.parent)


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_a_run_said_before_its_end(damage: str, copy: Path) -> None:
    (copy / "result.json").unlink()
    begun = json.dumps({"inputs": {}, "process": process_facts(locked=True)}).encode()
    (copy / BEGUN).write_bytes(DAMAGES[damage](begun))
    with pytest.raises(InputError, match=str(copy)):
        RunResult.read(copy)
    assert str(copy) in listed(copy.parent)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", ["fields.pvd", "fields/step_00002.vtu"])
def test_fields_are_left_out_of_the_page(name: str, damage: str, copy: Path, capfd: pytest.CaptureFixture[str]) -> None:
    damaged = DAMAGES[damage]((copy / name).read_bytes())
    (copy / name).write_bytes(damaged)
    result = RunResult.read(copy)
    with pytest.raises(InputError):
        states_of(result)
    page = run_page(result)
    assert "states" not in [picture.name for picture in page.pictures]
    assert "loading" in [picture.name for picture in page.pictures]
    assert "was not checked for interpenetration" in to_markdown(page)
    assert capfd.readouterr() == ("", "")


def test_fields_of_other_regions(copy: Path) -> None:
    text = (copy / "history.csv").read_text()
    (copy / "history.csv").write_text(text.replace("_solid", "_medium"))
    with pytest.raises(InputError, match="regions"):
        states_of(RunResult.read(copy))


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_values_of_another_type(wrong: Any, copy: Path) -> None:
    data = json.loads((copy / "result.json").read_text())
    for name in data:
        (copy / "result.json").write_text(json.dumps(data | {name: wrong}))
        try:
            result = RunResult.read(copy)
        except InputError as error:
            assert str(copy) in str(error)  # noqa: PT017 (either is right)
            assert str(copy) in listed(copy.parent)
            continue
        for options in ((), ("--csv",), ("--json",)):
            assert "box" in listed(copy.parent, *options)
        assert result.steps == 2
        assert all(isinstance(text, str) for text in (*result.errors, *result.warnings))


def test_a_file_in_place_of_a_directory_and_back(copy: Path) -> None:
    for name in ("result.json", "history.csv"):
        target = copy / name
        content = target.read_bytes()
        target.unlink()
        target.mkdir()
        with pytest.raises(InputError, match="Is a directory"):
            RunResult.read(copy)
        target.rmdir()
        target.write_bytes(content)
    with pytest.raises(InputError, match="not a run directory"):
        RunResult.read(copy / "result.json")
