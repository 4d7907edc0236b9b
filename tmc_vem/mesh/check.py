"""Find everything that is wrong with a mesh, by cell or vertex.

:class:`PolygonMesh` refuses a bad mesh at its first fault. Here all faults are listed, including those between cells:
overlaps, gaps, slits, and vertices that lie on a side of a cell without being one of its hanging nodes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.between import Outline, gaps, overlaps, shapes_of, slits, t_junctions
from tmc_vem.mesh.faults import (
    Fault,
    bad_polygons,
    bad_vertices,
    duplicate_cells,
    summaries,
    too_short,
)  # fmt: skip
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

__all__ = ["Fault", "find_faults", "summaries"]

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def find_faults(mesh: PolygonMesh, *, cracks: bool = False) -> list[Fault]:
    """All faults of a mesh, made with ``validate=False`` or not; an empty list for a good one.

    Args:
        mesh: the mesh.
        cracks: vertices at the same place, slits and gaps are meant.
    """
    try:
        mesh._check_arrays()
    except InputError as error:
        return [Fault("structure", str(error))]
    faults = [*bad_polygons(mesh), *duplicate_cells(mesh), *bad_vertices(mesh), *too_short(mesh)]
    if cracks:
        faults = [fault for fault in faults if fault.kind != "duplicate vertex"]
    if not any(fault.kind in ("polygon", "duplicate cell") for fault in faults):
        faults += _between_cells(mesh, cracks)
    if not faults:
        try:
            mesh._check_connectivity()
        except InputError as error:
            faults.append(Fault("structure", str(error)))
    return faults


def _between_cells(mesh: PolygonMesh, cracks: bool) -> Iterator[Fault]:
    outline, shapes = Outline.of(mesh), shapes_of(mesh)
    if not cracks:
        yield from slits(outline)
        yield from t_junctions(outline)
    yield from overlaps(outline, shapes)
    if not cracks and len(outline.pairs_sv):
        yield from gaps(outline, shapes)
