"""Write meshes: what each format has for regions, named points and named edges."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.cell_data import EDGES, ORDER, POINT, REGION, quoted
from tmc_vem.mesh.files.obj import OWN, QUOTED
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]

ONLY_CORNERS = (".msh", ".inp")


def write(mesh: PolygonMesh, path: Path, kind: str) -> None:
    """Write a mesh in the format of a suffix.

    Raises:
        InputError: the format cannot hold the mesh or one of its names.
    """
    if kind in ONLY_CORNERS and mesh.n_sides_c.max() > 4:
        c = int(mesh.n_sides_c.argmax())
        raise InputError(
            f"{path}: cell {c} has {mesh.n_sides_c[c]} sides, but {kind} holds triangles and quadrilaterals only: "
            "write .vtu, .vtk or .obj"
        )
    for name in (*mesh.region_names, *mesh.named_points, *mesh.named_edges):
        if kind not in (".vtu", ".vtk", ".off") and (not name.isprintable() or (kind in ONLY_CORNERS and '"' in name)):
            raise InputError(f"{path}: {kind} cannot hold the name {name!r}: write .vtu")
    writers: dict[str, Callable[[PolygonMesh, Path], None]] = {
        ".obj": _obj, ".inp": _inp, ".msh": _msh, ".vtu": _vtk, ".vtk": _vtk, ".off": _off, ".mat": _mat, ".nc": _ugrid,
    }  # fmt: skip
    writers[kind](mesh, path)


# -- by meshio ---------------------------------------------------------------------------------------------------------


def _msh(mesh: PolygonMesh, path: Path) -> None:
    """MSH 2.2, in binary; groups are numbered through all dimensions."""
    import meshio

    blocks: list[tuple[str, Int]] = []
    groups: list[NDArray[np.int32]] = []
    for n_sides, cells, vertices_cv in _runs(mesh):
        blocks.append(({3: "triangle", 4: "quad"}[n_sides], vertices_cv))
        groups.append((mesh.region_c[cells] + 1).astype(np.int32))
    lines = list(mesh.named_edges.items())
    points = [(name, np.array([[vertex]])) for name, vertex in mesh.named_points.items()]
    field_data = [(name, [n + 1, 2]) for n, name in enumerate(mesh.region_names)]
    for kind, dimension, members in (("line", 1, lines), ("vertex", 0, points)):
        for name, nodes in members:
            field_data.append((name, [len(field_data) + 1, dimension]))
            blocks.append((kind, np.asarray(nodes)))
            groups.append(np.full(len(nodes), len(field_data), dtype=np.int32))
    data = meshio.Mesh(
        _in_space(mesh), blocks, cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        field_data={_Name(name): np.array(group) for name, group in field_data},
    )  # fmt: skip
    meshio.write(path, data, file_format="gmsh22", binary=True)


class _Name(str):
    """A name that is equal to itself only: an edge may be called as a region is."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)


def _vtk(mesh: PolygonMesh, path: Path) -> None:
    """VTU or legacy VTK, with marks for what has a name."""
    import meshio

    blocks: list[tuple[str, Int]] = []
    marks: list[dict[str, Int]] = []
    for n_sides, cells, vertices_cv in mesh.cells_by_size():
        blocks.append(({3: "triangle", 4: "quad"}.get(n_sides, "polygon"), vertices_cv))
        regions = {f"{REGION}{r}": (mesh.region_c[cells] == i).astype(int) for i, r in enumerate(mesh.region_names)}
        marks.append({ORDER: cells, **regions})
    for name, pairs in mesh.named_edges.items():
        blocks.append(("line", np.asarray(pairs)))
        marks.append({f"{EDGES}{name}": np.ones(len(pairs), dtype=int)})
    for name, vertex in mesh.named_points.items():
        blocks.append(("vertex", np.array([[vertex]])))
        marks.append({f"{POINT}{name}": np.ones(1, dtype=int)})
    arrays = [ORDER, *(REGION + r for r in mesh.region_names), *(EDGES + e for e in mesh.named_edges)]
    arrays += [POINT + p for p in mesh.named_points]
    cell_data = {
        quoted(name): [
            m.get(name, np.full(len(b), -1 if name == ORDER else 0)) for m, (_, b) in zip(marks, blocks, strict=True)
        ]
        for name in arrays
    }
    meshio.write(path, meshio.Mesh(_in_space(mesh), blocks, cell_data=cell_data))


