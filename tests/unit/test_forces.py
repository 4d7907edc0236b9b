"""Forces as data: what they take, what they refuse, and how a problem says which it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from helpers_forces import SOLID, Parts, plate

from tmc_vem import Box, run
from tmc_vem.problems.base import forces_of
from tmc_vem.problems.conditions import check_conditions, check_forces, held_components, require_held
from tmc_vem.problems.wrapped import Wrapped
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import PROPORTIONAL, Prescribed
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


# -- what is checked on the mesh ---------------------------------------------------------------------------------------


NOTHING: dict[str, Force] = {
    "point force": PointForce("f", "tip", (0.0, 0.0)),
    "traction": Traction("f", "top", (0.0, 0.0)),
    "body force": BodyForce("f", ("block",), (0.0, 0.0)),
    "cavity": CavityPressure("f", "top", 0.0),
    "follower": FollowerPressure("f", "top", 0.0),
    "spring": Spring("f", "top", (1.0, 1.0)),
}
SOMETHING = (
    PointForce("f", "tip", (0.0, 1.0)),
    Traction("f", "top", (-1.0, 0.0)),
    BodyForce("f", ("block",), (0.0, -1.0)),
    CavityPressure("f", "top", -1.0),
    FollowerPressure("f", "top", 1.0),
)


def test_a_problem_in_which_only_a_force_acts_moves() -> None:
    held = Prescribed("left", 0)
    for nothing in NOTHING.values():
        with pytest.raises(InputError, match="nothing moves"):
            check_conditions([held], held, [nothing])
    for something in SOMETHING:
        check_conditions([held], held, [NOTHING["spring"], something])
    with pytest.raises(InputError, match="nothing moves"):
        check_conditions([held], held)


@pytest.mark.parametrize(
    ("force", "said"),
    [
        (PointForce("f", "nowhere", (0.0, 1.0)), "f: the mesh has neither a point nor edges named 'nowhere'"),
        (Spring("f", "nowhere", (0.0, 1.0)), "f: the mesh has neither a point nor edges named 'nowhere'"),
        (BodyForce("f", ("block", "bloc"), (0.0, 1.0)), r"f: the mesh has no region 'bloc' \(it has: block\)"),
        (Traction("f", "tip", (0.0, 1.0)), r"f: the mesh has no edges named 'tip' \(there are: left, .*corner\)"),
        (CavityPressure("f", "tip", 1.0), "f: the mesh has no edges named 'tip'"),
        (FollowerPressure("f", "tip", 1.0), "f: the mesh has no edges named 'tip'"),
    ],
)
def test_what_forces_act_on_is_on_the_mesh(force: Force, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        check_forces(plate(), [force])
    check_forces(plate(), list({force.name: force for force in SOMETHING}.values()))


def test_names_of_forces_are_given_once() -> None:
    with pytest.raises(InputError, match="two forces are called 'f'"):
        check_forces(plate(), [NOTHING["spring"], PointForce("g", "tip", (0.0, 1.0)), SOMETHING[0]])


def test_springs_hold_the_components_that_they_have_a_stiffness_in() -> None:
    mesh = plate(1, 1)
    held = held_components(mesh, [Prescribed("left", 0)], [Spring("f", "top", (0.0, 2.0)), SOMETHING[0]])
    by_place = dict(zip(map(tuple, mesh.points_vx.tolist()), held.tolist(), strict=True))
    assert by_place == {
        (0.0, 0.0): [True, False], (1.0, 0.0): [False, False], (0.0, 1.0): [True, True], (1.0, 1.0): [False, True],
    }  # fmt: skip
    regions = {"block": SOLID}
    require_held(mesh, regions, [], [Spring("f", "top", (1.0, 2.0))])
    with pytest.raises(InputError, match="nothing holds part 1"):
        require_held(mesh, regions, [], [Spring("f", "top", (0.0, 2.0))])


def test_a_run_is_told_what_is_wrong_with_its_forces() -> None:
    held = (Prescribed("left", 0), Prescribed("left", 1))
    with pytest.raises(InputError, match=r"^f: the mesh has no edges named 'tip'"):
        run(Parts(plate, held, [Traction("f", "tip", (0.0, 1.0))]))
    with pytest.raises(InputError, match="nothing moves"):
        run(Parts(plate, held, [NOTHING["traction"]]))
