"""gmsh's files in all versions, as text and in both orders of bytes: what is read, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_process import plain_words

from tmc_vem.mesh.files import msh
from tmc_vem.mesh.files.record import Group, Reading, Record
from tmc_vem.support.errors import InputError

TAGS = [30, 10, 20, 40, 50, 60, 80, 70]
AT = {tag: n for n, tag in enumerate(TAGS)}
NAMES = '$PhysicalNames\n4\n2 1 "body"\n\n2 -2 "a "b" c"\n1 1 "low" \n0 5 "tip\n$EndPhysicalNames\n'
# dimension and tag of an entity with its groups, type of the element, nodes
ELEMENTS: list[tuple[tuple[int, int], list[int], int, list[list[int]]]] = [
    ((0, 3), [5], 15, [[10]]),
    ((1, 1), [1, -7, 1], 8, [[20, 10, 60]]),
    ((2, 1), [1, -2], 9, [[10, 20, 30, 80, 70, 80]]),
    ((2, 2), [2], 3, [[30, 40, 10, 20], [40, 10, 50, 20]]),
    ((2, 3), [], 2, [[50, 40, 30]]),
]
Token = tuple[str, list[Any]]  # kind of number: int, size or double; or text


def written(version: str, order: str | None, *sections: tuple[str, list[Token]], names: str = NAMES) -> bytes:
    """A file with sections of numbers, as text (order None) or bytes."""
    head = f"$MeshFormat\n{version} {int(order is not None)} 8\n".encode()
    if order is not None:
        head += np.array([1], f"{order}i4").tobytes() + b"\n"
    content = head + b"$EndMeshFormat\n" + names.encode()
    for name, tokens in sections:
        content += f"${name}\n".encode()
        for kind, values in tokens:
            if order is None or kind == "text":
                content += " ".join(map(str, values)).encode() + b"\n"
            else:
                content += np.array(values, {"i": "i4", "s": "i8", "d": "f8"}[kind]).astype(
                    np.dtype({"i": "i4", "s": "i8", "d": "f8"}[kind]).newbyteorder(order)
                ).tobytes()  # fmt: skip
        content += f"\n$End{name}\n".encode()
    return content


def place(tag: int) -> list[float]:
    return [tag / 8.0, -tag / 4.0, tag / 16.0]


def version_2(order: str | None) -> bytes:
    """With an element for every group that it is in, and one without any tags."""
    nodes: list[Token] = [("text", [len(TAGS)])]
    for tag in TAGS:
        nodes += [("i", [tag]), ("d", place(tag))]
    rows = [
        (kind, [group, 3, 4][: 3 if group else 0], each)
        for _, groups, kind, members in ELEMENTS for group in dict.fromkeys(groups or [0]) for each in members
    ]  # fmt: skip
    elements: list[Token] = [("text", [len(rows)])]
    at = 0
    while at < len(rows):
        kind, tags, _ = rows[at]
        same = 1
        while at + same < len(rows) and rows[at + same][:2] == (kind, tags):
            same += 1
        if order is not None:
            elements.append(("i", [kind, same, len(tags)]))
        for n in range(at, at + same):
            elements.append(("i", [n + 1, *([] if order else [kind, len(tags)]), *tags, *rows[n][2]]))
        at += same
    return written("2.2", order, ("Nodes", nodes), ("Elements", elements))


def entities(version: str, *, parts: bool) -> list[Token]:
    """All entities; those of parts belong to some of another dimension too, and there are ghosts."""
    found: list[Token] = [("s", [2]), ("s", [1]), ("i", [9, 1])] if parts else []
    counts = [[key for key, *_ in ELEMENTS if key[0] == dimension] for dimension in range(4)]
    found.append(("s", [len(each) + (dimension == 0) for dimension, each in enumerate(counts)]))
    for dimension, keys in enumerate(counts):
        listed = [(tag, next(groups for key, groups, *_ in ELEMENTS if key == (dimension, tag))) for _, tag in keys]
        if dimension == 0:
            listed.append((8, [6]))
        for tag, groups in listed:
            found.append(("i", [tag]))
            if parts:
                found += [("i", [1 if tag == 8 else dimension, 1]), ("s", [2]), ("i", [1, 2])]
            found.append(("d", [0.5] * (3 if dimension == 0 and version == "4.1" else 6)))
            found += [("s", [len(groups)]), ("i", groups)]
            if dimension:
                found += [("s", [2]), ("i", [1, -2])]
    return found


def version_4(version: str, order: str | None, *, parts: bool = False) -> bytes:
    new = version == "4.1"
    nodes: list[Token] = [("s", [4, len(TAGS), 10, 80][: 4 if new else 2])]
    for dimension, parametric, tags in ((2, 1, TAGS[:3]), (1, 1, TAGS[3:5]), (0, 1, TAGS[5:6]), (2, 0, TAGS[6:])):
        nodes += [("i", [dimension, 7, parametric] if new else [7, dimension, parametric]), ("s", [len(tags)])]
        more = [0.125] * (dimension * parametric)
        if new:
            nodes += [("s", tags), *(("d", place(tag) + more) for tag in tags)]
        else:
            for tag in tags:
                nodes += [("i", [tag]), ("d", place(tag) + more)]
    elements: list[Token] = [("s", [len(ELEMENTS), 6, 1, 6][: 4 if new else 2])]
    number = 0
    for (dimension, tag), _, kind, members in ELEMENTS:
        elements += [("i", [dimension, tag, kind] if new else [tag, dimension, kind]), ("s", [len(members)])]
        for row in members:
            number += 1
            elements.append(("s" if new else "i", [number, *row]))
    name = "PartitionedEntities" if parts else "Entities"
    sections = [(name, entities(version, parts=parts)), ("Nodes", nodes), ("Elements", elements)]
    return written(version, order, *sections)


def read(content: bytes, path: Path) -> Record:
    (path / "a.msh").write_bytes(content)
    return msh.read(path / "a.msh", Reading())


def listed(groups: list[Group]) -> list[Any]:
    return [(group.number, group.name, group.members.tolist()) for group in groups]


def nodes_of(*tags: int) -> list[int]:
    return [AT[tag] for tag in tags]


@pytest.mark.parametrize("order", [None, "<", ">"])
@pytest.mark.parametrize("version", ["2.2", "4.0", "4.1", "4.0 in parts", "4.1 in parts"])
def test_versions(version: str, order: str | None, tmp_path: Path) -> None:
    made = version_2(order) if version == "2.2" else version_4(version[:3], order, parts="parts" in version)
    record = read(made, tmp_path)
    assert record.points.tolist() == [place(tag) for tag in TAGS]
    assert [loop.tolist() for loop in record.loops] == [
        nodes_of(10, 20, 30), nodes_of(30, 40, 10, 20), nodes_of(40, 10, 50, 20), nodes_of(50, 40, 30),
    ]  # fmt: skip
    assert record.middles.tolist() == [5, 6, 7]
    assert listed(record.regions) == [(1, "body", [0]), (2, 'a "b" c', [0, 1, 2])]
    low = [nodes_of(20, 10)]
    assert listed(record.edges) == [(1, "low", low), (7, None, low)]
    assert listed(record.nodes) == [(5, "tip", nodes_of(10))]


def plain(elements: str, nodes: str = "4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0", names: str = "") -> bytes:
    """A text of version 2.2."""
    return (f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}$Nodes\n{nodes}\n$EndNodes\n"
            f"$Elements\n{elements}\n$EndElements\n").encode()  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "loops", "regions"),
    [
        (["2 1 5 1 2 3", "2 1 6 3 1 2", "2 1 7 3 2 1"], [[0, 1, 2]], {5: [0], 6: [0], 7: [0]}),
        (["3 1 5 1 2 3 4", "3 1 6 4 3 2 1"], [[0, 1, 2, 3]], {5: [0], 6: [0]}),
        (["2 1 5 1 2 3", "2 1 5 3 1 2"], [[0, 1, 2], [2, 0, 1]], {5: [0, 1]}),
        (["2 1 5 1 2 3", "2 0 3 1 2", "2 1 6 1 2 3"], [[0, 1, 2], [2, 0, 1]], {5: [0], 6: [0]}),
        (["2 1 5 1 2 3", "2 1 -5 1 2 4", "2 3 6 9 9 1 3 4"], [[0, 1, 2], [0, 1, 3], [0, 2, 3]], {5: [0, 1], 6: [2]}),
        (["2 1 5 1 2 3", "3 1 6 1 2 3 4"], [[0, 1, 2], [0, 1, 2, 3]], {5: [0], 6: [1]}),
    ],
)
def test_cells_that_are_there_for_each_of_their_groups(
    rows: list[str], loops: list[list[int]], regions: dict[int, list[int]], tmp_path: Path
) -> None:
    lines = "\n".join(f"{n + 1} {row}" for n, row in enumerate(rows))
    record = read(plain(f"{len(rows)}\n{lines}"), tmp_path)
    assert [loop.tolist() for loop in record.loops] == loops
    assert {group.number: group.members.tolist() for group in record.regions} == regions


def test_names_in_latin_1_and_the_last_of_sections_of_a_name(tmp_path: Path) -> None:
    names = b'$PhysicalNames\n1\n2 5 "k\xf6rper"\n$EndPhysicalNames\n'
    content = plain("1\n1 2 1 5 1 2 3").replace(b"$Nodes", names + b"$Nodes")
    assert read(content, tmp_path).regions[0].name == "körper"
    again = names.replace(b"k\xf6rper", "körper".encode()) + b"$Comments\nall $ sorts\n$EndComments\n$C\n1\n$EndC\n"
    assert read(content + again, tmp_path).regions[0].name == "körper"


CUT_OFF = "announces more than it has: it is cut off or damaged"
ONE = "1\n1 2 1 5 1 2 3"


def two(elements: list[int], *, n: int = 1, nodes: int = 3) -> bytes:
    """Version 2.2 in bytes, with ``n`` elements announced."""
    points: list[Token] = [("text", [nodes])]
    for tag in range(1, 4):
        points += [("i", [tag]), ("d", [0.0, 0.0, 0.0])]
    return written("2.2", "<", ("Nodes", points), ("Elements", [("text", [n]), ("i", elements)]), names="")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it does not start with $MeshFormat: it is no mesh of gmsh from version 2 on"),
        (b"$NOD\n$EndNOD", "it does not start with $MeshFormat: it is no mesh of gmsh from version 2 on"),
        (b"$MeshFormat\n2.2 0 8\n", "$MeshFormat has no end: the file is cut off"),
        (b"$MeshFormat", "it does not start with $MeshFormat: it is no mesh of gmsh from version 2 on"),
        (b"$MeshFormat\n2.2 x 8\n$EndMeshFormat", "its format '2.2 x 8' is not understood"),
        (b"$MeshFormat\n2.2 0\n$EndMeshFormat", "its format '2.2 0' is not understood"),
        *((f"$MeshFormat\n{v} 0 {size}\n$EndMeshFormat".encode(),
           f"its format {float(v):g} cannot be read: save it as MSH 4.1 or 2.2 (Mesh.MshFileVersion = 4.1)")
          for v, size in (("1.9", 8), ("3.0", 8), ("4.2", 8), ("2.2", 4), ("4.1", 4))),
        *((f"$MeshFormat\n{v} 0 8\n$EndMeshFormat".encode(),
           "it has no $Nodes: it is cut off, or no mesh was made before it was saved")
          for v in ("2", "2.9", "4", "4.1")),
        (plain(ONE).replace(b"Elements", b"Others"),
         "it has no $Elements: it is cut off, or no mesh was made before it was saved"),
        (plain(ONE, names='$PhysicalNames\n1\n2 5 body\n$EndPhysicalNames\n'),
         "the physical name '2 5 body' is not understood"),
        (plain(ONE, names='$PhysicalNames\n1\n5 "body"\n$EndPhysicalNames\n'),
         "the physical name '5 \"body\"' is not understood"),
        (plain(ONE, names='$PhysicalNames\n1\n2 x "body"\n$EndPhysicalNames\n'),
         "the physical name '2 x \"body\"' is not understood"),
        (plain(ONE, "2\n1 0 0 0"), f"$Nodes {CUT_OFF}"),
        (plain(ONE, "1\n1 0 0 0 7"), "$Nodes has more than it announces: 1 numbers are left"),
        (plain(ONE, "-1"), "$Nodes announces -1 rows"),
        (plain(ONE, ""), f"$Nodes {CUT_OFF}"),
        (plain(ONE, "1\n1 0 x 0"), "$Nodes: a number cannot be read: could not convert string to float: b'x'"),
        (plain("1\nx"), "$Elements: a number cannot be read: invalid literal for int() with base 10: b'x'"),
        (plain("2\n1 2 1 5 1 2 3"), "elements of gmsh's type 0 cannot be read; plane cells are, of any order"),
        (plain("1\n1 2 1 5 1 2"),
         "$Elements announces 1 elements and ends before: it is cut off or damaged"),
        (plain("1\n1 2 1 5 1 2 3 4"), "$Elements has more than the 1 elements that it announces"),
        (plain("1\n1 99 1 5 1 2 3"), "elements of gmsh's type 99 cannot be read; plane cells are, of any order"),
        (plain("2\n1 2 1 5 1 2 3\n2 4 1 5 1 2 3 4"),
         "it has solid cells (1 of type gmsh 4): give a mesh of plane cells"),
        (plain(ONE, "3\n1 0 0 0\n2 0 0 0\n2 0 0 0"), "node 2 is there twice"),
        (plain("1\n1 2 1 5 1 7 2"), "an element has the node 7, which is not there"),
        (plain("1\n1 2 1 5 0 1 2"), "an element has the node 0, which is not there"),
        (plain(ONE, "0"), "an element has the node 1, which is not there"),
        (two([2, 0, 1]), "$Elements is damaged: a block has no elements"),
        (two([2, 1, -1]), "$Elements is damaged: a block has no elements"),
        (two([2, 1, 1, 1, 5, 1, 2]), f"$Elements {CUT_OFF}"),
        (two([2, 1, 1, 1, 5, 1, 2, 3, 9]), "$Elements has more than it announces: 5 bytes are left"),
        (two([2, 1, 1, 1, 5, 1, 2, 3], nodes=4), f"$Nodes {CUT_OFF}"),
        (two([2, 1, 1, 1, 5, 1, 2, 3]).replace(b"$Elements\n1\n", b"$Elements\nx\n"),
         "$Elements does not say how many it has"),
        (two([2, 1, 1, 1, 5, 1, 2, 3], n=-1), "$Elements does not say how many it has"),
    ],
)  # fmt: skip
def test_files_that_are_refused(content: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        read(content, tmp_path)
    assert plain_words(refused.value) == message


def test_blocks_of_bytes_hold_several_elements_with_or_without_tags(tmp_path: Path) -> None:
    """The last is the first once more, for its group."""
    record = read(two([2, 2, 0, 1, 1, 2, 3, 2, 3, 2, 1, 2, 1, 2, 3, 6, 9, 1, 3, 2], n=3), tmp_path)
    assert [loop.tolist() for loop in record.loops] == [[0, 1, 2], [2, 1, 0]]
    assert listed(record.regions) == [(6, None, [0])]
