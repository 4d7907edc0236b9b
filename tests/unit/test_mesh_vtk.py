"""VTK's files, legacy and XML: every type of cell, kind of number, attribute and encoding, and what is refused."""

from __future__ import annotations

import base64
import lzma
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import plain_words

from tmc_vem.mesh.files import vtk, vtu
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.mesh.files.vtk_cells import VtkCells, to_record
from tmc_vem.support.errors import InputError

# -- cells -------------------------------------------------------------------------------------------------------------

NINE = list(range(9, 0, -1))
# type, nodes, and what is read: a cell by its corners, nodes in the middle
PLANE: list[tuple[int, list[int], list[list[int]], list[int]]] = [
    (5, [3, 1, 2], [[3, 1, 2]], []),
    (9, [3, 1, 2, 0], [[3, 1, 2, 0]], []),
    (22, [3, 1, 2, 7, 8, 9], [[3, 1, 2]], [7, 8, 9]),
    (23, [3, 1, 2, 0, 6, 7, 8, 9], [[3, 1, 2, 0]], [6, 7, 8, 9]),
    (28, [0, 1, 2, 3, 4, 5, 6, 7, 8], [[0, 1, 2, 3]], [4, 5, 6, 7, 8]),
    (30, [0, 1, 2, 3, 4, 5], [[0, 1, 2, 3]], [4, 5]),
    (34, [3, 1, 2, 6, 7, 8, 9], [[3, 1, 2]], [6, 7, 8, 9]),
    (69, NINE, [[9, 8, 7]], [1, 2, 3, 4, 5, 6]),
    (70, NINE, [[9, 8, 7, 6]], [1, 2, 3, 4, 5]),
    (76, NINE, [[9, 8, 7]], [1, 2, 3, 4, 5, 6]),
    (77, NINE, [[9, 8, 7, 6]], [1, 2, 3, 4, 5]),
    (7, NINE, [NINE], []),
    (36, [9, 8, 7, 6, 5, 4, 3, 2], [[9, 8, 7, 6]], [2, 3, 4, 5]),
    (8, [5, 6, 7, 8], [[5, 6, 8, 7]], []),
    (6, [1, 3, 5, 7, 9], [[1, 3, 5], [5, 3, 7], [5, 7, 9]], []),
    (6, [1, 3, 5], [[1, 3, 5]], []),
]
SOLIDS = {
    10: "tetrahedron", 11: "voxel", 12: "hexahedron", 13: "wedge", 14: "pyramid", 15: "pentagonal prism",
    16: "hexagonal prism", 24: "quadratic tetrahedron", 25: "quadratic hexahedron", 26: "quadratic wedge",
    27: "quadratic pyramid", 42: "polyhedron", 71: "Lagrange tetrahedron", 72: "Lagrange hexahedron",
    73: "Lagrange wedge",
}  # fmt: skip


def cells_of(*cells: tuple[int, list[int]], **data: Any) -> VtkCells:
    sizes = [len(nodes) for _, nodes in cells]
    flat = [node for _, nodes in cells for node in nodes]
    return VtkCells(
        np.zeros((10, 3)), np.array([kind for kind, _ in cells], dtype=np.int64), np.cumsum([0, *sizes]),
        np.array(flat, dtype=np.int64), {name: np.array(values) for name, values in data.items()},
    )  # fmt: skip


def listed(groups: list[Group]) -> list[Any]:
    return [(group.name, group.number, group.members.tolist()) for group in groups]


def loops(record: Record) -> list[list[int]]:
    return [loop.tolist() for loop in record.loops]


@pytest.mark.parametrize(("kind", "nodes", "corners", "middles"), PLANE)
def test_types_of_plane_cells(kind: int, nodes: list[int], corners: list[list[int]], middles: list[int]) -> None:
    record = to_record(cells_of((5, [0, 1, 2]), (kind, nodes), (5, [2, 1, 3]), region=[4, 3, 4]), Reading())
    assert loops(record) == [[0, 1, 2], *corners, [2, 1, 3]]
    assert record.middles.tolist() == middles
    n = len(corners)
    assert listed(record.regions) == [(None, 3, list(range(1, n + 1))), (None, 4, [0, n + 1])]


