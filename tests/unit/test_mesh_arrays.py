"""Meshes as arrays: MATLAB, netCDF and MED, read in this process; what is read, and what is refused."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from tmc_vem.mesh.files import mat, med, netcdf, ugrid
from tmc_vem.mesh.files.netcdf import Variable
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.support.errors import InputError

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0.5]])
LOOPS = [[0, 1, 2, 3], [1, 4, 2]]


def listed(groups: list[Group]) -> list[Any]:
    return [(group.number, group.name, group.members.tolist()) for group in groups]


def loops(record: Record) -> list[list[int]]:
    return [loop.tolist() for loop in record.loops]


# -- MATLAB ------------------------------------------------------------------------------------------------------------


def cell_array(*entries: Any) -> np.ndarray[Any, Any]:
    column = np.empty((len(entries), 1), dtype=object)
    for n, entry in enumerate(entries):
        column[n, 0] = entry
    return column


CELLS = cell_array(*(np.array([loop]) + 1.0 for loop in LOOPS))
PADDED = np.array([[1.0, 2, 3, 4], [2, 5, 3, np.nan]])


def of_mat(path: Path, **tables: Any) -> Record:
    scipy.io.savemat(path / "a.mat", tables)
    return mat.read(path / "a.mat", Reading())


@pytest.mark.parametrize("elements", [CELLS, PADDED, np.nan_to_num(PADDED), np.nan_to_num(PADDED).astype(int)])
def test_elements_of_matlab(elements: Any, tmp_path: Path) -> None:
    record = of_mat(tmp_path, Node=POINTS, Element=elements)
    assert (record.points.tolist(), loops(record)) == (POINTS.tolist(), LOOPS)


@pytest.mark.parametrize("nodes", ["Node", "nodes", "vertices", "COORDINATES", "points", "p"])
@pytest.mark.parametrize("elements", ["Element", "elements", "elem", "elems", "cells", "faces", "connectivity", "t"])
def test_names_of_nodes_and_elements(nodes: str, elements: str) -> None:
    tables = mat._with_structures({nodes: POINTS, elements: CELLS, "other": 3})
    assert mat._of(tables[0], mat.NODES) is POINTS
    assert mat._of(tables[0], mat.ELEMENTS) is CELLS
    inner = mat._with_structures({"first": 3, "Mesh": {nodes: POINTS, elements: CELLS}})  # as HDF5 has it
    assert mat._of(inner[0], mat.NODES) is None
    assert mat._of(inner[1], mat.NODES) is POINTS


def test_structures_regions_and_names_of_matlab(tmp_path: Path) -> None:
    """The first table that has both; values for every element are data, of which 'region' tells regions."""
    inner = {"P": POINTS, "Cells": CELLS, "Region": np.array([[3.0], [1.0]])}
    assert listed(of_mat(tmp_path, Node=POINTS, mesh=inner).regions) == [(1, None, [1]), (3, None, [0])]
    tables: dict[str, Any] = {
        "node": np.pad(POINTS, ((0, 0), (0, 1)), constant_values=7.0), "elem": CELLS, "region": np.array([2, 1]),
        "region_names": cell_array("one", "two", "three"), "edge_names": cell_array("low", "up"),
        "edge_sets": cell_array(np.array([[1, 2], [2, 5]]), np.array([[3, 4]])), "point_names": cell_array("tip"),
        "point_sets": cell_array(5),
    }  # fmt: skip
    record = of_mat(tmp_path, **tables)
    assert listed(record.regions) == [(1, "one", [1]), (2, "two", [0])]
    assert listed(record.edges) == [(None, "low", [[0, 1], [1, 4]]), (None, "up", [[2, 3]])]
    assert listed(record.nodes) == [(None, "tip", [4])]
    assert record.points.tolist() == tables["node"].tolist()
    some = of_mat(tmp_path, **(tables | {"region": np.array([4, 0]), "region_names": cell_array("a", "b", "c")}))
    assert listed(some.regions) == [(0, None, [1]), (4, None, [0])]
    odd = of_mat(tmp_path, **(tables | {"edge_names": cell_array("low"), "point_names": np.array([1.0])}))
    assert (listed(odd.edges), listed(odd.nodes)) == ([], [])
    data = {"a": np.array([[5.0, 6.0]]), "b": np.array([True, False]), "c": np.array([1.0, 2.0, 3.0])}
    for name, regions in (("a", [(5, None, [0]), (6, None, [1])]), ("b", [(0, None, [1]), (1, None, [0])])):
        of_mat(tmp_path, Node=POINTS, Element=CELLS, **data)
        assert listed(mat.read(tmp_path / "a.mat", Reading(region_data=name)).regions) == regions
    with pytest.raises(InputError, match=r"no cell data 'c' \(there are: a, b\)$"):
        mat.read(tmp_path / "a.mat", Reading(region_data="c"))


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({}, "it has no Node and Element, nor node and elem (its variables: none)"),
        ({"x": 1}, "it has no Node and Element, nor node and elem (its variables: x)"),
        ({"Node": POINTS, "y": 2}, "it has no Node and Element, nor node and elem (its variables: Node, y)"),
        ({"Element": CELLS}, "it has no Node and Element, nor node and elem (its variables: Element)"),
        ({"Node": POINTS[:, :1], "Element": CELLS}, "its nodes have shape (5, 1), not (n, 2)"),
        ({"Node": np.zeros((2, 4)), "Element": CELLS}, "its nodes have shape (2, 4), not (n, 2)"),
        ({"Node": np.zeros((2, 2, 2)), "Element": CELLS}, "its nodes have shape (2, 2, 2), not (n, 2)"),
        ({"Node": POINTS, "Element": cell_array(np.array([1, 2, 3]), "abc")}, "element 2 is no list of numbers"),
        ({"Node": POINTS, "Element": cell_array(np.array([1, 2, 0]))},
         "element 1 has a node that is no number from 1 on"),
        ({"Node": POINTS, "Element": cell_array(np.array([1, 2, 3.5]))},
         "element 1 has a node that is no number from 1 on"),
        ({"Node": POINTS, "Element": cell_array([1], np.array([1, np.nan]))},
         "element 2 has a node that is no number from 1 on"),
        ({"Node": POINTS, "Element": np.array([[1, 2, 3], [-1, 2, 3]])},
         "element 2 has a node that is no number from 1 on"),
        ({"Node": POINTS, "Element": CELLS, "edge_names": cell_array("e"), "edge_sets": cell_array([[1, 6]])},
         "'e' has a node that is not there"),
        ({"Node": POINTS, "Element": CELLS, "point_names": cell_array("p"), "point_sets": cell_array(0)},
         "'p' has a node that is not there"),
    ],
)  # fmt: skip
def test_matlab_files_that_are_refused(tables: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        of_mat(tmp_path, **tables)
    assert str(refused.value) == message


def test_what_is_no_matlab_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    for start, message in (
        (b"\x89HDF", "it is of version 7.3: pip install h5py"), (b" " * 512 + b"\x89HDF", "it is of version 7.3"),
        (b"other", "it is no MATLAB file that scipy can read: "), (b" " * 511 + b"\x89HDF", "it is no MATLAB file"),
    ):  # fmt: skip
        (tmp_path / "a.mat").write_bytes(start + b"\0" * 600)
        with pytest.raises(InputError, match=f"^{message}"):
            mat.read(tmp_path / "a.mat", Reading())


# -- netCDF ------------------------------------------------------------------------------------------------------------


def attributes(**more: Any) -> dict[str, Any]:
    return {"cf_role": b"mesh_topology", "topology_dimension": 2, "node_coordinates": "x y",
            "face_node_connectivity": np.array(["faces"]), **more}  # fmt: skip


def variables(table: Any = ((0, 1, 2, 3), (1, 4, 2, -1)), **more: Any) -> dict[str, Variable]:
    """A mesh; ``more`` replaces variables."""
    found = {
        "mesh": Variable(np.array(0), (), attributes()),
        "x": Variable(POINTS[:, 0], ("node",), {}), "y": Variable(POINTS[:, 1], ("node",), {}),
        "faces": Variable(np.array(table), ("face", "side"), {"_FillValue": np.int32(-1)}),
    }  # fmt: skip
    return found | more


def of_ugrid(monkeypatch: pytest.MonkeyPatch, found: dict[str, Variable], region_data: str | None = None) -> Record:
    monkeypatch.setattr(ugrid, "variables_of", lambda path: found)
    return ugrid.read(Path("a.nc"), Reading(region_data=region_data))


NAN = float("nan")


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (((0, 1, 2, 3), (1, 4, 2, -1)), {}),
        (((0, 1, 2, 3), (1, 4, 2, 99)), {"_FillValue": 99}),
        (((1, 2, 3, 4), (2, 5, 3, 0)), {"start_index": np.array([1])}),
        (((1, 2, 3, 4), (2, 5, 3, -9)), {"start_index": 1, "_FillValue": [-9]}),
        (((0, 1, 2, 3), (1, 4, 2, NAN)), {"_FillValue": NAN}),
        (((1.0, 2, 3, 4), (2, 5, 3, NAN)), {"start_index": 1}),
        (((1.0, 2, 3, 4), (2, 5, 3, 1e30)), {"start_index": 1, "_FillValue": 1e30}),
    ],
)
@pytest.mark.parametrize("dimension", ["", "face", "other"])
def test_tables_of_faces(table: Any, said: dict[str, Any], dimension: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes count from 0 or 1, and rows are filled up; a table that says so may be transposed."""
    mesh = Variable(np.array(0), (), attributes(face_dimension=dimension) if dimension else attributes())
    faces = Variable(np.array(table), ("face", "side"), said)
    record = of_ugrid(monkeypatch, variables(mesh=mesh, faces=faces))
    assert (record.points.tolist(), loops(record)) == (POINTS.tolist(), LOOPS)
    if dimension == "face":
        turned = Variable(faces.values.T, ("side", "face"), said)
        assert loops(of_ugrid(monkeypatch, variables(mesh=mesh, faces=turned))) == LOOPS