def _in_space(mesh: PolygonMesh) -> NDArray[np.float64]:
    return np.column_stack([mesh.points_vx, np.zeros(mesh.n_vertices)])


def _runs(mesh: PolygonMesh) -> Iterator[tuple[int, Int, Int]]:
    """As ``cells_by_size``, but in the order of the cells, for formats that cannot number them."""
    starts = np.flatnonzero(np.diff(mesh.n_sides_c, prepend=0))
    for first, last in itertools.pairwise([*starts.tolist(), mesh.n_cells]):
        n_sides = int(mesh.n_sides_c[first])
        entries = mesh.cell_vertices[mesh.cell_offsets[first] : mesh.cell_offsets[last]]
        yield n_sides, np.arange(first, last), entries.reshape(-1, n_sides)


# -- text --------------------------------------------------------------------------------------------------------------


def _inp(mesh: PolygonMesh, path: Path) -> None:
    """Plane strain elements; named edges are sets of trusses, which have no material and take part in nothing."""
    lines = ["*HEADING", "polygon mesh", "*NODE"]
    lines += [f"{v + 1}, {x!r}, {y!r}" for v, (x, y) in enumerate(mesh.points_vx.tolist())]
    for n_sides, cells, vertices_cv in _runs(mesh):
        lines.append(f"*ELEMENT, TYPE=CPE{n_sides}")
        lines += [f"{c + 1}, {', '.join(map(str, row))}" for c, row in zip(cells.tolist(), (vertices_cv + 1).tolist(),
                                                                          strict=True)]  # fmt: skip
    for r, name in enumerate(mesh.region_names):
        lines.append(f'*ELSET, ELSET="{name}"')
        lines += _wrapped(np.flatnonzero(mesh.region_c == r) + 1)
    element = mesh.n_cells + 1
    for name, pairs in mesh.named_edges.items():
        lines.append(f'*ELEMENT, TYPE=T2D2, ELSET="{name}"')
        lines += [f"{element + n}, {a}, {b}" for n, (a, b) in enumerate((pairs + 1).tolist())]
        element += len(pairs)
    for name, vertex in mesh.named_points.items():
        lines += [f'*NSET, NSET="{name}"', f"{vertex + 1}"]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _wrapped(numbers: Int, width: int = 12) -> list[str]:
    return [", ".join(map(str, numbers[n : n + width].tolist())) for n in range(0, len(numbers), width)]


