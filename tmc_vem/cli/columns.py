"""Text on a terminal as it is: names of problems, regions and runs are no markup, and no codes for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from tmc_vem.support.validation import printable

if TYPE_CHECKING:
    from tmc_vem.report.page import Table as PageTable

# width of what does not go to a terminal: no line is broken, so that other programs can read it
WHOLE = 10_000


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


def show_table(table: PageTable) -> None:
    """Print a table of a page; a pipe gets whole lines."""
    console = Console()
    shown = Table(box=None, pad_edge=False)
    for head in table.head:
        shown.add_column(plain(head, "bold"))
    for row in table.cells:
        shown.add_row(*(plain(cell.text) for cell in row))
    (console if console.is_terminal else Console(width=WHOLE)).print(shown)
