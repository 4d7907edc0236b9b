"""Input files of Abaqus and CalculiX as keywords with their parameters and data lines, those of included files too."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tmc_vem.mesh.files.text import lines_of
from tmc_vem.support.errors import InputError

OUTSIDE_QUOTES = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')
DEEPEST = 10  # files that include each other


@dataclass
class Keyword:
    """A keyword line and the data lines after it.

    Attributes:
        name: in capitals, without spaces, such as ``ENDPART``.
        parameters: by name in capitals; a flag has an empty value.
        data: fields of the data lines, without spaces around them.
        where: file and line, for messages.
    """

    name: str
    parameters: dict[str, str]
    where: str
    data: list[list[str]] = field(default_factory=list)

    def get(self, *names: str) -> str | None:
        """The first of these parameters that is there and not empty."""
        return next((self.parameters[name] for name in names if self.parameters.get(name)), None)


def keywords_of(path: Path, depth: int = 0) -> Iterator[Keyword]:
    """The keywords of a file, in order.

    Raises:
        InputError: an included file is not there, or files include each other.
    """
    if depth > DEEPEST:
        raise InputError(f"{path.name} is included in itself")
    current: Keyword | None = None
    before = ""
    for n, line in lines_of(path):
        if not line or line.startswith("**"):
            continue
        if line.startswith("*") or before:
            if line.endswith(","):  # a keyword line goes on
                before += line
                continue
            if current is not None:
                yield from _finished(current, path, depth)
            current = _keyword(before + line, f"line {n}" if depth == 0 else f"{path.name}, line {n}")
            before = ""
        elif current is not None:
            current.data.append(_fields(line))
    if current is not None:
        yield from _finished(current, path, depth)


def _finished(keyword: Keyword, path: Path, depth: int) -> Iterator[Keyword]:
    if keyword.name != "INCLUDE":
        yield keyword
        return
    name = keyword.get("INPUT")
    included = path.parent / name if name else None
    if included is None or not included.is_file():
        raise InputError(f"{keyword.where}: *INCLUDE names the file '{name or ''}', which is not there")
    yield from keywords_of(included, depth + 1)


def _keyword(line: str, where: str) -> Keyword:
    name, *parameters = _fields(line)
    found = {}
    for parameter in parameters:
        key, _, value = parameter.partition("=")
        found["".join(key.split()).upper()] = value.strip().strip('"')
    return Keyword("".join(name[1:].split()).upper(), found, where)


def _fields(line: str) -> list[str]:
    """Fields between commas that are not in quotes."""
    return [part.strip() for part in (OUTSIDE_QUOTES.split(line) if '"' in line else line.split(","))]
