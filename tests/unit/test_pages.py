"""Numbers of the documentation: which block makes what, what is kept, and that a wrong digit is found."""

from __future__ import annotations

import math
import re
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tmc_vem.simulation.interrupt import Interrupted
from tmc_vem.support.errors import InputError

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

from pages import refresh as command  # noqa: E402
from pages import runs, sources  # noqa: E402
from pages.block import COSTS, Block  # noqa: E402
from pages.refresh import chosen, pages, places, refresh  # noqa: E402

CALLS: list[float] = []


def half(value: float) -> float:
    """Something to measure."""
    CALLS.append(value)
    return value / 2


def gap(measure: runs.Measure) -> str:
    return f"| gap | iterations |\n|---|---|\n| {measure(half, 8.1338e-3):.4e} | 69 |"


def fails(measure: runs.Measure) -> str:
    raise InputError("no equilibrium was found")


BLOCKS = (Block("gap", "seconds", gap), Block("other", "minutes", lambda measure: f"{measure(half, 3.0):.1f} mm"))


def _batch(jobs: Any) -> Any:
    raise AssertionError("no block of the paper is asked for")


@pytest.fixture
def repository(tmp_path: Path) -> SimpleNamespace:
    """A README and a page with numbers of older code, and a place for measurements."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("a\n<!-- numbers: gap -->\n\n<!-- end of numbers -->\nb\n")
    (tmp_path / "docs" / "page.md").write_text("c\n<!-- numbers: other -->\n\n7.0 mm\n\n<!-- end of numbers -->\nd\n")

    def run(*, check: bool = False, quick: bool = False, again: bool = False) -> tuple[list[str], list[str]]:
        CALLS.clear()
        wanted = chosen(places(pages(tmp_path), BLOCKS), [], quick)
        return refresh(tmp_path, wanted, runs.Kept(tmp_path / "runs", again=again), _batch, check=check)

    return SimpleNamespace(root=tmp_path, run=run, page=tmp_path / "docs" / "page.md", readme=tmp_path / "README.md")


def test_a_second_refresh_changes_nothing_and_measures_nothing(repository: SimpleNamespace) -> None:
    stale, failed = repository.run()
    assert len(stale) > 1
    assert not failed
    assert CALLS == [8.1338e-3, 3.0]
    texts = repository.readme.read_text(), repository.page.read_text()
    assert "4.0669e-03" in texts[0]
    assert texts[1] == "c\n<!-- numbers: other -->\n\n1.5 mm\n\n<!-- end of numbers -->\nd\n"
    assert repository.run() == ([], [])
    assert CALLS == []
    assert texts == (repository.readme.read_text(), repository.page.read_text())
    assert repository.run(again=True) == ([], [])
    assert CALLS == [8.1338e-3, 3.0]


def test_a_wrong_digit_is_named_with_page_block_and_both_values(repository: SimpleNamespace) -> None:
    repository.run()
    right = repository.readme.read_text()
    repository.readme.write_text(right.replace("4.0669e-03", "4.0569e-03"))
    (line,), _ = repository.run(check=True)
    assert line.startswith("README.md, gap: 4.0569e-03 -> 4.0669e-03 (")
    assert "4.0569e-03" in repository.readme.read_text()  # nothing is written
    repository.readme.write_text(right.replace("4.0669e-03", "4.0670e-03").replace("69 |", "70 |"))
    assert repository.run(check=True) == ([], [])  # rounding, and the work that it tips


def test_quick_leaves_out_what_takes_longer(repository: SimpleNamespace) -> None:
    repository.run(quick=True)
    assert "4.0669e-03" in repository.readme.read_text()
    assert "7.0 mm" in repository.page.read_text()


def test_a_block_that_fails_is_named_and_the_others_are_refreshed(repository: SimpleNamespace) -> None:
    wanted = [("README.md", Block("gap", "seconds", fails)), ("docs/page.md", BLOCKS[1])]
    stale, failed = refresh(repository.root, wanted, runs.directly, _batch, check=False)
    assert failed == ["README.md, gap: no equilibrium was found"]
    assert [line.split(":")[0] for line in stale] == ["docs/page.md, other"]


def test_an_interrupt_ends_the_refresh(repository: SimpleNamespace) -> None:
    """A run that is told to stop says so as an error, which is not that of a block."""

    def stopped(measure: runs.Measure) -> str:
        raise Interrupted(signal.SIGTERM)

    with pytest.raises(Interrupted):
        refresh(repository.root, [("README.md", Block("gap", "seconds", stopped))], runs.directly, _batch, check=False)


@pytest.mark.parametrize(
    ("documents", "message"),
    [
        ({"a.md": "<!-- numbers: gapp -->\n\n<!-- end of numbers -->"}, "a.md: no numbers are known by 'gapp'"),
        ({"a.md": "<!-- numbers: gap -->\n\n<!-- end of numbers -->"}, "no page has a block 'other'"),
        (
            dict.fromkeys(("a.md", "b.md"), "<!-- numbers: gap -->\n\n<!-- end of numbers -->"),
            "'gap' stands in a.md and in b.md",
        ),
    ],
)
def test_blocks_that_do_not_fit_the_pages_are_refused(documents: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        places(documents, BLOCKS)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="no page or block is called 'gapp'"):
        chosen({"a.md": BLOCKS}, ["gapp"], quick=False)
    with pytest.raises(InputError, match="nothing in other takes seconds"):
        chosen({"a.md": BLOCKS}, ["other"], quick=True)


def test_every_block_stands_in_a_page_and_is_filled() -> None:
    registry = pytest.importorskip("pages.registry")
    documents = pages()
    found = places(documents, registry.BLOCKS)
    assert {block.cost for blocks in found.values() for block in blocks} == set(COSTS)
    for page, blocks in found.items():
        texts = command.texts(documents[page])
        for block in blocks:
            assert re.search(r"\d", texts[block.name]), f"{page}, {block.name}"


def test_measurements_depend_on_what_their_module_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    monkeypatch.setattr(sources, "PLACES", (tmp_path,))
    monkeypatch.setattr(sources, "START", math.inf)
    files = {
        "study.py": "from package import name\n",
        "package/__init__.py": "import typing\nif typing.TYPE_CHECKING:\n    from package.one import name\n",
        "package/one.py": "from package.two.three import f\nname = 1\n",
        "package/two/__init__.py": "",
        "package/two/three.py": "def f() -> int:\n    return 1\n",
        "package/two/part.c": "int f;\n",
        "package/other.py": "import package.two\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    def digest() -> str:
        for cached in (sources._content, sources._imported, sources._file):
            cached.cache_clear()
        return sources.digest(tmp_path / "study.py")

    before = digest()
    (tmp_path / "package/other.py").write_text("another = 1\n")  # nobody imports it
    (tmp_path / "package/one.py").write_text('"""Words."""\n\n# more\n' + files["package/one.py"])
    assert digest() == before
    for name in ("package/two/three.py", "package/two/part.c", "package/two/__init__.py", "package/one.py"):
        (tmp_path / name).write_text((tmp_path / name).read_text() + "value = 2\n")
        assert digest() != before, name
        before = digest()
    # what has changed since the process began may have been imported before: the value would not be of these sources
    monkeypatch.setattr(sources, "START", (tmp_path / "package/one.py").stat().st_mtime - 1.0)
    with pytest.raises(InputError, match="has changed since the refresh began"):
        digest()


def test_the_command_lists_and_refuses() -> None:
    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, str(ROOT / "scripts" / "refresh-numbers"), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)

    listed = run("--list", "--quick")
    assert listed.returncode == 0, listed.stderr
    assert "docs/projection.md" in listed.stdout
    assert "minutes" not in listed.stdout
    refused = run("no-such-block")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1


# what says where numbers come from: in the paragraph before a table, or in the page's own marks
SOURCE = re.compile(r"benchmarks/\w+\.py|test_\w+\.py|<!-- \w+ -->|measured once")
RESULT = re.compile(r"\d\.\d|\de-\d")


def test_tables_of_results_come_from_a_block_or_name_their_source() -> None:
    """A table most of whose cells are numbers with a point or an exponent."""
    for page, text in pages().items():
        outside = re.sub(r"<!-- numbers: .*?<!-- end of numbers -->", "", text, flags=re.DOTALL)
        paragraphs = re.split(r"\n\s*\n", outside)
        for before, paragraph in zip(["", *paragraphs], paragraphs, strict=False):
            rows = [line for line in paragraph.splitlines() if line.startswith("|")][2:]
            cells = [cell for row in rows for cell in row.strip("|").split("|")[1:]]
            if cells and sum(RESULT.search(cell) is not None for cell in cells) > len(cells) / 2:
                assert SOURCE.search(before) or SOURCE.search(paragraph), f"{page}: where is this from?\n{paragraph}"


def test_what_is_said_about_runs_in_media() -> None:
    """A run is good if it gets there without a jump and without J < 0; others say where they stop."""
    from pages import media

    full = {"load": 1.0, "reason": "full load", "depth": 0.0, "jumps": 0, "dense_min_j": 6e-4, "iterations": 52}
    found = {
        0.1: full,
        0.05: {**full, "jumps": 2, "iterations": 99},
    }

    def measure(function: Any, problem: str, medium: str, alpha: float, gamma: float, cells: str, size: float) -> Any:
        if gamma == 1e-4 and cells == "triangles":
            return {**full, "dense_min_j": -0.02, "depth": 2e-7}
        if gamma == 1e-6 and cells == "triangles":
            return {**full, "load": 0.826, "reason": "solids would overlap: depth 1", "jumps": 1}
        return found[size]

    row = media.summary(measure).splitlines()[2]
    assert row == "| flush | the paper's, 2.5 | 4 of 8 | 7 | 2 | 1 | 2e-07 | 52 to 99 |"
    rows = media.blocks(measure).splitlines()[2:4]
    assert rows[0].endswith("| 1e-04 | 52, J = 6e-04 | 99, 2 jumps, J = 6e-04 | 52, J = 6e-04 | 52, J = -2e-02 |")
    assert rows[1].endswith("| stops at 83 %, would overlap, 1 jump, J = 6e-04 |")


def test_problem_files_get_another_medium() -> None:
    from pages import media

    paper, ours = media.studies.MEDIA.values()
    plain = '[x]\nmedium = { gamma = 1, mu = 2, regulariser = "angle" }\n'
    assert media._in_medium(plain, paper) == plain
    changed = media._in_medium(plain, ours)
    assert changed == f"[x]\nmedium = {{ gamma = 1, mu = 2, {ours} }}\n"
    first = f"\nmedium = {{ {ours}, alpha = 1 }}\n"
    assert media._in_medium(first, paper) == f"\nmedium = {{ {paper}, alpha = 1 }}\n"


def test_the_problems_of_the_guide_are_compared_in_both_media() -> None:
    from pages import media

    def measure(function: Any, text: str) -> dict[str, Any]:
        n = 2 if 'regulariser = "angle"' in text else 1
        return {"load": 1.0, "iterations": 50 * n, "jumps": 0, "gap": 2e-3, "reaction": 0.5, "inverted": n}

    lines = media.demos(measure).splitlines()
    assert lines[2] == "| seal | the paper's | full load | 100 | 0 | 2.00e-03 | 5.0000e-01 | 2 |"
    assert lines[3] == "| seal | balanced (the file's) | full load | 50 | 0 | 2.00e-03 | 5.0000e-01 | 1 |"
    assert lines[4].startswith("| gripper | the paper's (the file's) |")
    assert lines[-1].startswith("Of the two media not every file takes")
