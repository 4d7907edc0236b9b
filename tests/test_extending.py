"""Every example of docs/extending.md works on a copy of the sources, and touches no more files than the page says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers_process import clean_environment

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/extending.md").read_text()
BLOCK = re.compile(r"^```(python|sh|diff)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
EXAMPLES = {title: BLOCK.findall(text) for title, text in SECTIONS.items() if BLOCK.search(text)}
NEW_FILE = re.compile(r"# ((?:tmc_vem|codegen)/\S+\.py)\n")


def changed(text: str, lines: list[str]) -> str:
    """A source after the lines of a diff: runs of old lines, each found once, become the new ones."""
    if all(line.startswith("+") for line in lines):
        return text + "".join(f"{line[1:]}\n" for line in lines)
    for hunk in hunks(lines):
        old = "".join(f"{line[1:]}\n" for line in hunk if line[0] in " -")
        new = "".join(f"{line[1:]}\n" for line in hunk if line[0] in " +")
        if old.endswith(",\n") and text.count(old) == 0:  # the begin of a line
            old, new = old.rstrip("\n"), new.rstrip("\n")
        assert text.count(old) == 1, f"the page changes what is there {text.count(old)} times:\n{old}"
        text = text.replace(old, new)
    return text


def hunks(lines: list[str]) -> Iterator[list[str]]:
    """Parts of a diff with one run of new lines each, which has its old lines before or after it."""
    hunk: list[str] = []
    for line in lines:
        done = hunk and any(part[0] == "+" for part in hunk) and any(part[0] in " -" for part in hunk)
        if done and line[0] != "+":
            yield hunk
            hunk = []
        hunk.append(line)
    yield hunk


def apply(language: str, text: str, sources: Path) -> str:
    """The file that a block makes or changes, or nothing."""
    if language == "diff":
        head, *lines = text.splitlines()
        name = head.removeprefix("--- ")
        path = sources / name
        path.write_text(changed(path.read_text(), [line or " " for line in lines]))
        return name
    match = NEW_FILE.match(text) if language == "python" else None
    if not match:
        return ""
    path = sources / match[1]
    assert not path.exists()
    path.write_text(text[match.end() :])
    return match[1]


@pytest.mark.parametrize("title", EXAMPLES)
def test_the_example_works(title: str, tmp_path: Path) -> None:
    sources, work = tmp_path / "sources", tmp_path / "work"
    work.mkdir()
    for package in ("tmc_vem", "codegen"):
        shutil.copytree(ROOT / package, sources / package, ignore=shutil.ignore_patterns("__pycache__"))
    touched = [apply(language, text, sources) for language, text in EXAMPLES[title]]
    files = set(touched) - {""}
    assert len(files) == 2, files
    (row,) = (row for row in PAGE.splitlines() if row.startswith(f"| {title[0].lower()}{title[1:]} |"))
    if "the same two" not in row and "its dataclass" not in row:
        assert all(name in row or f"`{Path(name).parent}`" in row or Path(name).name in row for name in files), row
    environment = {
        **clean_environment(),
        "PYTHONPATH": str(sources),
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    for (language, text), file in zip(EXAMPLES[title], touched, strict=True):
        if file:
            continue
        command = [sys.executable, "-c", text] if language == "python" else ["bash", "-euo", "pipefail", "-c", text]
        done = subprocess.run(
            command, cwd=work, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("title", EXAMPLES)
def test_the_example_does_not_work_without_its_changes(title: str, tmp_path: Path) -> None:
    """It says so: what the page adds is not there already."""
    for language, text in EXAMPLES[title]:
        if language == "diff":
            name, *lines = text.splitlines()
            source = (ROOT / name.removeprefix("--- ")).read_text()
            new = [line[1:] for line in lines if line.startswith("+") and line[1:].strip()]
            assert not all(line in source.splitlines() for line in new)
        elif NEW_FILE.match(text):
            assert not (ROOT / text.splitlines()[0][2:]).exists()


def test_every_kind_is_on_the_page() -> None:
    kinds = ("A regulariser", "A material", "A problem", "Something to measure", "A setting", "A format of meshes",
             "A projection space")  # fmt: skip
    assert tuple(EXAMPLES) == kinds
    for word in ("A load of another kind", "A field besides the displacement", "Adaptivity", "History"):
        assert f"**{word}" in SECTIONS["What has no place yet"]


def test_files_that_the_page_names_exist() -> None:
    files = set(re.findall(r"`((?:tmc_vem|codegen|tests)/[\w/.]+)`", PAGE))
    assert len(files) > 10
    made = {text.splitlines()[0][2:] for blocks in EXAMPLES.values() for _, text in blocks if NEW_FILE.match(text)}
    assert not [name for name in files - made if not (ROOT / name).exists()]
