"""A mesh made anew from its shapes, with the sizes of cells that errors ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.mesh.make.change import CellTree, MeshChange
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.adaptable import fitted

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# Voronoi cells of sites a distance apart have between the area of a hexagon and that of a square of that width.
SIZE = 1.03


def remade(problem: OwnProblem, mesh: PolygonMesh, level_c: Int) -> MeshChange:
    """Another mesh of the same shapes, whose cells are as wide as those of a mesh, halved as often as these are to be
    cut, and growing from place to place no faster than ``growth`` of the problem says.

    Nothing of the old mesh is kept: ``parent_c`` is the old cell whose centroid is nearest, and cells do not lie in it.

    Raises:
        InputError: the mesh cannot be made.
    """
    center_cx, area_c = centroids_and_areas(mesh)
    tree, wanted_c = cKDTree(center_cx), SIZE * np.sqrt(area_c) / 2.0**level_c

    def size(points_nx: Float) -> Float:
        found: Float = wanted_c[tree.query(points_nx)[1]]
        return found

    table = replace(problem.table, mesh=replace(problem.table.mesh, size=size, refine=()))
    new = fitted(replace(problem, table=table))[1]
    parent_c = tree.query(centroids_and_areas(new)[0])[1]
    return MeshChange(new, new.points_vx, np.asarray(parent_c, dtype=np.int64), CellTree.of(new))
