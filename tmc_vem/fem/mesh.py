"""The polygon mesh of a problem as a distributed dolfinx mesh, with its regions and the names of points and edges."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem import compat
from tmc_vem.mesh.geometry import areas, centroids
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.distributed import Comm
from tmc_vem.support.errors import InputError, TmcError
from tmc_vem.system.graded import Graded

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Names:
    """What the problem's mesh calls its parts; equal on all ranks.

    Attributes:
        regions: names of the regions.
        points: vertex of the problem's mesh by name.
        coordinates: (2,) coordinates of the named points.
        edges: (n, 2) end vertices by name, the smaller first.
        cell_data: numbers of all cells of the problem's mesh by name.
    """

    regions: tuple[str, ...]
    points: Mapping[str, int]
    coordinates: Mapping[str, Float]
    edges: Mapping[str, Int]
    cell_data: Mapping[str, Float]


@dataclass(frozen=True)
class FemMesh:
    """A rank's part of the mesh. Cells come in dolfinx' order: those that the rank owns first, then ghosts.

    Attributes:
        comm: communicator.
        mesh: the dolfinx mesh.
        cell: its kind of cell, ``compat.TRIANGLE`` or ``compat.QUADRILATERAL``.
        n_owned: cells that this rank owns.
        n_cells_global: cells of the whole mesh.
        region_c: (n_cells,) index into the names of the regions.
        cell_ids: (n_cells,) cell of the problem's mesh that each is, or is a part of.
        vertices_cv: (n_cells, 3 or 4) vertices of the problem's mesh, in dolfinx' order.
        points_cvx: (n_cells, 3 or 4, 2) their coordinates.
        areas_c: (n_cells,) areas.
        extent: larger side of the mesh's bounding box.
        names: names of regions, points and edges.
    """

    comm: Comm
    mesh: Any
    cell: str
    n_owned: int
    n_cells_global: int
    region_c: Int
    cell_ids: Int
    vertices_cv: Int
    points_cvx: Float
    areas_c: Float
    extent: float
    names: Names

    def factors(self, graded: Graded, cells: Int) -> Float:
        """Factors (n, n_names) of a region's parameters in some of the local cells."""
        centroid_cx = centroids(self.points_cvx[cells][:, compat.tensor_order(self.cell)])
        ids = self.cell_ids[cells]
        return graded.factors(centroid_cx, {name: values[ids] for name, values in self.names.cell_data.items()})


def distribute(comm: Comm, make_mesh: Callable[[], PolygonMesh], *, triangles: bool = False) -> FemMesh:
    """Make the problem's mesh on rank 0 and let dolfinx distribute it.

    Args:
        comm: communicator.
        make_mesh: called on rank 0 only.
        triangles: cut every quadrilateral in two.

    Raises:
        InputError: dolfinx cannot be used, or the cells are not all triangles or all quadrilaterals.
        TmcError: whatever ``make_mesh`` raises, on every rank.
    """
    compat.require()
    source = _on_root(comm, lambda: as_elements(make_mesh(), triangles)) if comm.size > 1 else as_elements(
        make_mesh(), triangles
    )  # fmt: skip
    cell, cells, points, region_c, parents, names = source
    on_root = comm.rank == 0
    mine = slice(None) if on_root else slice(0)
    mesh = compat.create_mesh(comm, cell, cells[mine], points[mine])

    cell_map = mesh.topology.index_map(2)
    n_local = cell_map.size_local + cell_map.num_ghosts
    original = compat.original_cells(mesh)[:n_local]
    nodes_cv = compat.cell_nodes(mesh, n_local)
    vertices_cv = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)[nodes_cv]
    points_cvx = np.asarray(mesh.geometry.x)[nodes_cv, :2]
    order = compat.tensor_order(cell)
    return FemMesh(
        comm=comm,
        mesh=mesh,
        cell=cell,
        n_owned=cell_map.size_local,
        n_cells_global=cell_map.size_global,
        region_c=region_c[original],
        cell_ids=parents[original],
        vertices_cv=vertices_cv,
        points_cvx=points_cvx,
        areas_c=areas(points_cvx[:, order]),
        extent=float(np.ptp(points, axis=0).max()),
        names=names,
    )


def as_elements(polygons: PolygonMesh, triangles: bool) -> tuple[str, Int, Float, Int, Int, Names]:
    """Cells in dolfinx' order of vertices, coordinates, regions, original cells and names.

    Raises:
        InputError: the cells are not all triangles or all convex quadrilaterals.
    """
    parents = np.arange(polygons.n_cells)
    names = Names(
        polygons.region_names,
        dict(polygons.named_points),
        {name: polygons.points_vx[vertex] for name, vertex in polygons.named_points.items()},
        {name: np.sort(np.asarray(pairs).reshape(-1, 2), axis=1) for name, pairs in polygons.named_edges.items()},
        dict(polygons.cell_data),
    )
    if triangles:
        polygons, parents = split_quadrilaterals(polygons)
    n_sides = polygons.n_sides_c
    other = np.flatnonzero(n_sides != n_sides[0])
    if n_sides[0] not in (3, 4) or len(other):
        odd = 0 if n_sides[0] not in (3, 4) else int(other[0])
        raise InputError(
            f"cell {odd} has {n_sides[odd]} vertices: finite elements need all triangles or all quadrilaterals; "
            "use a mesh without hanging nodes, or remesh its outline with triangles"
        )
    cell = compat.TRIANGLE if n_sides[0] == 3 else compat.QUADRILATERAL
    cells = polygons.cell_vertices.reshape(-1, n_sides[0])
    if cell == compat.QUADRILATERAL:
        _check_convex(polygons.points_vx[cells])
    return cell, cells[:, compat.tensor_order(cell)].copy(), polygons.points_vx, polygons.region_c, parents, names


def _check_convex(corners_cvx: Float) -> None:
    """A quadrilateral element folds over where its polygon is not convex."""
    ahead, behind = np.roll(corners_cvx, -1, axis=1) - corners_cvx, np.roll(corners_cvx, 1, axis=1) - corners_cvx
    turn_cv = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    wrong = np.flatnonzero((turn_cv <= 0.0).any(axis=1))
    if len(wrong):
        raise InputError(f"cell {wrong[0]} is not convex: quadrilateral elements need convex cells; use triangles")


def _on_root(comm: Comm, make: Callable[[], Any]) -> Any:
    """Make something on rank 0; all ranks get it, or its error."""
    made: Any = None
    if comm.rank == 0:
        try:
            made = make()
        except TmcError as error:
            made = error
    made = comm.bcast(made)
    if isinstance(made, TmcError):
        raise made
    return made
