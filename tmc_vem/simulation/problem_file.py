"""Problem files: a problem and how it is solved, in one TOML file; ``docs/guide/problem-files.md`` has the schema."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from tmc_vem.problems.description import ProblemTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.errors import InputError
from tmc_vem.support.validation import build, shown


def read_problem(path: str | Path) -> tuple[OwnProblem, RunOptions]:
    """The problem and the run options that a file describes.

    Raises:
        InputError: it cannot be read, has an unknown or wrong entry, or the entries do not fit together. The message
            names the file, the table and, where it can be found, the line.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise InputError(f"{path} cannot be read: {reason}") from None
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        reason = str(error) or "nested too deeply"
        twice = re.match(r"Cannot overwrite a value \(at line (\d+)", reason)
        if twice:
            key = text.splitlines()[int(twice[1]) - 1].partition("=")[0].strip()
            raise InputError(f"{path}: {shown(key)} stands twice in its table (line {twice[1]})") from None
        raise InputError(f"{path} is not TOML: {reason}") from None
    try:
        problem = OwnProblem(build(ProblemTable, data, path.name), path.parent)
        return problem, build(RunOptions, problem.table.solve, f"{path.name}: solve")
    except InputError as error:
        message = str(error) if str(error).startswith(path.name) else f"{path.name}: {error}"
        raise InputError(message + _line(text, message)) from None


def _line(text: str, message: str) -> str:
    """Where in the file the thing is that a message is about, if clear: a quoted word, or the last key named; in one of
    several tables, within it."""
    quoted = re.findall(r"'([^']+)'", message)[:1]
    keys = re.findall(r"(?:^|: )([\w.-]+)(?=[:=, ]| = )", message)[::-1]
    lines = [line.split("#")[0] for line in text.splitlines()]
    first, last = _entry(lines, message) or (0, len(lines))
    for word in [*quoted, *keys]:
        pattern = re.compile(rf"(?<![\w.-]){re.escape(word)}(?![\w-])")
        found = [n + 1 for n in range(first, last) if pattern.search(lines[n])]
        if len(found) == 1:
            return f" (line {found[0]})"
    return f" (line {first + 1})" if last < len(lines) or first else ""


def _entry(lines: list[str], message: str) -> tuple[int, int] | None:
    """First line of the table ``[[NAME]]`` that a message calls ``NAME, entry N``, and the first one of the next."""
    for name, number in re.findall(r"(\w+), entry (\d+)", message):
        starts = [n for n, line in enumerate(lines) if re.fullmatch(rf"\s*\[\[\s*{name}\s*\]\]\s*", line)]
        if int(number) <= len(starts):
            start = starts[int(number) - 1]
            following = (n for n, line in enumerate(lines) if n > start and line.lstrip().startswith("["))
            return start, next(following, len(lines))
    return None