def test_edges_and_points_are_those_of_their_own_entries() -> None:
    cells = [(1, [8]), (3, [0, 1]), (21, [1, 2, 9]), (5, [0, 1, 2]), (35, [2, 3, 7, 6]), (68, [3, 4]), (75, [4, 5]),
             (4, [7, 5, 3]), (4, [2]), (2, [6, 4])]  # fmt: skip
    marks = {"edges:all": [0, 1, 1, 0, 1, 1, 1, 0, 1, 1], "edges:poly": [0] * 7 + [1, 0, 0], "edges:none": [0] * 10,
             "point:both": [1] + [0] * 8 + [1], "point:last": [0] * 9 + [1],
             "region:r": [[n == 3] for n in range(10)]}  # fmt: skip
    record = to_record(cells_of(*cells, **marks), Reading())
    assert loops(record) == [[0, 1, 2]]
    assert record.middles.tolist() == [6, 7, 9]
    assert listed(record.edges) == [
        ("all", None, [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]]), ("poly", None, [[7, 5], [5, 3]]),
    ]  # fmt: skip
    assert listed(record.nodes) == [("both", None, [8, 6, 4]), ("last", None, [6, 4])]
    assert listed(record.regions) == [("r", None, [0])]
    physical = to_record(cells_of(*cells, **{"gmsh:physical": [7, 5, 0, 2, 5, 0, 0, 3, 0, 6]}), Reading())
    assert listed(physical.edges) == [(None, 3, [[7, 5], [5, 3]]), (None, 5, [[0, 1], [2, 3]])]
    assert listed(physical.nodes) == [(None, 6, [6, 4]), (None, 7, [8])]
    assert listed(physical.regions) == [(None, 2, [0])]


def test_solid_and_unknown_cells_are_named() -> None:
    kinds = ", ".join(f"1 of type {name}" for name in SOLIDS.values())
    with pytest.raises(InputError, match=rf"^it has solid cells \({kinds}\): give a mesh of plane cells$"):
        to_record(cells_of(*((kind, [0, 1, 2, 3]) for kind in SOLIDS), (99, [0])), Reading())
    bad = [(5, [0, 1]), (9, [0, 1, 2]), (36, [0, 1, 2]), (8, [0, 1, 2]), (6, [0, 1]), (3, [0]), (33, []), (0, [])]
    words = ("1 of type VTK 5 with 2 nodes, 1 of type VTK 9 with 3 nodes, 1 of type VTK 36, 1 of type VTK 8, "
             "1 of type VTK 6, 1 of type VTK 3, 1 of type VTK 33, 1 of type VTK 0")  # fmt: skip
    with pytest.raises(InputError, match=f"^cells that cannot be read: {words}; plane cells are"):
        to_record(cells_of((5, [0, 1, 2]), *bad), Reading())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"offsets": [0, 3]}, "offsets of its 2 cells are 1 and must grow"),
        ({"offsets": [0, 8, 7]}, "offsets of its 2 cells are 2 and must grow"),
        ({"offsets": [1, 3, 7]}, "its cells need 7 entries of the connectivity, which has 7"),
        ({"offsets": [0, 3, 6]}, "its cells need 6 entries of the connectivity, which has 7"),
        ({"connectivity": [0, 1, 2, 10, 4, 5, 6]}, "cell 1 refers to vertex 10; there are 10 vertices"),
        ({"connectivity": [0, 1, -1, 3, 4, 5, 6]}, "cell 0 refers to vertex -1; there are 10 vertices"),
        ({"data": {"a": np.zeros(3)}}, "cell data 'a' has 3 values for 2 cells"),
        ({"connectivity": [0, 1, 2, 9, 4, 5, 6], "data": {"a": np.zeros(2)}}, None),
        ({"offsets": [0, 0, 7]}, None),
    ],
)
def test_arrays_of_cells_that_do_not_fit(changes: dict[str, Any], message: str | None) -> None:
    cells = cells_of((5, [0, 1, 2]), (9, [3, 4, 5, 6]))
    for name, value in changes.items():
        setattr(cells, name, value if isinstance(value, dict) else np.array(value))
    if message is None:
        cells.check()
        return
    for look in (cells.check, lambda: to_record(cells, Reading())):
        with pytest.raises(InputError) as refused:
            look()
        assert plain_words(refused.value) == message


# -- legacy files ------------------------------------------------------------------------------------------------------

GRID = "DATASET UNSTRUCTURED_GRID"
LEGACY = {
    "unsigned_char": "u1", "char": "i1", "unsigned_short": "u2", "short": "i2", "unsigned_int": "u4", "int": "i4",
    "unsigned_long": "u8", "long": "i8", "float": "f4", "double": "f8", "vtkIdType": "i4", "vtktypeint64": "i8",
    "vtktypeint32": "i4", "vtktypeuint64": "u8", "vtktypeuint32": "u4", "vtktypeint16": "i2", "vtktypeint8": "i1",
    "vtktypeuint8": "u1", "vtktypeuint16": "u2",
}  # fmt: skip
Line = str | tuple[str, list[Any]]


