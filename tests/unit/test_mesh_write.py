"""What every format has of a mesh: texts to the letter, arrays by the libraries of others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import scipy.io

from tmc_vem.mesh.files.io import read_mesh, write_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

POINTS = [[0, 0], [1, 0], [2, 0.5], [1, 1], [0, 1], [2, 1], [-1, 0.5]]
FOURS, PENTAGON = [[0, 1, 3, 4], [1, 2, 3], [2, 5, 3], [0, 4, 6]], [[1, 2, 5, 3, 4], [0, 1, 4]]


def mesh_of(cells: list[list[int]], *, quote: str = "", tail: str = "") -> PolygonMesh:
    regions = [1, 1, 0, 1][: len(cells)]
    return PolygonMesh.from_cells(
        np.array(POINTS, dtype=float)[: 1 + max(map(max, cells))], cells, regions, (f"a b{quote}", f"c{tail}"),
        {"tip": 2, f"p{tail}": 0}, {f"low{tail}": np.array([[0, 1], [1, 2]]), "up": np.array([[3, 4]])},
    )  # fmt: skip


def written(mesh: PolygonMesh, suffix: str, path: Path) -> Path:
    write_mesh(mesh, path / f"a{suffix}")
    return path / f"a{suffix}"


OBJ = """# polygon mesh; groups are regions
# region a b
# region c
# point 3 tip
# point 1 p
# edges 1-2,2-3 low
# edges 4-5 up
v 0.0 0.0 0
v 1.0 0.0 0
v 2.0 0.5 0
v 1.0 1.0 0
v 0.0 1.0 0
v 2.0 1.0 0
v -1.0 0.5 0
g c
f 1 2 4 5
f 2 3 4
g a b
f 3 6 4
g c
f 1 5 7
"""
OFF = """OFF
7 4 {}
0.0 0.0 0
1.0 0.0 0
2.0 0.5 0
1.0 1.0 0
0.0 1.0 0
2.0 1.0 0
-1.0 0.5 0
4 0 1 3 4
3 1 2 3
3 2 5 3
3 0 4 6
"""
INP = """*HEADING
polygon mesh
*NODE
1, 0.0, 0.0
2, 1.0, 0.0
3, 2.0, 0.5
4, 1.0, 1.0
5, 0.0, 1.0
6, 2.0, 1.0
7, -1.0, 0.5
*ELEMENT, TYPE=CPE4
1, 1, 2, 4, 5
*ELEMENT, TYPE=CPE3
2, 2, 3, 4
3, 3, 6, 4
4, 1, 5, 7
*ELSET, ELSET="a b"
3
*ELSET, ELSET="c"
1, 2, 4
*ELEMENT, TYPE=T2D2, ELSET="low"
5, 1, 2
6, 2, 3
*ELEMENT, TYPE=T2D2, ELSET="up"
7, 4, 5
*NSET, NSET="tip"
3
*NSET, NSET="p"
1
"""


def test_texts_to_the_letter(tmp_path: Path) -> None:
    mesh = mesh_of(FOURS)
    assert written(mesh, ".obj", tmp_path).read_text() == OBJ
    assert written(mesh, ".off", tmp_path).read_text() == OFF.format(len(mesh.edges))
    assert written(mesh, ".inp", tmp_path).read_text() == INP
    quoted = written(mesh_of(FOURS, quote="%", tail="\\"), ".obj", tmp_path).read_text().splitlines()
    assert quoted[:7] == [
        "# polygon mesh; groups are regions; percent-encoded names", "# region a b%25", "# region c%5C",
        "# point 3 tip", "# point 1 p%5C", "# edges 1-2,2-3 low%5C", "# edges 4-5 up",
    ]  # fmt: skip
    assert quoted[14:16] == ["g c%5C", "f 1 2 4 5"]


def test_long_sets_are_wrapped(tmp_path: Path) -> None:
    points = [[x, y] for x in range(15) for y in (0, 1)]
    cells = [[2 * n, 2 * n + 2, 2 * n + 3, 2 * n + 1] for n in range(14)]
    lines = written(PolygonMesh.from_cells(np.array(points, float), cells), ".inp", tmp_path).read_text().splitlines()
    assert lines[-2:] == [", ".join(map(str, range(1, 13))), "13, 14"]


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_marks_of_vtk(suffix: str, tmp_path: Path) -> None:
    """Cells by their numbers of sides, then edges and points; every name has an array that marks what it is of."""
    found = meshio.read(written(mesh_of(PENTAGON), suffix, tmp_path))
    assert found.points.tolist() == [[*point, 0.0] for point in POINTS[:6]]
    blocks = [(block.type.rstrip("0123456789"), np.asarray(block.data).tolist()) for block in found.cells]
    assert blocks == [
        ("triangle", [[0, 1, 4]]), ("polygon", [[1, 2, 5, 3, 4]]), ("line", [[0, 1], [1, 2], [3, 4]]),
        ("vertex", [[2], [0]]),
    ]  # fmt: skip
    data = {name: np.concatenate(values).astype(int).tolist() for name, values in found.cell_data.items()}
    assert data == {
        "cell_number": [1, 0, -1, -1, -1, -1, -1], "region:a%20b": [0] * 7, "region:c": [1, 1, 0, 0, 0, 0, 0],
        "edges:low": [0, 0, 1, 1, 0, 0, 0], "edges:up": [0, 0, 0, 0, 1, 0, 0], "point:tip": [0, 0, 0, 0, 0, 1, 0],
        "point:p": [0, 0, 0, 0, 0, 0, 1],
    }  # fmt: skip


def test_groups_of_gmsh(tmp_path: Path) -> None:
    """Numbered on through all dimensions; cells in their order."""
    path = written(mesh_of(FOURS), ".msh", tmp_path)
    found = meshio.read(path)
    assert path.read_bytes().startswith(b"$MeshFormat\n2.2 1 8\n")
    assert found.points.tolist() == [[*point, 0.0] for point in POINTS]
    assert [(block.type, block.data.tolist()) for block in found.cells] == [
        ("quad", [FOURS[0]]), ("triangle", FOURS[1:]), ("line", [[0, 1], [1, 2], [3, 4]]), ("vertex", [[2], [0]]),
    ]  # fmt: skip
    for name in ("gmsh:physical", "gmsh:geometrical"):
        assert [values.tolist() for values in found.cell_data[name]] == [[2], [2, 1, 2], [3, 3, 4], [5, 6]]
    names = {name: values.tolist() for name, values in found.field_data.items()}
    assert names == {"a b": [1, 2], "c": [2, 2], "low": [3, 1], "up": [4, 1], "tip": [5, 0], "p": [6, 0]}
    same = PolygonMesh.from_cells(np.array(POINTS[:5], float), [FOURS[0], [1, 2, 3]], None, ("x",), {"x": 2},
                                  {"x": np.array([[0, 1]])})  # fmt: skip
    again = read_mesh(written(same, ".msh", tmp_path))
    assert (again.region_names, dict(again.named_points), list(again.named_edges)) == (("x",), {"x": 2}, ["x"])


def test_tables_of_matlab(tmp_path: Path) -> None:
    found = scipy.io.loadmat(written(mesh_of(PENTAGON), ".mat", tmp_path))
    assert found["Node"].tolist() == POINTS[:6]
    assert [row.tolist() for row in found["Element"][:, 0]] == [[[2, 3, 6, 4, 5]], [[1, 2, 5]]]
    assert found["region"].tolist() == [[2], [2]]
    assert [str(name[0]) for name in found["region_names"][:, 0]] == ["a b", "c"]
    assert [str(name[0]) for name in found["edge_names"][:, 0]] == ["low", "up"]
    assert [pairs.tolist() for pairs in found["edge_sets"][:, 0]] == [[[1, 2], [2, 3]], [[4, 5]]]
    assert [str(name[0]) for name in found["point_names"][:, 0]] == ["tip", "p"]
    assert [vertex.tolist() for vertex in found["point_sets"][:, 0]] == [[[3]], [[1]]]
    bare = PolygonMesh.from_cells([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    assert not {"edge_names", "point_names"} & scipy.io.loadmat(written(bare, ".mat", tmp_path)).keys()


def test_variables_of_ugrid(tmp_path: Path) -> None:
    """Attributes and dimensions as the conventions want them."""
    with scipy.io.netcdf_file(written(mesh_of(PENTAGON), ".nc", tmp_path), mmap=False) as data:
        assert (data.version_byte, data.Conventions) == (2, b"CF-1.8 UGRID-1.0")
        assert data.dimensions == {"node": 6, "face": 2, "side": 5, "two": 2, "one": 1, "edges_0": 2, "edges_1": 1}
        found: dict[str, Any] = {
            name: (v.typecode() + str(v.itemsize()), v.dimensions, np.array(v.data).tolist(),
                   {key: np.asarray(value).tolist() for key, value in v._attributes.items()})
            for name, v in data.variables.items()
        }  # fmt: skip
    mesh = found.pop("mesh")
    assert (mesh[1], mesh[3]) == ((), {
        "cf_role": b"mesh_topology", "topology_dimension": 2, "node_coordinates": b"node_x node_y",
        "face_node_connectivity": b"face_nodes", "face_dimension": b"face",
    })  # fmt: skip
    assert found == {
        "node_x": ("d8", ("node",), [point[0] for point in POINTS[:6]], {}),
        "node_y": ("d8", ("node",), [point[1] for point in POINTS[:6]], {}),
        "face_nodes": ("i4", ("face", "side"), [[1, 2, 5, 3, 4], [0, 1, 4, -1, -1]],
                       {"start_index": 0, "_FillValue": -1}),
        "region": ("i4", ("face",), [1, 1], {"flag_values": [0, 1], "flag_meanings": b"a%20b c"}),
        "edges_0": ("i4", ("edges_0", "two"), [[0, 1], [1, 2]], {"tmc_vem": b"low"}),
        "edges_1": ("i4", ("edges_1", "two"), [[3, 4]], {"tmc_vem": b"up"}),
        "point_0": ("i4", ("one",), [2], {"tmc_vem": b"tip"}), "point_1": ("i4", ("one",), [0], {"tmc_vem": b"p"}),
    }  # fmt: skip


@pytest.mark.parametrize("suffix", [".obj", ".inp", ".msh", ".mat", ".nc", ".vtu", ".vtk", ".off"])
@pytest.mark.parametrize(("character", "holds"), [("\n", (".vtu", ".vtk", ".off")),
                                                  ('"', (".vtu", ".vtk", ".off", ".obj", ".mat", ".nc"))])  # fmt: skip
def test_names_that_formats_cannot_hold(suffix: str, character: str, holds: tuple[str, ...], tmp_path: Path) -> None:
    for options, name in (({"quote": character}, f"a b{character}"), ({"tail": character}, f"c{character}")):
        mesh = mesh_of(FOURS, **options)
        if suffix in holds:
            written(mesh, suffix, tmp_path)
            continue
        with pytest.raises(InputError) as refused:
            written(mesh, suffix, tmp_path)
        assert str(refused.value) == f"{tmp_path}/a{suffix}: {suffix} cannot hold the name {name!r}: write .vtu"
        assert not (tmp_path / f"a{suffix}").exists()


def test_polygons_in_formats_without_them(tmp_path: Path) -> None:
    for suffix in (".msh", ".inp"):
        with pytest.raises(InputError) as refused:
            written(mesh_of(PENTAGON), suffix, tmp_path)
        assert str(refused.value) == (
            f"{tmp_path}/a{suffix}: cell 0 has 5 sides, but {suffix} holds triangles and quadrilaterals only: "
            "write .vtu, .vtk or .obj"
        )
