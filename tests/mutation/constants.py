"""Numbers and strings that are a little wrong."""

from __future__ import annotations

import ast
import re

SMALL = 1e-3  # what is below is a tolerance, of which the power of ten matters
_KEY = re.compile(r"[A-Za-z][\w.:-]{0,29}")
_LITERAL = re.compile(r"""[rRbB]?(["'])[\w.:-]+\1""")


def changed_number(text: str) -> tuple[str, ...]:
    """Numbers in the place of one that is written so, in Python or C; none if it is not decimal."""
    plain = text.replace("_", "")
    if re.fullmatch(r"\d+", plain):
        value = int(plain)
        return (str(value + 1), *((str(value - 1),) if value else ()))
    if not re.fullmatch(r"[\d.]+(e[+-]?\d+)?", plain, re.IGNORECASE):
        return ()
    number = float(plain)
    if number == 0:
        return ("1.0",)
    if number < SMALL:
        return (f"{10 * number:.6g}", f"{0.1 * number:.6g}")
    larger = f"{1.1 * number:.12g}"
    return (larger if "." in larger or "e" in larger else f"{larger}.0",)


def changed_string(text: str) -> tuple[str, ...]:
    """Another key in the place of one that is written so; none if it is not written as one literal."""
    return (f"{text[:-1]}_{text[-1]}",) if _LITERAL.fullmatch(text) else ()


def is_key(node: ast.Constant, parent: ast.AST | None, words: bool) -> bool:
    """Whether the program does something else for another string, as far as its place says.

    Args:
        node: the string.
        parent: the node above it.
        words: it is in a module that writes mostly for people, where only what is looked up or compared counts.
    """
    if not isinstance(node.value, str) or not _KEY.fullmatch(node.value):
        return False
    if isinstance(parent, ast.Subscript | ast.Compare):
        return True
    if isinstance(parent, ast.Dict):
        return not words or node in parent.keys
    return not words