def legacy(*lines: Line, binary: bool = False, head: str = "# vtk DataFile Version 3.0") -> bytes:
    """A file of lines, and of arrays with their types, as text or big-endian bytes."""
    parts = [f"{head}\ntitle\n{'BINARY' if binary else 'ascii '}\n".encode()]
    for line in lines:
        if isinstance(line, str):
            parts.append(f"{line}\n".encode())
        elif binary:
            parts.append(np.array(line[1], dtype=f">{line[0]}").tobytes() + b"\n")
        else:
            parts.append(" ".join(map(repr, line[1])).encode() + b"\n")
    return b"".join(parts)


def parsed(content: bytes) -> VtkCells:
    return vtk._Parser(content).parse()


SQUARE: list[Line] = [
    "POINTS 4 float", ("f4", [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0.5]), "CELLS 2 8", ("i4", [3, 0, 1, 2, 3, 0, 2, 3]),
    "CELL_TYPES 2", ("i4", [5, 5]),
]  # fmt: skip


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize(("name", "dtype"), LEGACY.items())
def test_numbers_of_all_types(name: str, dtype: str, binary: bool) -> None:
    kind = np.dtype(dtype)
    values = [0.25, -3.5] if kind.kind == "f" else [int(np.iinfo(kind).max), int(np.iinfo(kind).min) or 2]
    lines = [GRID, *SQUARE, "CELL_DATA 2", f"SCALARS a {name}", "LOOKUP_TABLE default", (dtype, values)]
    found = parsed(legacy(*lines, binary=binary)).data["a"]
    assert (found.dtype.str.lstrip("<|="), found.tolist()) == (dtype, values)


ATTRIBUTES: list[tuple[list[Line], Any]] = [
    (["SCALARS a int", ("i4", [5, 6])], [5, 6]),
    (["SCALARS a int 1", "lookup_table default", ("i4", [5, 6])], [5, 6]),
    (["SCALARS a int 2", "LOOKUP_TABLE default", ("i4", [5, 6, 7, 8])], [[5, 6], [7, 8]]),
    (["VECTORS a short", ("i2", [1, 2, 3, 4, 5, 6])], [[1, 2, 3], [4, 5, 6]]),
    (["NORMALS a short", ("i2", [1, 2, 3, 4, 5, 6])], [[1, 2, 3], [4, 5, 6]]),
    (["TENSORS a short", ("i2", list(range(18)))], [list(range(9)), list(range(9, 18))]),
    (["TENSORS6 a short", ("i2", list(range(12)))], [list(range(6)), list(range(6, 12))]),
    (["TEXTURE_COORDINATES a 2 short", ("i2", [1, 2, 3, 4])], None),
    (["COLOR_SCALARS a 3", ("color", [1, 2, 3, 4, 5, 6])], None),
    (["LOOKUP_TABLE a 2", ("color", [1, 2, 3, 4, 5, 6, 7, 8])], None),
    (["GLOBAL_IDS a long", ("i8", [7, 9])], [7, 9]),
    (["PEDIGREE_IDS a long", ("i8", [7, 9])], [7, 9]),
    (["METADATA", "INFORMATION 1", "NAME x LOCATION y", ""], None),
    (["FIELD f 2", "a 2 2 short", ("i2", [1, 2, 3, 4]), "b 1 2 int", ("i4", [8, 9])], [[1, 2], [3, 4]]),
    (["FIELD f 2", "b 1 2 int", ("i4", [8, 9]), "METADATA", "INFORMATION 0", "", "a 1 2 int", ("i4", [5, 6])], [5, 6]),
]


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize(("lines", "expected"), ATTRIBUTES)
def test_attributes_of_cells_and_what_follows(lines: list[Line], expected: Any, binary: bool) -> None:
    """Those of cells are kept, those of points are not, and each takes as much as it has."""
    lines = [("u1" if binary else "f4", line[1]) if line[0:1] == ("color",) else line for line in lines]  # type: ignore[misc]
    last: list[Line] = ["SCALARS last int 1", "LOOKUP_TABLE default", ("i4", [3, 4])]
    content = legacy(GRID, *SQUARE, "CELL_DATA 2", *lines, *last, "POINT_DATA 2", *lines, *last, binary=binary)
    cells = parsed(content)
    assert cells.data.pop("last").tolist() == [3, 4]
    assert cells.data.pop("b", np.array([8, 9])).tolist() == [8, 9]
    assert {name: values.tolist() for name, values in cells.data.items()} == ({"a": expected} if expected else {})
    assert cells.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]]
    assert cells.types.tolist() == [5, 5]
    assert (cells.offsets.tolist(), cells.connectivity.tolist()) == ([0, 3, 6], [0, 1, 2, 0, 2, 3])
    other = parsed(legacy(GRID, *SQUARE, "POINT_DATA 2", *lines, *last, "CELL_DATA 2", *last, binary=binary))
    assert list(other.data) == ["last"]


