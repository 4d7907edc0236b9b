"""Tractions in a run directory: ``contact.csv`` of the last step, tables and lines for every snapshot of the fields.

A table ``contact/step_00005.csv`` and lines ``contact/step_00005.vtu`` belong to the fields ``fields/step_00005.vtu``;
``contact.pvd`` is the collection of the lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tmc_vem.results.contact.curves import ContactCurves
from tmc_vem.results.contact_lines import write_lines
from tmc_vem.results.contact_table import read_table, write_table
from tmc_vem.results.records import CONTACT_FOLDER, CONTACT_LINES, CONTACT_TABLE, Written
from tmc_vem.results.snapshots import nearest, snapshots
from tmc_vem.support.errors import InputError
from tmc_vem.support.units import Units
from tmc_vem.system.fields import write_pvd

Entries = Sequence[tuple[float, Sequence[str]]]  # coordinates on the path, and files of the fields
STEP = "step_"


def write_snapshot(directory: Path, step: int, curves: ContactCurves, units: Units, entries: Entries) -> None:
    """Write the state of a snapshot, and the collection.

    Args:
        directory: of the run.
        step: number of the load step.
        curves: its tractions.
        units: of the problem.
        entries: all snapshots so far.

    Raises:
        OSError: a file could not be written.
    """
    name = directory / CONTACT_FOLDER / f"{STEP}{step:05d}"
    name.parent.mkdir(exist_ok=True)
    write_table(name.with_suffix(".csv"), curves, units)
    write_lines(name.with_suffix(".vtu"), curves, units)
    collect(directory, entries)


def collect(directory: Path, entries: Entries) -> None:
    """Write the collection of the lines that are there."""
    lines = [(load, _belonging_to(Path(name), ".vtu")) for load, (name, *_) in entries]
    there = [(load, [name]) for load, name in lines if (directory / name).exists()]
    write_pvd(directory / CONTACT_LINES, there)


def write_last(directory: Path, curves: ContactCurves, units: Units) -> None:
    """Write the table of the last step.

    Raises:
        OSError: it could not be written.
    """
    write_table(directory / CONTACT_TABLE, curves, units)


def curves_at(result: Written, load: float | None = None) -> ContactCurves:
    """Tractions of the last step, or of the snapshot nearest to a load factor.

    Args:
        result: the run.
        load: factor, or coordinate on the load path; None for the last step.

    Raises:
        InputError: the run has none.
    """
    if result.directory is None:
        raise InputError("the run was kept in memory only: it has no tractions")
    last = result.directory / CONTACT_TABLE
    if not last.exists():
        raise InputError(
            f"{result.directory} has no {CONTACT_TABLE}: no solid is in medium, the run has no result, or it is one of "
            "before tractions were written"
        )
    if load is None:
        return read_table(last)
    fields = nearest(snapshots(result), load).files[0]
    return read_table(result.directory / _belonging_to(fields, ".csv"))


def _belonging_to(fields: Path, suffix: str) -> str:
    """The file of contact that belongs to a file of fields, of one rank or of any, relative to the run directory."""
    number = fields.stem.removeprefix(STEP).partition("_")[0]
    return f"{CONTACT_FOLDER}/{STEP}{number}{suffix}"
