"""Whole boxes are the same wherever they lie, however they are turned, reflected, scaled and numbered."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from helpers_motion import Motion, Moved

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.make.refine import refine
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.vem.spaces.element_settings import ElementSettings

MOTIONS = {
    "turned by 37 degrees": Motion(angle=37.0),
    "turned by 90 degrees": Motion(angle=90.0),
    "reflected": Motion(reflect=True),
    "a thousand times smaller": Motion(scale=1e-3),
    "a thousand times larger": Motion(scale=1e3),
    "shifted": Motion(shift=(10.0, -7.0)),
    "renumbered": Motion(seed=5),
    "all at once": Motion(211.0, True, 30.0, (-10.0, 10.0), 8),
}


@dataclass(frozen=True)
class Refined(Wrapped):
    """A problem with every fourth of its cells cut from the centroid to the middles of sides."""

    def make_mesh(self) -> PolygonMesh:
        """The refined mesh; neighbours of refined cells have hanging nodes."""
        mesh = self.problem.make_mesh()
        return refine(mesh, np.arange(0, mesh.n_cells, 4), max_hanging=2)


def boxes(cells: tuple[int, int], uy: float) -> dict[str, Box | Refined]:
    """The box on each kind of mesh."""
    chosen = {"cells": cells, "uy": uy, "medium": Medium(gamma=1e-5)}
    voronoi = Box(**chosen, cell_kind="voronoi")
    return {
        "voronoi": voronoi,
        "hanging nodes": Box(**chosen, medium_refinement=2),
        "voronoi with hanging nodes": Refined(voronoi),
    }


@cache
def gap(mesh: str, cells: tuple[int, int], uy: float, order: int, motion: Motion) -> tuple[float, int]:
    """Gap at full load, in the units of the box that is not moved, and iterations."""
    result = run(Moved(boxes(cells, uy)[mesh], motion), None, RunOptions(element=ElementSettings(order=order)))
    assert result.complete
    return result.gap / motion.scale, result.newton_iterations


def check(mesh: str, cells: tuple[int, int], uy: float, order: int, motion: str) -> None:
    """The moved box is the same to rounding, and so is the way to it but for an iteration that rounding decides on."""
    found, iterations = gap(mesh, cells, uy, order, MOTIONS[motion])
    expected, expected_iterations = gap(mesh, cells, uy, order, Motion())
    assert found == pytest.approx(expected, rel=1e-10)
    assert abs(iterations - expected_iterations) <= 1


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("mesh", ["voronoi", "hanging nodes"])
def test_the_gap_of_a_coarse_box_does_not_depend_on_motions(mesh: str, motion: str) -> None:
    check(mesh, (20, 5), -0.3, 2, motion)


def test_nor_does_that_of_a_box_with_hanging_nodes_on_voronoi_cells() -> None:
    check("voronoi with hanging nodes", (20, 5), -0.1, 2, "all at once")


@pytest.mark.parametrize("mesh", ["voronoi", "hanging nodes"])
def test_nor_does_that_of_a_cubic_one(mesh: str) -> None:
    check(mesh, (20, 5), -0.3, 3, "all at once")


@pytest.mark.slow
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("mesh", boxes((40, 10), -1.0))
def test_the_gap_of_the_papers_box_does_not_depend_on_motions(mesh: str, motion: str) -> None:
    check(mesh, (40, 10), -1.0, 2, motion)
