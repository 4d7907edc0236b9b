"""Every tolerance by a case on each side of it: what is barely inside it passes, what is barely outside does not.

The numbers are written out here on purpose: a tolerance that is changed should be noticed.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from helpers_pair import Pair
from numpy.typing import NDArray
from test_plausibility import findings, open_gap, record
from test_report_contact import LOWER, UPPER, lowered, square, state

from tmc_vem.mesh import PolygonMesh, Rectangle, structured_quadrilaterals
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.faults import tolerance_of
from tmc_vem.mesh.make.refine import refine
from tmc_vem.mesh.make.weld import weld
from tmc_vem.results.contact.contact import check_contact
from tmc_vem.simulation.checkpoint import Checkpoint
from tmc_vem.solve.newton import NewtonOptions, NewtonSolver
from tmc_vem.support.errors import InputError
from tmc_vem.system.discretisation import Evaluation, RegionValues

Float = NDArray[np.float64]
INSIDE, OUTSIDE = 0.9, 1.1  # of a tolerance


# -- Newton's method -------------------------------------------------------------------------------------------------


class Rounding(Pair):
    """One free and one held degree of freedom, whose residual does as a list says: linear, but for what is left over.

    Args:
        residuals: of the free one, one evaluation after another; the last stays.
        stiffness: of the free one, so that a correction is residual over stiffness.
        reaction: of the held one.
    """

    depth = 0.0

    def __init__(self, residuals: Sequence[float], stiffness: float, reaction: float) -> None:
        self._values = itertools.chain(residuals, itertools.repeat(residuals[-1]))
        self._stiffness, self._reaction = stiffness, reaction

    def energy(self, u: Any) -> Evaluation:
        return Evaluation(1.0, {"all": RegionValues(1.0, 1.0)}, "J = 1")

    def residual(self, u: Any, out: Any) -> Evaluation:
        out.getArray()[:] = [next(self._values), self._reaction]
        return self.energy(u)

    def jacobian(self, u: Any, out: Any) -> None:
        for i, value in enumerate((self._stiffness, 1.0)):
            out.setValue(i, i, value)
        out.assemble()

    def tangent_action(self, du: Any, out: Any) -> None:
        out.getArray()[:] = du.getArray(readonly=True) * [self._stiffness, 1.0]

    def reaction(self, residual: Any, where: str, component: int) -> float:
        return self._reaction


def iterations(residuals: Sequence[float], stiffness: float = 1e5, reaction: float = 1.0) -> int | None:
    """How many it takes to converge, or None."""
    system = Rounding(residuals, stiffness, reaction)
    result = NewtonSolver(system).solve(system.create_vector())
    assert result.converged or "no convergence" in result.reason
    return len(result.iterations) if result.converged else None


def test_the_tolerances_of_newton_s_method_are_those_of_the_documentation() -> None:
    options = NewtonOptions()
    assert (options.residual, options.correction, options.stalled_residual) == (1e-8, 1e-7, 1e-6)
    assert (options.reuse, options.max_iterations) == (1e-5, 20)


def test_a_residual_is_small_relative_to_the_reactions() -> None:
    assert iterations([1e-3, INSIDE * 1e-8]) == 1
    assert iterations([1e-3, OUTSIDE * 1e-8, 1e-12]) == 2
    assert iterations([7e-3, 7.0 * INSIDE * 1e-8], reaction=7.0) == 1
    assert iterations([7e-3, 7.0 * OUTSIDE * 1e-8, 1e-12], reaction=7.0) == 2


def test_a_correction_is_small_relative_to_the_domain() -> None:
    assert iterations([1e-3, 1e-12], stiffness=1e-3 / (INSIDE * 1e-7)) == 1
    assert iterations([1e-3, 1e-12], stiffness=1e-3 / (OUTSIDE * 1e-7)) == 2


def test_a_residual_that_stalls_is_rounding_up_to_a_limit() -> None:
    assert iterations([1e-3, INSIDE * 1e-6]) == 2
    assert iterations([1e-3, OUTSIDE * 1e-6]) is None
    # while it falls to less than 0.3 of the one before, there is more to gain
    assert iterations([9e-7, 0.29 * 9e-7, 0.29**2 * 9e-7, 1e-12]) == 3
    assert iterations([9e-7, 0.31 * 9e-7]) == 1


def test_without_reactions_the_residual_is_compared_with_the_stiffness() -> None:
    """1e-6 of the largest stiffness times the size stands for the reactions, 1e-6 of that is rounding if it stalls."""
    assert iterations([INSIDE * 1e-12], stiffness=1.0, reaction=0.0) is not None
    assert iterations([OUTSIDE * 1e-12], stiffness=1.0, reaction=0.0) is None
    assert iterations([INSIDE * 1e-9], stiffness=1e3, reaction=0.0) is not None
    assert iterations([OUTSIDE * 1e-9], stiffness=1e3, reaction=0.0) is None


# -- meshes ----------------------------------------------------------------------------------------------------------


def grid(nx: int, ny: int, x: tuple[float, float], scale: float = 1.0) -> PolygonMesh:
    lines = [np.linspace(*x, nx + 1) * scale, np.linspace(0.0, 1.0, ny + 1) * scale]
    return structured_quadrilaterals(*lines, [Rectangle("a", x[0] * scale, x[1] * scale, 0.0, scale)])


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("distance", "is_one"), [(0.0, True), (INSIDE, True), (OUTSIDE, False), (1e3, False)])
def test_vertices_are_welded_up_to_a_billionth_of_the_mesh(distance: float, is_one: bool, scale: float) -> None:
    """The meshes together are 2 wide."""
    shift = 2e-9 * distance
    mesh = weld([grid(1, 1, (0.0, 1.0), scale), grid(1, 1, (1.0 + shift, 2.0), scale)])
    assert mesh.n_vertices == (6 if is_one else 8)
    assert mesh.edges.n_cells_e.tolist().count(2) == is_one


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize(("distance", "is_one"), [(INSIDE, True), (OUTSIDE, False)])
def test_vertices_are_duplicates_up_to_a_billionth_of_the_mesh(distance: float, is_one: bool, scale: float) -> None:
    """Two squares, together 2 wide; in whatever unit, as rounding goes with the coordinates."""
    x = 1.0 + 2e-9 * distance
    points = scale * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [x, 0], [2, 0], [2, 1], [x, 1]])
    mesh = PolygonMesh(points, np.array([0, 4, 8]), np.arange(8), [0, 0], ("a",), validate=False)
    assert [fault.kind for fault in find_faults(mesh)].count("duplicate vertex") == (2 if is_one else 0)


@pytest.mark.parametrize("place", [1e3, 1e9])
def test_far_from_the_origin_vertices_are_duplicates_up_to_rounding(place: float) -> None:
    mesh = grid(2, 2, (0.0, 1.0))
    moved = dataclasses.replace(mesh, points_vx=mesh.points_vx + place)
    assert tolerance_of(moved) == pytest.approx(max(1e-9, 8.0 * 2.0**-52 * (place + 1.0)), rel=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("distance", "is_on"), [(INSIDE, True), (OUTSIDE, False)])
def test_vertices_hang_on_a_side_up_to_a_billionth_of_the_mesh(distance: float, is_on: bool, scale: float) -> None:
    right = grid(1, 2, (1.0, 2.0), scale)
    points = right.points_vx.copy()
    middle = np.flatnonzero(np.abs(points - np.array([1.0, 0.5]) * scale).max(axis=1) < 1e-9 * scale)
    points[middle, 0] += 2e-9 * distance * scale
    moved = PolygonMesh.from_cells(points, [list(loop) for loop in right.cells()])
    assert weld([grid(1, 1, (0.0, 1.0), scale), moved]).n_sides_c.tolist() == [5 if is_on else 4, 4, 4]


@pytest.mark.parametrize(("where", "is_used"), [(0.31, True), (0.29, False), (0.69, True), (0.71, False)])
def test_a_hanging_node_is_the_middle_up_to_a_fifth_of_its_side(where: float, is_used: bool) -> None:
    points = [(0.0, 0.0), (where, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    fine = refine(PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4]]), [0])
    assert fine.n_vertices == 5 + 3 + 1 + (not is_used)


@pytest.mark.parametrize(("turn", "corners"), [(0.9e-6, 4), (1.1e-6, 5)])
def test_a_vertex_is_a_corner_where_the_boundary_turns(turn: float, corners: int) -> None:
    """The sine of the angle between the two halves of the lower side."""
    points = [(0.0, 0.0), (0.5, -0.25 * turn), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    fine = refine(PolygonMesh.from_cells(points, [[0, 1, 2, 3, 4]]), [0])
    assert fine.n_cells == corners


# -- checkpoints -----------------------------------------------------------------------------------------------------


def test_labels_of_a_checkpoint_agree_up_to_a_billionth_of_the_domain() -> None:
    labels = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 1.0, 1.0], [2.0, 1.0, 2.0]])
    states = np.arange(8.0).reshape(1, 4, 2)
    checkpoint = Checkpoint({}, labels, states)
    near, far = labels.copy(), labels.copy()
    near[1, 0] += INSIDE * 4e-9
    far[1, 0] += OUTSIDE * 4e-9
    np.testing.assert_array_equal(checkpoint.values_at(near), states)
    with pytest.raises(InputError, match=r"no node at \(4, 0\)"):
        checkpoint.values_at(far)


# -- contact ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("left", "touches"), [(0.049, True), (0.051, False)])
def test_points_touch_at_a_tenth_of_their_distance(left: float, touches: bool) -> None:
    """The gap is 0.5 in the reference state; 0.05 of the domain, 2.5 high, is more."""
    assert (check_contact(state([LOWER, UPPER], lowered(0.5 - left))).contact_nodes > 0) == touches


@pytest.mark.parametrize(("left", "touches"), [(0.24, True), (0.26, False)])
def test_points_touch_below_a_twentieth_of_the_domain(left: float, touches: bool) -> None:
    """The gap is 3 in the reference state, a tenth of it 0.3; the domain is 5 high."""
    far = state([LOWER, square(0, 4)], lambda p: np.column_stack([0 * p[:, 0], np.where(p[:, 1] >= 4, left - 3, 0)]))
    assert (check_contact(far).contact_nodes > 0) == touches


@pytest.mark.parametrize(("depth", "counts"), [(5e-12, False), (8e-12, True)])
def test_overlap_counts_from_rounding_on(depth: float, counts: bool) -> None:
    """1e-12 of the square of the domain, 2.5 high; the squares are 1 wide."""
    assert (check_contact(state([LOWER, UPPER], lowered(0.5 + depth))).overlap_area > 0.0) == counts


# -- plausibility ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ([record(min_j={"solid": 0.201, "medium": 0.01})], [record(min_j={"solid": 0.199, "medium": 0.01})]),
        ([record(min_j={"solid": 0.8, "medium": 1.01e-6})], [record(min_j={"solid": 0.8, "medium": 0.99e-6})]),
        ([record(energy={"solid": 0.951, "medium": 0.049})], [record(energy={"solid": 0.949, "medium": 0.051})]),
        ([open_gap(0.1, -0.098, 0.5), record()], [open_gap(0.1, -0.102, 0.5), record()]),
        # what counts as squeezed: then the medium's part is no parasitic one any more
        (
            [record(0.1, min_j={"solid": 0.9, "medium": 0.499}, energy={"solid": 0.0, "medium": 0.01}), record()],
            [record(0.1, min_j={"solid": 0.9, "medium": 0.501}, energy={"solid": 0.0, "medium": 0.01}), record()],
        ),
    ],
    ids=["J of a solid", "J of the medium", "in contact", "before contact", "squeezed"],
)
def test_what_is_worth_a_warning(good: list[Any], bad: list[Any]) -> None:
    assert findings(*good) == []
    assert len(findings(*bad)) == 1


@pytest.mark.parametrize(("gamma", "count"), [(0.0099, 0), (0.0101, 1)])
def test_what_gamma_is_large(gamma: float, count: int) -> None:
    assert len(findings(record(), inputs={"medium": {"gamma": gamma}})) == count


@pytest.mark.parametrize(("difference", "count"), [(0.9e-9, 0), (1.1e-9, 1)])
def test_parameters_are_those_of_the_problem_up_to_a_billionth(difference: float, count: int) -> None:
    last = record(parameters={"gamma": 1e-5 * (1.0 + difference)})
    assert len(findings(last, inputs={"medium": {"gamma": 1e-5}})) == count
