"""Integrals along sides, sides of all ranks together, and on which side of edges a pressure is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from helpers_ranks import Ranks
from mpi4py import MPI

from tmc_vem.support.errors import InputError
from tmc_vem.system.enclosed import against_cells, around_cavity
from tmc_vem.system.pressure import swept
from tmc_vem.system.sides import AllSides, Sides
from tmc_vem.system.trace import Trace
from tmc_vem.system.turned import Turned
from tmc_vem.vem.spaces.quadrature import gauss, gauss_lobatto


@pytest.mark.parametrize("k", [1, 2, 3])
def test_integrals_along_a_side(k: int) -> None:
    """Against a quadrature of the polynomials and their slopes."""
    nodes = gauss_lobatto(k + 1)[0]
    trace = Trace.of(nodes)
    s, w = gauss(5)
    N = np.array([np.poly1d(np.polyfit(nodes, row, k)) for row in np.eye(k + 1)])
    values = np.array([np.polyval(row, s) for row in N])
    slopes = np.array([np.polyval(np.polyder(row), s) for row in N])
    assert trace.mean_a == pytest.approx(values @ w, abs=1e-13)
    assert trace.mass_ab == pytest.approx((values * w) @ values.T, abs=1e-13)
    assert trace.turn_ab == pytest.approx((values * w) @ slopes.T - (slopes * w) @ values.T, abs=1e-13)


Corner = tuple[float, float]


def sides_of(loops: Sequence[Sequence[Corner]], regions: Sequence[str] = ("s",) * 9, straight: bool = True) -> Sides:
    """Sides of cells that go along each loop, one cell each; the same place is the same vertex."""
    places: dict[Corner, int] = {}
    points, ends, cells = [], [], []
    for cell, loop in enumerate(loops):
        closed = [*loop, loop[0]] if straight else list(loop)
        for start, end in pairwise(closed):
            ends.append([places.setdefault(corner, len(places)) for corner in (start, end)])
            points.append([start, (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])), end])
            cells.append(cell)
    numbers = np.array(ends)
    nodes = np.column_stack([numbers[:, 0], 100 + np.arange(len(ends)), numbers[:, 1]])
    return Sides(nodes, np.array(points, dtype=float), numbers, np.array(cells), np.array(regions)[cells])


def all_of(*arguments: Any, **named: Any) -> AllSides:
    return AllSides.gather(MPI.COMM_SELF, sides_of(*arguments, **named))


def square(x: float, y: float, size: float) -> list[Corner]:
    """Counter-clockwise."""
    return [(x, y), (x + size, y), (x + size, y + size), (x, y + size)]


def test_sides_have_lengths_and_nodes_between_their_ends() -> None:
    sides = sides_of([[(0.0, 0.0), (3.0, 4.0), (0.0, 4.0)]])
    assert len(sides) == 3
    assert sides.length_s.tolist() == [5.0, 3.0, 4.0]
    assert sides.trace.mean_a == pytest.approx([1 / 6, 2 / 3, 1 / 6])
    few = sides.take(np.array([False, True, True]))
    assert few.length_s.tolist() == [3.0, 4.0]
    assert (few.nodes_sa[0].tolist(), few.cell_s.tolist(), few.region_s.tolist()) == ([1, 101, 2], [0, 0], ["s", "s"])
    none = sides.take(np.zeros(3, dtype=bool))
    assert (len(none), none.trace.mean_a.shape, none.length_s.shape) == (0, (3,), (0,))
    assert few.dofs_sm[0].tolist() == [2, 3, 202, 203, 4, 5]
    assert none.dofs_sm.shape == (0, 6)
    terms, area = swept(none, np.ones(0, dtype=np.int64), np.zeros(2))
    assert (terms.along(Turned()).linear_sm.shape, area) == ((0, 6), 0.0)


def test_the_sides_of_two_ranks_know_each_other() -> None:
    """The upper square's lower side is the lower square's upper one; each rank has one square."""
    lower, upper = sides_of([square(0, 0, 1)]), sides_of([square(0, 1, 1)[::1]])
    shifted = Sides(
        upper.nodes_sa + 50, upper.points_sax, np.array([[3, 2], [2, 7], [7, 8], [8, 3]]), upper.cell_s + 1,
        np.array(["m"] * 4),
    )  # fmt: skip
    given = [
        (s.ends_se, s.nodes_sa[:, [0, 2]], s.points_sax[:, [0, 2]], s.cell_s, s.region_s) for s in (lower, shifted)
    ]
    for rank, sides, mine in ((0, lower, slice(0, 4)), (1, shifted, slice(4, 8))):
        every = AllSides.gather(Ranks(rank, other=given[1 - rank]), sides)
        assert every.mine == mine
        assert every.other_s.tolist() == [-1, -1, 4, -1, 2, -1, -1, -1]
        assert every.first_s.tolist() == [True] * 4 + [False] + [True] * 3
        assert every.region_s.tolist() == ["s"] * 4 + ["m"] * 4
        assert every.nodes_se[4].tolist() == [50, 51]
        assert every.corners_sex[4].tolist() == [[0.0, 1.0], [1.0, 1.0]]
        assert every.origin.tolist() == [0.0, 0.0]


def test_a_hole_is_a_cavity() -> None:
    """A body's sides go round its hole clockwise; one whose middle is level with corners as well."""
    diamond = [(1.0, 0.0), (2.0, 1.0), (1.0, 2.0), (0.0, 1.0)]
    step = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.0, 1.0)]
    for loop in (square(0, 0, 1), diamond, step, [(x, -y) for x, y in step[::-1]]):
        assert around_cavity("air", "wall", all_of([loop[::-1]])).tolist() == [-1] * len(loop)


