"""Runs below a directory."""

from __future__ import annotations

import os
from pathlib import Path

from tmc_vem.results.design_run import DesignRun
from tmc_vem.results.records import DESIGN, MARKS
from tmc_vem.results.run_result import RunResult
from tmc_vem.support.errors import InputError


def find_runs(directory: Path) -> tuple[dict[str, RunResult], list[str]]:
    """All runs in a directory and below it, by path relative to it, and why others are not readable.

    Runs that go on or were interrupted are among them.

    Raises:
        InputError: there is no such directory, or it cannot be read.
    """
    if not directory.is_dir():
        raise InputError(f"{directory} is not a directory")
    runs, unreadable = {}, []

    def missed(error: OSError) -> None:
        if error.filename == str(directory):
            raise InputError(f"{directory} cannot be read: {error.strerror}")
        unreadable.append(f"{error.filename} cannot be read: {error.strerror}")

    found = [
        Path(path)
        for path, _, names in os.walk(directory, onerror=missed)
        if not {*MARKS}.isdisjoint(names) and DESIGN not in names
    ]
    for path in sorted(found):
        try:
            runs[str(path.relative_to(directory))] = RunResult.read(path)
        except InputError as error:
            unreadable.append(str(error))
    return runs, unreadable


def find_designs(directory: Path) -> tuple[dict[str, DesignRun], list[str]]:
    """All searches for designs in a directory and below it, by path relative to it, and what there is to say of those
    without a result."""
    found, others = {}, []
    for path in sorted(Path(path) for path, _, names in os.walk(directory) if DESIGN in names):
        try:
            found[str(path.relative_to(directory))] = DesignRun.read(path)
        except InputError as error:
            others.append(str(error))
    return found, others
