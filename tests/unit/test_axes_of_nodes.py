"""Conditions as degrees of freedom of nodes: axes, corners, rotations; what is held against rigid motions."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from helpers_plate import plate, turned

from tmc_vem.mesh.rigid import free_parts
from tmc_vem.problems import Material
from tmc_vem.problems.base import solid_region
from tmc_vem.problems.conditions import check_conditions, check_shared, held_across, held_components, require_held
from tmc_vem.problems.directions import normals_of, on_mesh
from tmc_vem.report.problem_figure import draw_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.constrained import Constrained, Frames, is_other
from tmc_vem.system.constraints import Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.control import Control
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, PointForce, Spring, Traction
from tmc_vem.system.histories import RAMP, History

C, S = math.cos(math.radians(30.0)), math.sin(math.radians(30.0))
SLOPE = PrescribedAcross("slope", "normal", 0.5, axis=(C, S))
NODES = {"slope": np.array([1, 2]), "wall": np.array([2, 3]), "top": np.array([4])}
POINTS = np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 1.0), (1.0, 3.0)])
FULL = Control(1.0)


def test_a_node_on_a_slope_gets_its_axes() -> None:
    held = Constrained.of([SLOPE], NODES.__getitem__)
    assert (held.dofs.tolist(), held.frames.nodes.tolist()) == ([2, 4], [1, 2])
    assert held.at(Control(0.5)).tolist() == [0.25, 0.25]
    assert held.per_load(FULL).tolist() == [0.5, 0.5]
    u = held.frames.displacements(np.array([(9.0, 9.0), (1.0, 0.0), (0.0, 1.0)]))
    assert u == pytest.approx(np.array([(9.0, 9.0), (C, S), (-S, C)]))
    assert held.frames.forces(u) == pytest.approx(np.array([(9.0, 9.0), (1.0, 0.0), (0.0, 1.0)]))
    assert held.frames.everywhere(3)[[0, 2]] == pytest.approx(np.array([np.eye(2), [[C, -S], [S, C]]]))
    assert held.along_x_and_y().dofs.tolist() == []
    moved = held.renumbered(np.array([0, -1, 5]))
    assert (moved.dofs.tolist(), moved.frames.nodes.tolist(), moved.at(FULL).tolist()) == ([10], [5], [0.5])
    values = np.zeros((3, 2))
    values[1], values[2] = (2.0, 7.0), (3.0, 8.0)  # across and along: what nothing holds is left out
    assert held.forces(values) == pytest.approx(np.array([(2 * C, 2 * S), (3 * C, 3 * S)]))


def test_where_a_slope_meets_a_wall_both_components_are_prescribed() -> None:
    """u . n = 0.5 and u_x = 0.2 at node 2; the wall alone at node 3."""
    held = Constrained.of([SLOPE, Prescribed("wall", 0, 0.2)], NODES.__getitem__)
    assert (held.dofs.tolist(), held.frames.nodes.tolist()) == ([2, 4, 5, 6], [1])
    values = held.at(FULL)
    assert values == pytest.approx([0.5, 0.2, (0.5 - 0.2 * C) / S, 0.2])
    assert held.is_still_d.tolist() == [False] * 4
    still = Constrained.of([replace(SLOPE, value=0.0), Prescribed("wall", 0, 0.2)], NODES.__getitem__)
    assert still.is_still_d.tolist() == [True, False, False, False]
    other = held.along_x_and_y()
    assert (other.dofs.tolist(), other.at(FULL)) == ([4, 5, 6], pytest.approx(values[1:]))


def test_axes_against_x_and_y_need_no_turning() -> None:
    down = PrescribedAcross("top", "normal", 0.5, axis=(0.0, -1.0))
    held = Constrained.of([down], NODES.__getitem__)
    assert (held.dofs.tolist(), held.at(FULL).tolist(), len(held.frames.nodes)) == ([9], [-0.5], 0)
    assert not is_other((0.0, -1.0), (0.0, 1.0))
    assert is_other((1.0, 0.0), (C, S))
    untouched = np.ones((2, 2))
    assert Frames().displacements(untouched) is untouched


def test_a_rotation_and_its_rate() -> None:
    """By the matrix of the angle; the rate is that of a difference quotient, of second order."""
    turn = PrescribedRotation("top", (1.0, 1.0), 60.0, History(((0.0, 0.0), (2.0, 1.0))))
    held = Constrained.of([turn], NODES.__getitem__, POINTS)
    assert held.dofs.tolist() == [8, 9]
    assert held.at(Control(2.0)) == pytest.approx([-2.0 * math.sin(math.pi / 3), 2.0 * (math.cos(math.pi / 3) - 1.0)])
    errors = []
    for h in (1e-2, 1e-3):
        difference = (held.at(Control(1.0 + h)) - held.at(Control(1.0 - h))) / (2 * h)
        errors.append(np.abs(difference - held.per_load(FULL)).max())
    assert errors[1] < 0.011 * errors[0]
    assert turn.at(FULL) == 30.0


# -- directions on a mesh ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_normals_point_out_and_tangents_have_the_body_on_the_left(degrees: float) -> None:
    mesh = plate(degrees)
    for side, normal in (("bottom", (0.0, -1.0)), ("right", (1.0, 0.0)), ("top", (0.0, 1.0)), ("left", (-1.0, 0.0))):
        conditions = [PrescribedAcross(side, direction, 1.0) for direction in ("normal", "tangential")]
        (out,), (along,) = (each.axes for each in on_mesh(conditions, mesh, []))
        assert out == pytest.approx(turned(degrees, normal)[0])
        assert along == pytest.approx((-out[1], out[0]))
        assert (0.0 in out) == (degrees == 0.0)
        assert normals_of(mesh, mesh.named_edges[side], [])[0] == pytest.approx(np.array(out))
        against = mesh.named_edges[side][:, ::-1]
        assert normals_of(mesh, against, [])[0] == pytest.approx(np.array(out))


def test_of_solid_and_medium_the_solid_is_the_body() -> None:
    from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals

    line = np.linspace(0.0, 1.0, 3)
    halves = [Rectangle("medium", 0.0, 0.5, 0.0, 1.0), Rectangle("solid", 0.5, 1.0, 0.0, 1.0)]
    mesh = structured_quadrilaterals(line, line, halves)
    left, right = mesh.cells_of_edges
    between = (left >= 0) & (right >= 0) & (mesh.region_c[left] != mesh.region_c[right])
    mesh = replace(mesh, named_edges={"middle": mesh.edges.vertices_ev[between]})
    (held,) = on_mesh([PrescribedAcross("middle", "normal", 1.0)], mesh, ["medium"])
    assert held.axes == ((-1.0, 0.0),)


def test_a_direction_is_not_known_without_a_mesh() -> None:
    with pytest.raises(InputError, match="the direction of the edges 'a' is not known before there is a mesh"):
        _ = PrescribedAcross("a", "normal", 1.0).axes
    with pytest.raises(InputError, match="unknown direction 'norml'"):
        PrescribedAcross("a", "norml", 1.0)


# -- what is checked -------------------------------------------------------------------------------------------------


def test_rollers_on_a_slope_hold_like_others() -> None:
    mesh, every = plate(30.0), np.ones(8, dtype=bool)
    found = {}
    for sides in (("bottom",), ("bottom", "left"), ()):
        held = on_mesh([PrescribedAcross(side, "normal") for side in sides], mesh, [])
        across = held_across(mesh, held)
        assert not held_components(mesh, held).any()
        found[sides] = [part.motion for part in free_parts(mesh, every, held_components(mesh, held), *across)]
    assert found[()] == ["moving in x and y and turning"]
    assert found["bottom", "left"] == []
    assert found["bottom",] == ["moving along (0.866, 0.5)"]


def test_what_a_slope_alone_does_not_hold_is_said() -> None:
    mesh, regions = plate(30.0), {"block": solid_region(Material(20.0, 10.0))}
    with pytest.raises(InputError) as caught:
        require_held(mesh, regions, on_mesh([PrescribedAcross("bottom", "normal")], mesh, []))
    assert str(caught.value).endswith(
        "against moving along (0.866, 0.5): add a support that holds it in that direction"
    )


def test_conditions_that_meet_must_agree_at_all_times() -> None:
    mesh = plate(30.0)
    roller = PrescribedAcross("bottom", "normal")
    (axis,) = on_mesh([roller], mesh, [])[0].axes
    fixed = [Prescribed("a", 0, 0.0), Prescribed("a", 1, 0.0)]
    check_shared(mesh, on_mesh([*fixed, roller], mesh, []))  # it says the same a third time
    for n, sign in ((0, 1.0), (1, 1.0)):
        moved = [replace(each, value=0.1 * sign if i == n else 0.0) for i, each in enumerate(fixed)]
        with pytest.raises(InputError, match="meet at"):
            check_shared(mesh, on_mesh([*moved, roller], mesh, []))
    along = [replace(each, value=0.1 * value) for each, value in zip(fixed, (-axis[1], axis[0]), strict=True)]
    check_shared(mesh, on_mesh([*along, roller], mesh, []))  # along the slope nothing is against it
    late = History(((0.0, 0.0), (1.0, 1.0), (2.0, 0.0)))
    ramps = [Prescribed("left", 0, 0.1, RAMP), Prescribed("a", 0, 0.1, late)]
    check_shared(plate(), ramps)
    with pytest.raises(InputError, match="meet at"):
        check_shared(plate(), ramps, None, (1.0, 2.0))


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ([Prescribed("t", 0, 0.0), PrescribedRotation("t", (0.0, 0.0), 9.0, name="turn")],
         "'t' has both a support ux = 0 and the load rotation = 9 degrees about (0, 0): leave out one of them"),
        ([PrescribedAcross("t", "normal", 1.0, name="a"), PrescribedRotation("t", (0.0, 0.0), 9.0, name="b")],
         "load 'b' with rotation = 9 degrees about (0, 0) prescribes normal at 't', as load 'a' with normal = 1 does"),
        ([PrescribedAcross("t", "normal", 0.0), PrescribedAcross("t", "normal", 0.5)],
         "'t' has two supports, normal = 0 and normal = 0.5: leave out one of them"),
        ([Prescribed("t", 0, 0.0)], "nothing moves: all loads and supports are 0"),
    ],
)  # fmt: skip
def test_conditions_that_do_not_go_together(conditions: Any, message: str) -> None:
    with pytest.raises(InputError) as caught:
        check_conditions(conditions)
    assert message in str(caught.value)
    if "nothing" in message:
        check_conditions(conditions, None, [PointForce("f", "t", (1.0, 0.0))])


def test_every_kind_of_load_is_drawn() -> None:
    """An arrow for each place of each load, and marks and words for what holds."""
    mesh = plate(30.0)
    conditions = [
        PrescribedAcross("bottom", "normal"), PrescribedAcross("left", "normal", -0.1),
        PrescribedRotation("c", (0.0, 0.0), 9.0), Prescribed("b", 0, 0.2),
    ]  # fmt: skip
    forces = [
        PointForce("push", "d", (0.0, -1.0)), Traction("pull", "right", (1.0, 0.0)), BodyForce("weight", ("block",),
        (0.0, -1.0)), FollowerPressure("press", "top", 2.0), CavityPressure("fill", "top", -2.0),
        Spring("hold", "b", (1.0, 1.0)),
    ]  # fmt: skip
    (axes,) = draw_problem(mesh, [], conditions, conditions[1], {}, forces).axes
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "fixed across or along" in words
    assert "spring" in words
    assert "$u_n$ = -0.1, rotation by 9°, $u_x$ = 0.2, push, pull, weight, press, fill" in words
    arrows = [entry for entry in axes.texts if entry.arrow_patch is not None]
    assert len(arrows) == 7 + 1 + 1 + 1 + 7 + 1 + 4 + 4
    heads = np.array([entry.xy for entry in arrows])
    tails = np.array([entry.xyann for entry in arrows])
    across = (heads - tails) / np.hypot(*(heads - tails).T)[:, None]
    assert across[0] == pytest.approx(np.array([C, S])), "-0.1 out of the left side: along its inner normal"
    assert across[7] == pytest.approx(np.array([-heads[7][1], heads[7][0]]) / np.hypot(*heads[7]))
    assert across[-8] == pytest.approx(np.array([S, -C])), "pressure against the body"
    assert across[-1] == pytest.approx(np.array([-S, C])), "suction"