@pytest.mark.parametrize("scale", [0.1, 7.0])
def test_cavities_may_have_any_shape(scale: float) -> None:
    """Stars of random radii, whose sides hide each other from many directions; the middle of the last one is a cell."""
    rng = np.random.default_rng(5)
    angles, radii = 2.0 * np.pi * np.arange(60) / 60, rng.uniform(0.2, 1.0, 60)
    star = [(scale * r * np.cos(a) + 3.0, scale * r * np.sin(a) - 2.0) for r, a in zip(radii, angles, strict=True)]
    assert around_cavity("air", "wall", all_of([star[::-1]])).tolist() == [-1] * 60
    middle = [(3.0 + 0.1 * (x - 3.0), -2.0 + 0.1 * (y + 2.0)) for x, y in star]
    assert around_cavity("air", "wall", all_of([star[::-1], middle])).tolist() == [-1] * 120


def test_an_island_is_no_part_of_the_cavity() -> None:
    """The hole of a body with another body inside, which goes counter-clockwise round itself."""
    both = all_of([square(0, 0, 3)[::-1], square(1, 1, 1)])
    assert around_cavity("air", "wall", both).tolist() == [-1] * 8


def test_a_cavity_may_be_full_of_medium() -> None:
    """Each edge has a cell inside and one outside and counts once, with the side of the smaller number."""
    inside, outside = square(0, 0, 1), square(0, 0, 1)[::-1]
    assert around_cavity("air", "wall", all_of([inside, outside])).tolist() == [1] * 4 + [0] * 4
    assert around_cavity("air", "wall", all_of([outside, inside])).tolist() == [-1] * 4 + [0] * 4
    sides = sides_of([outside, inside])
    later = AllSides.gather(MPI.COMM_SELF, replace(sides, cell_s=1 - sides.cell_s))
    assert around_cavity("air", "wall", later).tolist() == [0] * 4 + [1] * 4


def test_edges_that_are_no_cavity_are_refused() -> None:
    with pytest.raises(InputError, match=r"^air: the edges 'wall' have the body inside, at \(0.5, 0\)"):
        around_cavity("air", "wall", all_of([square(0, 0, 1)]))
    with pytest.raises(InputError, match=r"^air: the edges 'wall' have the body inside, at \(1.5, 0\)"):
        around_cavity("air", "wall", all_of([square(0, 0, 3), square(1, 1, 1)[::-1]]))
    open_ = all_of([[(1.0, 0.0), (0.0, 0.0), (0.0, 2.0)]], straight=False)
    with pytest.raises(InputError, match=r"do not close, they end at \(1, 0\) and \(0, 2\): name the whole boundary"):
        around_cavity("air", "wall", open_)


def test_pressure_on_edges_is_against_the_solid() -> None:
    body, around = square(0, 0, 1), square(0, 0, 1)[::-1]
    assert against_cells("air", "wall", all_of([body]), ["m"]).tolist() == [True] * 4
    found = against_cells("air", "wall", all_of([body, around], ("m", "s")), ["m"])
    assert found.tolist() == [False] * 4 + [True] * 4
    for regions, said in ((("s", "t"), "solid"), (("m", "m"), "medium")):
        with pytest.raises(InputError, match=rf"^air: of the edges 'wall' the one at \(0.5, 0\) has {said} on both"):
            against_cells("air", "wall", all_of([body, around], regions), ["m"])