def test_texts_and_bits_of_binary_files_are_passed_over() -> None:
    """Their numbers of bytes are in 1, 2, 4 or 8 bytes, as the first two bits tell; eight bits are a byte."""
    texts = b"\xc3abc" + b"\x80\x05abcde" + b"\x40\x00\x00\x02ab" + b"\x00" * 7 + b"\x04abcd"
    start = legacy(GRID, *SQUARE, binary=True)
    bits = b"SCALARS bits bit\nLOOKUP_TABLE default\n\xff\xff\n"
    end = b"last 1 2 short\n\0\3\0\4\n"
    for words in (texts + b"\n", texts):
        content = start + b"CELL_DATA 9\n" + bits + b"FIELD f 2\ntexts 1 4 string\n" + words + end
        assert parsed(content).data["last"].tolist() == [3, 4]
        assert parsed(content).data["bits"].shape == (9,)
    text = legacy(GRID, *SQUARE, "CELL_DATA 2", "FIELD f 2", "texts 1 2 variant", "a b", "c", "last 1 2 int", "3 4")
    assert parsed(text).data["last"].tolist() == [3, 4]
    assert parsed(text).data["texts"].tolist() == [0, 0]


@pytest.mark.parametrize("binary", [False, True])
def test_polygons_and_version_5(binary: bool) -> None:
    """Kinds of cells in the order of the file; from 5.1 on they are offsets and nodes."""
    points: Line = ("f8", list(range(18)))
    old = [
        "FIELD FieldData 1", "t 1 1 double", ("f8", [0.5]), "METADATA", "INFORMATION 0", "", "dataset polydata",
        "points 6 double", points, "vertices 1 2", ("i4", [1, 5]), "Lines 1 3", ("i4", [2, 0, 1]), "POLYGONS 2 9",
        ("i4", [4, 0, 1, 2, 3, 3, 3, 4, 5]), "TRIANGLE_STRIPS 1 5", ("i4", [4, 0, 1, 2, 3]),
    ]  # fmt: skip
    new = [
        "DATASET POLYDATA", "POINTS 6 double", points, "VERTICES 2 1", "OFFSETS vtktypeint64", ("i8", [0, 1]),
        "CONNECTIVITY vtktypeint32", ("i4", [5]), "LINES 2 2", "OFFSETS int", ("i4", [0, 2]), "CONNECTIVITY int",
        ("i4", [0, 1]), "POLYGONS 3 7", "offsets short", ("i2", [0, 4, 7]), "connectivity long",
        ("i8", [0, 1, 2, 3, 3, 4, 5]), "TRIANGLE_STRIPS 2 4", "OFFSETS int", ("i4", [0, 4]), "CONNECTIVITY int",
        ("i4", [0, 1, 2, 3]),
    ]  # fmt: skip
    for lines, head in ((old, "# vtk DataFile Version 2.0"), (new, "# vtk DataFile Version 5.1")):
        cells = parsed(legacy(*lines, binary=binary, head=head))
        assert cells.types.tolist() == [2, 4, 7, 7, 6]
        assert cells.offsets.tolist() == [0, 1, 3, 7, 10, 14]
        assert cells.connectivity.tolist() == [5, 0, 1, 0, 1, 2, 3, 3, 4, 5, 0, 1, 2, 3]
        assert cells.points.tolist() == np.arange(18.0).reshape(6, 3).tolist()


def test_bits_of_text_and_cells_without_nodes() -> None:
    bits = parsed(legacy(GRID, *SQUARE, "CELL_DATA 2", "SCALARS a bit", "1 0")).data["a"]
    assert (bits.dtype, bits.tolist()) == (np.dtype("u1"), [1, 0])
    cells = parsed(legacy(GRID, "CELLS 2 3", "0", "1 4"))
    assert (cells.offsets.tolist(), cells.connectivity.tolist()) == ([0, 0, 1], [4])
    with pytest.raises(InputError, match=r"^offsets of its 0 cells are 2 and must grow$"):
        parsed(legacy("DATASET POLYDATA", "CELLS 2 3", "0", "1 4")).check()


def test_no_file_has_more_numbers_than_bytes() -> None:
    n = len(legacy(GRID, "POINTS 00 int"))
    for more, message in (
        (0, f"{3 * n} numbers are announced and 0 are there"),
        (1, "has more than the file can hold"),
    ):
        with pytest.raises(InputError, match=message):
            parsed(legacy(GRID, f"POINTS {n + more} int"))


