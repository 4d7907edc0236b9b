"""From what a file says to a mesh: planes, cells, groups, names and notes, and the plain formats."""

from __future__ import annotations

import pickle
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.files import io, isolated, obj, off
from tmc_vem.mesh.files.assemble import assemble
from tmc_vem.mesh.files.cell_data import add_groups, quoted, unquoted, whole_numbers
from tmc_vem.mesh.files.record import DECLARED, IMPLIED, Group, Reading, Record
from tmc_vem.mesh.files.regions import regions_of
from tmc_vem.mesh.files.text import lines_of, shown_line, text_of
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

# a row of three squares and a point above them that no cell has: 4 - 5 - 6 - 7
#                                                                 0 - 1 - 2 - 3
POINTS = np.array([[x, y] for y in (0, 1) for x in range(4)] + [[1, 3]], dtype=float)
SQUARES = [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]]


def group(*members: Any, name: str | None = None, number: int | None = None, rank: int = DECLARED) -> Group:
    return Group(np.array(members, dtype=np.int64), name, number, rank)


def record(points: Any = POINTS, loops: Any = SQUARES, **more: Any) -> Record:
    return Record(np.array(points, dtype=float), [np.array(loop) for loop in loops], **more)


def named(mesh: PolygonMesh) -> tuple[list[str], dict[str, int], dict[str, Any]]:
    regions = [mesh.region_names[r] for r in mesh.region_c]
    return regions, dict(mesh.named_points), {name: pairs.tolist() for name, pairs in mesh.named_edges.items()}


def listed(groups: list[Group]) -> list[Any]:
    return [(group.name, group.number, group.members.tolist()) for group in groups]


# -- cells and planes --------------------------------------------------------------------------------------------------


def test_cells_are_turned_and_nodes_numbered_anew() -> None:
    """In order of the nodes that cells have; the first corner of a cell stays the first."""
    loops = [[7, 6, 2, 3], [1, 2, 6, 5], [6, 2, 8], [5, 6, 8]]
    found = record(loops=loops, middles=np.array([0]))
    mesh = assemble(found, Reading())
    assert mesh.points_vx.tolist() == POINTS[[1, 2, 3, 5, 6, 7, 8]].tolist()
    assert [cell.tolist() for cell in mesh.cells()] == [[5, 4, 1, 2], [0, 1, 4, 3], [4, 6, 1], [3, 4, 6]]
    assert mesh.region_names == ("domain",)
    assert found.notes == [
        "a cell is clockwise and turned: cell 2",
        "a vertex belongs to no cell and is left out: vertex 4",
    ]


@pytest.mark.parametrize(
    ("n", "turned", "unused"),
    [(2, "2 cells are clockwise and turned: cell 0, 1", None),
     (5, "5 cells are clockwise and turned: cell 0, 1, 2 and 2 more",
      "5 vertices belong to no cell and are left out: vertex 4, 5, 6 and 2 more"),
     (3, "3 cells are clockwise and turned: cell 0, 1, 2",
      "3 vertices belong to no cell and are left out: vertex 4, 5, 6")],
)  # fmt: skip
def test_notes_name_three(n: int, turned: str, unused: str | None) -> None:
    points = [(0, 0), (1, 0), (1, 1), (0, 1)] + [(2, 2)] * (n if unused else 0)
    found = record(points, [[0, 3, 2]] * n + [[0, 1, 2, 3]])
    assemble(found, Reading())
    assert found.notes == [turned] + ([unused] if unused else [])


