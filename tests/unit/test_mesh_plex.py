"""Arrays of a DMPlex against its points one at a time."""

from __future__ import annotations

import numpy as np
import pytest
from helpers_mesh import hanging, non_convex, voronoi
from mpi4py import MPI

from tmc_vem.mesh.spread.distribute import distribute
from tmc_vem.mesh.spread.plex import cone_sizes, cones
from tmc_vem.support.petsc import PETSc


@pytest.mark.parametrize("mesh", [voronoi(9), hanging(3), non_convex()], ids=["Voronoi", "hanging", "non-convex"])
def test_cones_and_cell_types_are_those_of_every_point(mesh):
    plex = distribute(MPI.COMM_SELF, lambda: mesh).plex
    points = np.arange(*plex.getChart())
    sizes = cone_sizes(plex, points)
    cone, orientation = cones(plex, int(sizes.sum()))
    ends = np.cumsum(sizes)
    for point, size, end in zip(points.tolist(), sizes.tolist(), ends.tolist(), strict=True):
        assert size == plex.getConeSize(point)
        assert cone[end - size : end].tolist() == plex.getCone(point).tolist()
        assert orientation[end - size : end].tolist() == plex.getConeOrientation(point).tolist()
        kind = {0: PETSc.DM.PolytopeType.POINT, 2: PETSc.DM.PolytopeType.SEGMENT}
        assert plex.getCellType(point) == kind.get(size, PETSc.DM.PolytopeType.FV_GHOST)
    # edges are the sides of the cells that contain them, and vertices the ends of the edges
    edge, cell = int(plex.getDepthStratum(1)[0]), 0
    assert cell in plex.getSupport(plex.getCone(cell)[0])
    assert edge in plex.getSupport(plex.getCone(edge)[0])