def test_files_without_cells_or_points() -> None:
    for lines in ([], ["CELLS 0 0", "CELL_TYPES 0"], ["CELLS 0 0", "OFFSETS int", "CONNECTIVITY int"]):
        cells = parsed(legacy(GRID, *lines))
        assert (cells.points.shape, cells.types.shape, cells.connectivity.shape) == ((0, 3), (0,), (0,))
        assert cells.offsets.tolist() == [0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"# vtk", "it does not start with '# vtk DataFile Version'"),
        (b"# vtk DataFile Version 3\n\nXML of some other program\n",
         "it is neither ASCII nor BINARY but 'XML OF SOME OTHER PR'"),
        (legacy(), "its DATASET is missing: UNSTRUCTURED_GRID and POLYDATA can be read"),
        (legacy("GRID UNSTRUCTURED_GRID"), "its DATASET is missing: UNSTRUCTURED_GRID and POLYDATA can be read"),
        (legacy("DATASET"), "its DATASET is missing: UNSTRUCTURED_GRID and POLYDATA can be read"),
        (legacy("DATASET Field"), "its DATASET is FIELD: UNSTRUCTURED_GRID and POLYDATA can be read"),
        (legacy(GRID, "POINTS 1"), "the type '' of an array is not known"),
        (legacy(GRID, "POINTS 1 quad"), "the type 'quad' of an array is not known"),
        (legacy(GRID, "POINTS x int"), "'POINTS x int' lacks a number, or has more than the file can hold"),
        (legacy(GRID, "POINTS"), "'POINTS' lacks a number, or has more than the file can hold"),
        (legacy(GRID, "POINTS -1 int"), "'POINTS -1 int' lacks a number, or has more than the file can hold"),
        (legacy(GRID, "POINTS 999 int"), "'POINTS 999 int' lacks a number, or has more than the file can hold"),
        (legacy(GRID, "POINTS 1 int", "1 2"), "3 numbers are announced and 2 are there"),
        (legacy(GRID, "POINTS 1 int", "1 2 3 4"), "3 numbers are announced and 4 are there"),
        (legacy(GRID, "POINTS 1 int", "1 2 x"),
         "a number cannot be read: invalid literal for int() with base 10: 'x'"),
        (legacy(GRID, "POINTS 1 int", ("i2", [1, 2, 3]), binary=True),
         "3 numbers are announced and 1 are there: it is cut off"),
        (legacy(GRID, "CELLS 1 4", "OFFSETS int", "3"), "CONNECTIVITY is missing after the OFFSETS of CELLS"),
        (legacy(GRID, "CELLS 1 4", "OFFSETS int", "3", "NODES int"),
         "CONNECTIVITY is missing after the OFFSETS of CELLS"),
        (legacy(GRID, "CELLS 2 4", "3 0 1 2"), "CELLS: 4 entries do not hold 2 cells"),
        (legacy(GRID, "CELLS 2 4", "1 0 -1 2"), "CELLS: 4 entries do not hold 2 cells"),
        (legacy(GRID, "CELLS 1 4", "2 0 1 2"), "CELLS: 1 cells take 3 of 4 entries"),
        (legacy(GRID, "CELLS 1 4", "4 0 1 2"), "CELLS: 1 cells take 5 of 4 entries"),
        (legacy(GRID, "FIELD f 1", "a 1 2"), "a field lacks its name, size or type: 'a 1 2'"),
        (legacy(GRID, "FIELD f 1"), "a field lacks its name, size or type: ''"),
        (legacy(GRID, "NOTHING", "at all"), "'NOTHING' is not understood at byte 74"),
        (legacy(GRID, "VECTORS a"), "'VECTORS a' is not understood at byte 76"),
        (legacy(GRID, "TEXTURE_COORDINATES a 2"), "'TEXTURE_COORDINATES a 2' is not understood at byte 90"),
        (legacy(GRID, "COLOR_SCALARS a"), "'COLOR_SCALARS a' is not understood at byte 82"),
        (legacy(GRID, "LOOKUP_TABLE a"), "'LOOKUP_TABLE a' is not understood at byte 81"),
        (legacy(GRID, "GLOBAL_IDS a"), "'GLOBAL_IDS a' is not understood at byte 79"),
    ],
)  # fmt: skip
def test_legacy_files_that_are_refused(content: bytes, message: str) -> None:
    with pytest.raises(InputError) as refused:
        parsed(content)
    assert plain_words(refused.value) == message


