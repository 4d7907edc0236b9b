"""Fields of a state on polygons: what is written for ParaView and drawn in pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.files import write_atomically
from tmc_vem.support.units import COORDINATES, Units

Float = NDArray[np.float64]
Int = NDArray[np.int64]


@dataclass(frozen=True)
class Polygons:
    """Cells as polygons through all nodes of their boundary, vertices and points on the sides, in order.

    Attributes:
        points_nx: (n_points, 2) reference coordinates.
        offsets: (n_cells + 1,) where each polygon starts in ``connectivity``.
        connectivity: points of all polygons, counter-clockwise.
        region_c: (n_cells,) region of each cell.
        region_names: names of the regions.
        media: names of those that are third medium.
    """

    points_nx: Float
    offsets: Int
    connectivity: Int
    region_c: Int
    region_names: tuple[str, ...]
    media: tuple[str, ...] = ()

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.region_c)

    @property
    def is_solid_c(self) -> NDArray[np.bool_]:
        """(n_cells,) which cells are not of third medium."""
        solid = np.array([name not in self.media for name in self.region_names], dtype=bool)
        of_cells: NDArray[np.bool_] = solid[self.region_c]
        return of_cells

    def cell(self, c: int) -> Int:
        """Points of cell ``c``."""
        return self.connectivity[self.offsets[c] : self.offsets[c + 1]]

    @staticmethod
    def merge(parts: Sequence[Polygons]) -> Polygons:
        """Cells of several ranks as one; points on borders between ranks stay doubled."""
        first_point = np.cumsum([0, *(len(part.points_nx) for part in parts)])
        first_entry = np.cumsum([0, *(len(part.connectivity) for part in parts)])
        offsets = [part.offsets[:-1] + start for part, start in zip(parts, first_entry, strict=False)]
        return Polygons(
            points_nx=np.concatenate([part.points_nx for part in parts]),
            offsets=np.concatenate([*offsets, first_entry[-1:]]),
            connectivity=np.concatenate(
                [part.connectivity + start for part, start in zip(parts, first_point, strict=False)]
            ),
            region_c=np.concatenate([part.region_c for part in parts]),
            region_names=parts[0].region_names,
            media=parts[0].media,
        )


@dataclass(frozen=True)
class Fields:
    """A state on polygons.

    Attributes:
        polygons: the cells.
        displacement_ni: (n_points, 2).
        jacobian_c, min_jacobian_c: (n_cells,) mean and smallest J of each cell.
        energy_density_c: (n_cells,) energy over reference area.
        cell_fields, point_fields: further values of cells and of points by name, with a second axis for components.
    """

    polygons: Polygons
    displacement_ni: Float
    jacobian_c: Float
    min_jacobian_c: Float
    energy_density_c: Float
    cell_fields: Mapping[str, Float] = field(default_factory=dict)
    point_fields: Mapping[str, Float] = field(default_factory=dict)

    @staticmethod
    def merge(parts: Sequence[Fields]) -> Fields:
        """Fields of several ranks as one; points on borders between ranks stay doubled."""
        polygons = Polygons.merge([part.polygons for part in parts])
        return Fields(
            polygons,
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("displacement_ni", "jacobian_c", "min_jacobian_c", "energy_density_c")
            ),
            *(
                {
                    name: np.concatenate([getattr(part, group)[name] for part in parts])
                    for name in getattr(parts[0], group)
                }
                for group in ("cell_fields", "point_fields")
            ),
        )


def units_label(unit: str) -> str:
    """Element that says the unit of an array of a VTK file; nothing without one."""
    key = f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{unit}</InformationKey>'
    return key if unit else ""


def write_pvtu(
    path: Path,
    pieces: Sequence[str],
    units: Units | None = None,
    of_cells: Mapping[str, str] | None = None,
    of_points: Mapping[str, str] | None = None,
) -> None:
    """Write the file that puts the pieces of several ranks beside it together.

    Args:
        path: the file.
        pieces: names of the pieces.
        units: of the problem.
        of_cells, of_points: further arrays, the elements that say what they are, without values.
    """
    unit = {name: units_label(label) for name, label in (units or Units()).of_fields().items()}
    kinds = {"J": "Float64", "min_J": "Float64", "energy_density": "Float64", "region": "Int64", "medium": "UInt8"}
    per_cell = "".join(
        f'      <PDataArray type="{kind}" Name="{name}">{unit[name]}</PDataArray>\n' for name, kind in kinds.items()
    )
    per_cell += "".join(f"      {element}\n" for element in (of_cells or {}).values())
    per_point = "".join(f"      {element}\n" for element in (of_points or {}).values())
    sources = "".join(f'    <Piece Source="{name}"/>\n' for name in pieces)
    path.write_text(
        '<?xml version="1.0"?>\n<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">\n'
        '  <PUnstructuredGrid GhostLevel="0">\n'
        '    <PPoints>\n      <PDataArray type="Float64" NumberOfComponents="3">'
        f"{unit[COORDINATES]}</PDataArray>\n    </PPoints>\n"
        '    <PPointData>\n      <PDataArray type="Float64" Name="displacement" NumberOfComponents="3">'
        f"{unit['displacement']}</PDataArray>\n{per_point}    </PPointData>\n"
        f"    <PCellData>\n{per_cell}    </PCellData>\n{sources}"
        "  </PUnstructuredGrid>\n</VTKFile>\n"
    )


def write_pvd(path: Path, entries: Sequence[tuple[float, Sequence[str]]]) -> None:
    """Write a ParaView collection: load factors, each with the files of its parts relative to ``path``."""
    datasets = "".join(
        f'    <DataSet timestep="{load:.12g}" part="{part}" file="{name}"/>\n'
        for load, names in entries
        for part, name in enumerate(names)
    )
    write_atomically(
        path,
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
        f"  <Collection>\n{datasets}  </Collection>\n</VTKFile>\n",
        durable=False,
    )
