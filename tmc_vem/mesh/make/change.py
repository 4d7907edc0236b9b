"""What refinement and coarsening hand back: the new mesh, where it was in the mesh before, and what it is made of."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

# Meshes up to this many cells are validated after every change; validity is by construction, and checking costs more.
VALIDATED = 10000


@dataclass(frozen=True)
class CellTree:
    """The history of a mesh's cells, so that refinement can be undone over any number of levels.

    A family is the cells that one cell, their parent, was cut into. All attributes are arrays: ``np.savez(path,
    **vars(tree))`` saves a tree, ``CellTree(**np.load(path))`` reads it.

    Attributes:
        family_c: (n_cells,) family of each cell, -1 for cells of the first mesh.
        level_c: (n_cells,) how often what is now the cell has been cut; 0 for cells of the first mesh.
        born_v: (n_vertices,) vertices made by refinement.
        size_f: (n_families,) how many cells a family has, counting those that have been cut themselves.
        above_f: (n_families,) family that the parent belongs to, -1 if it is a cell of the first mesh.
        first_f: (n_families,) vertex that the parent's list of vertices begins with.
    """

    family_c: Int
    level_c: Int
    born_v: Bool
    size_f: Int
    above_f: Int
    first_f: Int

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            array = np.array(getattr(self, name), dtype=bool if name == "born_v" else np.int64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @staticmethod
    def of(mesh: PolygonMesh) -> CellTree:
        """Tree of a mesh that nothing was done to."""
        none = np.empty(0, dtype=np.int64)
        level, born = np.zeros(mesh.n_cells, dtype=np.int64), np.zeros(mesh.n_vertices, dtype=bool)
        return CellTree(np.full(mesh.n_cells, -1), level, born, none, none, none)

    def check(self, mesh: PolygonMesh) -> None:
        """Check that the tree is that of a mesh, as far as numbers tell.

        Raises:
            InputError: it has other numbers of cells or vertices.
        """
        for what, mine, n in (
            ("cells", len(self.family_c), mesh.n_cells),
            ("vertices", len(self.born_v), mesh.n_vertices),
        ):
            if mine != n:
                raise InputError(
                    f"the tree is of a mesh with {mine} {what}, this one has {n}: use the tree that came with the mesh"
                )


@dataclass(frozen=True)
class MeshChange:
    """A mesh that was made of another one by cutting or joining cells.

    Attributes:
        mesh: the new mesh.
        before_vx: (n_vertices, 2) where each of its vertices was in the mesh before: where it is, except for a vertex
            that was moved onto a curve, which was in the middle of the straight side. Where a cell was cut more than
            once beside a curve, vertices between such ones have moved along.
        parent_c: (n_cells,) cell of the mesh before that each cell lies in; of a cell that was joined, the one with the
            smallest number of those that it was made of.
        tree: history of the new mesh's cells.
    """

    mesh: PolygonMesh
    before_vx: Float
    parent_c: Int
    tree: CellTree


def marked_cells(mesh: PolygonMesh, marked: object) -> Bool:
    """(n_cells,) mask of cells that are given by number or as a mask.

    Raises:
        InputError: a number is no cell, or a mask has another length.
    """
    chosen = np.asarray(marked)
    chosen = chosen if chosen.size else np.empty(0, dtype=np.int64)
    mask = np.zeros(mesh.n_cells, dtype=bool)
    if chosen.dtype == np.bool_ and chosen.shape != mask.shape:
        raise InputError(f"the mask has {len(chosen)} entries for {mesh.n_cells} cells")
    if chosen.dtype != np.bool_ and len(chosen) and not (chosen.min() >= 0 and chosen.max() < mesh.n_cells):
        raise InputError(
            f"cells {chosen.min()} to {chosen.max()} are marked, but cells run from 0 to {mesh.n_cells - 1}"
        )
    mask[chosen] = True
    return mask


def check_limits(max_hanging: int, flat: float) -> None:
    """Check two numbers that refinement and coarsening share.

    Raises:
        InputError: ``max_hanging`` is below 1, or ``flat`` no angle from 0 to 60 degrees.
    """
    if max_hanging < 1:
        raise InputError(f"max_hanging = {max_hanging}: a refined cell leaves one hanging node, use 1 or more")
    if not 0.0 <= flat <= 60.0:
        raise InputError(f"flat = {flat:g}: use an angle from 0 to 60 degrees")
