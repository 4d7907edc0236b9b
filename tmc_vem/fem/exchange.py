"""Meshes of dolfinx as polygon meshes, for virtual elements on what a script in dolfinx has made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.fem import compat
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.dual import dual_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError
from tmc_vem.support.parallel import on_every_rank

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def polygon_mesh(
    mesh: Any,
    cell_tags: Any = None,
    facet_tags: Any = None,
    *,
    regions: Mapping[int, str] | None = None,
    edges: Mapping[int, str] | None = None,
    points: Mapping[str, tuple[float, float]] | None = None,
    dual: bool = False,
) -> PolygonMesh:
    """The whole of a plane dolfinx mesh, on every rank, cells and vertices in the order in which they were made.

    Args:
        mesh: of triangles or quadrilaterals with straight sides, in the plane of x and y.
        cell_tags: ``MeshTags`` of the cells; without them all are the region ``domain``.
        facet_tags: ``MeshTags`` of facets, which become named edges.
        regions: names of the tags of cells; ``region_N`` for those without.
        edges: names of the tags of facets; ``curve_N`` for those without.
        points: vertices to be named, by their places.
        dual: one polygon around every vertex instead of the cells, see :func:`tmc_vem.mesh.make.dual.dual_mesh`.

    Raises:
        InputError: dolfinx cannot be used, the mesh is not plane, its sides are curved, cells have no tag, or no vertex
            is where a point is; or the mesh is none that virtual elements can use.
    """
    compat.require()

    def here() -> tuple[Int, str, int, Int]:
        nodes, kind = compat.plane_cells(mesh)
        n_own = mesh.topology.index_map(2).size_local
        tags = np.zeros(n_own, dtype=np.int64) if cell_tags is None else _values_by_entity(cell_tags, n_own)
        return nodes, kind, n_own, tags

    # a rank's cells may be wrong where those of the others are not: all raise, so that none waits for ever
    nodes_cv, cell, n_owned, tags_c = on_every_rank(mesh.comm, here)
    numbers_v = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)
    used = np.unique(nodes_cv[:n_owned])
    sides, tags_s = _tagged_sides(mesh, facet_tags, nodes_cv, cell)

    def whole(part: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate(mesh.comm.allgather(part))

    numbers, first = np.unique(whole(numbers_v[used]), return_index=True)
    points_vx = whole(np.asarray(mesh.geometry.x)[used, :2])[first]
    order = np.argsort(whole(compat.original_cells(mesh)[:n_owned]), kind="stable")
    loops = np.searchsorted(numbers, whole(numbers_v[nodes_cv[:n_owned]]))[order][:, compat.tensor_order(cell)]
    clockwise = areas(points_vx[loops]) < 0.0
    loops[clockwise] = loops[clockwise][:, ::-1]
    tags = whole(tags_c)[order]
    present = np.unique(tags)
    called = [(regions or {}).get(int(tag), f"region_{tag}") if cell_tags else "domain" for tag in present]
    names = list(dict.fromkeys(called))  # several tags may have one name
    polygons = PolygonMesh.from_cells(
        points_vx,
        loops.tolist(),
        np.array([names.index(name) for name in called])[np.searchsorted(present, tags)],
        names,
        named_edges=_named_edges(np.searchsorted(numbers, whole(numbers_v[sides])), whole(tags_s), edges or {}),
    )
    found = {name: polygons.find_vertex(*place) for name, place in (points or {}).items()}
    polygons = PolygonMesh(
        polygons.points_vx, polygons.cell_offsets, polygons.cell_vertices, polygons.region_c, polygons.region_names,
        found, polygons.named_edges, validate=False,
    )  # fmt: skip
    return dual_mesh(polygons) if dual else polygons


def _values_by_entity(tags: Any, n_entities: int) -> Int:
    """Tag (n_entities,) of each of the first local entities.

    Raises:
        InputError: one has none.
    """
    values, tagged = np.zeros(n_entities, dtype=np.int64), np.zeros(n_entities, dtype=bool)
    here = tags.indices < n_entities
    values[tags.indices[here]], tagged[tags.indices[here]] = tags.values[here], True
    if not tagged.all():
        raise InputError(f"cell {int(np.argmin(tagged))} has no tag: cell_tags need a value for every cell")
    return values


def _tagged_sides(mesh: Any, tags: Any, nodes_cv: Int, cell: str) -> tuple[Int, Int]:
    """Nodes (n, 2) at the ends of the facets with tags, and the tags (n,)."""
    if tags is None:
        return np.empty((0, 2), dtype=np.int64), np.empty(0, dtype=np.int64)
    facets = np.asarray(tags.indices, dtype=np.int64)
    cells, positions = compat.cell_and_position(mesh, facets)
    ends = compat.reference_edges(cell)[positions]
    return nodes_cv[cells[:, None], ends], np.asarray(tags.values, dtype=np.int64)


def _named_edges(pairs: Int, tags: Int, names: Mapping[int, str]) -> dict[str, Int]:
    """Edges by name, each once; several tags may have one name."""
    called = np.array([names.get(int(tag), f"curve_{tag}") for tag in tags], dtype=object)
    return {name: np.unique(np.sort(pairs[called == name], axis=1), axis=0) for name in sorted(set(called))}
