"""Tractions along the surface of the solids as a table: ``contact.csv``, a row a station."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.problems.contact_quantities import joint_of
from tmc_vem.results.contact.curves import COLUMNS, FRICTION_COLUMNS, Column, ContactCurves, FrictionCurves
from tmc_vem.results.records import heading
from tmc_vem.support.errors import InputError
from tmc_vem.support.files import write_atomically
from tmc_vem.support.units import Units

BODY, FACES, CLOSED = "body", "faces", "closed"


def write_table(path: Path, curves: ContactCurves, units: Units) -> None:
    """Write a table; what a problem declares as units stands in the headings.

    Raises:
        OSError: it could not be written.
    """
    text = io.StringIO()
    writer = csv.writer(text)
    columns = [*COLUMNS, *(FRICTION_COLUMNS if curves.friction is not None else ())]
    names = [heading(column.name, units.of(column.kind) if units.declared else "") for column in columns]
    writer.writerow([BODY, FACES, CLOSED, *names])
    values = np.column_stack([_values(curves, column) for column in columns])
    for n, row in enumerate(values.tolist()):
        faces = "" if curves.faces_n[n] < 0 else curves.bodies[curves.faces_n[n]]
        closed = int(curves.closed_l[curves.line_n[n]])
        plain = ["" if math.isnan(value) else int(value) if column.name == "line" else value
                 for column, value in zip(columns, row, strict=True)]  # fmt: skip
        writer.writerow([curves.bodies[curves.body_n[n]], faces, closed, *plain])
    write_atomically(path, text.getvalue())


def read_table(path: Path) -> ContactCurves:
    """What stands in a table.

    Raises:
        InputError: it is missing or not readable.
    """
    try:
        reader = csv.DictReader(io.StringIO(path.read_text()))
        names = {heading: heading.partition(" [")[0] for heading in reader.fieldnames or ()}
        missing = {BODY, FACES, CLOSED, *(column.name for column in COLUMNS)} - set(names.values())
        if missing:
            raise KeyError(min(missing))
        return _curves([{names[heading]: value for heading, value in row.items()} for row in reader])
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except (KeyError, ValueError, AttributeError, TypeError, IndexError) as error:
        raise InputError(f"{path} is not a readable table of contact: {error}") from None


def _curves(rows: list[dict[str, str]]) -> ContactCurves:
    friction = None
    if rows and FRICTION_COLUMNS[0].name in rows[0]:
        friction = FrictionCurves(**{column.field: _numbers(rows, column) for column in FRICTION_COLUMNS})
    bodies = tuple(dict.fromkeys(row[BODY] for row in rows))
    number = {name: n for n, name in enumerate(bodies)} | {"": -1}
    fields: dict[str, list[NDArray[np.float64]]] = {}
    for column in COLUMNS:
        fields.setdefault(column.field, []).append(_numbers(rows, column))
    arrays = {name: parts[0] if len(parts) == 1 else np.column_stack(parts) for name, parts in fields.items()}
    line = arrays.pop("line_n").astype(np.int64)
    return ContactCurves(
        bodies=bodies,
        joint=joint_of(bodies),
        closed_l=np.array([rows[first][CLOSED] == "1" for first in np.unique(line, return_index=True)[1].tolist()]),
        body_n=np.array([number[row[BODY]] for row in rows]),
        line_n=line,
        faces_n=np.array([number[row[FACES]] for row in rows]),
        friction=friction,
        **arrays,
    )


def _numbers(rows: list[dict[str, str]], column: Column) -> NDArray[np.float64]:
    return np.array([float(row[column.name] or "nan") for row in rows])


def _values(curves: ContactCurves, column: Column) -> NDArray[np.float64]:
    of = curves.friction if column in FRICTION_COLUMNS else curves
    values: NDArray[np.float64] = np.asarray(getattr(of, column.field), dtype=np.float64)
    return values if column.component is None else values[:, column.component]


def units_of_table(units: Units) -> Mapping[str, str]:
    """Units of the columns by name."""
    return {column.name: units.of(column.kind) for column in (*COLUMNS, *FRICTION_COLUMNS)}
