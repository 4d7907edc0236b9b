"""Text on a terminal as it is: names of problems, regions and runs are no markup, and no codes for the terminal."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from tmc_vem.support.validation import printable


def plain(text: str, style: str = "") -> Text:
    """A text for rich that shows every character; line breaks and other controls as Python writes them."""
    return Text(printable(text), style=style)


def names_and_values(rows: Sequence[tuple[str, str]], styles: dict[str, str] | None = None) -> Table:
    """A table of two columns without lines.

    Args:
        rows: names and values.
        styles: of rows by their name; names are bold.
    """
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column()
    table.add_column(justify="left")
    for name, value in rows:
        style = (styles or {}).get(name, "")
        table.add_row(plain(name, f"bold {style}".strip()), plain(value, style))
    return table
