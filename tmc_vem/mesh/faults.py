"""Faults of meshes as data, and those of single cells and vertices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tmc_vem.mesh.geometry import areas, diameters
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.validate import check_polygons
from tmc_vem.support.errors import InputError

# Vertices closer than this fraction of the mesh's extent are at the same place; rounding moves them less.
COINCIDE = 1e-9
# Edges of polygons shorter than this fraction of the cell's width (area over diameter) cost digits: the error of the
# functions on the sliver there grows with the square of the ratio, and is 1e-9 at this one.
SHORT = 1e-4


@dataclass(frozen=True)
class Fault:
    """Something wrong with a mesh.

    Attributes:
        kind: 'structure', 'polygon', 'clockwise', 'duplicate cell', 'duplicate vertex', 'near vertices',
            'unreferenced vertex', 'short edge', 'T-junction', 'overlap' or 'gap'.
        message: what is wrong and where; names the cell or vertex.
        fixable: whether :func:`tmc_vem.mesh.make.repair.repair` removes it.
        where: the place in few words, such as ``cell 3``.
    """

    kind: str
    message: str
    fixable: bool = False
    where: str = ""


def summaries(faults: Sequence[Fault]) -> list[str]:
    """A line for every kind of fault: its first message, how many there are, and where two more of them are."""
    lines = []
    for kind in dict.fromkeys(fault.kind for fault in faults):
        first, *others = [fault for fault in faults if fault.kind == kind]
        places = [fault.where for fault in others[:2] if fault.where]
        more = f"; {len(others)} more" + (f", such as {' and '.join(places)}" if places else "") if others else ""
        lines.append(f"{first.message}{more}")
    return lines


def tolerance_of(mesh: PolygonMesh) -> float:
    """Distance (length) below which vertices are at the same place: of rounding, also far from the origin."""
    points = mesh.points_vx
    rounding = 8.0 * float(np.finfo(float).eps) * float(np.abs(points).max(initial=0.0))
    return max(COINCIDE * float(np.ptp(points, axis=0).max()), rounding)


def bad_polygons(mesh: PolygonMesh) -> Iterator[Fault]:
    """Faults of single polygons. Good ones are passed over in groups, the others are looked at one by one."""
    for _, cells, vertices_cv in mesh.cells_by_size():
        size = vertices_cv.shape[1]
        pending = [cells]
        while pending:
            group = pending.pop()
            entries = mesh.cell_offsets[group][:, None] + np.arange(size)
            try:
                check_polygons(mesh.points_vx, np.arange(len(group) + 1) * size, mesh.cell_vertices[entries].ravel())
            except InputError as error:
                if len(group) > 1:
                    pending += np.array_split(group, 2)[::-1]
                    continue
                message = str(error).replace("cell 0 ", f"cell {group[0]} ")
                fixable = "clockwise" in message or "length zero" in message
                yield Fault("clockwise" if "clockwise" in message else "polygon", message, fixable, f"cell {group[0]}")


def duplicate_cells(mesh: PolygonMesh) -> Iterator[Fault]:
    """Cells that are there twice; if in two regions, there is no telling which is meant."""
    for _, cells, vertices_cv in mesh.cells_by_size():
        _, first, inverse = np.unique(np.sort(vertices_cv, axis=1), axis=0, return_index=True, return_inverse=True)
        original = cells[first[inverse.reshape(-1)]]
        for c, o in zip(cells[original != cells].tolist(), original[original != cells].tolist(), strict=True):
            names = [mesh.region_names[mesh.region_c[cell]] for cell in (o, c)]
            message = f"cell {c} has the same vertices as cell {o}"
            if names[0] == names[1]:
                yield Fault("duplicate cell", f"{message}: remove one of them", True, f"cell {c}")
            else:
                message += f", which is in '{names[0]}', and is in '{names[1]}': a cell has one region, remove one"
                yield Fault("duplicate cell", message, False, f"cell {c}")


def short_edges(mesh: PolygonMesh, fraction: float = SHORT) -> list[tuple[int, int]]:
    """Ends of edges, and one of their cells, that are short beside the widths of all cells with five or more sides.

    Edges of thin triangles and quadrilaterals, such as those across a layer, are none.
    """
    width_c = np.empty(mesh.n_cells)
    for _, cells, vertices_cv in mesh.cells_by_size():
        polygons = mesh.points_vx[vertices_cv]
        width_c[cells] = np.abs(areas(polygons)) / diameters(polygons)
    width_s = np.repeat(np.where(mesh.n_sides_c > 4, width_c, 0.0), mesh.n_sides_c)
    widest_e = np.zeros(len(mesh.edges))
    np.maximum.at(widest_e, mesh.edges.cell_edges, width_s)
    ends = mesh.points_vx[mesh.edges.vertices_ev]
    short = np.flatnonzero(np.hypot(*(ends[:, 1] - ends[:, 0]).T) < fraction * widest_e)
    return [(int(a), int(b)) for a, b in mesh.edges.vertices_ev[short]]


def too_short(mesh: PolygonMesh) -> Iterator[Fault]:
    """Edges that are too short."""
    for a, b in short_edges(mesh):
        (x, y), (s, t) = mesh.points_vx[[a, b]]
        yield Fault(
            "short edge",
            f"the edge between vertices {a} and {b} at ({x:.6g}, {y:.6g}) is {np.hypot(x - s, y - t):.3g} long, less "
            f"than {SHORT:g} of a cell's width: collapse it",
            True, f"vertices {a} and {b}",
        )  # fmt: skip


def bad_vertices(mesh: PolygonMesh) -> Iterator[Fault]:
    """Vertices at the same place, and those that no cell has."""
    from scipy.spatial import cKDTree

    for a, b in sorted(map(sorted, cKDTree(mesh.points_vx).query_pairs(tolerance_of(mesh)))):
        x, y = mesh.points_vx[a]
        message = f"vertices {a} and {b} are both at ({x:.6g}, {y:.6g}): merge them"
        yield Fault("duplicate vertex", message, True, f"vertices {a} and {b}")
    for v in np.setdiff1d(np.arange(mesh.n_vertices), mesh.cell_vertices).tolist():
        yield Fault("unreferenced vertex", f"vertex {v} belongs to no cell: remove it", True, f"vertex {v}")
