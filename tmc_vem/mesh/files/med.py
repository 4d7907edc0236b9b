"""SALOME's MED files (.med) with triangles, quadrilaterals and polygons; groups of families are regions and names.

They are HDF5. Layout: https://docs.salome-platform.org, MED file 3 and later, and what medcoupling writes.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.record import Group, Reading, Record, refuse_kinds
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]

# plane cells and edges with their corners and nodes
CELLS = {"TR3": (3, 3), "TR6": (3, 6), "TR7": (3, 7), "QU4": (4, 4), "QU8": (4, 8), "QU9": (4, 9)}
EDGES = {"SE2": 2, "SE3": 3, "SE4": 4}
POLYGONS, QUADRATIC_POLYGONS, POINT = "POG", "PO2", "PO1"


def read(path: Path, reading: Reading) -> Record:
    """Read a .med file.

    Raises:
        InputError: h5py is not installed, or the file is damaged or has cells that are not plane.
    """
    try:
        import h5py
    except ImportError:
        raise InputError("MED files need h5py: pip install h5py") from None
    try:
        with h5py.File(path, "r") as file:
            return _record(file)
    except InputError:
        raise
    except (OSError, KeyError, ValueError, RuntimeError, TypeError, AttributeError, IndexError) as error:
        raise InputError(f"h5py cannot read it: {error or type(error).__name__}") from None


def _record(file: Any) -> Record:
    meshes = list(file.get("ENS_MAA", {}))
    if not meshes:
        raise InputError("it has no mesh")
    mesh = file["ENS_MAA"][meshes[0]]
    steps = [name for name in mesh if isinstance(mesh[name], type(mesh)) and "NOE" in mesh[name]]
    if not steps:
        raise InputError(f"its mesh '{meshes[0]}' has no nodes")
    step = mesh[steps[0]]
    coordinates = np.asarray(step["NOE/COO"], dtype=float)
    n = int(step["NOE/COO"].attrs["NBR"])
    points = coordinates.reshape(-1, n).T  # all x, then all y
    if points.shape[1] not in (2, 3):
        raise InputError(f"its nodes have {points.shape[1]} coordinates")
    record = Record(points, [])
    if len(meshes) > 1:
        record.notes.append(f"it has the meshes {', '.join(meshes)}, of which the first is read")
    names = _groups(file, meshes[0])
    families: list[Int] = []
    middles = [np.empty(0, dtype=np.int64)]
    pairs: dict[str, list[Int]] = {}
    unknown: list[str] = []
    solids: list[str] = []
    for kind in step.get("MAI", {}):
        cells = step["MAI"][kind]
        nodes = np.asarray(cells["NOD"], dtype=np.int64) - 1
        if kind in CELLS:
            corners, n_nodes = CELLS[kind]
            rows = nodes.reshape(n_nodes, -1).T
            record.loops += list(rows[:, :corners])
            middles.append(rows[:, corners:].ravel())
            families.append(_families(cells, len(rows)))
        elif kind in (POLYGONS, QUADRATIC_POLYGONS):
            index = np.asarray(cells["INN"], dtype=np.int64) - 1
            found = [nodes[a:b] for a, b in itertools.pairwise(index)]
            if kind == QUADRATIC_POLYGONS:
                middles += [loop[len(loop) // 2 :] for loop in found]
                found = [loop[: len(loop) // 2] for loop in found]
            record.loops += found
            families.append(_families(cells, len(found)))
        elif kind in EDGES:
            rows = nodes.reshape(EDGES[kind], -1).T
            middles.append(rows[:, 2:].ravel())
            for family, row in zip(_families(cells, len(rows)).tolist(), rows[:, :2], strict=True):
                for name in names.get(family, ()):
                    pairs.setdefault(name, []).append(row)
        elif kind != POINT:
            (unknown if kind[:1] not in "THP" else solids).append(f"MED {kind}")
    refuse_kinds(unknown, solids)
    record.middles = np.unique(np.concatenate(middles))
    family_c = np.concatenate(families) if families else np.empty(0, dtype=np.int64)
    record.regions = _by_name(family_c, names)
    record.edges = [Group(np.array(rows), name) for name, rows in pairs.items()]
    taken = {group.name for group in (*record.regions, *record.edges)}
    record.nodes = [g for g in _by_name(_families(step["NOE"], n), names) if g.name not in taken]
    return record


def _families(cells: Any, n: int) -> Int:
    if "FAM" not in cells:
        return np.zeros(n, dtype=np.int64)
    families = np.asarray(cells["FAM"], dtype=np.int64)
    if len(families) != n:
        raise InputError(f"{len(families)} families are given for {n} cells or nodes")
    return families


def _groups(file: Any, mesh: str) -> dict[int, list[str]]:
    """Names of the groups of every family."""
    found: dict[int, list[str]] = {}
    families = file.get(f"FAS/{mesh}", {})
    for kind in ("ELEME", "NOEUD"):
        for family in families.get(kind, {}).values() if kind in families else ():
            names: Any = family["GRO/NOM"][()] if "GRO/NOM" in family else []
            found[int(family.attrs["NUM"])] = [_text(name) for name in names]
    return found


def _text(name: Any) -> str:
    """A name of 80 characters, in bytes or as numbers."""
    data = name if isinstance(name, bytes) else bytes(np.asarray(name).astype(np.uint8).tolist())
    return data.split(b"\0")[0].decode("utf-8", "replace").strip()


def _by_name(family_n: Int, names: dict[int, list[str]]) -> list[Group]:
    found: dict[str, list[Int]] = {}
    for family in np.unique(family_n).tolist():
        for name in names.get(family, ()):
            found.setdefault(name, []).append(np.flatnonzero(family_n == family))
    return [Group(np.concatenate(parts), name) for name, parts in found.items()]
