"""Problem files: a problem and how it is solved, in one TOML file; ``docs/guide/problem-files.md`` has the schema."""

from __future__ import annotations

import dataclasses
import re
import tomllib
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tmc_vem.problems.cell_size import size_text
from tmc_vem.problems.description import ProblemTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.options import RunOptions
from tmc_vem.support.assignments import changed, said
from tmc_vem.support.errors import InputError
from tmc_vem.support.toml_text import as_table, toml_text
from tmc_vem.support.validation import build, shown

# Tables whose entries have names of the user's own. Probes may be added to those of a file, as they change nothing.
NAMED = {
    name
    for name, hint in typing.get_type_hints(ProblemTable).items()
    if typing.get_origin(hint) is Mapping and name not in ("solve", "probes")
}
HEADER = "# The problem of this run as it was solved: 'tmc-vem run' on this file does the same again.\n"


def read_problem(path: str | Path, changes: Mapping[str, Any] | None = None) -> tuple[OwnProblem, RunOptions]:
    """The problem and the run options that a file describes.

    Args:
        path: the file.
        changes: other values for its entries, ``{"regions.block.solid.mu": 20}``; see
            :mod:`tmc_vem.support.assignments` for the names.

    Raises:
        InputError: it cannot be read, has an unknown or wrong entry, or the entries do not fit together. The message
            names the file, the table and, where it can be found, the line; or the change that is at fault.
    """
    path, changes = Path(path), dict(changes or {})
    text, data = _read(path)
    try:
        return _made(data, path, changes)
    except InputError as error:
        message = str(error) if str(error).startswith(path.name) else f"{path.name}: {error}"
        fault = _at_fault(data, path, changes)
        where = _line(text, message) if fault is None else f" ({said(fault, changes[fault])})"
        raise InputError(message + where) from None


def with_changes(problem: OwnProblem, changes: Mapping[str, Any]) -> OwnProblem:
    """A problem with other values for some of its entries, as :func:`read_problem` makes it of a file.

    Raises:
        InputError: there is nothing of a name, or the entries do not fit together.
    """
    table = build(ProblemTable, changed(as_table(problem.table), changes, NAMED), problem.name)
    return OwnProblem(table, problem.directory, {**problem.changes, **changes})


def problem_text(problem: OwnProblem, options: RunOptions) -> str:
    """Problem and run options as a problem file, which may lie anywhere: files in it are named from the root.

    Limits on the work of one run are left out, as nothing but its length depends on them.

    Raises:
        InputError: the size of cells is a function of Python.
    """
    return HEADER + toml_text(solved_table(problem, options))


def can_be_written(problem: OwnProblem) -> bool:
    """Whether a file can have the problem: not if the size of cells is a function of Python."""
    return not callable(problem.table.mesh.size)


def solved_table(problem: OwnProblem, options: RunOptions) -> dict[str, Any]:
    """The tables of :func:`problem_text`.

    Raises:
        InputError: the size of cells is a function of Python.
    """
    size = problem.table.mesh.size
    if callable(size):
        raise InputError(
            f"mesh: size = {size_text(size)} is a function of Python, which no file can have: write it as a formula of "
            "x and y"
        )
    table = as_table(problem.table)
    directory = problem.directory
    if "file" in table["mesh"]:
        table["mesh"]["file"] = str((directory / table["mesh"]["file"]).resolve())
    for region in table["regions"].values():
        for place, key in ((region, "density"), (region.get("medium", {}), "regulariser")):
            if key in place:
                place[key] = from_root(place[key], directory)
        if isinstance(region.get("stiffness"), str):
            region["stiffness"] = str((directory / region["stiffness"]).resolve())
    solve = as_table(dataclasses.replace(options, overwrite=False, max_iterations=None, max_seconds=None))
    if "solver" in solve and Path(solve["solver"]).is_file():
        solve["solver"] = str(Path(solve["solver"]).resolve())
    return {**table, "solve": solve} if solve else {name: of for name, of in table.items() if name != "solve"}


def from_root(wanted: str, directory: Path) -> str:
    """``FILE.py:FUNCTION`` with the whole path of the file, if it is one of the directory's."""
    file, colon, function = wanted.rpartition(":")
    inside = directory / file
    return f"{inside.resolve()}:{function}" if colon and inside.is_file() else wanted


def _read(path: Path) -> tuple[str, dict[str, Any]]:
    """Text and tables of a file.

    Raises:
        InputError: it cannot be read, or is not TOML.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text in UTF-8"
        raise InputError(f"{path} cannot be read: {reason}") from None
    try:
        data: dict[str, Any] = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        reason = str(error) or "nested too deeply"
        twice = re.match(r"Cannot overwrite a value \(at line (\d+)", reason)
        if twice:
            key = text.splitlines()[int(twice[1]) - 1].partition("=")[0].strip()
            raise InputError(f"{path}: {shown(key)} stands twice in its table (line {twice[1]})") from None
        raise InputError(f"{path} is not TOML: {reason}") from None
    return text, data


def _made(data: Mapping[str, Any], path: Path, changes: Mapping[str, Any]) -> tuple[OwnProblem, RunOptions]:
    table = build(ProblemTable, changed(data, changes, NAMED), path.name)
    return OwnProblem(table, path.parent, changes), build(RunOptions, table.solve, f"{path.name}: solve")


def _at_fault(data: Mapping[str, Any], path: Path, changes: Mapping[str, Any]) -> str | None:
    """The first change with which a file is wrong that was right before it; None if the file itself is wrong."""
    names = list(changes)
    for n in range(len(names) + 1):
        try:
            _made(data, path, {name: changes[name] for name in names[:n]})
        except InputError:
            return names[n - 1] if n else None
    return None


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
