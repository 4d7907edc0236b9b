"""Runs as data frames and meshes of other programs, and states at points."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from tmc_vem import Box, RunOptions, RunResult, run
from tmc_vem.simulation.sample import displacement_at, function_at, last_state, onto_function
from tmc_vem.support.errors import InputError

PROBLEM = Box(cells=(20, 5), uy=-0.1, cell_kind="voronoi")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    return run(PROBLEM, tmp_path_factory.mktemp("run") / "box", RunOptions(steps=2, snapshots=2))


def test_history_as_a_data_frame(result: RunResult) -> None:
    frame = result.to_pandas()
    assert frame.index.tolist() == [1, 2]
    assert frame["gap"].iloc[-1] == result.gap
    assert frame.attrs["units"]["gap"] == "length"
    assert frame["min_j_medium"].iloc[-1] == result.min_j["medium"]


def test_fields_as_meshes_of_meshio_and_pyvista(result: RunResult) -> None:
    for load, uy in ((1.0, -0.1), (0.4, -0.05)):
        ours, theirs = result.to_meshio(load), result.to_pyvista(load)
        for points, displacement in (
            (ours.points, ours.point_data["displacement"]),
            (theirs.points, theirs.point_data["displacement"]),
        ):
            top = np.hypot(points[:, 0] - 1.0, points[:, 1] - 0.5).argmin()
            assert displacement[top, 1] == pytest.approx(uy)
        assert theirs.n_cells == sum(len(block.data) for block in ours.cells) == result.n_cells
        assert list(theirs.field_data["region_names"]) == list(ours.field_data) == ["solid", "medium"]
        area = theirs.compute_cell_sizes()["Area"]
        assert area.sum() == pytest.approx(1.0)
        assert area[theirs.cell_data["region"] == 0].sum() == pytest.approx(1.0 - 1.8 * 0.3)


def test_missing_packages_and_fields_are_named(result: RunResult, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, call in (("pandas", result.to_pandas), ("pyvista", result.to_pyvista)):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(InputError, match=rf"needs {name}.*\[analysis\]"):
            call()
    with pytest.raises(InputError, match="no fields"):
        RunResult.to_meshio(run(Box(cells=(20, 5), uy=-0.01), options=RunOptions(steps=1)))


@pytest.fixture(scope="module")
def state(result: RunResult) -> Any:
    assert result.directory is not None
    return last_state(PROBLEM, result.directory, RunOptions(steps=2, snapshots=2))


def test_quadratic_fields_are_sampled_exactly(state: Any) -> None:
    from helpers_system import interpolate

    system, _ = state

    def quadratic(x: Any) -> Any:
        return np.column_stack([1 + x[:, 0] - 2 * x[:, 0] * x[:, 1], x[:, 1] ** 2 - 3 * x[:, 0]])

    points = np.random.default_rng(1).uniform((0.0, 0.0), (2.0, 0.5), (200, 2))
    assert displacement_at(system, interpolate(system, quadratic), points) == pytest.approx(
        quadratic(points), abs=1e-10
    )


def test_the_state_of_a_run_at_its_probes_and_outside(state: Any, result: RunResult) -> None:
    system, u = state
    probes = np.array([[1.0, 0.4], [1.0, 0.1]])
    top, bottom = probes + displacement_at(system, u, probes)
    assert np.hypot(*(top - bottom)) == pytest.approx(result.gap, rel=1e-3)
    assert displacement_at(system, u, np.array([[1.0, 0.5]]))[0, 1] == pytest.approx(-0.1, abs=1e-15)  # no slope
    with pytest.raises(InputError, match=r"\(2.5, 0.1\) lies 0.5 outside"):
        displacement_at(system, u, np.array([[2.5, 0.1]]))


def test_onto_a_dolfinx_function_and_back(state: Any) -> None:
    pytest.importorskip("dolfinx")
    from mpi4py import MPI

    from tmc_vem.fem.system import FemSystem

    system, u = state
    target = Box(cells=(40, 10))
    fem = FemSystem(MPI.COMM_WORLD, target.make_mesh, target.regions(), target.prescribed())
    function = fem.nodes.function()
    onto_function(system, u, function)
    points = np.random.default_rng(2).uniform((0.01, 0.01), (1.99, 0.49), (50, 2))
    direct = displacement_at(system, u, points)
    assert function_at(function, points) == pytest.approx(direct, abs=2e-3 * np.abs(direct).max())
    with pytest.raises(InputError, match="in no cell"):
        function_at(function, np.array([[3.0, 3.0]]))