def test_data_and_names_of_ugrid(monkeypatch: pytest.MonkeyPatch) -> None:
    flags = {"flag_values": np.array([7, 2]), "flag_meanings": "seven two%20b"}
    more = {
        "region": Variable(np.array([2, 7]), ("face",), flags), "code": Variable(np.array([5.0, 6.0]), ("face",), {}),
        "word": Variable(np.array(["a", "b"]), ("face",), {}), "wide": Variable(np.zeros((2, 2)), ("face", "two"), {}),
        "edges_10": Variable(np.array([[2, 3]]), ("n", "two"), {"tmc_vem": "up"}),
        "edges_2": Variable(np.array([[0, 1], [1, 4]]), ("n", "two"), {"tmc_vem": b"low%25"}),
        "edges_3": Variable(np.array([[0, 1]]), ("n", "two"), {}),
        "point_0": Variable(np.array([4]), ("one",), {"tmc_vem": "tip"}),
        "point_1": Variable(np.array(0), (), {"tmc_vem": "start"}),
        "other": Variable(np.array([2, 7]), ("face",), {"flag_values": np.array([2]), "flag_meanings": "x"}),
    }  # fmt: skip
    record = of_ugrid(monkeypatch, variables(**more))
    assert listed(record.regions) == [(2, "two b", [0]), (7, "seven", [1])]
    assert listed(record.edges) == [(None, "low%", [[0, 1], [1, 4]]), (None, "up", [[2, 3]])]
    assert listed(record.nodes) == [(None, "tip", [4]), (None, "start", [0])]
    assert record.notes == []
    assert listed(of_ugrid(monkeypatch, variables(**more), "code").regions) == [(5, None, [0]), (6, None, [1])]
    with pytest.raises(InputError, match=r"no cell data 'word' \(there are: region, code, other\)"):
        of_ugrid(monkeypatch, variables(**more), "word")
    some = Variable(np.array([2, 3]), ("face",), {"flag_values": np.array([2]), "flag_meanings": "two"})
    assert listed(of_ugrid(monkeypatch, variables(region=some)).regions) == [(2, "two", [0]), (3, None, [1])]
    more_words = Variable(np.array([2, 7]), ("face",), flags | {"flag_meanings": "a b c"})
    assert listed(of_ugrid(monkeypatch, variables(region=more_words)).regions) == [(2, None, [0]), (7, None, [1])]
    deep = Variable(np.array(0), (), attributes(node_coordinates="x y y"))
    assert of_ugrid(monkeypatch, variables(mesh=deep)).points.shape == (5, 2)
    second = variables(mesh2=Variable(np.array(0), (), attributes(node_coordinates="y x")))
    record = of_ugrid(monkeypatch, second)
    assert record.notes == ["it has 2 meshes of faces, of which the first is read"]
    assert record.points.tolist() == POINTS.tolist()


