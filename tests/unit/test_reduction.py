"""What ranks know of a state put together: nothing is lost, above all no value that is not a number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tmc_vem.support.errors import InputError
from tmc_vem.system.constrained import Constrained
from tmc_vem.system.constraints import Prescribed
from tmc_vem.system.control import Control
from tmc_vem.system.discretisation import Evaluation
from tmc_vem.system.reduction import Shares, at_named_points, step_limit

REGIONS = ("solid", "medium")
NAN = math.nan


class Ranks:
    """A communicator as one rank sees it, the others having handed over theirs."""

    def __init__(self, others: list[Any]) -> None:
        self.others = others
        self.mine: Any = None

    def allgather(self, thing: Any) -> list[Any]:
        self.mine = thing
        return [*self.others, thing]

    def allreduce(self, thing: Any, op: Any = None) -> Any:
        return op(*self.others, thing) if self.others else thing


def share(*cells: tuple[str, list[float], int]) -> Shares:
    """A rank with groups of cells: region, smallest J of each (1 is its energy), number of the first."""
    shares = Shares(REGIONS)
    for region, min_j, first in cells:
        shares.add_cells(region, np.ones(len(min_j)), np.array(min_j), first + np.arange(len(min_j)))
    return shares


def together(*ranks: Shares, work: float = 0.0) -> Evaluation:
    handed_over: list[Any] = []
    for rank in ranks[:-1]:
        comm = Ranks([])
        rank.together(comm, work)  # type: ignore[arg-type]
        handed_over.append(comm.mine)
    return ranks[-1].together(Ranks(handed_over), work)  # type: ignore[arg-type]


def test_energies_add_up_and_the_smallest_j_is_found_on_any_rank() -> None:
    found = together(
        share(("solid", [0.9, 0.4], 10), ("medium", [0.3], 20)),
        share(("solid", [0.5], 30), ("medium", [0.2, 0.25], 40), ("medium", [0.6], 50)),
        work=0.25,
    )
    assert {name: (of.energy, of.min_j) for name, of in found.regions.items()} == {
        "solid": (3, 0.4),
        "medium": (4, 0.2),
    }
    assert found.energy == 7.0 - 2 * 0.25
    assert found.worst == "J = 0.2 in cell 40 of region 'medium'"
    assert found.admissible


def test_of_equal_values_the_first_counts() -> None:
    found = together(share(("solid", [0.5], 7), ("medium", [0.5], 8)), share(("solid", [0.5], 3)))
    assert found.worst == "J = 0.5 in cell 7 of region 'solid'"


def test_ranks_without_cells_of_a_region_say_nothing_about_it() -> None:
    found = together(share(("solid", [], 0)), share(("medium", [0.7], 4)))
    assert found.regions["solid"].min_j == math.inf
    assert found.worst == "J = 0.7 in cell 4 of region 'medium'"


@pytest.mark.parametrize(
    "ranks",
    [
        (share(("solid", [NAN, 0.5], 7)),),
        (share(("solid", [0.5], 0), ("solid", [NAN], 7)),),
        (share(("solid", [NAN], 7), ("solid", [0.5], 0)),),  # a group after that with the NaN
        (share(("solid", [NAN], 7), ("medium", [0.1], 0)),),  # a region after it
        (share(("solid", [NAN], 7)), share(("solid", [-2.0], 0))),  # a rank after it
        (share(("solid", [-2.0], 0)), share(("solid", [NAN], 7))),
    ],
)
def test_what_is_no_number_is_never_lost(ranks: tuple[Shares, ...]) -> None:
    found = together(*ranks)
    assert not found.admissible
    assert math.isnan(found.regions["solid"].min_j)
    assert found.worst == "J = nan in cell 7 of region 'solid'"


def test_the_step_limit_is_the_smallest_of_all() -> None:
    assert step_limit(Ranks([]), [3.0, 0.5]) == 0.5  # type: ignore[arg-type]
    assert step_limit(Ranks([]), []) == math.inf  # type: ignore[arg-type]


def test_named_points_are_found_on_the_rank_that_has_them() -> None:
    comm: Any = Ranks([{"a": np.array([1.0, 2.0])}])
    found = at_named_points(comm, ("b", "a"), {"b": np.array([3.0, 4.0])})
    assert found.tolist() == [[3.0, 4.0], [1.0, 2.0]]
    with pytest.raises(InputError, match="no named point 'c'"):
        at_named_points(comm, ("c",), {})


class Square:
    """Grows with the square of the load factor."""

    def at(self, position: Control) -> float:
        return position.load**2

    def per_load(self, position: Control) -> float:
        return 2.0 * position.load


def nodes(where: str) -> Any:
    return np.array({"left": [4, 1], "top": [1, 2], "nowhere": []}[where], dtype=np.int64)


def test_conditions_become_degrees_of_freedom_in_order_and_the_last_one_holds() -> None:
    held = Constrained.of([Prescribed("left", 0, 0.5), Prescribed("top", 1, -2.0), Prescribed("top", 0, 3.0)], nodes)
    assert held.dofs.tolist() == [2, 3, 4, 5, 8]  # node 1: x of the last, y; node 2: x, y; node 4: x
    assert held.at(Control(1.0)).tolist() == [3.0, -2.0, 3.0, -2.0, 0.5]
    assert held.at(Control(0.5)).tolist() == [1.5, -1.0, 1.5, -1.0, 0.25]
    assert held.per_load(Control(0.3)).tolist() == held.at(Control(1.0)).tolist()


def test_a_condition_follows_its_amplitude_along_the_path() -> None:
    held = Constrained.of([Prescribed("left", 0, 0.5), Prescribed("top", 1, -2.0, Square())], nodes)
    assert held.at(Control(0.5)).tolist() == [0.25, -0.5, -0.5, 0.25]
    step = 1e-6
    slope = (held.at(Control(0.5 + step)) - held.at(Control(0.5 - step))) / (2.0 * step)
    assert held.per_load(Control(0.5)) == pytest.approx(slope, rel=1e-8)


def test_no_conditions_are_no_degrees_of_freedom() -> None:
    for held in (Constrained.of([], nodes), Constrained.of([Prescribed("nowhere", 0, 1.0)], nodes)):
        assert held.dofs.shape == held.at(Control(1.0)).shape == (0,)


def test_nodes_with_other_numbers_keep_what_is_prescribed() -> None:
    held = Constrained.of([Prescribed("left", 0, 0.5), Prescribed("top", 1, -2.0)], nodes)
    numbers = np.array([-1, 7, -1, -1, 0])
    mine = held.renumbered(numbers)
    assert mine.dofs.tolist() == [14, 15, 0]
    assert mine.at(Control(1.0)).tolist() == [0.5, -2.0, 0.5]
