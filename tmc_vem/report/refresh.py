"""Numbers in documents that come from runs: blocks between comments are written anew."""

from __future__ import annotations

import re

from tmc_vem.report.page import Page, Section, Table, Text
from tmc_vem.report.write import to_markdown
from tmc_vem.support.errors import InputError

BLOCK = re.compile(r"(<!-- numbers: (?P<name>[\w-]+) -->\n)(?P<text>.*?)(\n<!-- end of numbers -->)", re.S)


def block_names(document: str) -> list[str]:
    """Names of the blocks of a document, in their order.

    Raises:
        InputError: a block has no end.
    """
    names = [match["name"] for match in BLOCK.finditer(document)]
    started = re.findall(r"<!-- numbers: ([\w-]+) -->", document)
    if names != started:
        raise InputError(f"block '{next(n for n in started if n not in names)}' has no '<!-- end of numbers -->'")
    return names


def texts(document: str) -> dict[str, str]:
    """What the blocks of a document say, by their names.

    Raises:
        InputError: a block has no end.
    """
    block_names(document)
    return {match["name"]: match["text"].strip() for match in BLOCK.finditer(document)}


def replaced(document: str, name: str, text: str) -> str:
    """The document with another text in one of its blocks."""

    def new(match: re.Match[str]) -> str:
        return f"{match[1]}\n{text.strip()}\n{match[4]}" if match["name"] == name else match[0]

    return BLOCK.sub(new, document)


def section_markdown(section: Section) -> str:
    """Tables and texts of a section as Markdown, without its heading and pictures."""
    kept = [block for block in section.blocks if isinstance(block, Table | Text)]
    text = to_markdown(Page("", "", [Section(section.title, kept)]))
    return text.split("\n## ", 1)[1].partition("\n")[2].strip()
