"""A mesh in a NumPy archive, bit for bit: what is read again is what was written."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh

# What reading such an archive raises where it is damaged.
DAMAGED = (OSError, EOFError, KeyError, TypeError, ValueError, zipfile.BadZipFile)
_ARRAYS = ("points_vx", "cell_offsets", "cell_vertices", "region_c")
_NAMES = "names"


def mesh_arrays(mesh: PolygonMesh) -> dict[str, NDArray[Any]]:
    """A mesh as arrays for ``np.savez``."""
    names = {"regions": list(mesh.region_names), "points": dict(mesh.named_points)}
    edges = {f"edges {name}": pairs for name, pairs in mesh.named_edges.items()}
    data = {f"data {name}": values for name, values in mesh.cell_data.items()}
    return {**{name: getattr(mesh, name) for name in _ARRAYS}, **edges, **data, _NAMES: np.array(json.dumps(names))}


def mesh_of(arrays: Mapping[str, NDArray[Any]]) -> PolygonMesh:
    """The mesh that such arrays are of; it is not validated again.

    Raises:
        KeyError: an array is missing.
        ValueError: the names are damaged.
    """
    names = json.loads(str(arrays[_NAMES]))

    def called(kind: str) -> dict[str, NDArray[Any]]:
        return {key.removeprefix(kind): arrays[key] for key in arrays if key.startswith(kind)}

    return PolygonMesh(
        **{name: arrays[name] for name in _ARRAYS}, region_names=tuple(names["regions"]), named_points=names["points"],
        named_edges=called("edges "), cell_data=called("data "), validate=False,
    )  # fmt: skip
