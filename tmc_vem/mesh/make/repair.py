"""Repair what is wrong with a mesh and can be repaired without guessing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.between import NEAR, Outline, near_vertices
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.faults import SHORT, duplicate_cells, short_edges, tolerance_of
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.weld import weld
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]


def repair(mesh: PolygonMesh, tolerance: float | None = None) -> PolygonMesh:
    """A valid mesh: vertices that coincide, or nearly do, merged, short edges collapsed, equal cells merged, clockwise
    cells turned, unused vertices dropped, and vertices that lie on the sides of other cells inserted as hanging nodes.

    Args:
        mesh: made with ``validate=False`` or not. No cell changes its region.
        tolerance: distance of vertices that are merged as a fraction of the sides there, and length of edges that are
            collapsed as a fraction of the width of their cells. By default, what :func:`find_faults` names.

    Raises:
        InputError: something else is wrong, such as an overlap; the message names the cell.
    """
    mesh._check_arrays()
    for fault in duplicate_cells(mesh):
        if not fault.fixable:
            raise InputError(fault.message)
    label = _merged(mesh, tolerance)
    cells, region, seen = [], [], set()
    for c, loop in enumerate(mesh.cells()):
        named = label[loop]
        named = named[named != np.roll(named, 1)]
        key = tuple(sorted(named.tolist()))
        if key in seen or len(named) < 3:
            continue
        seen.add(key)
        backwards = areas(mesh.points_vx[named][None])[0] < 0.0
        cells.append(named[::-1] if backwards else named)
        region.append(int(mesh.region_c[c]))
    used, local = np.unique(np.concatenate(cells), return_inverse=True)
    number = np.full(mesh.n_vertices, -1)
    number[used] = np.arange(len(used))
    clean = PolygonMesh.from_cells(
        mesh.points_vx[used],
        [part.tolist() for part in np.split(local, np.cumsum([len(cell) for cell in cells])[:-1])],
        region,
        mesh.region_names,
        {name: int(number[label[v]]) for name, v in mesh.named_points.items() if number[label[v]] >= 0},
        {name: _joined(number[label[pairs]]) for name, pairs in mesh.named_edges.items()},
    )
    lengths = Outline.of(clean).length_s
    off_side = (NEAR if tolerance is None else tolerance) * float(lengths.min(initial=np.inf))
    mesh = weld([clean], off_side=off_side if np.isfinite(off_side) else 0.0)
    left = find_faults(mesh)
    if left:
        raise InputError(f"{left[0].message} ({len(left)} faults that cannot be repaired)")
    return mesh


def _joined(pairs: Int) -> Int:
    """Edges whose ends are at cells and still two."""
    kept: Int = pairs[(pairs >= 0).all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
    return kept


def _merged(mesh: PolygonMesh, tolerance: float | None) -> Int:
    """For every vertex the one that it becomes: of those that are merged, one with a name, else one of the outline."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    outline = Outline.of(mesh)
    pairs = [*cKDTree(mesh.points_vx).query_pairs(tolerance_of(mesh))]
    pairs += near_vertices(outline, NEAR if tolerance is None else tolerance)
    pairs += short_edges(mesh, SHORT if tolerance is None else tolerance)
    ends = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(mesh.n_vertices,) * 2)
    _, group = connected_components(graph, directed=False)
    rank = np.full(mesh.n_vertices, 2)
    rank[outline.vertices] = 1
    rank[[v for v in mesh.named_points.values() if 0 <= v < mesh.n_vertices]] = 0
    order = np.lexsort([np.arange(mesh.n_vertices), rank, group])
    first = order[np.searchsorted(group[order], np.arange(group.max() + 1))]
    label: Int = first[group]
    return label
