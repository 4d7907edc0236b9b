"""Designs in files: what a run makes of them, and what is refused."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from helpers_design import cantilever
from numpy.typing import NDArray

from tmc_vem import run
from tmc_vem.mesh.cells import centroids_and_areas
from tmc_vem.problems.stiffness_file import StiffnessOfFile, write_stiffness
from tmc_vem.simulation import prepare
from tmc_vem.simulation.problem_file import problem_text, read_problem
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]
BY_FILE = {"regions.plate.stiffness": "stiffness.npz"}


def design(directory: Path, seed: int = 0) -> Float:
    """Stiffnesses of all cells, in a file too, in another order."""
    mesh = cantilever(directory)[0].make_mesh()
    stiffness_c = np.random.default_rng(seed).uniform(0.2, 1.0, mesh.n_cells)
    order = np.random.default_rng(1).permutation(mesh.n_cells)
    centroid_cx = centroids_and_areas(mesh)[0]
    write_stiffness(directory / "stiffness.npz", centroid_cx[order], stiffness_c[order], stiffness_c[order])
    return stiffness_c


def test_a_run_of_a_file_is_that_of_the_stiffnesses_in_it(method: str, tmp_path: Path) -> None:
    stiffness_c = design(tmp_path)
    problem, options = cantilever(tmp_path, {**BY_FILE, "solve.method": method})
    found = run(problem, None, options)
    other = prepare(cantilever(tmp_path)[0], None, options)
    other.system.set_factors("plate", stiffness_c[other.system.cell_numbers()][:, None])
    assert found.probes["tip"] == pytest.approx(other.go().probes["tip"], rel=1e-12)


def test_the_problem_of_such_a_run_may_lie_anywhere(tmp_path: Path) -> None:
    design(tmp_path)
    problem, options = cantilever(tmp_path, BY_FILE)
    (tmp_path / "elsewhere").mkdir()
    copy = tmp_path / "elsewhere" / "copy.toml"
    copy.write_text(problem_text(problem, options))
    assert read_problem(copy)[0].regions()["plate"].graded == StiffnessOfFile(tmp_path / "stiffness.npz")


def test_inputs_tell_two_designs_from_each_other(tmp_path: Path) -> None:
    design(tmp_path)
    first = cantilever(tmp_path, BY_FILE)[0].inputs()
    design(tmp_path, seed=1)
    second = cantilever(tmp_path, BY_FILE)[0].inputs()
    assert first["regions"]["plate"]["stiffness_content"] != second["regions"]["plate"]["stiffness_content"]
    assert first["regions"]["plate"]["stiffness"] == "stiffness.npz"


def test_designs_travel_to_other_processes(tmp_path: Path) -> None:
    stiffness_c = design(tmp_path)
    known = pickle.loads(pickle.dumps(StiffnessOfFile(tmp_path / "stiffness.npz")))
    (tmp_path / "stiffness.npz").unlink()
    centroid_cx = centroids_and_areas(cantilever(tmp_path)[0].make_mesh())[0]
    assert known.factors(centroid_cx, {})[:, 0].tolist() == stiffness_c.tolist()
    assert known.factors(np.empty((0, 2)), {}).shape == (0, 1)


def test_a_design_of_another_mesh_is_refused(tmp_path: Path) -> None:
    design(tmp_path)
    problem, options = cantilever(tmp_path, {**BY_FILE, "mesh.size": 0.125})
    message = (
        r"regions: plate: stiffness: stiffness.npz has no cell around \(0.0625, 0.0625\): it is a design on another"
    )
    with pytest.raises(InputError, match=message):
        run(problem, None, options)


ONE = np.array([[0.5, 0.5]])


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (None, r"regions: plate: stiffness: .*stiffness.npz cannot be read: No such file"),
        (b"no archive", r"stiffness.npz is no design \(.*\): it needs the arrays centroid_cx and stiffness_c"),
        ({"centroid_cx": ONE}, r"stiffness.npz is no design \(.*stiffness_c"),
        ({"centroid_cx": ONE, "stiffness_c": np.array([1.0, 0.0])}, r"shape \(1, 2\) .* shape \(2,\): they need to be"),
        ({"centroid_cx": ONE, "stiffness_c": np.array([1.5])}, r"has 1.5 in the cell around \(0.5, 0.5\): it must be"),
        ({"centroid_cx": ONE, "stiffness_c": np.array([np.nan])}, r"has nan in the cell around"),
        ({"centroid_cx": ONE * np.nan, "stiffness_c": np.array([1.0])}, r"has a centroid that is no number"),
        ({"centroid_cx": ONE, "stiffness_c": np.array([{}], dtype=object)}, r"is no design"),
    ],
)
def test_what_is_no_design(arrays: object, message: str, tmp_path: Path) -> None:
    path = tmp_path / "stiffness.npz"
    if isinstance(arrays, bytes):
        path.write_bytes(arrays)
    elif isinstance(arrays, dict):
        np.savez(path, **arrays)
    with pytest.raises(InputError, match=message):
        cantilever(tmp_path, BY_FILE)


def test_other_stiffnesses_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"stiffness = 'design.vtu': give a number from 0 to 1, or a file .* \.npz"):
        cantilever(tmp_path, {"regions.plate.stiffness": "design.vtu"})
    with pytest.raises(InputError, match=r"stiffness = 1.5 of a design region must be from 0"):
        cantilever(tmp_path, {"regions.plate.stiffness": 1.5})
