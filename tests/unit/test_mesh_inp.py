"""Abaqus' and CalculiX' files: what their keywords define, to the last label, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.files import inp
from tmc_vem.mesh.files.inp_types import ElementType, element_type, is_axisymmetric
from tmc_vem.mesh.files.record import DECLARED, IMPLIED, MATERIAL, Group, Reading, Record
from tmc_vem.support.errors import InputError

CELLS = {
    "CPS3": (3, 3), "CPE4": (4, 4), "CPE4R": (4, 4), "CPE6M": (6, 3), "CPEG8": (8, 4), "CGAX4": (4, 4), "CAX8R": (8, 4),
    "STRI3": (3, 3), "STRI65": (6, 3), "S4R": (4, 4), "S8R5": (8, 4), "S9R5": (9, 4), "M3D6": (6, 3), "R3D4": (4, 4),
    "SFM3D3": (3, 3), "DS4": (4, 4), "DC2D8": (8, 4), "DCAX3": (3, 3), "AC2D4": (4, 4), "ACAX6": (6, 3),
    "WARP2D4": (4, 4),
}  # fmt: skip
LINES = {
    "T2D2": 2, "T2D3": 3, "T3D2": 2, "R2D2": 2, "RB2D2": 2, "RB3D2": 2, "RAX2": 2, "SAX1": 2, "SAX2": 3, "DC1D2": 2,
    "DC1D3": 3, "B21": 2, "B22": 3, "B23": 2, "B31": 2, "B32": 3, "B33": 2, "PIPE21": 2, "PIPE22": 3, "PIPE31": 2,
    "ELBOW31": 2, "ELBOW32": 3, "FRAME2D": 2, "FRAME3D": 2, "F2D2": 2, "T2D1": 2,
}  # fmt: skip
SOLID = ["C3D8", "SC8R", "DC3D4", "AC3D8", "CSS8", "EC3D8R", "COH3D6", "CCL9", "MCL6", "PC3D", "TIRE"]
NONE = ["MASS", "ROTARYI", "SPRINGA", "DASHPOT1", "GAPUNI", "CONN2D2", "DCOUP2D", "HEATCAP", "JOINTC", "ITSUNI",
        "DISTRIBUTING", "DRAG2D", "NET"]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "found"),
    [
        *((name, ElementType("cell", *numbers)) for name, numbers in CELLS.items()),
        *((name, ElementType("edge", n)) for name, n in LINES.items()),
        *((name, ElementType("solid")) for name in SOLID),
        *((name, ElementType("none")) for name in NONE),
        *((name, ElementType("unknown")) for name in ("CPE5", "CPE44", "U1", "S", "XS4", "CPE", "VMASS")),
    ],
)  # fmt: skip
def test_types_of_elements(name: str, found: ElementType) -> None:
    assert element_type(name) == found
    assert is_axisymmetric(name) == name.startswith(("CAX", "CGAX", "DCAX", "ACAX", "SAX"))


# -- files -------------------------------------------------------------------------------------------------------------

NODES = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n5, 2, 0\n6, 2, 1\n"
TWO = "*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n2, 2, 5, 6, 3\n"


def read(text: str, path: Path) -> Record:
    (path / "a.inp").write_text(text)
    return inp.read(path / "a.inp", Reading())


def listed(groups: list[Group]) -> dict[str | None, Any]:
    return {group.name: group.members.tolist() for group in groups}


def loops(record: Record) -> list[list[int]]:
    return [loop.tolist() for loop in record.loops]


@pytest.mark.parametrize(
    ("rows", "places"),
    [
        ("1, 1.5D1, 2d-1, 3\n", [[15.0, 0.2, 3.0]]),
        ("1, 1, 2, 3, 4, 5\n\n, ,\n7\n8, 9\n9, , 4\n", [[1, 2, 3], [0, 0, 0], [9, 0, 0], [0, 4, 0]]),
        ("1, 1, 2\n1, 1, 2, 0\n2, 3, 4\n", [[1, 2, 0], [3, 4, 0]]),
    ],
)
def test_nodes(rows: str, places: list[list[float]], tmp_path: Path) -> None:
    for system in ("", ", SYSTEM=R", ", SYSTEM=r"):
        assert read(f"*NODE{system}\n{rows}", tmp_path).points.tolist() == places


def test_elements_of_all_kinds(tmp_path: Path) -> None:
    """Lines go on until an element has its nodes, or after a comma where their number does not matter."""
    nodes = "*NODE\n" + "".join(f"{n}, {n}, 0\n" for n in range(1, 13))
    record = read(
        f"{nodes}*ELEMENT, TYPE=cpe8, ELSET=A\n20, 1, 2, 3, 4, 5, 6\n7, 8\n\n10, 1, 2, 3, 4,\n5, 6, 7,\n9\n"
        "*ELEMENT, TYPE=CAX3\n30, 9, 10, 11\n31, 9, 11, 12\n*ELEMENT, TYPE=MASS, ELSET=M\n40, 1, 2\n41, 3,\n4\n"
        "*ELEMENT, TYPE=T2D3, ELSET=B\n50, 1, 12, 2\n*ELEMENT, TYPE=T2D2, ELSET=b\n51, 2, 3\n*ELEMENT, TYPE=SPRINGA\n"
        "60, 1\n*ELEMENT, TYPE=CPE8R, ELSET=A\n21, 2, 3, 4, 5, 6, 7, 8, 9\n",
        tmp_path,
    )
    assert loops(record) == [[0, 1, 2, 3], [0, 1, 2, 3], [8, 9, 10], [8, 10, 11], [1, 2, 3, 4]]
    assert record.middles.tolist() == [4, 5, 6, 7, 4, 5, 6, 8, 11, 5, 6, 7, 8]
    assert listed(record.regions) == {"A": [0, 1, 4]}
    assert listed(record.edges) == {"B": [[0, 1], [1, 2]]}
    assert record.notes == [
        "elements of type MASS are no cells and left out (2)", "elements of type SPRINGA are no cells and left out (1)",
        "elements of type CAX3 are taken as plane cells (2)",
    ]  # fmt: skip


def test_sets_and_their_ranks(tmp_path: Path) -> None:
    """Of labels, ranges, sets and nodes of elements; those for internal use and without members are none."""
    record = read(
        NODES.replace("*NODE", "*NODE, NSET=Nall") + TWO.replace("CPE4", "CPE4, ELSET=Eall")
        + "*ELSET, ELSET=left\n1\n*ELSET, ELSET=LEFT\n1, 9\n*ELSET, ELSET=both, GENERATE\n1, 2\n"
        "*ELSET, ELSET=sets\nleft, 'both'\n*ELSET, ELSET=_hidden\n1\n*ELSET, ELSET=ASSEMBLY__x\n1\n"
        "*ELSET, ELSET=own, INTERNAL\n1\n*ELSET, ELSET=none\n9\n*SOLID SECTION, ELSET=sect\n*ELSET, ELSET=sect\n2\n"
        "*SHELL SECTION, ELSET=shell\n*ELSET, ELSET=shell\n2\n*MEMBRANE SECTION, ELSET=membrane\n"
        "*ELSET, ELSET=membrane\n2\n*BEAM SECTION, ELSET=beam\n*ELSET, ELSET=beam\n2\n"
        "*NSET, NSET=some\n6, 2, 7\n*NSET, NSET=of, ELSET=left\n5\n*NSET, NSET=step, GENERATE\n1, 6, 2\n"
        "*NSET, NSET=long, GENERATE\n5, 900\n*NSET, NSET=left\n3\n*NSET, NSET=empty\n77\n".replace("'", '"'),
        tmp_path,
    )  # fmt: skip
    assert listed(record.regions) == {
        "Eall": [0, 1], "left": [0], "both": [0, 1], "sets": [0, 1], "sect": [1], "shell": [1], "membrane": [1],
        "beam": [1],
    }  # fmt: skip
    ranks = {"Eall": IMPLIED, "sect": MATERIAL, "shell": MATERIAL, "membrane": MATERIAL}
    assert {group.name: group.rank for group in record.regions} == {
        str(group.name): ranks.get(str(group.name), DECLARED) for group in record.regions
    }
    assert listed(record.nodes) == {
        "Nall": [0, 1, 2, 3, 4, 5], "some": [5, 1], "of": [4, 0, 1, 2, 3, 0, 1, 2, 3], "step": [0, 2, 4],
        "long": [4, 5],
    }  # fmt: skip


def test_surfaces(tmp_path: Path) -> None:
    """Sides count from 1 in the order of the corners; nodes are a group; a name of lines is not one of nodes too."""
    record = read(
        NODES + TWO + "*ELSET, ELSET=left\n1\n*NSET, NSET=tips\n5, 6\n*SURFACE, NAME=first\n1, S1\n2, E2\n\n, \n1, S4\n"
        "*SURFACE, NAME=second, TYPE=element\nleft, s3\n2, S5\n2, S0\n2, SPOS\n9, S1\n1\n1, X1\n1, S\n1, S11\n"
        "*SURFACE, NAME=third, TYPE=NODE\ntips, 1.0\n1\n*SURFACE, NAME=cut, TYPE=CUTTING SURFACE\nnothing\n"
        '*SURFACE, NAME=quoted\n"left", S2\n*SURFACE\n1, S1\n*NSET, NSET=first\n6\n*SURFACE, NAME=None\n9, S1\n',
        tmp_path,
    )
    assert listed(record.edges) == {
        "first": [[0, 1], [4, 5], [3, 0]], "second": [[2, 3]], "quoted": [[1, 2]],
    }  # fmt: skip
    assert listed(record.nodes) == {"third": [4, 5, 0], "tips": [4, 5]}


PART = (
    "*PART, NAME={name}\n*NODE\n1, 0, 0\n2, 1, 0\n3, 0, 1\n"
    "*ELEMENT, TYPE=CPE3, ELSET=body\n1, 1, 2, 3\n{more}*END PART\n"
)


def test_parts_without_instances_are_where_they_are(tmp_path: Path) -> None:
    """Sets of several parts are called by their part as well; labels count within it."""
    more = "*NSET, NSET=one\n2\n"
    record = read(
        PART.format(name="P", more=more) + PART.format(name="q", more="").replace("1, 0, 0", "1, -5, 0"), tmp_path
    )
    assert record.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-5, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert loops(record) == [[0, 1, 2], [3, 4, 5]]
    assert listed(record.regions) == {"P.body": [0], "q.body": [1]}
    assert listed(record.nodes) == {"one": [1]}


def test_instances_and_sets_of_the_assembly(tmp_path: Path) -> None:
    """Instances of a part share its sets; an assembly names labels and sets of instances, and has nodes of its own."""
    part = PART.format(name="P", more="*NSET, NSET=one\n2\n*ELSET, ELSET=el\n1\n")
    record = read(
        f"{part}*ASSEMBLY\n*NODE\n1, 9, 9\n*INSTANCE, NAME=I, PART=p\n\n*END INSTANCE\n*INSTANCE, NAME=J, PART=P\n"
        "10, 20\n0, 0, 0, 0, 0, 2, 90\n*ELEMENT, TYPE=CPE3\n1, 1, 2, 3\n*NODE\n1, 4, 0, 1\n2, 5, 0\n3, 5, 1\n"
        "*END INSTANCE\n*NSET, NSET=tip, INSTANCE=j\n3\n*NSET, NSET=all, INSTANCE=I, GENERATE\n1, 3\n"
        "*NSET, NSET=own\n1\n*NSET, NSET=mixed\nI.one, J.2\n*NSET, NSET=of, INSTANCE=I, ELSET=el\n"
        "*ELSET, ELSET=right, INSTANCE=J\n1\n*SURFACE, NAME=s\nI.el, S3\nJ.1, S1\n*END ASSEMBLY\n",
        tmp_path,
    )
    points = [[9, 9, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [-20, 10, 0], [-20, 11, 0], [-21, 10, 0], [-20, 14, 1],
              [-20, 15, 0], [-21, 15, 0]]  # fmt: skip
    assert np.abs(record.points - points).max() < 1e-12
    assert loops(record) == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert listed(record.regions) == {"right": [1, 2], "body": [0, 1], "el": [0, 1]}
    assert listed(record.edges) == {"s": [[3, 1], [4, 5], [7, 8]]}
    assert listed(record.nodes) == {
        "tip": [6, 9], "all": [1, 2, 3], "own": [0], "mixed": [2, 5, 8], "of": [1, 2, 3], "one": [2, 5],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("data", "points"),
    [
        ("2", [[2, 0, 0], [3, 0, 0], [2, 1, 0]]),
        ("2, , 3", [[2, 0, 3], [3, 0, 3], [2, 1, 3]]),
        (",,,,,\n1, 1", [[1, 1, 0], [2, 1, 0], [1, 2, 0]]),
        ("1, 1, 0, 1, 1, 4, 90", [[2, 0, 0], [2, 1, 0], [1, 0, 0]]),
        ("1, 0, 0\n1, 1, 5, 1, 1, 4, 180", [[1, 2, 0], [0, 2, 0], [1, 1, 0]]),
        ("0, 0, 0, 3, 0, 0, 90", [[0, 0, 0], [1, 0, 0], [0, 0, 1]]),
        ("0, 0, 0, 0, 2, 0, 90", [[0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    ],
)
def test_instances_at_their_places(data: str, points: list[list[float]], tmp_path: Path) -> None:
    text = (
        f"{PART.format(name='P', more='')}*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n{data}\n*END INSTANCE\n*END ASSEMBLY\n"
    )
    assert np.abs(read(text, tmp_path).points - points).max() < 1e-12


def chain(n: int) -> str:
    return "*ELSET, ELSET=S0\n1\n" + "".join(f"*ELSET, ELSET=S{k}\nS{k - 1}\n" for k in range(1, n + 1))


INSTANCE = PART.format(name="P", more="") + "*INSTANCE, NAME=I, PART=P\n{}\n*END INSTANCE\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((f"*{name}\n", f"line 1: *{name.replace(' ', '')} makes nodes or elements out of others and cannot be read: "
           "write a file that lists them all")
          for name in ("NGEN", "NFILL", "ELGEN", "NCOPY", "ELCOPY", "NMAP", "SYSTEM", "SUBMODEL", "SUPER ELEMENT")),
        ("*NODE, SYSTEM=C\n1, 0, 0\n",
         "line 1: *NODE is not understood: coordinates of this SYSTEM cannot be read: write rectangular ones"),
        ("*NODE\nx, 0, 0\n", "line 1: *NODE is not understood: invalid literal for int() with base 10: 'x'"),
        ("*NODE\n1, 0, 0\n1, 0, 1\n",
         "line 1: *NODE is not understood: node 1 is at two places: parts with numbers of their own need *PART"),
        (f"{NODES}*ELEMENT\n1, 1, 2, 3\n", "line 8: *ELEMENT is not understood: it lacks TYPE="),
        (f"{NODES}*ELEMENT, TYPE=CPE3\n1, 1, 2\n",
         "line 8: *ELEMENT is not understood: element 1 of type CPE3 has 2 nodes instead of 3"),
        (f"{NODES}*ELEMENT, TYPE=CPE3\n1, 1, 2, 3, 4\n",
         "line 8: *ELEMENT is not understood: element 1 of type CPE3 has 4 nodes instead of 3"),
        (f"{NODES}{TWO}*ELEMENT, TYPE=CPE4\n1, 2, 3, 4, 1\n",
         "line 11: *ELEMENT is not understood: element 1 is there twice: parts with numbers of their own need *PART"),
        (f"{NODES}{TWO}*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n1, 1, 2, 3, 4\n", None),
        (f"{NODES}*ELEMENT, TYPE=CPE3\n1, 1, 2, 8\n", "element 1 has node 8, which is not there"),
        (f"{NODES}*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n",
         "it has solid cells (1 of type C3D4): give a mesh of plane cells"),
        (f"{NODES}*ELEMENT, TYPE=U1\n1, 1, 2\n",
         "cells that cannot be read: 1 of type U1; plane cells are, of any order"),
        ("*NSET\n1\n", "line 1: *NSET is not understood: it lacks NSET="),
        ("*ELSET, NAME=x\n1\n", "line 1: *ELSET is not understood: it lacks ELSET="),
        (f"{NODES}{TWO}*NSET, NSET=a\nb\n", "set 'a' contains the set 'b', which is not there"),
        (f"{NODES}{TWO}*NSET, NSET=a\nI.b\n", "set 'a' contains the set 'I.b', which is not there"),
        (f"{NODES}{TWO}*NSET, NSET=a, INSTANCE=I\n1\n", "set 'a' is of instance 'I', which is not there"),
        (f"{NODES}{TWO}*NSET, NSET=a, ELSET=b\n", "set 'a' contains the set 'b', which is not there"),
        (f"{NODES}{TWO}{chain(50)}", None),
        (f"{NODES}{TWO}{chain(51)}", "set 'S0' contains itself"),
        (INSTANCE.replace("PART=P", "PART=q").format(""), "instance 'I' is of part 'Q', which is not there"),
        (INSTANCE.replace(", PART=P", "").format(""), "instance 'I' is of part '', which is not there"),
        (INSTANCE.format("1, x"), "instance 'I': its place is not understood: could not convert string to float: 'x'"),
        (INSTANCE.format("1, 2, 3, 4"), "instance 'I': its place needs 3 numbers, or 7 to turn it, not 4"),
        (INSTANCE.format("1, 2, 3, 1, 2, 3, 90"), "instance 'I': the axis it is turned about has no length"),
    ],
)  # fmt: skip
def test_files_that_are_refused(text: str, message: str | None, tmp_path: Path) -> None:
    if message is None:
        assert loops(read(text, tmp_path)) == [[0, 1, 2, 3], [1, 4, 5, 2]]
        return
    with pytest.raises(InputError) as refused:
        read(text, tmp_path)
    assert str(refused.value) == message


def test_files_are_included_where_they_are_named(tmp_path: Path) -> None:
    (tmp_path / "nodes.inc").write_text(NODES)
    record = read(f"*INCLUDE, INPUT=nodes.inc\n{TWO}*NSET, NSET=a\n1\n", tmp_path)
    assert (len(record.points), len(record.loops), listed(record.nodes)) == (6, 2, {"a": [0]})


def test_keywords_in_all_spellings(tmp_path: Path) -> None:
    """Small letters, spaces, commas in quotes, lines that go on, and comments."""
    record = read(
        '*Heading\n** comment\nsome, words\n*Node , nset = "a, b"\n1, 0, 0\n** comment\n2, 1, 0\n'
        "*Element,\n type = cpe3 ,"
        "\nel set=c d\n1, 1, 2, 3\n*Node\n3, 1, 1",
        tmp_path,
    )
    assert (listed(record.nodes), listed(record.regions)) == ({"a, b": [0, 1]}, {"c d": [0]})
    assert loops(record) == [[0, 1, 2]]
