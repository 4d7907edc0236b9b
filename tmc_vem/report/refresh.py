"""Numbers in documents that come from runs: blocks between comments are written anew."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from tmc_vem.report.page import Page, Section, Table, Text
from tmc_vem.report.write import to_markdown
from tmc_vem.support.errors import InputError

BLOCK = re.compile(r"(<!-- numbers: (?P<name>[\w-]+) -->\n).*?(\n<!-- end of numbers -->)", re.S)


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


def refreshed(document: str, blocks: Mapping[str, Callable[[], str]]) -> str:
    """The document with the text of its blocks made anew.

    Raises:
        InputError: a block has a name that nothing is known by, or no end.
    """
    for name in block_names(document):
        if name not in blocks:
            raise InputError(f"no numbers are known by '{name}': choose one of {', '.join(blocks)}")
    return BLOCK.sub(lambda match: f"{match[1]}\n{blocks[match['name']]().strip()}\n{match[3]}", document)


def section_markdown(section: Section) -> str:
    """Tables and texts of a section as Markdown, without its heading and pictures."""
    kept = [block for block in section.blocks if isinstance(block, Table | Text)]
    text = to_markdown(Page("", "", [Section(section.title, kept)]))
    return text.split("\n## ", 1)[1].partition("\n")[2].strip()