def test_lines_may_end_as_on_windows_and_the_last_without_an_end() -> None:
    text = legacy(GRID, *SQUARE, "CELL_DATA 2", "SCALARS a int", "5 6").replace(b"\n", b"\r\n").rstrip()
    assert parsed(text).data["a"].tolist() == [5, 6]


# -- XML ---------------------------------------------------------------------------------------------------------------

XML = {"Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4", "Int64": "i8",
       "UInt64": "u8", "Float32": "f4", "Float64": "f8"}  # fmt: skip


def lz4(data: bytes) -> bytes:
    return bytes(pytest.importorskip("lz4.block").compress(data, store_size=False))


COMPRESSORS: dict[str, Callable[[bytes], bytes]] = {
    "vtkZLibDataCompressor": zlib.compress, "vtkLZMADataCompressor": lzma.compress, "vtkLZ4DataCompressor": lz4,
}  # fmt: skip


def encoded(data: bytes, header: str, compressor: str, raw: bool, block: int = 16) -> bytes:
    """Bytes as VTK writes them: after their number, or in blocks after the numbers and sizes of these."""
    text = (lambda each: each) if raw else base64.b64encode
    if not compressor:
        return text(np.array([len(data)], header).tobytes() + data)
    blocks = [data[n : n + block] for n in range(0, len(data), block)]
    packed = [COMPRESSORS[compressor](each) for each in blocks]
    head = [len(blocks), block, len(data) % block, *map(len, packed)] if blocks else [0]
    return text(np.array(head, header).tobytes()) + text(b"".join(packed))


def xml(
    *, order: str = "<", header: str = "UInt32", compressor: str = "", how: str = "binary", raw: bool = False,
    kind: str = "Float64", **changed: str,
) -> bytes:  # fmt: skip
    """Two triangles, with an array ``a`` of any kind; ``changed`` are words to put in place of others."""
    limits = np.iinfo(XML[kind]) if XML[kind][0] != "f" else None
    values = [0.25, -3.5] if limits is None else [int(limits.max), int(limits.min) or 2]
    arrays = {
        "Points": ("Float64", [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0.5], 3),
        "connectivity": ("Int32", [0, 1, 2, 0, 2, 3], 1), "offsets": ("Int32", [3, 6], 1),
        "types": ("UInt8", [5, 5], 1), "a": (kind, values, 1),
    }  # fmt: skip
    appended, elements = b"", {}
    for name, (type_, numbers, components) in arrays.items():
        data = np.array(numbers, dtype=order + XML[type_]).tobytes()
        block = encoded(data, order + XML[header], compressor, raw)
        inside, offset = block.decode("latin-1"), ""
        if how == "ascii":
            inside = " ".join(map(str, numbers))
        elif how == "appended":
            inside, offset = "", f' offset="{len(appended)}"'
            appended += block
        elements[name] = (f'<DataArray Name="{name}" type="{type_}" NumberOfComponents="{components}" format="{how}"'
                          f"{offset}>{inside}</DataArray>")  # fmt: skip
    cells = "".join(elements[name] for name in ("connectivity", "offsets", "types"))
    byte_order = "BigEndian" if order == ">" else "LittleEndian"
    by = f' compressor="{compressor}"' if compressor else ""
    text = (f'<VTKFile type="UnstructuredGrid" byte_order="{byte_order}" header_type="{header}"{by}><UnstructuredGrid>'
            f'<Piece NumberOfPoints="4" NumberOfCells="2"><Points>{elements["Points"]}</Points><Cells>{cells}</Cells>'
            f"<CellData>{elements['a']}</CellData></Piece></UnstructuredGrid>")  # fmt: skip
    for before, after in changed.items():
        assert before in text
        text = text.replace(before, after)
    end = b'<AppendedData encoding="' + (b"raw" if raw else b"base64") + b'">\n  _' + appended + b"</AppendedData>"
    return text.encode("latin-1") + (end if how == "appended" else b"") + b"</VTKFile>"


def pieces(content: bytes) -> VtkCells:
    """The cells of a file."""
    root, appended = vtu._parse(content)
    return vtu._piece(root[0][0], vtu._Arrays(root, appended), root.get("type") == "PolyData")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("header", ["UInt32", "UInt64"])
@pytest.mark.parametrize("compressor", ["", *COMPRESSORS])
@pytest.mark.parametrize(("how", "raw"), [("binary", False), ("appended", False), ("appended", True)])
def test_encodings_of_vtk(order: str, header: str, compressor: str, how: str, raw: bool) -> None:
    cells = pieces(xml(order=order, header=header, compressor=compressor, how=how, raw=raw))
    assert cells.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]]
    assert (cells.types.tolist(), cells.offsets.tolist()) == ([5, 5], [0, 3, 6])
    assert (cells.connectivity.tolist(), cells.data["a"].tolist()) == ([0, 1, 2, 0, 2, 3], [0.25, -3.5])


