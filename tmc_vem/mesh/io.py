"""Read and write meshes: VTU and VTK with polygons, gmsh's MSH, Abaqus' INP, Wavefront OBJ.

Everything a mesh has survives writing and reading, in the same order: regions, named points and named edges. Each
format says so in its own way. MSH has physical groups and INP sets; in VTU and VTK, vertices and edges with names are
cells of their own, and arrays called ``region:NAME``, ``point:NAME`` and ``edges:NAME`` mark what the name is of. In
OBJ, groups are regions, and comments hold the names. MSH and INP know triangles and quadrilaterals only.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.errors import InputError
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.polygon import PolygonMesh

Float = NDArray[np.float64]
Int = NDArray[np.int64]

FORMATS = (".vtu", ".vtk", ".msh", ".inp", ".obj")
_ONLY_CORNERS = (".msh", ".inp")
# meshio's cell types that are plane cells, and how many of their nodes are corners
_CORNERS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
_SOLIDS = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")
_ORDER, _REGION, _POINT, _EDGES = "cell_number", "region:", "point:", "edges:"


def write_mesh(mesh: PolygonMesh, path: str | Path) -> None:
    """Write a mesh; the suffix of the file decides the format.

    Raises:
        InputError: the format is unknown, or cannot hold polygons with more than four sides (the message names a cell).
    """
    import meshio

    path = Path(path)
    kind = _format(path)
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written: there is no directory {path.parent}")
    if kind == ".obj":
        _write_obj(mesh, path)
        return
    if kind in _ONLY_CORNERS and mesh.n_sides_c.max() > 4:
        c = int(mesh.n_sides_c.argmax())
        raise InputError(
            f"{path}: cell {c} has {mesh.n_sides_c[c]} sides, but {kind} holds triangles and quadrilaterals only: "
            "write .vtu, .vtk or .obj"
        )
    data = _to_meshio(mesh, kind)
    if kind == ".msh":
        meshio.write(path, data, file_format="gmsh22", binary=True)
    elif kind == ".inp":
        meshio.write(path, data, file_format="abaqus", float_fmt=".17g")
    else:
        meshio.write(path, data)


def read_mesh(path: str | Path, *, validate: bool = True) -> PolygonMesh:
    """Read a mesh that this program, gmsh or another one wrote.

    Higher-order cells become polygons through their corners. Physical groups of surfaces, element sets and OBJ groups
    are regions; those of points and curves are named points and edges. Vertices that no cell uses are dropped.

    Args:
        path: file in one of the formats above.
        validate: refuse a mesh with bad cells; False only reads, for :mod:`tmc_vem.mesh.check`.

    Raises:
        InputError: the file cannot be read, has no plane cells or solids, is not plane, or has bad cells (by number).
    """
    path = Path(path)
    kind = _format(path)
    if not path.is_file():
        raise InputError(f"mesh file {path} does not exist")
    mesh = _read_obj(path, validate) if kind == ".obj" else _read_with_meshio(path, kind, validate)
    faults = find_faults(mesh) if validate else []
    if faults:
        more = f" ({len(faults)} faults; 'tmc-vem mesh check' lists them)" if len(faults) > 1 else ""
        raise InputError(f"{path}: {faults[0].message}{more}")
    return mesh


def _read_with_meshio(path: Path, kind: str, validate: bool) -> PolygonMesh:
    import contextlib
    import io

    import meshio

    try:
        with contextlib.redirect_stdout(io.StringIO()):  # meshio prints warnings there
            data = meshio.read(path)
    except SystemExit:
        raise InputError(f"{path} is not a readable {kind} file") from None
    except Exception as error:  # meshio's readers fail with whatever a bad file leads them to
        reason = str(error).strip().splitlines()
        raise InputError(
            f"{path} is not a readable {kind} file: {reason[0] if reason else type(error).__name__}"
        ) from None
    return _from_meshio(data, path, validate)


def _format(path: Path) -> str:
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"{path}: unknown mesh format '{kind}', use one of {', '.join(FORMATS)}")
    return kind


# -- meshio ------------------------------------------------------------------------------------------------------------


def _to_meshio(mesh: PolygonMesh, kind: str) -> Any:
    import meshio

    blocks: list[tuple[str, Int]] = []
    marks: list[dict[str, Int]] = []
    for n_sides, cells, vertices_cv in _runs(mesh) if kind in _ONLY_CORNERS else mesh.cells_by_size():
        name = {3: "triangle", 4: "quad"}.get(n_sides, "polygon")
        blocks.append((name, vertices_cv))
        regions = {f"{_REGION}{r}": (mesh.region_c[cells] == i).astype(int) for i, r in enumerate(mesh.region_names)}
        marks.append({_ORDER: cells, **regions, "group": mesh.region_c[cells] + 1})
    group, field_data = len(mesh.region_names), {r: [i + 1, 2] for i, r in enumerate(mesh.region_names)}
    for name, pairs in mesh.named_edges.items():
        group += 1
        blocks.append(("line", np.asarray(pairs)))
        ones = np.ones(len(pairs), dtype=int)
        marks.append({f"{_EDGES}{name}": ones, "group": group * ones})
        field_data[name] = [group, 1]
    for name, vertex in mesh.named_points.items():
        group += 1
        blocks.append(("vertex", np.array([[vertex]])))
        marks.append({f"{_POINT}{name}": np.ones(1, dtype=int), "group": np.array([group])})
        field_data[name] = [group, 0]

    points = np.column_stack([mesh.points_vx, np.zeros(mesh.n_vertices)])
    if kind == ".inp":
        plane = [(n, b) for n, b in blocks if n in ("triangle", "quad")]
        sets = {r: [np.flatnonzero(m[f"{_REGION}{r}"]) for m in marks[: len(plane)]] for r in mesh.region_names}
        point_sets: dict[str, Any] = {f"{_POINT}{name}": np.array([v]) for name, v in mesh.named_points.items()}
        point_sets |= {f"{_EDGES}{name}": np.unique(pairs) for name, pairs in mesh.named_edges.items()}
        return meshio.Mesh(points, plane, point_sets=point_sets, cell_sets=sets)
    if kind == ".msh":
        groups = [m["group"].astype(np.int32) for m in marks]
        return meshio.Mesh(
            points, blocks, field_data={name: np.array(v) for name, v in field_data.items()},
            cell_data={"gmsh:physical": groups, "gmsh:geometrical": groups},
        )  # fmt: skip
    arrays = sorted({name for m in marks for name in m if name != "group"}, key=_array_order(mesh))
    cell_data = {
        name: [
            m.get(name, np.full(len(b), -1 if name == _ORDER else 0)) for m, (_, b) in zip(marks, blocks, strict=True)
        ]
        for name in arrays
    }
    return meshio.Mesh(points, blocks, cell_data={_quoted(name): values for name, values in cell_data.items()})


def _runs(mesh: PolygonMesh) -> Iterator[tuple[int, Int, Int]]:
    """As ``cells_by_size``, but in the order of the cells, for formats that cannot number them."""
    starts = np.flatnonzero(np.diff(mesh.n_sides_c, prepend=0))
    for first, last in itertools.pairwise([*starts.tolist(), mesh.n_cells]):
        n_sides = int(mesh.n_sides_c[first])
        entries = mesh.cell_vertices[mesh.cell_offsets[first] : mesh.cell_offsets[last]]
        yield n_sides, np.arange(first, last), entries.reshape(-1, n_sides)


def _array_order(mesh: PolygonMesh) -> Any:
    """Key that keeps names in the order in which the mesh has them."""
    names = [_ORDER, *(_REGION + r for r in mesh.region_names), *(_EDGES + e for e in mesh.named_edges)]
    names += [_POINT + p for p in mesh.named_points]
    return names.index


def _quoted(name: str) -> str:
    """Array names in VTK files have no spaces."""
    return name.replace("%", "%25").replace(" ", "%20")


def _unquoted(name: str) -> str:
    return name.replace("%20", " ").replace("%25", "%")


def _from_meshio(data: Any, path: Path, validate: bool) -> PolygonMesh:
    points = np.asarray(data.points, dtype=float)
    if points.shape[1] == 3:
        if len(points) and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points[:, :2], axis=0).max():
            raise InputError(
                f"{path} is not a plane mesh: z runs from {points[:, 2].min():g} to {points[:, 2].max():g}"
            )
        points = points[:, :2]
    cell_data = {_unquoted(name): values for name, values in data.cell_data.items()}
    loops: list[Int] = []
    number: list[int] = []
    where: list[tuple[int, int]] = []  # block and position of each plane cell
    for b, block in enumerate(data.cells):
        if block.type.startswith(_SOLIDS):
            raise InputError(f"{path} has {block.type} cells: give a mesh of plane cells")
        if block.type in _CORNERS or block.type.startswith("polygon"):
            corners = _CORNERS.get(block.type)
            for i, cell in enumerate(block.data):
                loops.append(np.asarray(cell[:corners], dtype=np.int64))
                where.append((b, i))
    if not loops:
        raise InputError(f"{path} has no plane cells (it has {', '.join(b.type for b in data.cells) or 'nothing'})")
    number = list(range(len(loops)))
    if _ORDER in cell_data:
        stored = [int(cell_data[_ORDER][b][i]) for b, i in where]
        if sorted(stored) == number:
            number = stored
    order = np.argsort(number, kind="stable").tolist()
    loops, where = [loops[n] for n in order], [where[n] for n in order]
    region_c, region_names = _regions_of(data, cell_data, where)
    named_points, named_edges = _names_of(data, cell_data, loops)
    return _assembled(points, loops, region_c, region_names, named_points, named_edges, validate)


def _regions_of(data: Any, cell_data: dict[str, Any], where: Sequence[tuple[int, int]]) -> tuple[Int, list[str]]:
    """Region of each plane cell, from marks, physical groups or element sets."""
    marks: dict[str, Any] = {n[len(_REGION) :]: v for n, v in cell_data.items() if n.startswith(_REGION)}
    if not marks and "gmsh:physical" in cell_data:
        physical = cell_data["gmsh:physical"]
        names = {int(v[0]): name for name, v in data.field_data.items() if int(v[1]) == 2}
        for tag in sorted({int(physical[b][i]) for b, i in where}):
            name = names.get(tag, f"region_{tag}" if tag else "domain")
            marks[name] = [np.asarray(values) == tag for values in physical]
    if not marks and data.cell_sets:
        blocks = [len(block.data) for block in data.cells]
        for name, sets in data.cell_sets.items():
            flags = [np.zeros(n, dtype=bool) for n in blocks]
            for flag, members in zip(flags, sets, strict=False):
                if members is not None and len(members):
                    flag[np.asarray(members, dtype=np.int64)] = True
            if any(flags[b][i] for b, i in where):
                marks[name] = flags
    if not marks and "region" in cell_data:
        values = cell_data["region"]
        for tag in sorted({int(values[b][i]) for b, i in where}):
            marks[f"region_{tag}"] = [np.asarray(v) == tag for v in values]
    names_list = list(marks) or ["domain"]
    region_c = np.zeros(len(where), dtype=np.int64)
    for n, name in enumerate(marks):
        flags = marks[name]
        chosen = [c for c, (b, i) in enumerate(where) if flags[b][i]]
        region_c[chosen] = n
    return region_c, names_list


def _names_of(data: Any, cell_data: dict[str, Any], loops: Sequence[Int]) -> tuple[dict[str, int], dict[str, Int]]:
    """Named points and edges, from marks, physical groups or sets of nodes."""
    named_points: dict[str, int] = {}
    named_edges: dict[str, Int] = {}
    physical = cell_data.get("gmsh:physical")
    groups = {(int(v[1]), int(v[0])): name for name, v in data.field_data.items() if len(np.atleast_1d(v)) == 2}
    found: dict[str, list[list[int]]] = {}
    for b, block in enumerate(data.cells):
        if not block.type.startswith(("line", "vertex")):
            continue
        dimension = 0 if block.type == "vertex" else 1
        for i, cell in enumerate(block.data):
            nodes = [int(v) for v in cell[: dimension + 1]]
            names = [n for n, v in cell_data.items() if n.startswith((_EDGES, _POINT)) and v[b][i]]
            names = [n.split(":", 1)[1] for n in names]
            if not names and physical is not None:
                names = [groups[dimension, int(physical[b][i])]] if (dimension, int(physical[b][i])) in groups else []
            for name in names:
                if dimension == 0:
                    named_points[name] = nodes[0]
                else:
                    found.setdefault(name, []).append(nodes)
    named_edges = {name: np.array(pairs, dtype=np.int64) for name, pairs in found.items()}
    for name, members in (data.point_sets or {}).items():
        bare = name.split(":", 1)[-1]
        if name.startswith(_EDGES):
            inside = set(np.asarray(members).tolist())
            pairs = {
                (min(a, b), max(a, b))
                for loop in loops
                for a, b in zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
                if a in inside and b in inside
            }
            named_edges[bare] = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
        elif len(members) == 1:
            named_points[bare] = int(members[0])
    return named_points, named_edges


def _assembled(
    points: Float, loops: Sequence[Int], region_c: Int, region_names: Sequence[str],
    named_points: dict[str, int], named_edges: dict[str, Int], validate: bool,
) -> PolygonMesh:  # fmt: skip
    """The mesh; unless it is only read, without vertices that no cell uses (centres of arcs, middles of sides)."""
    flat = np.concatenate(loops) if len(loops) else np.empty(0, dtype=np.int64)
    offsets = np.concatenate([[0], np.cumsum([len(loop) for loop in loops])]).astype(np.int64)
    if validate and len(flat) and flat.min() >= 0 and flat.max() < len(points):
        used = np.unique(flat)
        number = np.full(len(points), -1, dtype=np.int64)
        number[used] = np.arange(len(used))
        points, flat = points[used], number[flat]
        named_points = {name: int(number[v]) for name, v in named_points.items() if number[v] >= 0}
        named_edges = {name: number[pairs] for name, pairs in named_edges.items()}
    return PolygonMesh(
        points, offsets, flat, region_c, tuple(region_names), named_points, named_edges, validate=validate
    )


# -- Wavefront OBJ -----------------------------------------------------------------------------------------------------


def _write_obj(mesh: PolygonMesh, path: Path) -> None:
    lines = ["# polygon mesh; groups are regions"]
    lines += [f"# region {name}" for name in mesh.region_names]
    lines += [f"# point {vertex + 1} {name}" for name, vertex in mesh.named_points.items()]
    for name, pairs in mesh.named_edges.items():
        lines.append(f"# edges {','.join(f'{a}-{b}' for a, b in (pairs + 1).tolist())} {name}")
    lines += [f"v {x!r} {y!r} 0" for x, y in mesh.points_vx.tolist()]
    current = -1
    for loop, region in zip(mesh.cells(), mesh.region_c.tolist(), strict=True):
        if region != current:
            lines.append(f"g {mesh.region_names[region]}")
            current = region
        lines.append("f " + " ".join(map(str, (loop + 1).tolist())))
    path.write_text("\n".join(lines) + "\n")


def _read_obj(path: Path, validate: bool) -> PolygonMesh:
    points: list[list[float]] = []
    loops: list[Int] = []
    region_c: list[int] = []
    names: list[str] = []
    named_points: dict[str, int] = {}
    named_edges: dict[str, Int] = {}
    region = "domain"
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not a readable .obj file: {error}") from None
    for n, line in enumerate(text.splitlines(), start=1):
        word, _, rest = line.strip().partition(" ")
        try:
            if word == "v":
                values = [float(value) for value in rest.split()]
                if len(values) < 2 or (len(values) > 2 and abs(values[2]) > 0.0):
                    raise ValueError("a vertex needs x and y, and z = 0")
                points.append(values[:2])
            elif word == "f":
                corners = [int(entry.split("/")[0]) for entry in rest.split()]
                if 0 in corners:
                    raise ValueError("vertices count from 1")
                loops.append(np.array([v - 1 if v > 0 else len(points) + v for v in corners], dtype=np.int64))
                if region not in names:
                    names.append(region)
                region_c.append(names.index(region))
            elif word in ("g", "usemtl"):
                region = rest.strip() or "domain"
            elif word == "#" and rest.startswith("region "):
                names.append(rest[len("region ") :])
            elif word == "#" and rest.startswith("point "):
                _, vertex, name = rest.split(" ", 2)
                named_points[name] = int(vertex) - 1
            elif word == "#" and rest.startswith("edges "):
                _, pairs, name = rest.split(" ", 2)
                named_edges[name] = np.array([pair.split("-") for pair in pairs.split(",")], dtype=np.int64) - 1
        except ValueError as error:
            raise InputError(f"{path}, line {n}: '{line.strip()[:60]}' is not understood: {error}") from None
    if not loops:
        raise InputError(f"{path} has no faces")
    return _assembled(
        np.array(points, dtype=float).reshape(-1, 2), loops, np.array(region_c), names or ["domain"], named_points,
        named_edges, validate,
    )  # fmt: skip
