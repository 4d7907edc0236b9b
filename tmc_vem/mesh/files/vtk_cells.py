"""Cells as VTK has them, by type, connectivity and offsets: what its XML and its legacy files share.

Types and orders of nodes: vtkCellType.h and the classes named there, https://vtk.org/doc/nightly/html/.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.files.cell_data import Data, add_groups
from tmc_vem.mesh.files.record import Reading, Record, refuse_kinds
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]

VERTEX, POLY_VERTEX, LINE, POLY_LINE, STRIP, POLYGON, PIXEL, QUADRATIC_POLYGON = 1, 2, 3, 4, 6, 7, 8, 36
# types of plane cells whose corners come first, and how many these are
CORNERS = {5: 3, 9: 4, 22: 3, 23: 4, 28: 4, 30: 4, 34: 3, 69: 3, 70: 4, 76: 3, 77: 4}
CURVES = (LINE, 21, 35, 68, 75)  # whose ends come first
SOLIDS = {
    10: "tetrahedron", 11: "voxel", 12: "hexahedron", 13: "wedge", 14: "pyramid", 15: "pentagonal prism",
    16: "hexagonal prism", 24: "quadratic tetrahedron", 25: "quadratic hexahedron", 26: "quadratic wedge",
    27: "quadratic pyramid", 42: "polyhedron", 71: "Lagrange tetrahedron", 72: "Lagrange hexahedron",
    73: "Lagrange wedge",
}  # fmt: skip
# cell data of files of results, in which points are there once for each region that they are of
OF_RESULTS = {"region", "min_J", "energy_density"}


@dataclass
class VtkCells:
    """Points and cells of one piece or file.

    Attributes:
        points: (n, 3).
        types: of every cell.
        offsets: (n_cells + 1,) where each starts in ``connectivity``.
        connectivity: nodes of all cells.
        data: arrays of cell data by name.
    """

    points: Float
    types: Int
    offsets: Int
    connectivity: Int
    data: dict[str, NDArray[np.generic]] = field(default_factory=dict)

    def check(self) -> None:
        """Refuse arrays that do not fit together.

        Raises:
            InputError: they do not.
        """
        n = len(self.types)
        if len(self.offsets) != n + 1 or (np.diff(self.offsets) < 0).any():
            raise InputError(f"offsets of its {n} cells are {len(self.offsets) - 1} and must grow")
        if self.offsets[0] != 0 or self.offsets[-1] != len(self.connectivity):
            raise InputError(
                f"its cells need {self.offsets[-1]} entries of the connectivity, which has {len(self.connectivity)}"
            )
        bad = np.flatnonzero((self.connectivity < 0) | (self.connectivity >= len(self.points)))
        if len(bad):
            c = int(np.searchsorted(self.offsets, bad[0], side="right")) - 1
            raise InputError(
                f"cell {c} refers to vertex {self.connectivity[bad[0]]}; there are {len(self.points)} vertices"
            )
        for name, values in self.data.items():
            if len(values) != n:
                raise InputError(f"cell data '{name}' has {len(values)} values for {n} cells")


def to_record(cells: VtkCells, reading: Reading) -> Record:
    """The record of the cells.

    Raises:
        InputError: the arrays do not fit together, or a cell is no plane cell.
    """
    cells.check()
    if cells.data.keys() >= OF_RESULTS:
        cells = _joined_regions(cells)
    loops: list[Int] = []
    owners: list[int] = []
    pairs: list[list[int]] = []
    pair_owners: list[int] = []
    singles: list[int] = []
    single_owners: list[int] = []
    unknown: list[str] = []
    solids: list[str] = []
    middles: list[Int] = []
    offsets = cells.offsets.tolist()
    for c, kind in enumerate(cells.types.tolist()):
        nodes = cells.connectivity[offsets[c] : offsets[c + 1]]
        n = CORNERS.get(kind, 0)
        if n and len(nodes) >= n:
            middles.append(nodes[n:])
            nodes = nodes[:n]
        elif kind == QUADRATIC_POLYGON and len(nodes) % 2 == 0:
            middles.append(nodes[len(nodes) // 2 :])
            nodes = nodes[: len(nodes) // 2]
        elif kind == PIXEL and len(nodes) == 4:
            nodes = nodes[[0, 1, 3, 2]]
        elif kind == STRIP and len(nodes) >= 3:
            loops += [nodes[t : t + 3] if t % 2 == 0 else nodes[[t + 1, t, t + 2]] for t in range(len(nodes) - 2)]
            owners += [c] * (len(nodes) - 2)
            continue
        elif kind in CURVES and len(nodes) >= 2:
            pairs.append(nodes[:2].tolist())
            pair_owners.append(c)
            middles.append(nodes[2:])
            continue
        elif kind == POLY_LINE:
            pairs += np.stack([nodes[:-1], nodes[1:]], axis=1).tolist()
            pair_owners += [c] * max(len(nodes) - 1, 0)
            continue
        elif kind in (VERTEX, POLY_VERTEX):
            singles += nodes.tolist()
            single_owners += [c] * len(nodes)
            continue
        elif kind in SOLIDS:
            solids.append(SOLIDS[kind])
            continue
        elif kind != POLYGON:
            unknown.append(f"VTK {kind}" + (f" with {len(nodes)} nodes" if n else ""))
            continue
        loops.append(nodes)
        owners.append(c)
    refuse_kinds(unknown, solids)
    record = Record(cells.points, loops, middles=np.unique(np.concatenate([*middles, np.empty(0, dtype=np.int64)])))
    add_groups(
        record, _one_a_cell(cells.data), np.array(owners, dtype=np.int64), reading.region_data,
        (np.array(pair_owners, dtype=np.int64), np.array(pairs, dtype=np.int64).reshape(-1, 2)),
        (np.array(single_owners, dtype=np.int64), np.array(singles, dtype=np.int64)),
    )  # fmt: skip
    return record


def _joined_regions(cells: VtkCells) -> VtkCells:
    """The same cells with points at exactly the same place as one."""
    points, number = np.unique(cells.points, axis=0, return_inverse=True)
    return replace(cells, points=points, connectivity=number.reshape(-1)[cells.connectivity])


def _one_a_cell(data: Data) -> dict[str, NDArray[np.generic]]:
    return {
        name: values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values for name, values in data.items()
    }