@pytest.mark.parametrize(
    ("found", "message"),
    [
        ({}, "it has no mesh_topology with face_node_connectivity: it is no UGRID file of plane cells"),
        (variables(mesh=Variable(np.array(0), (), attributes(cf_role="x"))),
         "it has no mesh_topology with face_node_connectivity: it is no UGRID file of plane cells"),
        (variables(mesh=Variable(np.array(0), (), attributes(face_node_connectivity=""))),
         "it has no mesh_topology with face_node_connectivity: it is no UGRID file of plane cells"),
        (variables(mesh=Variable(np.array(0), (), attributes(node_coordinates="x"))),
         "node_coordinates = 'x' must name two variables"),
        (variables(mesh=Variable(np.array(0), (), attributes(node_coordinates="x z"))),
         "it has no variable 'z', which its mesh_topology names"),
        (variables(mesh=Variable(np.array(0), (), attributes(face_node_connectivity="cells"))),
         "it has no variable 'cells', which its mesh_topology names"),
        (variables(faces=Variable(np.array([0, 1, 2]), ("face",), {})),
         "its faces have shape (3,): they need the nodes of a face in a row"),
        (variables(faces=Variable(np.array([["0", "1"]]), ("face", "side"), {})),
         "its faces have shape (1, 2): they need the nodes of a face in a row"),
        (variables(((0, 1, 2, -1), (0, -1, 2, 3))), "face 1 has a node after one that is missing"),
        (variables(edges_0=Variable(np.array([[0, 5]]), ("n", "two"), {"tmc_vem": "e"})),
         "'edges_0' has a node that is not there"),
        (variables(point_0=Variable(np.array([-1]), ("one",), {"tmc_vem": "e"})),
         "'point_0' has a node that is not there"),
    ],
)  # fmt: skip
def test_netcdf_files_that_are_refused(
    found: dict[str, Variable], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError) as refused:
        of_ugrid(monkeypatch, found)
    assert str(refused.value) == message


