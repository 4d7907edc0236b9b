"""Which cells are cut: the smallest set with its share of the error, whatever the numbers of cells; and grading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_mesh import grid, voronoi
from numpy.typing import NDArray

from tmc_vem import Box
from tmc_vem.adapt.changes import next_mesh
from tmc_vem.adapt.marking import LAG, LEAST_LEFT, LEFT, NEW_CELLS, SAFETY, SAME, graded, levels_of
from tmc_vem.mesh import PolygonMesh
from tmc_vem.mesh.geometry import centroids
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.make.refine import refined

Float = NDArray[np.float64]
Int = NDArray[np.int64]


def drawn(n: int, seed: int = 0) -> Float:
    """Contributions over many orders of magnitude."""
    contributions: Float = np.exp(np.random.default_rng(seed).normal(scale=3.0, size=n))
    return contributions


def gain(contributions_c: Float, level_c: Int) -> float:
    """By how much cuts lower the error, as expected."""
    return float((contributions_c * (1.0 - LEFT**level_c)).sum())


def permuted(mesh: PolygonMesh, order_c: Int) -> PolygonMesh:
    """The same cells in another order."""
    cells = [mesh.cell(c).tolist() for c in order_c]
    return PolygonMesh.from_cells(mesh.points_vx, cells, mesh.region_c[order_c], mesh.region_names)


@pytest.mark.parametrize(("error", "goal"), [(0.04, LEAST_LEFT), (0.01, SAFETY * 0.5), (0.006, SAFETY * 5.0 / 6.0)])
@pytest.mark.parametrize("seed", range(3))
def test_the_share_that_is_expected_is_reached_with_as_few_cells_as_possible(
    seed: int, error: float, goal: float
) -> None:
    """With a tolerance of 0.005; any set that is reached by cutting somewhere else has no fewer new cells."""
    mesh, contributions_c = grid(12, 10), drawn(120, seed)
    total, level_c = float(contributions_c.sum()), levels_of(mesh, contributions_c, error, 0.005)
    assert level_c.dtype.kind == "i"
    assert set(level_c) <= {0, 1, 2}
    goal = max(goal, LEAST_LEFT)
    assert gain(contributions_c, level_c) >= (1.0 - goal) * total
    # the cut that is worth least was needed
    new_c = np.concatenate([[0.0], np.cumsum(NEW_CELLS)])
    last = min(
        (contributions_c[c] * (1.0 - LEFT) * LEFT ** (level_c[c] - 1) / NEW_CELLS[level_c[c] - 1], c)
        for c in np.flatnonzero(level_c)
    )[1]
    fewer = level_c.copy()
    fewer[last] -= 1
    assert gain(contributions_c, fewer) < (1.0 - goal) * total
    # others that reach as much, drawn by chance, cost as much or more
    rng, cost = np.random.default_rng(seed), float(new_c[fewer].sum())
    for _ in range(300):
        other = np.minimum(rng.poisson(contributions_c / contributions_c.max() * rng.uniform(0.1, 20.0)), 2)
        assert gain(contributions_c, other) < gain(contributions_c, fewer) or new_c[other].sum() >= cost - 1e-9


def test_the_numbers_of_cells_decide_nothing() -> None:
    mesh, contributions_c = voronoi(40), np.round(drawn(40), 1)
    order_c = np.random.default_rng(1).permutation(40)
    level_c = levels_of(mesh, contributions_c, 0.03, 0.01)
    again = levels_of(permuted(mesh, order_c), contributions_c[order_c], 0.03, 0.01)
    assert 0 < (level_c > 0).sum() < 40
    assert np.array_equal(again, level_c[order_c])
    before_c = np.random.default_rng(2).integers(0, 2, 40)
    media = np.array([False])
    one = graded(mesh, level_c, before_c, media)
    two = graded(permuted(mesh, order_c), level_c[order_c], before_c[order_c], media)
    assert np.array_equal(two, one[order_c])


@pytest.mark.parametrize("noise", [0.0, 0.1 * SAME])
def test_cells_that_contribute_equally_are_cut_together(noise: float) -> None:
    """Mirror images, which noise of a solver tells apart, and cells that all contribute the same."""
    mesh = grid(8, 4)
    x_c = np.array([centroids(mesh.points_vx[mesh.cell(c)][None])[0] for c in range(mesh.n_cells)])
    rng = np.random.default_rng(0)
    contributions_c = np.exp(-10.0 * np.abs(x_c[:, 0] - 0.5) - x_c[:, 1]) * (1.0 + noise * rng.uniform(-1, 1, 32))
    mirror_c = np.array([np.hypot(*(x_c - (1.0 - x, y)).T).argmin() for x, y in x_c])
    for error in (0.006, 0.008, 0.011, 0.02):
        level_c = levels_of(mesh, contributions_c, error, 0.005)
        assert 0 < (level_c > 0).sum() < mesh.n_cells
        assert np.array_equal(level_c, level_c[mirror_c])
    assert (levels_of(mesh, 1.0 + noise * rng.uniform(size=32), 0.02, 0.005) == 1).all()


def test_nothing_contributes() -> None:
    mesh = grid(3, 3)
    assert not levels_of(mesh, np.zeros(9), 0.1, 0.01).any()
    assert not levels_of(mesh, np.zeros(9), np.inf, 0.01).any()
    one = np.zeros(9)
    one[4] = 1.0
    assert levels_of(mesh, one, np.inf, 0.01)[4] == 1
    assert levels_of(mesh, one, np.inf, 0.01).sum() == 1


def sides(mesh: PolygonMesh) -> tuple[Int, Int]:
    left, right = mesh.cells_of_edges
    inner = (left >= 0) & (right >= 0)
    return left[inner], right[inner]


@pytest.mark.parametrize("seed", range(4))
def test_neighbours_differ_by_no_more_than_is_allowed(seed: int) -> None:
    """Beside cells that are cut; a medium may be behind a solid by more."""
    rng = np.random.default_rng(seed)
    mesh = grid(9, 9)
    region_c = (np.arange(81) % 9 > 4).astype(np.int64)
    mesh = replace(mesh, region_c=region_c, region_names=("solid", "medium"))
    media = np.array([False, True])
    wanted_c, before_c = rng.choice([0, 0, 0, 0, 1, 2], 81) * (region_c == 0), np.zeros(81, dtype=np.int64)
    wanted_c[40] = 2  # beside the medium
    level_c = graded(mesh, wanted_c, before_c, media)
    assert (level_c >= wanted_c).all()
    total_c = before_c + level_c
    for a, b in zip(*sides(mesh), strict=True):
        for own, other in ((a, b), (b, a)):
            allowed = LAG if media[region_c[own]] and not media[region_c[other]] else 1
            assert total_c[other] - total_c[own] <= allowed
    assert total_c[[40, 41]].tolist() == [2, 0]  # a medium that is behind
    assert np.array_equal(graded(mesh, level_c, before_c, media), level_c)
    # without a cell that is wanted, none is cut
    assert not graded(mesh, np.zeros_like(wanted_c), rng.integers(0, 5, 81), media).any()


def test_grading_counts_how_often_cells_were_cut_before() -> None:
    mesh = grid(4, 1)
    level_c = graded(mesh, np.array([1, 0, 0, 0]), np.array([2, 1, 1, 0]), np.array([False]))
    assert level_c.tolist() == [1, 1, 0, 0]  # the last two are as they were
    level_c = graded(mesh, np.array([1, 0, 0, 0]), np.array([2, 1, 0, 0]), np.array([False]))
    assert level_c.tolist() == [1, 1, 1, 0]


def cut_once(n: int = 4) -> tuple[PolygonMesh, CellTree]:
    change = refined(grid(n, n), np.arange(n * n))
    return change.mesh, change.tree


def test_the_next_mesh_of_a_box() -> None:
    """A round cuts what matters, twice where it matters a lot, and says how many cells."""
    problem = Box(cells=(20, 5))
    mesh = problem.make_mesh()
    contributions_c = np.zeros(mesh.n_cells)
    contributions_c[[37, 62]] = 1.0, 0.9
    chosen = next_mesh(problem, mesh, CellTree.of(mesh), contributions_c, 0.05, 0.005)
    count_c = np.bincount(chosen.change.parent_c)
    assert chosen.n_refined == (count_c > 1).sum() >= 2
    assert (count_c[[37, 62]] >= 4).all()
    assert chosen.change.mesh.n_cells == count_c.sum() < 150