@pytest.mark.parametrize(("order", "how"), [("<", "binary"), (">", "binary"), (">", "ascii")])
@pytest.mark.parametrize("kind", XML)
def test_numbers_of_all_types_in_xml(kind: str, order: str, how: str) -> None:
    found = pieces(xml(order=order, kind=kind, how=how)).data["a"]
    limits = np.iinfo(XML[kind]) if XML[kind][0] != "f" else None
    values = [0.25, -3.5] if limits is None else [int(limits.max), int(limits.min) or 2]
    assert (found.dtype.str.lstrip("<|="), found.tolist()) == (XML[kind], values)


def b64(*head: int, data: bytes = b"") -> bytes:
    return base64.b64encode(np.array(head, "<u4").tobytes() + data)


ZLIB = "vtkZLibDataCompressor"
CUT_OFF = "it is cut off, or not as VTK writes it; open it in ParaView or PyVista and save it anew"
OFFSETS = np.array([3, 6], "<i4").tobytes()
ENDS, HEAD = b64(8, data=OFFSETS), b64(1, 16, 8, len(zlib.compress(OFFSETS)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (xml(how="ascii", UnstructuredGrid="ImageData"), "it holds ImageData, not UnstructuredGrid or PolyData"),
        (b"<other/>", "it holds other, not UnstructuredGrid or PolyData"),
        (b'<VTKFile type="PolyData"/>', "it holds PolyData, not UnstructuredGrid or PolyData"),
        (b'<File type="PolyData"><PolyData/></File>', "it holds PolyData, not UnstructuredGrid or PolyData"),
        (b'<VTKFile type="PolyData"><PolyData/></VTKFile>', "it has no piece"),
        (b"<VTKFile><AppendedData>_</VTKFile>", "its AppendedData has no end: the file is cut off"),
        (b"<VTKFile>", "it is no XML: no element found: line 1, column 9"),
        (xml(how="ascii", UInt32="UInt16"), "header_type 'UInt16' is neither UInt32 nor UInt64"),
        (xml(how="ascii", Float64="Float16"), "array 'Points' has the type 'Float16'"),
        (xml(how="ascii").replace(b'"ascii"', b'"hex"'), "array 'Points' has the format 'hex'"),
        (xml(how="ascii").replace(b'"3"', b'"2"'), "its points have not three coordinates"),
        (xml(how="ascii").replace(b'"3"', b'"5"'),
         "array 'Points' cannot be decoded: cannot reshape array of size 12 into shape (5)"),
        (xml(how="ascii", connectivity="nodes"), "its cells have no connectivity or offsets"),
        (xml(how="ascii", offsets="ends"), "its cells have no connectivity or offsets"),
        (xml(how="ascii", types="kinds"), "its cells have no types"),
        (xml(how="ascii").replace(b'"UInt8"', b'"Float32"'), "array 'types' has no whole numbers"),
        (xml(how="ascii").replace(b'"Int32"', b'"Float32"'), "array 'connectivity' has no whole numbers"),
        (xml(how="ascii").replace(b'Points="4"', b'Points="5"'), "NumberOfPoints is 5, and 4 are there"),
        (xml(how="ascii").replace(b'Cells="2"', b'Cells="3"'), "NumberOfCells is 3, and 2 are there"),
        (xml(how="ascii").replace(b">3 6<", b">4 6 6<"), "offsets of its 2 cells are 3 and must grow"),
        (xml(how="ascii").replace(b' header_type="UInt32"', b' compressor="zip"'),
         "its compressor 'zip' is not known: write it with ZLib, LZMA or no compression"),
        (xml().replace(ENDS, b64(9, data=OFFSETS)), f"9 bytes are announced and 8 are there: {CUT_OFF}"),
        (xml().replace(ENDS, b"CAA="), f"4 bytes are announced and 2 are there: {CUT_OFF}"),
        (xml(compressor=ZLIB).replace(HEAD, b64(0)), "offsets of its 2 cells are 0 and must grow"),
        (xml(compressor=ZLIB).replace(HEAD, b64(99, 16, 8, 16)), "99 compressed blocks are more than there are"),
        (xml(compressor=ZLIB).replace(HEAD, b64(1, 16, 8, 15)), f"15 bytes are announced and 14 are there: {CUT_OFF}"),
        (xml(compressor=ZLIB).replace(HEAD, b64(1, 16, 9, 14)), f"9 bytes are announced and 8 are there: {CUT_OFF}"),
    ],
)  # fmt: skip
def test_xml_files_that_are_refused(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.vtu").write_bytes(content)
    with pytest.raises(InputError) as refused:
        vtu.read(tmp_path / "a.vtu", Reading())
    assert plain_words(refused.value) == message


def test_polygons_in_xml_and_pieces_without_cells(tmp_path: Path) -> None:
    """Groups in the order of the format, whose numbers of cells are not told as one."""
    points = '<Points><DataArray type="Float32" NumberOfComponents="3">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points>'

    def group(name: str, nodes: str, ends: str) -> str:
        return (f'<{name}><DataArray Name="connectivity" type="Int8">{nodes}</DataArray>'
                f'<DataArray Name="offsets" type="Int8">{ends}</DataArray></{name}>')  # fmt: skip

    body = group("Strips", "0 1 3 2", "4") + group("Polys", "0 1 2 3 0 1 2", "4 7") + group("Verts", "3", "1")
    body += group("Lines", "0 2", "2")
    data = '<CellData><DataArray Name="a" type="Int8">4 5 6 7 8</DataArray></CellData>'
    grid = f'<PolyData><Piece NumberOfPoints="9">{points}{body}{data}</Piece></PolyData>'
    cells = pieces(f'<VTKFile type="PolyData">{grid}</VTKFile>'.encode())
    assert cells.types.tolist() == [2, 4, 7, 7, 6]
    assert cells.offsets.tolist() == [0, 1, 3, 7, 10, 14]
    assert cells.connectivity.tolist() == [3, 0, 2, 0, 1, 2, 3, 0, 1, 2, 0, 1, 3, 2]
    assert cells.data["a"].tolist() == [4, 5, 6, 7, 8]
    (tmp_path / "a.vtp").write_text(f'<VTKFile type="PolyData">{grid}</VTKFile>')
    record = vtu.read(tmp_path / "a.vtp", Reading())
    assert loops(record) == [[0, 1, 2, 3], [0, 1, 2], [0, 1, 3], [3, 1, 2]]
    for number, more in (
        ("", ""),
        (' NumberOfCells="0"', "<Points/>"),
        ("", '<Points><DataArray type="Int8"/></Points>'),
    ):
        grid = f"<UnstructuredGrid><Piece{number}>{more}</Piece></UnstructuredGrid>"
        empty = pieces(f'<VTKFile type="UnstructuredGrid">{grid}</VTKFile>'.encode())
        assert (empty.points.shape, empty.types.shape, empty.offsets.tolist()) == ((0, 3), (0,), [0])


def test_arrays_with_components() -> None:
    for components, values in (("1", [1, 2, 3, 4]), ("2", [[1, 2], [3, 4]]), ("4", [[1, 2, 3, 4]])):
        array = f'type="Int8" NumberOfComponents="{components}">1 2 3 4</DataArray>'
        root, appended = vtu._parse(f"<VTKFile><DataArray {array}</VTKFile>".encode())
        assert vtu._Arrays(root, appended).values(root[0]).tolist() == values


def test_pieces_are_joined_with_what_all_have(tmp_path: Path) -> None:
    """Nodes and entries are counted on; an array that one piece lacks is left out."""
    one = xml(how="ascii").decode()
    piece = one[one.index("<Piece") : one.index("</UnstructuredGrid>")]
    named = piece.replace("<CellData>", '<CellData><DataArray Name="region" type="Int8">{}</DataArray>')
    other = named.format("3 4").replace('"a"', '"b"').replace(">0 1 2 0 2 3<", ">3 2 1 3 1 0<")
    (tmp_path / "a.vtu").write_text(one.replace(piece, named.format("4 5") + other + named.format("5 3")))
    record = vtu.read(tmp_path / "a.vtu", Reading())
    assert loops(record) == [[0, 1, 2], [0, 2, 3], [7, 6, 5], [7, 5, 4], [8, 9, 10], [8, 10, 11]]
    assert record.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]] * 3
    assert listed(record.regions) == [(None, 3, [2, 5]), (None, 4, [0, 3]), (None, 5, [1, 4])]
    far = piece.replace(">0 1 2 0 2 3<", ">0 1 2 0 2 4<")  # which the next piece has
    (tmp_path / "b.vtu").write_text(one.replace(piece, far + piece))
    with pytest.raises(InputError, match=r"^cell 1 refers to vertex 4; there are 4 vertices$"):
        vtu.read(tmp_path / "b.vtu", Reading())
    for name in ("a", "b"):
        with pytest.raises(InputError, match=rf"no cell data '{name}' \(there are: region\)"):
            vtu.read(tmp_path / "a.vtu", Reading(region_data=name))