def test_formats_of_netcdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for version in (1, 2):
        with scipy.io.netcdf_file(tmp_path / "a.nc", "w", version=version) as data:
            data.createDimension("n", 2)
            data.createVariable("a", "i4", ("n",))[:] = [3, -1]
            data.variables["a"]._FillValue, data.variables["a"].scale_factor = np.int32(-1), 2.0
        found = netcdf.variables_of(tmp_path / "a.nc")
        assert (list(found), found["a"].dimensions, found["a"].values.tolist()) == (["a"], ("n",), [3, -1])
        assert (found["a"].number("_FillValue"), found["a"].number("none"), found["a"].text("none")) == (-1.0, None, "")
    monkeypatch.setitem(sys.modules, "netCDF4", None)
    monkeypatch.setitem(sys.modules, "h5py", None)
    for content, message in (
        (b"CDX\1", "it is no netCDF file"), (b"", "it is no netCDF file"), (b"\x89HDX", "it is no netCDF file"),
        (b"CDF\5", "it is of netCDF's format 5: pip install netCDF4"),
        (b"\x89HDF", r"it is netCDF 4: pip install netCDF4 \(or h5py\)"), (b"CDF\1xyz", "scipy cannot read it: .+"),
    ):  # fmt: skip
        (tmp_path / "b.nc").write_bytes(content)
        with pytest.raises(InputError, match=f"^{message}$"):
            netcdf.variables_of(tmp_path / "b.nc")


# -- MED ---------------------------------------------------------------------------------------------------------------


class Folder(dict[str, Any]):
    """A group of an HDF5 file, with paths and attributes."""

    def __init__(self, entries: dict[str, Any], **attrs: Any) -> None:
        super().__init__(entries)
        self.attrs = attrs

    def __getitem__(self, path: str) -> Any:
        head, _, rest = path.partition("/")
        return super().__getitem__(head)[rest] if rest else super().__getitem__(head)

    def __contains__(self, path: object) -> bool:
        head, _, rest = str(path).partition("/")
        return super().__contains__(head) and (not rest or rest in super().__getitem__(head))

    def get(self, path: str, default: Any = None) -> Any:
        return self[path] if path in self else default  # noqa: SIM401


class Numbers(np.ndarray[Any, Any]):
    attrs: dict[str, Any]


def with_size(values: Any, n: int) -> Numbers:
    array = np.asarray(values).view(Numbers)
    array.attrs = {"NBR": n}
    return array


def med_file(cells: dict[str, Any], *, families: Any = None, groups: dict[int, list[Any]] | None = None,
             points: Any = None, **meshes: Any) -> Folder:  # fmt: skip
    where = np.arange(20.0).reshape(10, 2) if points is None else points
    nodes: dict[str, Any] = {"COO": with_size(where.T.ravel(), len(where))}
    if families is not None:
        nodes["FAM"] = np.array(families)
    step = Folder({"NOE": Folder(nodes), "MAI": Folder(cells)})
    found = {
        str(n): Folder({"GRO": Folder({"NOM": np.array(names, dtype=object)})} if names else {}, NUM=n)
        for n, names in (groups or {}).items()
    }
    kinds = {"ELEME": Folder({k: v for k, v in found.items() if int(k) < 0}),
             "NOEUD": Folder({k: v for k, v in found.items() if int(k) > 0})}  # fmt: skip
    return Folder(
        {"ENS_MAA": Folder({"m": Folder({"info": 3, "-1": step}), **meshes}), "FAS": Folder({"m": Folder(kinds)})}
    )


