"""VTU files of fields, written fast: arrays stand in their elements, in blocks in zlib's format, in base64.

The grid is the same in all files of a run: it is compressed once. Displacements and values of cells hardly shrink (by a
quarter to a half, most of it zeros), and compressing them would take ten times as long as all the rest: they are only
stored in that format. Raw appended arrays would be a quarter smaller, but meshio cannot read them with Python 3.13.

Arrays carry their units as VTK has it, in the information key UNITS_LABEL. The unit system as text in FieldData would
keep meshio from reading the file.
"""

from __future__ import annotations

import base64
import html
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.files import whole_file
from tmc_vem.support.units import COORDINATES, Units
from tmc_vem.support.vtk_types import cell_types, to_vtk
from tmc_vem.system.fields import Fields, Polygons, units_label
from tmc_vem.system.tensors import COMPONENTS, kind_of

BLOCK = 1 << 20  # bytes that are compressed as one, of any number of arrays
STORED, COMPRESSED = 0, 1  # levels of zlib; those above 1 take four times as long for a tenth less
TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}


@dataclass(frozen=True)
class _Array:
    """An array as it stands in a file: attributes of its element, its unit, which may be empty, and its text."""

    attributes: str
    unit: str
    text: bytes


class VtuWriter:
    """Writes states on the same cells, one file each, with displacement, J, region and energy density.

    Plain triangles and quadrilaterals are cells of VTK in which it interpolates exactly, the others true polygons.

    Args:
        polygons: the cells.
        units: of the problem.
        others: units of further fields, by name, that are no stresses or strains.
    """

    def __init__(
        self, polygons: Polygons, units: Units | None = None, others: Mapping[str, str] | None = None
    ) -> None:  # fmt: skip
        self._others = dict(others or {})
        self._of, self._units = (units or Units()).of, (units or Units()).of_fields()
        sizes = np.diff(polygons.offsets)
        self._counts = f'NumberOfPoints="{len(polygons.points_nx)}" NumberOfCells="{polygons.n_cells}"'
        types = cell_types(polygons.points_nx, polygons.offsets, polygons.connectivity)
        # readers like cells of one type with equally many points together
        self._order = np.lexsort([np.arange(len(sizes)), types, sizes])
        first, ordered = polygons.offsets[:-1][self._order], sizes[self._order]
        ends = np.cumsum(ordered)
        entries = np.arange(len(polygons.connectivity)) + np.repeat(first - (ends - ordered), ordered)
        around = to_vtk(polygons.offsets, polygons.connectivity, types)
        unit = self._units[COORDINATES]
        self._points = _array("Points", _in_space(polygons.points_nx), COMPRESSED, unit)
        self._cells = [
            _array("connectivity", around[entries].astype(np.int64), COMPRESSED),
            _array("offsets", ends.astype(np.int64), COMPRESSED),
            _array("types", types[self._order].astype(np.uint8), COMPRESSED),
        ]
        region = polygons.region_c[self._order].astype(np.int64)
        medium = (~polygons.is_solid_c[self._order]).astype(np.uint8)
        self._regions = [
            _array("region", region, COMPRESSED, self._units["region"]),
            _array("medium", medium, COMPRESSED, self._units["medium"]),
        ]

    def write(self, path: Path, fields: Fields) -> None:
        """Write a state; warp by ``displacement`` in ParaView.

        Args:
            path: file, which appears whole or not at all.
            fields: the state, on this writer's polygons.

        Raises:
            OSError: it could not be written.
        """
        values = {"J": fields.jacobian_c, "min_J": fields.min_jacobian_c, "energy_density": fields.energy_density_c}
        per_cell = [_array(name, value[self._order], STORED, self._units[name]) for name, value in values.items()]
        moved = _array("displacement", _in_space(fields.displacement_ni), STORED, self._units["displacement"])
        groups = {
            "Points": [self._points],
            "Cells": self._cells,
            "PointData": [moved, *self._more(fields.point_fields)],
            "CellData": [
                *per_cell,
                *self._regions,
                *self._more({name: value[self._order] for name, value in fields.cell_fields.items()}),
            ],
        }
        head = (
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" header_type="UInt64" '
            f'byte_order="{sys.byteorder.capitalize()}Endian" compressor="vtkZLibDataCompressor">\n'
            f"  <UnstructuredGrid>\n    <Piece {self._counts}>\n"
        )
        with whole_file(path, durable=False) as temporary, temporary.open("wb") as file:
            file.write(head.encode())
            for group, arrays in groups.items():
                file.write(f"      <{group}>\n".encode())
                for array in arrays:
                    file.write(f'        <DataArray {array.attributes} format="binary">'.encode())
                    file.write(array.text)
                    file.write(f"{units_label(array.unit)}</DataArray>\n".encode())
                file.write(f"      </{group}>\n".encode())
            file.write(b"    </Piece>\n  </UnstructuredGrid>\n</VTKFile>\n")

    def _more(self, fields: Mapping[str, NDArray[np.float64]]) -> list[_Array]:
        """Stresses and strains, and others."""
        return [
            _array(name, values, STORED, self._unit(name), _named(COMPONENTS.get(name, ())))
            for name, values in fields.items()
        ]

    def _unit(self, name: str) -> str:
        return self._others[name] if name in self._others else self._of(kind_of(name))

    def elements(self, fields: Mapping[str, NDArray[np.float64]]) -> dict[str, str]:
        """What a file that puts pieces together says of such arrays."""
        found = {}
        for name, values in fields.items():
            several = (
                f' NumberOfComponents="{values.shape[1]}"{_named(COMPONENTS.get(name, ()))}' if values.ndim > 1 else ""
            )
            label = units_label(self._unit(name))
            found[name] = f'<PDataArray type="Float64" Name="{name}"{several}>{label}</PDataArray>'
        return found


def _named(components: Sequence[str]) -> str:
    """Attributes with the names of an array's components."""
    return "".join(f' ComponentName{n}="{component}"' for n, component in enumerate(components))


def _array(name: str, values: NDArray[Any], level: int, unit: str = "", named: str = "") -> _Array:
    """Values (n,) or (n, components) as blocks, after their number, their size, the last one's, and what they take."""
    components = f' NumberOfComponents="{values.shape[1]}"{named}' if values.ndim > 1 else ""
    plain = np.ascontiguousarray(values).tobytes()
    blocks = [zlib.compress(plain[start : start + BLOCK], level) for start in range(0, len(plain), BLOCK)]
    head = np.array([len(blocks), BLOCK, len(plain) % BLOCK, *map(len, blocks)], np.uint64)
    text = base64.b64encode(head.tobytes()) + base64.b64encode(b"".join(blocks))
    return _Array(f'type="{TYPES[values.dtype.str[1:]]}" Name="{html.escape(name)}"{components}', unit, text)


def _in_space(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([plane, np.zeros(len(plane))])
