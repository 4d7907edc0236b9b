"""The next mesh of an adapted problem: cells cut where they matter, or made anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tmc_vem.adapt.marking import graded, levels_of
from tmc_vem.adapt.remade import remade
from tmc_vem.mesh.make.change import CellTree, MeshChange
from tmc_vem.mesh.make.refine import refined, refined_further
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.base import Problem, curves_of, media_of
from tmc_vem.problems.own import OwnProblem

Float = NDArray[np.float64]
Int = NDArray[np.int64]

HANGING = 3  # nodes on a side
MOST_LEVELS = 10  # that cells are cut in all: beyond, it is a point or a corner where there is no limit
FLAT = 20.0  # degrees: a vertex on a curve is no corner of a cell


@dataclass(frozen=True)
class NextMesh:
    """What becomes of a mesh.

    Attributes:
        change: to the next one.
        n_refined: how many cells are cut; where it is 0, nothing changes.
        nested: whether cells of the next mesh lie in those of this one, or are made of them.
    """

    change: MeshChange
    n_refined: int
    nested: bool = True


def every_cell_cut(problem: Problem, mesh: PolygonMesh, tree: CellTree) -> MeshChange:
    """The mesh with all cells cut."""
    return refined(
        mesh, np.arange(mesh.n_cells), tree=tree, max_hanging=HANGING, flat=FLAT, curves=curves_of(problem)
    )  # fmt: skip


def next_mesh(
    problem: Problem, mesh: PolygonMesh, tree: CellTree, contributions_c: Float, error: float, tolerance: float, *,
    anew: bool = False,
) -> NextMesh:  # fmt: skip
    """The mesh of the next round.

    Args:
        problem: whose mesh.
        mesh, tree: the present one.
        contributions_c: (n_cells,) to the relative error, not negative.
        error, tolerance: relative error that is estimated, and wanted.
        anew: make the mesh of the problem's shapes anew.

    Raises:
        InputError: it cannot be made anew.
    """
    media = set(media_of(problem))
    at_end = tree.level_c >= MOST_LEVELS
    level_c = levels_of(mesh, np.where(at_end, 0.0, contributions_c), error, tolerance)
    level_c = graded(mesh, level_c, tree.level_c, np.array([name in media for name in mesh.region_names]))
    n_refined = int((level_c > 0).sum())
    if anew and n_refined:
        assert isinstance(problem, OwnProblem)
        return NextMesh(remade(problem, mesh, level_c), n_refined, nested=False)
    change, curves = MeshChange(mesh, mesh.points_vx, np.arange(mesh.n_cells), tree), curves_of(problem)
    for level in range(int(level_c.max(initial=0))):
        marked = np.flatnonzero(level_c[change.parent_c] > level)
        change = refined_further(change, marked, max_hanging=HANGING, flat=FLAT, curves=curves)
    return NextMesh(change, n_refined)
