"""Pages of the documentation that have figures between ``<!-- name -->`` and ``<!-- /name -->``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path


def table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown table, numbers to the right."""
    marks = ["---", *["---:"] * (len(heading) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (heading, marks, *rows))


def fill(page: Path, parts: Mapping[str, Callable[[], str]]) -> None:
    """Replace what stands between the marks of all parts.

    Raises:
        SystemExit: the page has no place for one of them; nothing is written then.
    """
    text = page.read_text()
    for name, write in parts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(\n?<!-- /{name} -->)", re.DOTALL)
        if not pattern.search(text):
            raise SystemExit(f"{page} has no place for {name}")
        body = write()
        text = pattern.sub(lambda match, body=body: f"{match[1]}{body}\n<!-- /{match[0].split()[1]} -->", text)
    page.write_text(text)
