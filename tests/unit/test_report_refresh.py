"""Numbers in documents come from runs."""

from __future__ import annotations

import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from tmc_vem.report.page import Section, Table, Text
from tmc_vem.report.refresh import block_names, replaced, section_markdown, texts
from tmc_vem.report.rounding import differences
from tmc_vem.support.errors import InputError

ROOT = Path(__file__).parents[2]
HEAD = "| mesh | gap | steps |\n|---|---|---|\n"
DOCUMENT = "before\n<!-- numbers: gap -->\n\nold\n\n<!-- end of numbers -->\nafter\n"


def test_only_the_block_changes() -> None:
    new = replaced(DOCUMENT, "gap", "new")
    assert new == DOCUMENT.replace("old", "new")
    assert replaced(new, "gap", "new") == new
    assert replaced(DOCUMENT, "reaction", "new") == DOCUMENT
    assert texts(new) == {"gap": "new"}
    empty = "<!-- numbers: gap -->\n\n<!-- end of numbers -->\n"
    assert texts(empty) == {"gap": ""}
    assert texts(replaced(empty, "gap", "new")) == {"gap": "new"}


def test_an_open_block_is_refused() -> None:
    with pytest.raises(InputError, match="has no"):
        block_names("<!-- numbers: gap -->\n")


def test_a_section_as_markdown() -> None:
    section = Section("S", [Text("text"), Table("caption", ("a", "b"), [["1", "2"]])])
    assert section_markdown(section) == "text\n\ncaption\n\n| a | b |\n|---|---|\n| 1 | 2 |"


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("gap 2.0031e-03", "gap 2.0032e-03", []),  # one unit of the last digit is rounding
        ("gap 2.0031e-03", "gap 2.0033e-03", ["2.0031e-03 -> 2.0033e-03"]),
        ("gap 2.0031e-03", "gap 2.0031e-04", ["2.0031e-03 -> 2.0031e-04"]),
        ("off by +0.01 %", "off by -0.00 %", []),
        ("off by +0.02 %", "off by -0.02 %", ["+0.02 -> -0.02"]),
        ("2.999", "3.000", []),
        ("8.1e-3 ± 4e-05", "8.1e-3 ± 5e-05", []),
        ("8.1e-3 ± 4e-05", "8.1e-3 ± 6e-05", ["4e-05 -> 6e-05"]),
        ("gamma = 1e-05", "gamma = 2e-05", ["1e-05 -> 2e-05"]),  # a number without a point is no result
        ("40 x 10 cells", "41 x 10 cells", ["40 -> 41"]),
        ("69 iterations", "71 iterations", []),  # work may depend on rounding
        ("40 iterations", "43 iterations", ["40 -> 43"]),
        ("300 iterations", "315 iterations", []),
        ("300 iterations", "316 iterations", ["300 -> 316"]),
        ("69 in 18", "71 in 19", []),
        ("69 in 18", "71 in 25", ["18 -> 25"]),
        ("full load", "stops at 22 % of the load", ["full load -> stops at 22 % of the load"]),
        ("a\nb", "a", ["b -> nothing"]),
        ("3 hanging nodes", "4 hanging nodes", ["3 -> 4"]),
        (f"{HEAD}| 40 | 1.0 | 18 |", f"{HEAD}| 40 | 1.0 | 20 |", []),
        (f"{HEAD}| 40 | 1.0 | 18 |", f"{HEAD}| 41 | 1.0 | 18 |", ["40 -> 41"]),
    ],
)  # fmt: skip
def test_what_is_rounding_and_what_is_not(old: str, new: str, found: list[str]) -> None:
    assert [str(difference).rsplit(" (", 1)[0] for difference in differences(old, new)] == found
    assert differences(new, new) == []


@pytest.mark.parametrize("name", ["refresh-numbers", "make-pictures"])
def test_the_scripts_find_what_they_import(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither mypy nor another test looks at them, and what they do takes long."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec = spec_from_loader("script", SourceFileLoader("script", str(ROOT / "scripts" / name)))
    assert spec is not None
    assert spec.loader is not None
    spec.loader.exec_module(module_from_spec(spec))