def _obj(mesh: PolygonMesh, path: Path) -> None:
    goes_on = any(name.endswith("\\") for name in (*mesh.region_names, *mesh.named_points, *mesh.named_edges))

    def said(name: str) -> str:
        return name.replace("%", "%25").replace("\\", "%5C") if goes_on else name

    lines = [f"{OWN}; {QUOTED}" if goes_on else OWN]
    lines += [f"# region {said(name)}" for name in mesh.region_names]
    lines += [f"# point {vertex + 1} {said(name)}" for name, vertex in mesh.named_points.items()]
    for name, pairs in mesh.named_edges.items():
        lines.append(f"# edges {','.join(f'{a}-{b}' for a, b in (pairs + 1).tolist())} {said(name)}")
    lines += [f"v {x!r} {y!r} 0" for x, y in mesh.points_vx.tolist()]
    current: int | None = None
    for loop, region in zip(mesh.cells(), mesh.region_c.tolist(), strict=True):
        if region != current:
            lines.append(f"g {said(mesh.region_names[region])}")
            current = region
        lines.append("f " + " ".join(map(str, (loop + 1).tolist())))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _off(mesh: PolygonMesh, path: Path) -> None:
    lines = ["OFF", f"{mesh.n_vertices} {mesh.n_cells} {len(mesh.edges)}"]
    lines += [f"{x!r} {y!r} 0" for x, y in mesh.points_vx.tolist()]
    lines += [f"{len(loop)} {' '.join(map(str, loop.tolist()))}" for loop in mesh.cells()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


# -- arrays ------------------------------------------------------------------------------------------------------------


def _mat(mesh: PolygonMesh, path: Path) -> None:
    """Node and Element as PolyMesher has them, and regions and names beside them."""
    import scipy.io

    def cells(arrays: list[Any]) -> NDArray[np.object_]:
        column = np.empty((len(arrays), 1), dtype=object)
        for n, array in enumerate(arrays):
            column[n, 0] = array
        return column

    tables = {
        "Node": mesh.points_vx,
        "Element": cells([(loop + 1.0).reshape(1, -1) for loop in mesh.cells()]),
        "region": (mesh.region_c + 1.0).reshape(-1, 1),
        "region_names": cells(list(mesh.region_names)),
    }
    if mesh.named_edges:
        tables |= {
            "edge_names": cells(list(mesh.named_edges)),
            "edge_sets": cells([p + 1.0 for p in mesh.named_edges.values()]),
        }
    if mesh.named_points:
        tables |= {
            "point_names": cells(list(mesh.named_points)),
            "point_sets": cells([v + 1.0 for v in mesh.named_points.values()]),
        }
    scipy.io.savemat(path, tables, do_compression=True)


def _ugrid(mesh: PolygonMesh, path: Path) -> None:
    """UGRID 1.0 in netCDF's classic format; regions are flags with meanings."""
    from scipy.io import netcdf_file

    widest = int(mesh.n_sides_c.max())
    with netcdf_file(path, "w", version=2) as data:
        data.Conventions = "CF-1.8 UGRID-1.0"
        for name, n in (("node", mesh.n_vertices), ("face", mesh.n_cells), ("side", widest), ("two", 2), ("one", 1)):
            data.createDimension(name, n)
        topology = data.createVariable("mesh", "i4", ())
        topology.cf_role, topology.topology_dimension = "mesh_topology", np.int32(2)
        topology.node_coordinates, topology.face_node_connectivity = "node_x node_y", "face_nodes"
        topology.face_dimension = "face"
        for axis, name in enumerate(("node_x", "node_y")):
            data.createVariable(name, "f8", ("node",))[:] = mesh.points_vx[:, axis]
        table = np.full((mesh.n_cells, widest), -1, dtype=np.int32)
        table[np.arange(widest) < mesh.n_sides_c[:, None]] = mesh.cell_vertices
        faces = data.createVariable("face_nodes", "i4", ("face", "side"))
        faces[:] = table
        faces.start_index, faces._FillValue = np.int32(0), np.int32(-1)
        region = data.createVariable("region", "i4", ("face",))
        region[:] = mesh.region_c
        region.flag_values = np.arange(len(mesh.region_names), dtype=np.int32)
        region.flag_meanings = " ".join(map(quoted, mesh.region_names))
        for n, (name, pairs) in enumerate(mesh.named_edges.items()):
            data.createDimension(f"edges_{n}", len(pairs))
            variable = data.createVariable(f"edges_{n}", "i4", (f"edges_{n}", "two"))
            variable[:] = pairs
            variable.tmc_vem = quoted(name)
        for n, (name, vertex) in enumerate(mesh.named_points.items()):
            variable = data.createVariable(f"point_{n}", "i4", ("one",))
            variable[:] = vertex
            variable.tmc_vem = quoted(name)
