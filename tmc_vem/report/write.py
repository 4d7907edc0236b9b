"""A page as self-contained HTML, as Markdown beside its figures, and its figures as files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from tmc_vem.report.page import Page
from tmc_vem.support.files import write_atomically

FIGURES = "figures"


def write_page(page: Page, directory: Path, stem: str = "report") -> Path:
    """Write ``<stem>.html``, ``<stem>.md`` and ``figures/*.svg`` and ``*.png``.

    Returns:
        Path of the HTML file. It needs no other file and no network.
    """
    directory.mkdir(parents=True, exist_ok=True)
    if page.pictures:
        (directory / FIGURES).mkdir(exist_ok=True)
    for picture in page.pictures:
        (directory / FIGURES / f"{picture.name}.svg").write_bytes(picture.svg)
        (directory / FIGURES / f"{picture.name}.png").write_bytes(picture.png)
    write_atomically(directory / f"{stem}.md", to_markdown(page))
    html = directory / f"{stem}.html"
    write_atomically(html, to_html(page))
    return html


def to_html(page: Page) -> str:
    """The page as one HTML document with its pictures in it."""
    return _render("page.html.j2", page, autoescape=True)


def to_markdown(page: Page) -> str:
    """The page as Markdown that shows the files in ``figures``."""
    return _render("page.md.j2", page, autoescape=False)


def _render(template: str, page: Page, *, autoescape: bool) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("tmc_vem.report"),
        autoescape=autoescape,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["markdown"] = _markdown
    text: Any = environment.get_template(template).render(page=page, figures=FIGURES)
    return str(text)


# what Markdown would read: code, emphasis, links, HTML and formulas; an underscore inside a word means nothing to it
_MARKS = re.compile(r"[\\`*\[\]<>$|~]|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])")


def _markdown(text: str) -> str:
    """Text that Markdown shows as it is, in one line; bars would end a table's column."""
    return _MARKS.sub(r"\\\g<0>", " ".join(text.split("\n")))
