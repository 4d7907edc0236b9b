"""Local refinement: marked cells are cut from centroid to middles of sides, neighbours get hanging nodes.

A side is the chain of edges between two corners, a corner is a vertex where the boundary turns. So a quadrilateral with
hanging nodes is cut into four quadrilaterals (a quadtree), a hexagon into six; and where a side has a hanging node in
its middle, that node is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tmc_vem.mesh.geometry import centroids, star_shaped_about
from tmc_vem.mesh.make.change import VALIDATED, CellTree, MeshChange, check_limits, marked_cells
from tmc_vem.mesh.make.cut import cut
from tmc_vem.mesh.make.loops import Loops
from tmc_vem.mesh.make.onto_curves import Followed
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.support.errors import InputError

Int = NDArray[np.int64]
Marked = Int | Sequence[int] | NDArray[np.bool_]


def refine(mesh: PolygonMesh, marked: Marked, *, max_hanging: int = 1) -> PolygonMesh:
    """Mesh with the marked cells cut into one cell a corner.

    Args:
        mesh: any mesh; marked cells are star-shaped about their centroid (:func:`refined` does without).
        marked: numbers of cells, or a mask over all cells.
        max_hanging: largest number of hanging nodes that refinement may leave on a side; cells with more are refined
            too. Every hanging node raises the degree l that a cell needs, and l = 8 is the end.

    Returns:
        The mesh; cells keep their region and data, named points their place, and named edges that are cut are named in
        pieces.

    Raises:
        InputError: a number is no cell, ``max_hanging`` is below 1, or a marked cell is not star-shaped about its
            centroid.
    """
    check_limits(max_hanging, 0.0)
    chosen = np.flatnonzero(marked_cells(mesh, marked))
    for which, vertices in Loops.of(mesh).chosen(chosen).by_size():
        polygons = mesh.points_vx[vertices]
        blind = which[~star_shaped_about(polygons, centroids(polygons))]
        if len(blind):
            raise InputError(f"cell {chosen[blind[0]]} cannot be refined: it is not star-shaped about its centroid")
    return refined(mesh, chosen, max_hanging=max_hanging).mesh


def refined(
    mesh: PolygonMesh,
    marked: Marked,
    *,
    tree: CellTree | None = None,
    max_hanging: int = 1,
    flat: float = 0.0,
    curves: Sequence[Followed] = (),
) -> MeshChange:
    """Mesh with the marked cells cut, where it was before, and what coarsening needs.

    A cell is cut from its centroid to the middles of its sides, or from another point that sees all of it; where there
    is no good one, along diagonals into parts that have one. A side with a corner to the right is divided there. The
    result does not depend on the order of the marked
    cells, and new cells stand where their parent stood.

    Args:
        mesh: any mesh.
        marked: numbers of cells, or a mask over all cells.
        tree: history of its cells, from the call that made it; None for a mesh that nothing was done to.
        max_hanging: largest number of hanging nodes that refinement may leave on a side; cells with more are refined
            too, as often as it takes.
        flat: vertices where a cell's boundary turns by less (degrees) lie on a side and are no corners. 0 leaves only
            straight angles; along curves use 20, as vertices on them are off the straight line. A cell where fewer than
            three corners were left goes by straight angles.
        curves: such as :class:`tmc_vem.mesh.make.outline.Arc`. The new middle of an edge on the boundary, or between
            two regions, that is a chord of one of them is moved onto it, unless a cell would suffer from that.

    Raises:
        InputError: a number is no cell, ``max_hanging`` is below 1, ``flat`` is out of range, the tree is that of
            another mesh, or a cell can be cut in no way; the message names it.
    """
    tree = CellTree.of(mesh) if tree is None else tree
    tree.check(mesh)
    change = MeshChange(mesh, mesh.points_vx, np.arange(mesh.n_cells), tree)
    return refined_further(change, marked, max_hanging=max_hanging, flat=flat, curves=curves)


def refined_further(
    change: MeshChange, marked: Marked, *, max_hanging: int = 1, flat: float = 0.0, curves: Sequence[Followed] = ()
) -> MeshChange:
    """A change and one more refinement as one change of the first mesh; ``marked`` are cells of the second one.

    Args and Raises: as for :func:`refined`.
    """
    check_limits(max_hanging, flat)
    mesh = change.mesh
    pending = marked_cells(mesh, marked)
    while pending.any():
        change = cut(change, pending, flat, curves)
        new = change.mesh
        pending = Loops.of(new).overloaded(new.points_vx, change.tree.born_v, flat, max_hanging)
    if change.mesh is not mesh and change.mesh.n_cells <= VALIDATED:
        change = replace(change, mesh=replace(change.mesh, validate=True))
    return change