@pytest.mark.parametrize(
    ("points", "plane", "notes"),
    [
        ([[0, 0, 5], [2, 0, 5], [0, 2, 5]], [[0, 0], [2, 0], [0, 2]], []),
        ([[0, 5, 0], [2, 5, 0], [0, 5, 2]], [[0, 0], [2, 0], [0, 2]],
         ["the mesh lies in the xz plane: they are taken as x and y"]),
        ([[5, 0, 0], [5, 2, 0], [5, 0, 2]], [[0, 0], [2, 0], [0, 2]],
         ["the mesh lies in the yz plane: they are taken as x and y"]),
        ([[0, 0, 0], [2, 0, 0.0000019], [0, 2, 0]], [[0, 0], [2, 0], [0, 2]], []),
        ([[0, 0, 0], [2, 0, 0.000002], [0, 2, 0]], [[0, 0], [2, 0], [0, 2]], []),
        ([[0, 0, -1], [2, 0, 0], [0, 1, 0.25]],
         "it is not a plane mesh: z runs from -1 to 0.25; turn it into the xy plane", []),
        ([[0, 0, 0], [2, 0, 0.0000021], [0, 1, 0]],
         "it is not a plane mesh: z runs from 0 to 2.1e-06; turn it into the xy plane", []),
        ([[0, 0, np.nan], [2, 0, 0], [0, 1, 0.25]], [[0, 0], [2, 0], [0, 1]], []),
        ([[0, 0], [1e100, 0], [0, 1e100]], [[0, 0], [1e100, 0], [0, 1e100]], []),
        ([[0, 0], [0, -1.1e100], [2e100, 1]],
         "vertex 1 is at [0.0, -1.1e+100]: coordinates beyond 1e+100 are none", []),
    ],
)  # fmt: skip
def test_planes(points: Any, plane: Any, notes: list[str]) -> None:
    """A vertex that no cell has may be anywhere."""
    found = record([*points, [7e200] * len(points[0])], [[0, 1, 2]], middles=np.array([3]))
    if isinstance(plane, str):
        with pytest.raises(InputError) as refused:
            assemble(found, Reading())
        assert str(refused.value) == plane
    else:
        assert assemble(found, Reading()).points_vx.tolist() == plane
        assert found.notes == notes


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ([], "it has no plane cells"),
        ([[0, 1, 5], [0, 1]], "cell 1 has 2 vertices; a polygon needs at least 3"),
        ([[0, 1, 5], [0, 1, 2, 9]], "cell 1 refers to vertex 9; there are 9 vertices"),
        ([[0, 1, -1], [0, 1, 2, 3]], "cell 0 refers to vertex -1; there are 9 vertices"),
        ([[0, 1, 5], [9, 1, 2, 3]], "cell 1 refers to vertex 9; there are 9 vertices"),
    ],
)
def test_cells_that_are_refused(loops: Any, message: str) -> None:
    with pytest.raises(InputError) as refused:
        assemble(record(loops=loops), Reading())
    assert str(refused.value) == message


# -- names -------------------------------------------------------------------------------------------------------------


def test_edges_and_points() -> None:
    """Edges without a cell are left out, groups of an equal name are one, and several nodes are sides or points."""
    found = record(
        regions=[group(1, number=4), group(0, 2, name="ends")],
        edges=[group([0, 1], [1, 2], name="low"), group([8, 1], name="off"), group([0, 1], [8, 1], [8, 2], name="part"),
               group([2, 3], name="low"), group([3, 7], number=4)],
        nodes=[group(3, name="corner"), group(8, name="far"), group(name="empty"), group(4, number=9),
               group(5, 6, 7, name="top"), group(0, 1, 2, 5, name="more"), group(0, 7, name="two"),
               group(0, 1, 2, 3, 4, 5, 6, 7, 8, name="all"), group(1, 5, 6, name="edges:cut"), group(2, name="point:p"),
               group(0, 2, 3, 7, 5, name="mixed"), group(0, 2, 5, 7, 8, name="four"), group(5, 8, name="single")],
    )  # fmt: skip
    mesh = assemble(found, Reading())
    regions, points, edges = named(mesh)
    assert regions == ["ends", "region_4", "ends"]
    assert points == {"corner": 3, "point_9": 4, "two#1": 0, "two#2": 7, "p": 2, "mixed#1": 0, "mixed#2": 5,
                      "four#1": 0, "four#2": 2, "four#3": 5, "four#4": 7, "single": 5}  # fmt: skip
    assert edges == {
        "low": [[0, 1], [1, 2], [2, 3]], "part": [[0, 1]], "curve_4": [[3, 7]], "top": [[5, 6], [6, 7]],
        "more": [[0, 1], [1, 2], [1, 5]], "cut": [[1, 5], [5, 6]], "mixed": [[2, 3], [3, 7]],
    }  # fmt: skip
    assert found.notes == [
        "a vertex belongs to no cell and is left out: vertex 8",
        "named edges 'off': none of 1 edges is at a cell: left out",
        "named edges 'part': 2 of 3 edges are at no cell and left out",
        "named point 'far' is at no cell: left out",
        "'two' has 2 nodes that no side joins: points two#1, two#2",
        "'mixed' has 2 nodes that no side joins: points mixed#1, mixed#2, and edges 'mixed'",
        "'four' has 4 nodes that no side joins: points four#1, four#2, four#3 ...",
    ]


