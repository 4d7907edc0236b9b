"""Estimated errors against true ones, of finer meshes that are solved here; linearised estimates against solved."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tmc_vem import Box, RunOptions
from tmc_vem.adapt import refined as estimator
from tmc_vem.adapt.carried import carried, converges, start_on
from tmc_vem.adapt.changes import every_cell_cut
from tmc_vem.adapt.estimate import Estimate
from tmc_vem.adapt.refined import refined_estimate
from tmc_vem.adapt.solved import Solved, loaded, prepared
from tmc_vem.mesh.make.change import CellTree
from tmc_vem.mesh.make.refine import refined
from tmc_vem.problems.on_mesh import OnMesh
from tmc_vem.results.adaptivity import LINEARISED, SOLVED
from tmc_vem.solve.newton import NewtonOptions

NAMES = ("gap", "reaction", "energy")
UY = -0.05  # the flanges do not touch: smooth but for the corners


@cache
def state(uy: float) -> Solved:
    problem = Box(cells=(20, 5), uy=uy)
    mesh = problem.make_mesh()
    return loaded(prepared(OnMesh(problem, mesh), RunOptions()), mesh)


def estimate(uy: float, names: tuple[str, ...] = NAMES) -> Estimate:
    problem, solved = Box(cells=(20, 5), uy=uy), state(uy)
    change = every_cell_cut(problem, solved.mesh, CellTree.of(solved.mesh))
    return refined_estimate(solved, names, change, OnMesh(problem, change.mesh))


@cache
def solved_estimate() -> Estimate:
    return estimate(UY)


@cache
def truth() -> dict[str, float]:
    """Values on the mesh that is cut three times, with a sixteenth of the coarse one's size: 1 % of its error."""
    problem = Box(cells=(20, 5), uy=UY)
    mesh = problem.make_mesh()
    for _ in range(3):
        mesh = refined(mesh, np.arange(mesh.n_cells)).mesh
    return loaded(prepared(OnMesh(problem, mesh), RunOptions(steps=1)), mesh).values()


@pytest.mark.parametrize("name", [*NAMES, "displacement"])
def test_the_error_is_that_against_a_fine_mesh(name: str) -> None:
    found = solved_estimate()
    assert found.kind == SOLVED
    assert not found.doubt
    assert found.iterations > 0
    assert found.n_dofs > 3 * state(UY).simulation.n_dofs
    true = truth()[name] - found.values[name]
    if name == "displacement":  # what is prescribed is exact
        assert found.errors[name] == true == 0.0
        return
    assert 0.5 <= found.errors[name] / true <= 2.0


def test_indicators() -> None:
    """They are positive, a bound of the error, symmetric as the box is, and largest at the corners of the hole."""
    found = solved_estimate()
    mesh = state(UY).mesh
    center_cx = np.array([mesh.points_vx[mesh.cell(c)].mean(axis=0) for c in range(mesh.n_cells)])
    mirror_c = np.array([np.hypot(*(center_cx - (2.0 - x, y)).T).argmin() for x, y in center_cx])
    assert set(found.indicators) == set(NAMES)
    for name, indicators_c in found.indicators.items():
        assert indicators_c.shape == (100,)
        assert (indicators_c >= 0.0).all()
        assert indicators_c == pytest.approx(indicators_c[mirror_c], rel=1e-5)
        # of the error between the two meshes, which is 1 - 1/4 of what is estimated
        assert 0.7 <= indicators_c.sum() / abs(found.errors[name]) <= 3.0
    relative_c = found.relative_indicators(("gap",))
    assert relative_c.sum() == pytest.approx(abs(found.errors["gap"] / found.values["gap"]))
    both_c = found.relative_indicators(("gap", "energy"))
    assert np.array_equal(both_c, np.maximum(relative_c, found.relative_indicators(("energy",))))


def test_the_indicator_of_the_energy_is_the_energy_of_the_error() -> None:
    """Half of it, which is the error of the energy where the problem is linear and displacements are prescribed."""
    found = estimate(-1e-4, ("energy",))
    assert found.indicators["energy"].sum() == pytest.approx(0.75 * abs(found.errors["energy"]), rel=0.02)
    assert found.errors["energy"] < 0.0  # the coarse mesh is too stiff


@pytest.mark.parametrize("name", NAMES)
def test_one_newton_step_is_enough_in_the_linear_range(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    expected = estimate(-1e-3)
    monkeypatch.setattr(estimator, "MOST_ITERATIONS", 0)
    found = estimate(-1e-3)
    assert (expected.kind, found.kind) == (SOLVED, LINEARISED)
    assert "linearised" in found.doubt
    assert found.values[name] == expected.values[name]
    assert found.errors[name] == pytest.approx(expected.errors[name], rel=0.02)
    worst = np.abs(found.indicators[name] - expected.indicators[name]).max()
    assert worst < 0.02 * expected.indicators[name].max()


def test_results_without_a_derivative_have_no_linearised_error(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = set(solved_estimate().errors)
    monkeypatch.setattr(estimator, "MOST_ITERATIONS", 0)
    found = estimate(UY)
    assert set(found.errors) <= expected
    assert {"gap", "reaction", "energy"} <= set(found.errors)


def test_the_solver_is_left_as_it_was() -> None:
    """A run that goes on from its directory has a new one, which must do the same."""
    problem, solved = Box(cells=(20, 5), uy=UY), state(UY)
    before = solved.simulation.solver.options
    change = every_cell_cut(problem, solved.mesh, CellTree.of(solved.mesh))
    moved = carried(solved, change, OnMesh(problem, change.mesh))
    assert moved.found == "carried over"
    assert moved.simulation.solver.options == before == NewtonOptions()
    assert not converges(moved.simulation.solver, start_on(solved, change, OnMesh(problem, change.mesh)).u, 0)
    assert moved.simulation.solver.options == before


def test_what_is_within_the_tolerance() -> None:
    found = Estimate({"a": 2.0, "b": 0.0, "c": -1.0}, {"a": 0.02, "b": 0.0, "c": 0.5}, {}, SOLVED)
    assert found.within(("a",), 0.01)
    assert not found.within(("a",), 0.0099)
    assert found.within(("b",), 1e-9)
    assert not found.within(("a", "c"), 0.4)
    assert not found.within(("d",), 0.4)  # there is no estimate
    assert found.largest(("a", "c")) == 0.5
    assert found.largest(("a", "b")) == np.inf
