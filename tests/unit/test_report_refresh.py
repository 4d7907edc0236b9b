"""Numbers in documents come from runs."""

from __future__ import annotations

from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from tmc_vem.report.page import Section, Table, Text
from tmc_vem.report.refresh import block_names, refreshed, section_markdown
from tmc_vem.support.errors import InputError

ROOT = Path(__file__).parents[2]
DOCUMENT = "before\n<!-- numbers: gap -->\n\nold\n\n<!-- end of numbers -->\nafter\n"


def test_only_the_block_changes() -> None:
    new = refreshed(DOCUMENT, {"gap": lambda: "new"})
    assert new == DOCUMENT.replace("old", "new")
    assert refreshed(new, {"gap": lambda: "new"}) == new
    assert refreshed("no blocks", {}) == "no blocks"


def test_unknown_and_open_blocks_are_refused() -> None:
    with pytest.raises(InputError, match="'gap'"):
        refreshed(DOCUMENT, {"reaction": lambda: ""})
    with pytest.raises(InputError, match="has no"):
        block_names("<!-- numbers: gap -->\n")


def test_a_section_as_markdown() -> None:
    section = Section("S", [Text("text"), Table("caption", ("a", "b"), [["1", "2"]])])
    assert section_markdown(section) == "text\n\ncaption\n\n| a | b |\n|---|---|\n| 1 | 2 |"


@pytest.mark.parametrize(
    ("name", "blocks"),
    [
        ("README.md", ["readme"]),
        ("docs/reproduction.md", ["table2-fem", "table2-meshes", "table2-vem", "table3", "fig4", "figures"]),
    ],
)
def test_documents_have_their_blocks_filled(name: str, blocks: list[str]) -> None:
    document = (ROOT / name).read_text()
    assert block_names(document) == blocks
    for part in document.split("<!-- numbers: ")[1:]:
        assert "|---|" in part.split("<!-- end of numbers -->")[0]


@pytest.mark.parametrize("name", ["refresh-numbers", "make-pictures"])
def test_the_scripts_find_what_they_import(name: str) -> None:
    """Neither mypy nor another test looks at them, and what they do takes long."""
    spec = spec_from_loader("script", SourceFileLoader("script", str(ROOT / "scripts" / name)))
    assert spec is not None
    assert spec.loader is not None
    spec.loader.exec_module(module_from_spec(spec))