def test_sides_between_nodes_of_outlines() -> None:
    """If they reach all the nodes, only sides on outlines or between regions count; written by this program, all do."""
    for regions, name, inner in (
        ([], "a", []), ([group(0, name="x")], "a", [[1, 5]]), ([], "edges:a", [[1, 5], [2, 6]]),
        ([group(2, name="x"), group(0, 1, name="y")], "a", [[2, 6]]),
    ):  # fmt: skip
        found = record(POINTS[:8], regions=regions, nodes=[group(0, 1, 2, 4, 5, 6, name=name)])
        outer = [[0, 1], [0, 4], [1, 2], [4, 5], [5, 6]]
        assert assemble(found, Reading()).named_edges["a"].tolist() == sorted(outer + inner)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"edges": [group([0, 9], name="e")]}, "named edges 'e' refers to vertex 9; there are 9 vertices"),
        ({"edges": [group([0, -1], name="e")]}, "named edges 'e' refers to vertex -1; there are 9 vertices"),
        ({"nodes": [group(9, name="p")]}, "'p' refers to vertex 9; there are 9 vertices"),
        ({"nodes": [group(0, -2, name="p")]}, "'p' refers to vertex -2; there are 9 vertices"),
        ({"regions": [group(0, name="a"), group(1, 2, number=3)], "edges": [group([0, 1], number=3)]},
         "names: there is no group 'x' (there are: a, 3 (region region_3), 3 (curve curve_3))"),
        ({}, "names: there is no group 'x' (there are: none)"),
    ],
)  # fmt: skip
def test_groups_that_are_refused(more: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refused:
        assemble(record(**more), Reading({"x": "y"}))
    assert str(refused.value) == message


def test_names_are_given_by_name_or_number() -> None:
    """A number is that of a region if there is one."""
    groups = {"regions": [group(0, number=1), group(1, name="old", number=2), group(2, name="kept")],
              "edges": [group([0, 1], number=1), group([1, 2], number=5)], "nodes": [group(0, number=6)]}  # fmt: skip
    mesh = assemble(record(**groups), Reading({"1": "first", "old": "new", "5": "low", "point_6": "tip"}))
    assert named(mesh) == (["first", "new", "kept"], {"tip": 0}, {"curve_1": [[0, 1]], "low": [[1, 2]]})
    mesh = assemble(record(**groups), Reading({"region_1": "first", "1": "line", "2": "new"}))
    assert named(mesh)[0] == ["first", "new", "kept"]
    assert list(named(mesh)[2]) == ["line", "curve_5"]


def test_regions_of_nested_groups() -> None:
    """The smallest group; of equal ones that of the highest rank, or the first. Notes name the others of its rank."""
    groups = [group(0, 1, 2, 3, 4, name="all"), group(1, 2, name="low", rank=IMPLIED), group(1, 2, name="a"),
              group(2, 1, name="b"), group(3, name="c"), group(3, name="d"), group(5, name="all")]  # fmt: skip
    region_c, names, notes = regions_of(8, groups, [str(each.name) for each in groups])
    assert [names[r] for r in region_c] == ["all", "a", "a", "c", "all", "all", "domain", "domain"]
    assert names == ["domain", "all", "a", "c"]
    assert notes == [
        "2 cells (the first is 1) are in 'all' and 'b' as well as in 'a', the smallest of these groups, which is "
        "their region",
        "cell 3 is in 'all' and 'd' as well as in 'c', the smallest of these groups, which is their region",
        "2 cells (the first is 6) are in no group: region 'domain'",
    ]
    assert regions_of(2, [], [])[1:] == (["domain"], [])
    assert regions_of(1, [group(0, name="x")], ["x"])[1:] == (["x"], [])
    with pytest.raises(InputError) as refused:
        regions_of(4, [group(0, 1, 2, name="a"), group(2, 3, name="b")], ["a", "b"])
    assert str(refused.value) == (
        "cell 2 is in the groups 'a' and 'b', and neither contains the other: a cell has one region"
    )


# -- cell data ---------------------------------------------------------------------------------------------------------


def with_data(data: dict[str, Any], region_data: str | None = None, n: int = 3) -> Record:
    """Entries: an edge, ``n`` cells, a node."""
    found = record(loops=(SQUARES * n)[:n])
    add_groups(
        found, {name: np.array(values) for name, values in data.items()}, np.arange(1, n + 1), region_data,
        (np.array([0]), np.array([[3, 4]])), (np.array([n + 1]), np.array([7])),
    )  # fmt: skip
    return found


@pytest.mark.parametrize(
    ("data", "regions"),
    [
        ({"region": [9, 2, 0, 2, 9]}, [(None, 0, [1]), (None, 2, [0, 2])]),
        ({"region": [9, 2.0, -1.0, 2.0, 9]}, [(None, -1, [1]), (None, 2, [0, 2])]),
        ({"region": [[9], [2], [0], [2], [9]]}, [(None, 0, [1]), (None, 2, [0, 2])]),
        ({"MaterialIds": [0, 1, 1, 2, 0], "region": [0, 4, 5, 4, 0]}, [(None, 4, [0, 2]), (None, 5, [1])]),
        ({"MaterialIds": [0, 1, 1, 2, 0]}, [(None, 1, [0, 1]), (None, 2, [2])]),
        ({"gmsh:physical": [3, 1, 0, 2, 4], "region": [0] * 5}, [(None, 1, [0]), (None, 2, [2])]),
        ({"region": [0, 1, 1, 2, 0], "region:a%20b": [1, 1, 0, 1, 1]}, [("a b", None, [0, 2])]),
        ({"region:a": [1, 0, 0, 0, 1], "region:b": [0, 0, 1, 0, 0]}, [("b", None, [1])]),
        ({"other": [0, 1, 2, 2, 0], "cell_number": [0, 2, 0, 1, 0], "region": [0, 5, 6, 7, 0]},
         [(None, 5, [2]), (None, 6, [0]), (None, 7, [1])]),
        ({"cell_number": [0, 2, 0, 2, 0], "region": [0, 5, 6, 7, 0]}, [(None, 5, [0]), (None, 6, [1]), (None, 7, [2])]),
        ({"cell_number": [[0]] * 5, "region": [0, 5, 6, 7, 0]}, [(None, 5, [0]), (None, 6, [1]), (None, 7, [2])]),
    ],
)  # fmt: skip
def test_regions_of_cell_data(data: dict[str, Any], regions: Any) -> None:
    found = with_data(data)
    assert listed(found.regions) == regions
    order = [1, 2, 0] if data.get("cell_number") == [0, 2, 0, 1, 0] else [0, 1, 2]
    assert [loop.tolist() for loop in found.loops] == [SQUARES[c] for c in order]
    physical = "gmsh:physical" in data
    assert listed(found.edges) == ([(None, 3, [[3, 4]])] if physical else [])
    assert listed(found.nodes) == ([(None, 4, [7])] if physical else [])
    assert found.notes == []


def test_region_data_is_chosen_before_marks() -> None:
    data = {"region:a": [0, 1, 1, 1, 0], "soil": [9, 4, 4, 0, 9], "gmsh:physical": [1] * 5}
    assert listed(with_data(data, "soil").regions) == [(None, 0, [2]), (None, 4, [0, 1])]
    assert listed(with_data(data, "gmsh:physical").edges) == [(None, 1, [[3, 4]])]
    marked = with_data(data | {"edges:e": [1, 0, 0, 0, 0], "point:p": [0, 0, 0, 0, 2], "edges:f": [[1]] * 5})
    assert (listed(marked.edges), listed(marked.nodes)) == ([("e", None, [[3, 4]])], [("p", None, [7])])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "region_data: there is no cell data 'soil' (there are: none)"),
        ({"a%20": [0] * 5, "b": [0] * 5}, "region_data: there is no cell data 'soil' (there are: a , b)"),
        ({"soil": [[1, 2]] * 5}, "cell data 'soil' is no number a cell: it cannot tell regions"),
        ({"soil": ["a"] * 5}, "cell data 'soil' is no number a cell: it cannot tell regions"),
        ({"soil": [0, 1, 2.5, 1, 0]}, "cell data 'soil' is 2.5 for cell 2: regions need whole numbers"),
        ({"soil": [np.nan, 1, 2.5, 1, 0]}, "cell data 'soil' is nan for cell 0: regions need whole numbers"),
    ],
)
def test_region_data_that_is_refused(data: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as refused:
        with_data(data, "soil")
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("values", "n_cells", "offered"),
    [
        ([0, 1, 2, 1, 0], 3, 2), ([0, 1.0, 2.0, 1.0, 0], 3, 2), ([0, 1, 1, 1, 0], 3, 0), ([0, 1, 2, 3, 0], 3, 0),
        ([0, 1.5, 2.0, 1.5, 0], 3, 0), ([[0]] * 5, 3, 0), (["a"] * 5, 3, 0), ([True, True, False, True, True], 3, 0),
        ([0, *range(100), 0, 0], 101, 100), ([0, *range(101), 0, 0], 102, 0),
    ],
)  # fmt: skip
def test_data_that_may_tell_regions_is_offered(values: Any, n_cells: int, offered: int) -> None:
    """Of 2 to 100 whole values, and fewer than there are cells."""
    note = f"all cells are one region; cell data 'a' has {offered} values: region_data = \"a\" makes regions of them"
    assert with_data({"a": values}, n=n_cells).notes == ([note] if offered else [])
    assert with_data({"cell_number": values}, n=n_cells).notes == []
    assert with_data({"a": values, "region:b": [1] * len(values)}, n=n_cells).notes == []


