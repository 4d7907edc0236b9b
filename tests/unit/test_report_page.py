"""Pages: one file without others, every footnote numbered, text that cannot become markup."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import pytest

from tmc_vem.report.page import Entry, Page, Section, Table, Text, Warnings, picture
from tmc_vem.report.plots import rate
from tmc_vem.report.tables import flat, number, percent, relative
from tmc_vem.report.write import to_html, to_markdown, write_page


def _figure() -> object:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1], [0, 1])
    return figure


@pytest.fixture(scope="module")
def page() -> Page:
    table = Table(
        "Gaps",
        ("a|b", "gap"),
        [["x", Entry("1", "first", "suspect")], ["y", Entry("2", "second")], ["z", Entry("3", "first", "suspect")]],
    )
    blocks = [
        Text("1 < 2 & <script>"),
        Warnings(["careful"]),
        Warnings([]),
        table,
        picture(_figure(), "line", "A line."),
    ]
    return Page("Title <b>", "lead", [Section("Section", blocks)])


def test_html_needs_no_other_file(page: Page) -> None:
    html = to_html(page)
    assert not re.search(r'(src|href)="(?!data:|#)', html)
    assert "url(" not in html
    assert "<script" not in html.replace("&lt;script", "")
    assert "Title &lt;b&gt;" in html
    assert html.count("<img ") == 1
    uri = re.search(r'src="data:image/svg\+xml;base64,([^"]+)"', html)
    assert uri
    assert base64.b64decode(uri.group(1)) == page.pictures[0].svg


@pytest.mark.parametrize(("inline", "mime", "start"), [("svg", "svg+xml", b"<?xml"), ("png", "png", b"\x89PNG")])
def test_a_picture_stands_in_the_page_in_the_format_that_it_says(inline: str, mime: str, start: bytes) -> None:
    head, _, data = picture(_figure(), "line", "", inline=inline).uri.partition(",")
    assert head == f"data:image/{mime};base64"
    assert base64.b64decode(data).startswith(start)


def test_equal_notes_share_a_number(page: Page) -> None:
    html = to_html(page)
    assert re.findall(r"(\d)<sup>(\d)</sup>", html) == [("1", "1"), ("2", "2"), ("3", "1")]
    assert html.count("<li>first</li>") == 1
    assert html.count('class="suspect"') == 2
    assert "(1) first" in to_markdown(page)


def test_markdown_tables_have_equal_columns(page: Page) -> None:
    lines = [line for line in to_markdown(page).splitlines() if line.startswith("|")]
    assert len(lines) == 5
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {3}
    assert "- **Warning:** careful" in to_markdown(page)
    assert "No warnings." in to_markdown(page)


def test_files_are_written(page: Page, tmp_path: Path) -> None:
    html = write_page(page, tmp_path / "deep", "report")
    assert html.read_text() == to_html(page)
    figures = tmp_path / "deep" / "figures"
    assert (figures / "line.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (figures / "line.svg").read_bytes()
    assert "](figures/line.png)" in (tmp_path / "deep" / "report.md").read_text()


def test_equal_figures_give_equal_files() -> None:
    assert picture(_figure(), "line", "").svg == picture(_figure(), "line", "").svg


def test_numbers() -> None:
    assert number(None) == "–"
    assert number(0.00200534) == "2.0053e-03"
    assert percent(-0.0123) == "-1.23 %"
    assert relative(2.02, 2.0) == pytest.approx(0.01)
    assert relative(None, 2.0) is None
    assert relative(2.0, None) is None
    assert flat({"medium": {"gamma": 1e-5}, "cells": [1, 2]}) == [("medium.gamma", "1e-05"), ("cells", "[1, 2]")]


def test_rate_of_a_power_law() -> None:
    sizes = [100.0, 400.0, 1600.0]
    assert rate(sizes, [7.0 * n**-1.5 for n in sizes]) == pytest.approx(1.5)
    assert rate([1.0], [1.0]) is None
