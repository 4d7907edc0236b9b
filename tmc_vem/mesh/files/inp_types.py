"""Types of elements of Abaqus and CalculiX: which are plane cells, which are edges, and which no cells at all.

Names: Abaqus Elements Guide, and the CalculiX CrunchiX manual, section 6.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

# plane strain and stress, axisymmetric, shells, membranes, rigid and surface elements, those for heat and acoustics
_PLANE = re.compile(r"(CPS|CPEG|CPE|CGAX|CAX|STRI|S|M3D|R3D|SFM3D|DS|DC2D|DCAX|AC2D|ACAX|WARP2D)([34689])(?!\d)")
_STRI65 = re.compile(r"STRI65$")
_LINES = re.compile(r"(T2D|T3D|R2D|RB2D|RB3D|RAX|SAX|DC1D|B2|B3|PIPE2|PIPE3|ELBOW3|FRAME2D|FRAME3D|F2D)([123])?")
_SOLID = re.compile(r"(C3D|SC\d|DC3D|AC3D|CSS8|EC3D|COH3D|CCL|MCL|PC3D|TIRE)")
_NO_CELLS = re.compile(r"(MASS|ROTARYI|SPRING|DASHPOT|GAP|CONN|DCOUP|HEATCAP|JOINTC|ITS|DISTRIBUT|DRAG|NET)")
_CORNERS = {3: 3, 4: 4, 6: 3, 8: 4, 9: 4}


@dataclass(frozen=True)
class ElementType:
    """What is read of an element.

    Attributes:
        kind: 'cell', 'edge', 'none' (no cell, such as a point mass), 'solid' or 'unknown'.
        n_nodes: in the connectivity; 0 if that does not matter.
        n_corners: of a cell.
    """

    kind: str
    n_nodes: int = 0
    n_corners: int = 0


def element_type(name: str) -> ElementType:
    """The type of this name, in capitals."""
    if _STRI65.match(name):
        return ElementType("cell", 6, 3)
    if plane := _PLANE.match(name):
        n = int(plane[2])
        return ElementType("cell", n, _CORNERS[n])
    if _SOLID.match(name):
        return ElementType("solid")
    if _NO_CELLS.match(name):
        return ElementType("none")
    if line := _LINES.match(name):
        digit = int(line[2] or 2)
        # beams and axisymmetric shells count by order, the others by nodes; B23 and B33 are cubic and have two
        by_order = name.startswith(("B", "PIPE", "ELBOW", "SAX"))
        n = {1: 2, 2: 3, 3: 2}[digit] if by_order else max(digit, 2)
        return ElementType("edge", n)
    return ElementType("unknown")


def is_axisymmetric(name: str) -> bool:
    """Whether the plane of the element is a half plane that is turned about an axis."""
    return name.startswith(("CAX", "CGAX", "DCAX", "ACAX", "SAX"))