def test_no_numbers_are_none() -> None:
    assert whole_numbers(np.empty(0), "a").shape == (0,)
    assert whole_numbers(np.array([[2.0], [3.0]]), "a").tolist() == [2, 3]


def test_quoted_names() -> None:
    every = "".join(map(chr, range(33, 127)))
    assert quoted(every) == every.translate({ord(ch): f"%{ord(ch):02X}" for ch in '%"<>&'})
    assert quoted(" \x7fé\n") == "%20%7F%C3%A9%0A"
    for name in (every, " \x7fé\n", "%41"):
        assert unquoted(quoted(name)) == name


# -- text formats ------------------------------------------------------------------------------------------------------


def test_lines_of_any_editor(tmp_path: Path) -> None:
    text = " one \\\r\ntwo\rthree \\ \n\nfour\\\n"
    for encoding in ("utf-8", "utf-8-sig", "utf-16", "latin-1"):
        (tmp_path / "a").write_bytes(f"é{text}".encode(encoding))
        assert text_of(tmp_path / "a") == f"é{text}"
        assert list(lines_of(tmp_path / "a")) == [
            (1, "é one \\"), (2, "two"), (3, "three \\"), (4, ""), (5, "four\\"), (6, ""),
        ]  # fmt: skip
        assert list(lines_of(tmp_path / "a", continued="\\")) == [(1, "é one  two"), (3, "three"), (5, "four")]
    (tmp_path / "a").write_bytes("é".encode("utf-16-be").join([b"\xfe\xff", b""]))
    assert text_of(tmp_path / "a") == "é"
    (tmp_path / "a").write_bytes(b"a\\")
    assert list(lines_of(tmp_path / "a", continued="\\")) == [(1, "a")]
    assert shown_line("x" * 60) == "x" * 60
    assert shown_line("y" * 61) == "y" * 57 + "..."


