"""The arrays of a DMPlex, all points at once: petsc4py sets and gets the cone of one point at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tmc_vem.support.petsc import PETSc
from tmc_vem.support.petsc_arrays import in_place

Int = NDArray[np.int64]
Petsc = NDArray[Any]  # of PETSc's integers


def set_cone_sizes(plex: Any, first: int, sizes: Sequence[int]) -> None:
    """Cone sizes of consecutive points from ``first`` on."""
    for point, size in enumerate(sizes, first):
        plex.setConeSize(point, size)


def cone_sizes(plex: Any, points: Int) -> Int:
    """Cone sizes (n,) of points."""
    return np.fromiter((plex.getConeSize(p) for p in points.tolist()), dtype=np.int64, count=len(points))


def cones(plex: Any, n_entries: int) -> tuple[Petsc, Petsc]:
    """Cones and their orientations, (n_entries,) each, one point after the other in the order of the chart; in place.

    Args:
        plex: set up.
        n_entries: sum of all cone sizes.

    Raises:
        PETSc.Error: PETSc refuses.
    """
    cone = in_place("DMPlexGetCones", plex, n_entries, PETSc.IntType)
    return cone, in_place("DMPlexGetConeOrientations", plex, n_entries, PETSc.IntType)


def set_cell_types(plex: Any, types: Sequence[tuple[int, int, int]]) -> None:
    """Cell types: (type, first point, end) of consecutive points."""
    plex.createLabel("celltype")
    label = plex.getLabel("celltype")
    for cell_type, first, end in types:
        points = PETSc.IS().createStride(end - first, first, 1, comm=PETSc.COMM_SELF)
        label.setStratumIS(cell_type, points)
        points.destroy()
