"""Runs below a directory, and the inputs in which they differ."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from tmc_vem.errors import InputError
from tmc_vem.report.tables import flat
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


def differing(runs: Mapping[str, RunResult]) -> tuple[list[str], dict[str, list[str]]]:
    """Names of the inputs in which runs differ, and their values by run; '–' where a run does not have one."""
    inputs = {name: dict(flat(run.inputs)) for name, run in runs.items()}
    names = list(dict.fromkeys(key for values in inputs.values() for key in values))
    chosen = [key for key in names if len({values.get(key) for values in inputs.values()}) > 1]
    return chosen, {name: [values.get(key, "–") for key in chosen] for name, values in inputs.items()}