def of_text(module: Any, text: str, path: Path) -> Record:
    (path / "a").write_text(text)
    found: Record = module.read(path / "a", Reading())
    return found


def test_obj(tmp_path: Path) -> None:
    """Faces by positive and negative numbers; groups or materials, else objects, are regions."""
    text = "v 0 0\nv 1 0 5 7 # c\n{}f 1/2/3 2//4 -1 # c\nv 1 1\nv 0 1\n{}fo -4 -2 -1\nl 1 2 -1 # c\nl 3 4\nvn 1 2 3\n"
    found = of_text(obj, "v 9 9\n" + text.format("o a b\n", "o c\n").replace("-4 -2 -1", "1 -2 -1"), tmp_path)
    assert found.points.tolist() == [[9, 9, 0], [0, 0, 0], [1, 0, 5], [1, 1, 0], [0, 1, 0]]
    assert [loop.tolist() for loop in found.loops] == [[0, 1, 2], [0, 3, 4]]
    assert listed(found.regions) == [("a b", None, [0]), ("c", None, [1])]
    assert listed(found.edges) == [("lines", None, [[0, 1], [1, 4], [2, 3]])]
    for words, regions in (
        (("g a\no x\n", "usemtl b\n"), [("a", None, [0]), ("b", None, [1])]), (("", "g b\n"), [("b", None, [1])]),
        (("g a\n", ""), [("a", None, [0, 1])]), (("", ""), []), (("o x\n", "g\n"), []),
        (("# region b\n# region none\ng a\n", "g b\n"), [("b", None, [1]), ("a", None, [0])]),
    ):  # fmt: skip
        assert listed(of_text(obj, text.format(*words), tmp_path).regions) == regions
    assert [loop.tolist() for loop in of_text(obj, "v 0 \\\n0\nf 1 \\\n1 1\n", tmp_path).loops] == [[0, 0, 0]]
    marks = (
        "# point 2 tip of\n# point x y\n# edges 1-2,4-3 low %41\n# edges 1 few\n# edges 1-2-3 odd\n# regions no\n"
        "#point 1 n\n"
    )
    found = of_text(obj, text.format(marks, ""), tmp_path)
    assert listed(found.nodes) == [("tip of", None, [1])]
    assert listed(found.edges) == [("lines", None, [[0, 1], [1, 3], [2, 3]]), ("low %41", None, [[0, 1], [3, 2]])]
    head = "# polygon mesh; groups are regions; percent-encoded names\n"
    found = of_text(obj, head + text.format("# point 1 a%5C\n# edges 1-2 %25\ng b%5C\n", ""), tmp_path)
    assert listed(found.nodes + found.edges[1:] + found.regions) == [
        ("a\\", None, [0]), ("%", None, [[0, 1]]), ("b\\", None, [0, 1]),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("module", "text", "message"),
    [
        (obj, "v 0 0\n", "it has no faces"),
        (obj, "v 0\n", "line 1: 'v 0' is not understood: a vertex needs x and y"),
        (obj, "\nf 1 x\n", "line 2: 'f 1 x' is not understood: invalid literal for int() with base 10: 'x'"),
        (obj, "f 0\n", "line 1: 'f 0' is not understood: vertices count from 1"),
        (obj, "v 0 0\nf 1 1 1\n# point 2 tip\n", "point 'tip' are at a vertex that is not there; there are 1"),
        (obj, "v 0 0\nf 1 1 1\n# edges 1-0 low\n", "edges 'low' are at a vertex that is not there; there are 1"),
        (off, "", "it is empty"),
        (off, "# c\n\n", "it is empty"),
        (off, "4OFF\n1 1 1\n", "it is of the kind '4OFF': write plain OFF"),
        (off, "nOFF\n1 1 1\n", "it is of the kind 'nOFF': write plain OFF"),
        (off, "OFF BINARY\n1 1 1\n", "it is of the kind 'OFF BINARY': write plain OFF"),
        (off, "1 1 1\n", "it does not start with OFF"),
        (off, "OFFSET\n1 1 1\n", "it does not start with OFF"),
        (off, "OFF\n", "the numbers of vertices and faces are missing after OFF"),
        (off, "OFF\n1\n", "the numbers of vertices and faces are missing after OFF"),
        (off, "OFF 1 x\n", "the numbers of vertices and faces are missing after OFF"),
        (off, "OFF\n-1 0\n", "-1 vertices and 0 faces are announced and 0 lines are there"),
        (off, "OFF\n1 -1\n0 0\n", "1 vertices and -1 faces are announced and 1 lines are there"),
        (off, "OFF\n1 1\n0 0\n", "1 vertices and 1 faces are announced and 1 lines are there"),
        (off, "OFF\n1 1\n0\n1 0\n", "line 3: '0' is not understood: a vertex needs x, y and z"),
        (off, "OFF\n1 1\n0 0\n\n3 0 0\n", "line 5: '3 0 0' is not understood: a face of 3 needs as many vertices"),
        (off, "OFF\n1 1\n0 0\n1 y\n", "line 4: '1 y' is not understood: invalid literal for int() with base 10: 'y'"),
    ],
)  # fmt: skip
def test_texts_that_are_refused(module: Any, text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        of_text(module, text, tmp_path)
    assert str(refused.value) == message


@pytest.mark.parametrize("head", ["OFF\n3 2 9", "OFF 3 2 9", "# c\nCOFF # c\n\n3 2", "STCNOFF\n3 2 9", "NOFF 3 2"])
def test_off(head: str, tmp_path: Path) -> None:
    """Colours and normals after coordinates and corners are passed over, and so is what follows."""
    found = of_text(off, f"{head}\n0 0 5 9 9\n1 0\n1 1 2 # c\n3 0 1 2 9 9\n4 2 1 0 0\nmore\n", tmp_path)
    assert found.points.tolist() == [[0, 0, 5], [1, 0, 0], [1, 1, 2]]
    assert [loop.tolist() for loop in found.loops] == [[0, 1, 2], [2, 1, 0, 0]]


# -- reading -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "reason", "said"),
    [
        (".obj", "line 3: bad", "A, line 3: bad"), (".obj", "it has no faces", "A has no faces"),
        ("", "it is not a plane mesh", "A is not a plane mesh"), ("", "cell 3", "A: cell 3"),
        (".obj", "it is empty", "A is not a readable .obj file: it is empty"),
    ],
)  # fmt: skip
def test_messages_name_the_file(kind: str, reason: str, said: str) -> None:
    assert str(io._of_file("A", kind, reason)) == said


