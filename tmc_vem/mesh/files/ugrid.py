"""UGRID netCDF files (.nc): unstructured meshes of oceans, rivers and the like, with faces of any number of sides.

Conventions: https://ugrid-conventions.github.io/ugrid-conventions/
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.cell_data import NONE, add_groups, unquoted
from tmc_vem.mesh.files.netcdf import Variable, variables_of
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]


def read(path: Path, reading: Reading) -> Record:
    """Read a .nc file.

    Raises:
        InputError: it is no netCDF file, or has no mesh of faces.
    """
    variables = variables_of(path)
    topologies = [
        v for v in variables.values() if v.text("cf_role") == "mesh_topology" and v.text("face_node_connectivity")
    ]
    if not topologies:
        raise InputError("it has no mesh_topology with face_node_connectivity: it is no UGRID file of plane cells")
    mesh = topologies[0]
    coordinates = [_variable(variables, name) for name in mesh.text("node_coordinates").split()]
    if len(coordinates) < 2:
        raise InputError(f"node_coordinates = '{mesh.text('node_coordinates')}' must name two variables")
    points = np.stack([np.asarray(v.values, dtype=float).ravel() for v in coordinates[:2]], axis=1)
    table = _variable(variables, mesh.text("face_node_connectivity"))
    faces = mesh.text("face_dimension")
    if not faces or faces not in table.dimensions:
        faces = table.dimensions[0] if table.dimensions else ""
    rows = table.values.T if len(table.dimensions) == 2 and table.dimensions[1] == faces else table.values
    record = Record(points, _loops(rows, table))
    if len(topologies) > 1:
        record.notes.append(f"it has {len(topologies)} meshes of faces, of which the first is read")
    data = {
        name: v.values
        for name, v in variables.items()
        if v.dimensions == (faces,) and v.values.dtype.kind in "iuf" and v is not table
    }
    add_groups(record, data, np.arange(len(record.loops)), reading.region_data)
    _own_names(record, variables)
    return record


def _variable(variables: dict[str, Variable], name: str) -> Variable:
    if name not in variables:
        raise InputError(f"it has no variable '{name}', which its mesh_topology names")
    return variables[name]


def _loops(rows: NDArray[np.generic], table: Variable) -> list[Int]:
    """Nodes of every face, from 0, without what fills up the rows."""
    if rows.ndim != 2 or rows.dtype.kind not in "iuf":
        raise InputError(f"its faces have shape {rows.shape}: they need the nodes of a face in a row")
    start = int(table.number("start_index") or 0)
    fill = table.number("_FillValue")
    there = np.isfinite(rows.astype(float)) if rows.dtype.kind == "f" else np.ones(rows.shape, dtype=bool)
    if fill is not None and np.isfinite(fill):
        there &= rows != np.asarray(fill).astype(rows.dtype)
    numbers = np.where(there, rows, start).astype(np.int64) - start
    there &= numbers >= 0  # some fill up with -1, or with 0 where nodes count from 1, and do not say so
    late = np.flatnonzero((there[:, 1:] & ~there[:, :-1]).any(axis=1))
    if len(late):
        raise InputError(f"face {late[0]} has a node after one that is missing")
    return [row[mask] for row, mask in zip(numbers, there, strict=True)]


def _own_names(record: Record, variables: dict[str, Variable]) -> None:
    """Names that this program writes: of regions as meanings of flags, of points and edges as variables."""
    for name, v in sorted(variables.items(), key=lambda item: (len(item[0]), item[0])):
        meanings = [unquoted(word) for word in v.text("flag_meanings").split()]
        values = np.ravel(v.attributes.get("flag_values", NONE))
        if name == "region" and len(values) == len(meanings):
            known = dict(zip(values.tolist(), meanings, strict=True))
            for group in record.regions:
                group.name = known.get(group.number, group.name)
        for prefix, groups in (("edges_", record.edges), ("point_", record.nodes)):
            if name.startswith(prefix) and v.text("tmc_vem"):
                numbers = v.values.astype(np.int64)
                if numbers.size and (numbers.min() < 0 or numbers.max() >= len(record.points)):
                    raise InputError(f"'{name}' has a node that is not there")
                shaped = numbers.reshape(-1, 2) if prefix == "edges_" else numbers.ravel()
                groups.append(Group(shaped, unquoted(v.text("tmc_vem"))))