def of(rows: Any, family: Any = None, index: Any = None) -> Folder:
    entries: dict[str, Any] = {"NOD": np.array(rows)}
    if family is not None:
        entries["FAM"] = np.array(family)
    if index is not None:
        entries["INN"] = np.array(index)
    return Folder(entries)


@pytest.mark.parametrize(
    ("kind", "corners", "n"), [("TR3", 3, 3), ("TR6", 3, 6), ("TR7", 3, 7), ("QU4", 4, 4), ("QU8", 4, 8), ("QU9", 4, 9)]
)
def test_cells_of_med(kind: str, corners: int, n: int) -> None:
    """All first nodes, then all second ones, counted from 1."""
    rows = np.array([np.arange(1, n + 1), np.arange(n, 0, -1)])
    record = med._record(med_file({kind: of(rows.T.ravel())}))
    assert loops(record) == (rows[:, :corners] - 1).tolist()
    assert record.middles.tolist() == sorted(set((rows[:, corners:] - 1).ravel().tolist()))
    assert record.points.tolist() == np.arange(20.0).reshape(10, 2).tolist()
    assert (record.regions, record.edges, record.nodes, record.notes) == ([], [], [], [])


def test_groups_of_med() -> None:
    """Families have several groups; a group of nodes called as one of cells or edges is that one."""
    names = {-1: [b"a" + b"\0" * 9, b"b"], -2: [np.array([98, 0, 99])], -3: [], -4: [b"e", b"f\xf6 "],
             5: [b"tip", b"a"], 6: [b"tip"]}  # fmt: skip
    cells = {
        "TR3": of([1, 4, 2, 5, 3, 6], [-1, -2]), "POG": of([1, 2, 3, 4, 7, 8, 9], [-2, 0], [1, 5, 8]),
        "PO2": of([1, 2, 3, 4, 5, 6], [-3], [1, 7]), "SE2": of([1, 2, 2, 3], [-4, 0]), "SE3": of([5, 6, 10], [-4]),
        "SE4": of([7, 8, 9, 10]), "PO1": of([1]),
    }  # fmt: skip
    record = med._record(med_file(cells, families=[0, 0, 6, 5, 0, 0, 0, 0, 0, 6], groups=names, n=Folder({})))
    assert loops(record) == [[0, 1, 2], [3, 4, 5], [0, 1, 2, 3], [6, 7, 8], [0, 1, 2]]
    assert record.middles.tolist() == [3, 4, 5, 8, 9]
    assert listed(record.regions) == [(None, "b", [1, 2, 0]), (None, "a", [0])]
    assert listed(record.edges) == [(None, "e", [[0, 1], [4, 5]]), (None, "f\ufffd", [[0, 1], [4, 5]])]
    assert listed(record.nodes) == [(None, "tip", [3, 2, 9])]
    assert record.notes == ["it has the meshes m, n, of which the first is read"]
    bare = Folder({"ENS_MAA": med_file({"TR3": of([1, 2, 3])})["ENS_MAA"]})
    assert loops(med._record(bare)) == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (Folder({}), "it has no mesh"),
        (Folder({"ENS_MAA": Folder({})}), "it has no mesh"),
        (Folder({"ENS_MAA": Folder({"m": Folder({"info": 3, "step": Folder({})})})}), "its mesh 'm' has no nodes"),
        (med_file({}, points=np.zeros((4, 1))), "its nodes have 1 coordinates"),
        (med_file({}, points=np.zeros((4, 4))), "its nodes have 4 coordinates"),
        (med_file({"TR3": of([1, 2, 3], [0, 0])}), "2 families are given for 1 cells or nodes"),
        (med_file({}, families=[0]), "1 families are given for 10 cells or nodes"),
        (med_file({k: of([1]) for k in ("TE4", "HE8", "PE6", "XX1")}),
         "it has solid cells (1 of type MED TE4, 1 of type MED HE8, 1 of type MED PE6): give a mesh of plane cells"),
        (med_file({"XX1": of([1]), "YY2": of([1])}),
         "cells that cannot be read: 1 of type MED XX1, 1 of type MED YY2; plane cells are, of any order"),
    ],
)  # fmt: skip
def test_med_files_that_are_refused(file: Folder, message: str) -> None:
    with pytest.raises(InputError) as refused:
        med._record(file)
    assert str(refused.value) == message


def test_med_files_without_h5py(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r"^MED files need h5py: pip install h5py$"):
        med.read(tmp_path / "a.med", Reading())