READER = """
import os, sys
from tmc_vem.support.errors import InputError
def read(path, reading):
    what = path.name
    if what == "crash":
        os.kill(os.getpid(), 11)
    if what == "leave":
        sys.stderr.write("first\\nlast word\\n")
        os._exit(3)
    if what == "silent":
        os._exit(4)
    if what == "names":
        return str(reading.names)
    errors = {"input": InputError("no good"), "value": ValueError("odd"), "key": KeyError(), "file": OSError(2, "gone")}
    raise errors[what]
"""


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("crash", "the library that reads it ended with signal 11"), ("leave", "reading it failed: last word"),
        ("silent", "reading it failed: exit code 4"),
    ],
)  # fmt: skip
def test_readers_in_a_process_of_their_own(
    name: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "odd_reader.py").write_text(READER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    with pytest.raises(InputError) as refused:
        isolated.read("odd_reader", Path(name), Reading())
    assert str(refused.value) == message


def test_what_a_process_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "other_reader.py").write_text(READER)
    monkeypatch.syspath_prepend(tmp_path)
    for name, answer in (
        ("input", "no good"), ("value", "it is damaged (odd)"), ("key", "it is damaged (KeyError)"),
        ("file", "it cannot be read: gone"), ("names", "{'a': 'b'}"),
    ):  # fmt: skip
        given = TextIOWrapper(BytesIO(pickle.dumps(Reading({"a": "b"}))))
        monkeypatch.setattr(sys, "stdin", given)
        assert isolated.serve("other_reader", name) == answer
