"""Formulas as MathML, which browsers draw themselves: the pages need neither a network nor scripts."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.errors import ExtensionError


def setup(app: Any) -> dict[str, bool]:
    """Register the writers of formulas."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: Any, node: Any) -> None:
    writer.body.append(_mathml(node, "inline"))
    raise nodes.SkipNode


def _display(writer: Any, node: Any) -> None:
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    if node.get("number"):
        writer.body.append(f'<span class="eqno">({node["number"]})</span>')
    writer.body.append(_mathml(node, "block") + "</div>\n")
    raise nodes.SkipNode


def _mathml(node: Any, display: str) -> str:
    try:
        return str(convert(node.astext(), display=display))
    except Exception as error:  # the converter raises whatever it meets
        raise ExtensionError(f"formula '{node.astext()}' is not understood: {error!r}") from error
