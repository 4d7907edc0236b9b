"""The surface of the solids as lines in VTU files with tractions at their points; ParaView warps them as the fields."""

from __future__ import annotations

import base64
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.results.contact.curves import FRICTION_COLUMNS, ContactCurves
from tmc_vem.support.files import write_atomically
from tmc_vem.support.units import COORDINATES, FORCE, LENGTH, NONE, STRESS, Units
from tmc_vem.system.fields import units_label

LINE = 3  # VTK's number of a straight line between two points
TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
# arrays of the points, with what they are in the curves and their kind
POINT_DATA = {
    "traction": ("traction_ni", STRESS),
    "pressure": ("pressure_n", STRESS),
    "shear": ("shear_n", STRESS),
    "medium_pressure": ("medium_pressure_n", STRESS),
    "force": ("force_ni", FORCE),
    "normal": ("normal_nx", NONE),
    "gap": ("gap_n", LENGTH),
    "arc_length": ("arc_length_n", LENGTH),
    "body": ("body_n", NONE),
    "faces": ("faces_n", NONE),
}


def write_lines(path: Path, curves: ContactCurves, units: Units) -> None:
    """Write a state: the stations, with lines from each to the next; ``displacement`` warps them.

    Raises:
        OSError: it could not be written.
    """
    pieces = [np.column_stack([line[:-1], line[1:]]) for line in curves.lines(closing=True)]
    ends = np.concatenate([np.empty((0, 2), dtype=np.int64), *pieces])
    length = units.of(LENGTH)
    moved = _array("displacement", curves.point_nx - curves.reference_nx, length)
    of_friction = FRICTION_COLUMNS if curves.friction is not None else ()
    friction = [_array(each.name, getattr(curves.friction, each.field), units.of(each.kind)) for each in of_friction]
    groups = {
        "Points": [_array(COORDINATES, curves.reference_nx, length)],
        "Cells": [
            _array("connectivity", ends.ravel(), ""),
            _array("offsets", 2 * np.arange(1, len(ends) + 1), ""),
            _array("types", np.full(len(ends), LINE, dtype=np.uint8), ""),
        ],
        "PointData": [moved, *(_array(name, getattr(curves, field), units.of(kind))
                               for name, (field, kind) in POINT_DATA.items()), *friction],
    }  # fmt: skip
    body = "".join(f"      <{group}>\n{''.join(arrays)}      </{group}>\n" for group, arrays in groups.items())
    write_atomically(
        path,
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" header_type="UInt64" '
        f'byte_order="{sys.byteorder.capitalize()}Endian">\n  <UnstructuredGrid>\n'
        f'    <Piece NumberOfPoints="{len(curves)}" NumberOfCells="{len(ends)}">\n{body}'
        "    </Piece>\n  </UnstructuredGrid>\n</VTKFile>\n",
        durable=False,
    )


def _array(name: str, values: NDArray[Any], unit: str) -> str:
    """Values (n,), or vectors (n, 2) of the plane as those of space."""
    if values.ndim > 1:
        values = np.column_stack([values, np.zeros(len(values))])
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    plain = np.ascontiguousarray(values).tobytes()
    text = base64.b64encode(np.array([len(plain)], np.uint64).tobytes() + plain).decode()
    kind = TYPES[values.dtype.str[1:]]
    head = f'type="{kind}" Name="{name}"{components} format="binary"'
    return f"        <DataArray {head}>{text}{units_label(unit)}</DataArray>\n"
