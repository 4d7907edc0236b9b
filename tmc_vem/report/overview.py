"""Runs below a directory."""

from __future__ import annotations

from pathlib import Path

from tmc_vem.errors import InputError
from tmc_vem.results import RESULT, RunResult


def find_runs(directory: Path) -> tuple[dict[str, RunResult], list[str]]:
    """All runs in a directory and below it, by path relative to it, and why others are not readable.

    Raises:
        InputError: there is no such directory.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is not a directory")
    runs, unreadable = {}, []
    for path in sorted(directory.rglob(RESULT)):
        try:
            runs[str(path.parent.relative_to(directory))] = RunResult.read(path.parent)
        except InputError as error:
            unreadable.append(str(error))
    return runs, unreadable
