"""MATLAB files (.mat) of polygon meshes: nodes and, as a cell array, the nodes of every element, counted from 1.

So PolyMesher (Talischi, Paulino, Pereira, Menezes 2012) has them as Node and Element, mVEM (Yu) as node and elem, and
others as vertices and elements, on their own or in one structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.cell_data import add_groups
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]

NODES = ("node", "nodes", "vertices", "coordinates", "points", "p")
ELEMENTS = ("element", "elements", "elem", "elems", "cells", "faces", "connectivity", "t")


def read(path: Path, reading: Reading) -> Record:
    """Read a .mat file.

    Raises:
        InputError: it is damaged, or has no nodes or elements of a known name.
    """
    variables = _tables(path)
    tables = [t for t in _with_structures(variables) if _of(t, NODES) is not None and _of(t, ELEMENTS) is not None]
    chosen = tables[0] if tables else None
    if chosen is None:
        known = ", ".join(variables) or "none"
        raise InputError(f"it has no Node and Element, nor node and elem (its variables: {known})")
    nodes, elements = _of(chosen, NODES), _of(chosen, ELEMENTS)
    points = np.asarray(nodes, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"its nodes have shape {points.shape}, not (n, 2)")
    record = Record(points, _loops(elements))
    n = len(record.loops)
    data = {
        name: np.asarray(values).ravel()
        for name, values in chosen.items()
        if np.asarray(values).dtype.kind in "iufb" and np.size(values) == n and values is not nodes
    }
    add_groups(record, data, np.arange(n), reading.region_data)
    _own_names(record, chosen)
    return record


def _tables(path: Path) -> dict[str, Any]:
    """Variables of the file by name."""
    import scipy.io

    with path.open("rb") as file:
        start = file.read(520)
    if b"\x89HDF" in (start[:4], start[512:516]):
        return _tables_73(path)
    try:
        found = scipy.io.loadmat(path)
    except Exception as error:  # scipy fails with whatever a bad file leads it to
        raise InputError(f"it is no MATLAB file that scipy can read: {error or type(error).__name__}") from None
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _tables_73(path: Path) -> dict[str, Any]:
    """Variables of a file of version 7.3, which is HDF5: arrays are transposed, cell arrays refer to others."""
    try:
        import h5py
    except ImportError:
        raise InputError(
            "it is of version 7.3: pip install h5py, or save it with save('mesh.mat', ..., '-v7')"
        ) from None

    def value(file: Any, entry: Any) -> Any:
        if isinstance(entry, h5py.Group):
            return {name: value(file, inner) for name, inner in entry.items()}
        if entry.dtype.kind == "O":
            cells = np.empty(entry.shape[::-1], dtype=object)
            for at, reference in np.ndenumerate(np.asarray(entry).T):
                cells[at] = np.asarray(file[reference]).T
            return cells
        return np.asarray(entry).T

    try:
        with h5py.File(path, "r") as file:
            return {name: value(file, entry) for name, entry in file.items() if not name.startswith("#")}
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        raise InputError(f"it is damaged: {error}") from None


def _with_structures(variables: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The variables, then the fields of every structure among them, names in small letters."""
    tables: list[Mapping[str, Any]] = [variables]
    for value in variables.values():
        if isinstance(value, Mapping):
            tables.append(value)
        elif isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            tables.append({name: value.flat[0][name] for name in value.dtype.names})
    return [{name.lower(): value for name, value in table.items()} for table in tables]


def _of(table: Mapping[str, Any], names: Sequence[str]) -> Any:
    return next((table[name] for name in names if isinstance(table.get(name), np.ndarray)), None)


def _loops(elements: NDArray[Any]) -> list[Int]:
    """Nodes of every element, from 0, of a cell array or of a matrix that is filled up with NaN or 0."""
    rows = elements.ravel() if elements.dtype == object else np.atleast_2d(elements)
    loops = []
    for e, row in enumerate(rows):
        values = np.asarray(row)
        if values.dtype.kind not in "iuf":
            raise InputError(f"element {e + 1} is no list of numbers")
        flat = values.ravel().astype(float)
        if elements.dtype != object:
            flat = flat[np.isfinite(flat) & (flat != 0)]
        numbers = np.where(np.isfinite(flat), flat, 0.0).astype(np.int64)
        if (numbers != flat).any() or (numbers < 1).any():
            raise InputError(f"element {e + 1} has a node that is no number from 1 on")
        loops.append(numbers - 1)
    return loops


def _own_names(record: Record, table: Mapping[str, Any]) -> None:
    """Names that this program writes: of regions, points and edges."""
    if (names := _texts(table.get("region_names"))) is not None:
        for group in record.regions:
            if group.number is not None and 1 <= group.number <= len(names):
                group.name = names[group.number - 1]
    for kind, groups in (("point", record.nodes), ("edge", record.edges)):
        names, members = _texts(table.get(f"{kind}_names")), table.get(f"{kind}_sets")
        if names is None or not isinstance(members, np.ndarray) or members.size != len(names):
            continue
        for name, entry in zip(names, members.ravel(), strict=True):
            numbers = np.asarray(entry, dtype=np.int64) - 1
            if numbers.size and (numbers.min() < 0 or numbers.max() >= len(record.points)):
                raise InputError(f"'{name}' has a node that is not there")
            groups.append(Group(numbers.reshape(-1, 2) if kind == "edge" else numbers.ravel(), name))


def _texts(value: Any) -> list[str] | None:
    if not isinstance(value, np.ndarray) or value.dtype != object:
        return None
    return ["".join(np.asarray(text).astype(str).ravel().tolist()) for text in value.ravel()]
