"""Forces as data: what they take, what they refuse, and how a problem says which it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from tmc_vem import Box
from tmc_vem.problems.base import forces_of
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import PROPORTIONAL
from tmc_vem.system.control import Control
from tmc_vem.system.forces import (
    CONSTANT,
    BodyForce,
    CavityPressure,
    FollowerPressure,
    Force,
    PointForce,
    Spring,
    Traction,
)

INF = float("inf")


def test_forces_grow_with_the_load_and_springs_do_not() -> None:
    forces = [
        PointForce("push", "tip", (1.0, 2.0)),
        Traction("wind", "side", (0.0, 1.0)),
        BodyForce("weight", ("block",), (0.0, -1.0)),
        CavityPressure("air", "wall", 2.0),
        FollowerPressure("water", "bed", 3.0),
    ]
    assert all(force.amplitude is PROPORTIONAL for force in forces)
    spring = Spring("bedding", "base", (0.0, 4.0))
    assert spring.amplitude is CONSTANT
    assert (CONSTANT.at(Control(0.3)), CONSTANT.per_load(Control(0.3))) == (1.0, 0.0)


def test_numbers_and_names_are_made_pairs_and_tuples() -> None:
    assert PointForce("a", "tip", [1, 2]).force == (1.0, 2.0)  # type: ignore[arg-type]
    assert Spring("a", "tip", [0, 2]).stiffness == (0.0, 2.0)  # type: ignore[arg-type]
    assert Traction("a", "tip", [3, 2]).traction == (3.0, 2.0)  # type: ignore[arg-type]
    assert BodyForce("a", "block", (0.0, 1.0)).regions == ("block",)  # type: ignore[arg-type]
    assert BodyForce("a", ["b", "c"], [0, 1]).regions == ("b", "c")  # type: ignore[arg-type]
    assert BodyForce("a", ["b", "c"], [0, 1]).force == (0.0, 1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        (PointForce, ("tip", (1.0,)), r"push: force has 1 components: give two"),
        (PointForce, ("tip", (1.0, INF)), r"push: force along y = inf must be a finite number"),
        (Traction, ("side", (INF, 0.0)), r"push: traction along x = inf"),
        (BodyForce, (("block",), (INF, 0.0)), r"push: force along x = inf"),
        (BodyForce, ((), (1.0, 0.0)), r"push: a body force needs one region or more"),
        (CavityPressure, ("wall", INF), r"push: pressure = inf"),
        (FollowerPressure, ("wall", INF), r"push: pressure = inf"),
        (Spring, ("tip", (1.0, -2.0)), r"push: stiffness -2 is negative: use zero or more"),
        (Spring, ("tip", (1.0, INF)), r"push: stiffness along y = inf"),
    ],
)
def test_what_is_no_force_is_refused(kind: Any, arguments: tuple[Any, ...], said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        kind("push", *arguments)


@dataclass(frozen=True)
class Pushed(Wrapped):
    def forces(self) -> list[Force]:
        return [PointForce("push", "tip", (1.0, 2.0))]


def test_a_problem_says_which_forces_it_has() -> None:
    assert forces_of(Box()) == ()  # it has no such method
    assert [force.name for force in forces_of(Wrapped(Pushed(Box())))] == ["push"]
