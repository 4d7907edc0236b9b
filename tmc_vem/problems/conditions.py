"""Whether supports and loads fit together and hold everything, from names and geometry alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError
from tmc_vem.mesh.polygon import PolygonMesh

Int = NDArray[np.int64]


def vertices_at(mesh: PolygonMesh, where: str) -> Int:
    """Vertices of a named point and of named edges.

    Raises:
        InputError: the mesh has nothing of that name.
    """
    point = [mesh.named_points[where]] if where in mesh.named_points else []
    if not point and where not in mesh.named_edges:
        raise InputError(f"the mesh has neither a point nor edges named '{where}'")
    edges = mesh.named_edges.get(where, np.empty((0, 2), dtype=np.int64))
    found: Int = np.union1d(np.array(point, dtype=np.int64), edges.ravel())
    return found
