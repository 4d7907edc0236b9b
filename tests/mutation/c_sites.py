"""Faults in C: signs, comparisons, numbers, indices, names, and statements that are left out."""

from __future__ import annotations

import re
from collections.abc import Iterator

from mutation.constants import changed_number
from mutation.site import Site
from mutation.swaps import C_OPERATORS, NAMES

# Comments, strings and directives are passed over as a whole.
_TOKEN = re.compile(
    r"(?P<skipped>/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])+'|^[ \t]*\#(?:\\\n|[^\n])*)"
    r"|(?P<number>(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.]))"
    r"|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<binary>(?<=[\w)\]] )(?:\+=|-=|\*=|==|!=|<=|>=|&&|\|\||[-+*/%<>])(?= ))"
    r"|(?P<sign>(?<=[(=,*/+] )-(?=[\w(])|(?<=[(\[])-(?=[\w(]))",
    re.MULTILINE | re.DOTALL,
)
_INDICES = re.compile(r"\[(\w+)\]\[(\w+)\]")
_ASSIGNMENT = re.compile(
    r"^[ \t]*(?!return\b|for\b|if\b)\w[\w.>\[\]\-]*(?:\[[^=\n;]*\])? [-+*/]?= [^;\n{}]*;$", re.MULTILINE
)

Stretch = tuple[int, int, tuple[str, ...], str]


def c_sites(file: str, text: str) -> Iterator[Site]:
    """All sites of a C source."""
    yield from (Site(file, *stretch) for stretch in stretches(text))


def stretches(text: str) -> Iterator[Stretch]:
    """Start, end, what may stand there, and the kind, for every fault in a C text."""
    skipped = []
    for token in _TOKEN.finditer(text):
        start, end = token.span()
        word = token.group()
        if token["skipped"]:
            skipped.append((start, end))
        elif token["number"] and (options := changed_number(word)):
            yield start, end, options, "number"
        elif token["name"] and word in NAMES and text[end : end + 1] == "(":
            yield start, end, (NAMES[word],), "name"
        elif token["binary"]:
            yield start, end, C_OPERATORS[word], "operator"
        elif token["sign"]:
            yield start, end, ("",), "sign"
    for found in _INDICES.finditer(text):
        if found[1] != found[2] and not _within(found.start(), skipped):
            yield (*found.span(), (f"[{found[2]}][{found[1]}]",), "indices")
    for found in _ASSIGNMENT.finditer(text):
        if not _within(found.start(), skipped):
            start = found.end() - len(found.group().lstrip())
            yield start, found.end(), (";",), "statement deleted"


def _within(place: int, stretches_: list[tuple[int, int]]) -> bool:
    return any(start <= place < end for start, end in stretches_)
