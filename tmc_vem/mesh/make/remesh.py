"""Unstructured triangles from gmsh in the outlines of a mesh's regions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.cell_count import TRIANGLES, check_cells
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.far import moved, origin_for
from tmc_vem.mesh.make.traced import TracedOutline, trace_outline
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.environment import cells_allowed
from tmc_vem.support.errors import InputError
from tmc_vem.support.optional import load

Int = NDArray[np.int64]


def gmsh_triangles(mesh: PolygonMesh, size: float, most_cells: float | None = None) -> PolygonMesh:
    """Unstructured triangles of about one size in the outlines of another mesh's regions.

    Straight runs of the outlines become one line each, however finely the given mesh divides them; named points stay
    nodes, and named edges that lie on the outlines keep their names.

    Args:
        mesh: any mesh of the problem; a coarse one will do, as only its outlines matter.
        size: edge length to aim at.
        most_cells: how many there may be; None for what the environment says, or a million.

    Raises:
        InputError: gmsh is missing, ``size`` is not positive or makes too many cells, or edges with a name lie inside a
            region.
    """
    if not (math.isfinite(size) and size > 0.0):
        raise InputError(f"triangle size {size:g} must be a positive number")
    gmsh = load("gmsh", "unstructured triangles need")
    origin = origin_for(mesh.points_vx)
    if origin is not None:
        return moved(gmsh_triangles(moved(mesh, (-origin[0], -origin[1])), size, most_cells), origin)
    area = sum(float(areas(mesh.points_vx[loops]).sum()) for _, _, loops in mesh.cells_by_size())
    what = f"triangles of size {size:g} on an area of {area:.4g}"
    check_cells(TRIANGLES * area / size / size, cells_allowed(most_cells), f"{what}; use a larger size")
    outline = trace_outline(mesh)
    gmsh.initialize([])
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 6)  # frontal Delaunay
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        _draw(gmsh.model, mesh, outline, size)
        gmsh.model.mesh.generate(2)
        return _read(gmsh.model, mesh, outline)
    finally:
        gmsh.finalize()


def _draw(model: Any, mesh: PolygonMesh, outline: TracedOutline, size: float) -> None:
    """Points, lines and surfaces; point tags are vertices + 1, line tags runs + 1, surface tags count the faces."""
    geo = model.geo
    inner = set(mesh.named_points.values()) - outline.corners
    for vertex in sorted(outline.corners | inner):
        x, y = mesh.points_vx[vertex]
        geo.addPoint(x, y, 0.0, size, vertex + 1)
    for number, run in enumerate(outline.runs):
        geo.addLine(run[0] + 1, run[-1] + 1, number + 1)
    for number, face in enumerate(outline.faces):
        loops = [geo.addCurveLoop([run + 1 if along else -(run + 1) for run, along in loop]) for loop in face.loops]
        geo.addPlaneSurface(loops, number + 1)
    geo.synchronize()
    if inner:
        points = mesh.points_vx
        cell_of = {v: c for c in range(mesh.n_cells) for v in mesh.cell(c).tolist() if v in inner}
        for vertex in sorted(inner):
            region = int(mesh.region_c[cell_of[vertex]])
            faces = enumerate(outline.faces)
            surface = next(n + 1 for n, face in faces if face.region == region and face.contains(points[vertex]))
            model.mesh.embed(0, [vertex + 1], 2, surface)


def _read(model: Any, mesh: PolygonMesh, outline: TracedOutline) -> PolygonMesh:
    tags, coordinates, _ = model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    points = np.asarray(coordinates).reshape(-1, 3)[:, :2]
    cells, regions = [], []
    for surface, face in enumerate(outline.faces):
        _, nodes = model.mesh.getElementsByType(2, surface + 1)
        triangles = number[np.asarray(nodes, dtype=np.int64)].reshape(-1, 3)
        cells.append(triangles)
        regions.append(np.full(len(triangles), face.region))
    cell_vertices = np.concatenate(cells)
    corners = points[cell_vertices]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    cell_vertices[clockwise] = cell_vertices[clockwise][:, ::-1]
    used, compact = np.unique(cell_vertices, return_inverse=True)
    position = np.full(len(points), -1, dtype=np.int64)
    position[used] = np.arange(len(used))

    named_edges: dict[str, list[Int]] = {}
    for run, names in enumerate(outline.names):
        if names:
            _, nodes = model.mesh.getElementsByType(1, run + 1)
            for name in names:
                named_edges.setdefault(name, []).append(
                    position[number[np.asarray(nodes, dtype=np.int64)]].reshape(-1, 2)
                )
    named_points = {}
    for name, vertex in mesh.named_points.items():
        node, _, _ = model.mesh.getNodes(0, vertex + 1)
        named_points[name] = int(position[number[int(node[0])]])
    return PolygonMesh(
        points[used], np.arange(len(cell_vertices) + 1) * 3, compact.ravel(), np.concatenate(regions),
        mesh.region_names, named_points, {name: np.concatenate(parts) for name, parts in named_edges.items()},
    )  # fmt: skip
