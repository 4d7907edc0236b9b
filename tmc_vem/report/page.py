"""What a report is made of, independent of the format it is written in."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any


@dataclass(frozen=True)
class Entry:
    """Entry of a table.

    Attributes:
        text: what is shown.
        note: footnote; the same text gets the same number.
        style: '', 'suspect', 'good', 'bad', or 'long' for text that may be wrapped.
    """

    text: str
    note: str = ""
    style: str = ""


@dataclass(frozen=True)
class Table:
    """Table with a caption; entries are texts or :class:`Entry`."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str | Entry]]
    kind: str = field(default="table", init=False)

    @property
    def cells(self) -> list[list[Entry]]:
        """Entries, all as cells."""
        return [[cell if isinstance(cell, Entry) else Entry(cell) for cell in row] for row in self.rows]

    @property
    def notes(self) -> list[str]:
        """Footnotes in the order of their numbers, from 1."""
        return list(dict.fromkeys(cell.note for row in self.cells for cell in row if cell.note))

    @property
    def wrapped(self) -> set[int]:
        """Columns with long texts, from 0."""
        return {n for row in self.cells for n, cell in enumerate(row) if cell.style == "long"}

    def number(self, cell: Entry) -> str:
        """Number of a cell's footnote, or nothing."""
        return str(self.notes.index(cell.note) + 1) if cell.note else ""


@dataclass(frozen=True)
class Picture:
    """Figure in two formats.

    Attributes:
        name: file name without suffix.
        caption: text below it.
        svg, png: the files' contents.
        inline: which of them stands in the page; states with thousands of cells are lighter as png.
    """

    name: str
    caption: str
    svg: bytes = field(repr=False)
    png: bytes = field(repr=False)
    inline: str = "svg"
    kind: str = field(default="picture", init=False)

    @property
    def uri(self) -> str:
        """The picture as a data URI."""
        mime, data = ("image/svg+xml", self.svg) if self.inline == "svg" else ("image/png", self.png)
        return f"data:{mime};base64,{base64.b64encode(data).decode()}"


@dataclass(frozen=True)
class Text:
    """Paragraph."""

    text: str
    kind: str = field(default="text", init=False)


@dataclass(frozen=True)
class Warnings:
    """List of things that a reader must know, errors first; says so if there are none."""

    messages: Sequence[str]
    errors: Sequence[str] = ()
    kind: str = field(default="warnings", init=False)


Block = Table | Picture | Text | Warnings


@dataclass(frozen=True)
class Section:
    """Heading with what stands below it."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """A report."""

    title: str
    lead: str
    sections: Sequence[Section]

    @property
    def pictures(self) -> list[Picture]:
        """All pictures."""
        return [block for section in self.sections for block in section.blocks if isinstance(block, Picture)]


def picture(figure: Any, name: str, caption: str, *, inline: str = "svg") -> Picture:
    """Picture of a matplotlib figure; equal figures give equal files."""
    import matplotlib

    svg, png = BytesIO(), BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(svg, format="svg", metadata={"Date": None}, dpi=150)
        figure.savefig(png, format="png", dpi=150)
    return Picture(name, caption, svg.getvalue(), png.getvalue(), inline)
