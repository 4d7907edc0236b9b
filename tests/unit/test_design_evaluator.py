"""What a design is worth: compliance against linear algebra of our own, gradients against differences, load cases."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from helpers_design import CANTILEVER, cantilever, cantilever_file
from mpi4py import MPI
from numpy.typing import NDArray

from tmc_vem.design.evaluator import Evaluator
from tmc_vem.design.projection import Projection
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control

Float = NDArray[np.float64]

TWO_CASES = [
    {"name": "down", "set": {"load.force": [0, -0.001]}},
    {"name": "up", "set": {"load.force": [0.0005, 0.001]}, "weight": 2.0},
]


def evaluator(directory: Path, changes: dict[str, object] | None = None) -> Evaluator:
    return Evaluator(*cantilever(directory, changes), MPI.COMM_WORLD)


def variables(of: Evaluator, seed: int = 0) -> Float:
    return np.random.default_rng(seed).uniform(0.3, 0.9, of.parametrisation.n_variables)


def test_compliance_of_a_small_load_is_that_of_linear_algebra(method: str, tmp_path: Path) -> None:
    """K at u = 0, solved by scipy: f . K^-1 f, and its derivatives -u . dK/ds u by differences of K."""
    found = evaluator(tmp_path, {"load.force": [0, -1e-8], "solve.method": method})
    z = variables(found)
    evaluation = found(z)
    case = found.cases[""]
    system = case.system

    def stiffness(s_c: Float) -> tuple[scipy.sparse.csr_matrix, Float]:
        system.set_factors("plate", s_c[system.cell_numbers()][:, None])
        u, residual, matrix = system.create_vector(), system.create_vector(), system.create_matrix()
        system.set_position(Control(1.0))
        system.residual(u, residual)
        system.jacobian(u, matrix)
        indptr, indices, data = matrix.getValuesCSR()
        forces = -residual.getArray().copy()
        forces[system.constrained()] = 0.0
        return scipy.sparse.csr_matrix((data, indices, indptr), shape=(system.n_dofs,) * 2), forces

    s_c = found.stiffness(z)
    K, f = stiffness(s_c)
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()
    u = scipy.sparse.linalg.spsolve(K.tocsc(), f)
    compliance = float(f @ u)
    assert evaluation.objective == pytest.approx(compliance, rel=1e-6)
    for cell in (0, 13, 31):
        step = np.where(np.arange(len(s_c)) == cell, 1e-3, 0.0)
        rate = (stiffness(s_c + step)[0] - stiffness(s_c - step)[0]) / 2e-3
        expected = -float(u @ (rate @ u))
        solved = found.cases[""].solve(s_c)
        assert solved is not None
        assert solved.by_stiffness["compliance"][cell] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"design.cases": TWO_CASES, "design.limits": {"tip": {"at_least": -0.05}}},
        {"design.minimise": "volume", "design.limits": {"tip": {"at_least": -0.05}}},
        {"design.minimise": "", "design.maximise": "tip", "design.symmetry": {"y": 0.5}},
    ],
    ids=["compliance", "two load cases with a limit", "volume", "symmetric, a probe made large"],
)
def test_gradients_are_those_of_differences(changes: dict[str, object], tmp_path: Path) -> None:
    """Central differences of objective and limits at a moderate load, in fifty random directions and variables."""
    found = evaluator(tmp_path, {**changes, "load.force": [0, -0.002], "design.noise": 0.0})
    found.project(Projection(2.0))
    z = variables(found)
    at = found(z)
    rng = np.random.default_rng(1)
    n = len(z)
    directions = [*np.eye(n)[rng.permutation(n)[: min(n, 25)]], *rng.standard_normal((25, n))]
    h = 1e-4
    for d in directions:
        step = h * d / np.abs(d).max()
        above, below = found(z + step), found(z - step)
        scale = np.abs(at.gradient).sum() * h
        assert (above.objective - below.objective) / 2 == pytest.approx(at.gradient @ step, rel=1e-6, abs=1e-7 * scale)
        by_limits = (above.constraints - below.constraints) / 2
        assert by_limits == pytest.approx(at.jacobian @ step, rel=1e-5, abs=1e-6 * np.abs(at.jacobian).sum() * h)


def test_differences_get_better_with_the_square_of_their_step(tmp_path: Path) -> None:
    found = evaluator(tmp_path, {"load.force": [0, -0.003]})
    z = variables(found)
    d = np.random.default_rng(2).standard_normal(len(z))
    slope = found(z).gradient @ d
    off = [
        abs((found(z + h * d).objective - found(z - h * d).objective) / (2 * h) - slope) for h in (0.02, 0.01, 0.005)
    ]
    assert np.log2(off[0] / off[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(off[1] / off[2]) == pytest.approx(2.0, abs=0.1)


def test_load_cases_are_summed_with_their_weights(tmp_path: Path) -> None:
    found = evaluator(tmp_path, {"design.cases": TWO_CASES, "design.limits": {"tip": {"at_most": 0.05}}})
    z = variables(found)
    evaluation = found(z)
    assert found.worth is not None
    values = found.worth.values
    assert set(values) == {"down.compliance", "up.compliance", "down.tip", "up.tip"} == set(found.names)
    assert evaluation.objective == pytest.approx(values["down.compliance"] + 2.0 * values["up.compliance"])
    assert found.constraints == ("volume", "down.tip", "up.tip")
    assert evaluation.constraints[1:] == pytest.approx([values["down.tip"] / 0.05 - 1.0, values["up.tip"] / 0.05 - 1.0])
    alone = evaluator(tmp_path)
    assert alone(z).objective == pytest.approx(values["down.compliance"], rel=1e-9)


def test_a_symmetric_design_with_passive_parts(tmp_path: Path) -> None:
    passive = [{"is": "solid", "box": [1.75, 0.25, 2, 0.75]}, {"is": "void", "circle": [0.5, 0.5, 0.3]}]
    found = evaluator(tmp_path, {"design.symmetry": {"y": 0.5}, "design.passive": passive})
    z = variables(found)
    density_yx = found.densities(z).reshape(4, 8)
    assert density_yx == pytest.approx(density_yx[::-1])
    assert (density_yx[1:3, 7] == 1.0).all()
    assert (density_yx[1:3, 1:3] == 0.0).all()
    assert len(z) == (32 - 2 - 4) // 2
    assert found.stiffness(z).reshape(4, 8)[1, 7] == 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"design.minimise": "complience"}, r"complience"),
        ({"design.minimise": ""}, r"give one of minimise and maximise"),
        ({"design.maximise": "tip"}, r"give one of minimise and maximise"),
        ({"design.volume": 1.5}, r"volume = 1.5: use 1e-06 to 1"),
        ({"design.filter.radius": -1.0}, r"radius = -1 must be a positive number"),
        ({"design.filter.kind": "cube"}, r"unknown kind 'cube'.*: choose one of cone, helmholtz, none"),
        ({"design.symmetry": {"y": 0.4}}, r"mirror"),
        ({"design.symmetry": {"z": 0.5}}, r"symmetry: 'z' is no axis"),
        ({"design.passive": [{"is": "solid", "box": [5, 5, 6, 6]}]}, r"design: passive: no cell has its centroid in"),
        (
            {"design.passive": [{"is": "solid", "box": [-1, -1, 6, 6]}]},
            r"none of the 32 cells of the design may change",
        ),
        ({"design.passive": [{"is": "hard", "box": [0, 0, 1, 1]}]}, r"is = 'hard': a passive part is solid or void"),
        ({"design.limits": {"tip": {}}}, r"give one of at_most and at_least"),
        ({"design.cases": [{"name": "a b"}]}, r"cases: 'a b': use letters, digits, _ and -"),
        ({"design.cases": [{"name": "a"}, {"name": "a"}]}, r"two load cases are called 'a'"),
        ({"design.cases": [{"name": "a", "set": {"load.farce": [0, 1]}}]}, r"design: cases: a: .*'farce'"),
        ({"design.method": "simplex"}, r"unknown method 'simplex'.*: choose one of mma, ccsaq, oc"),
        ({"design.iterations": 0}, r"iterations = 0: give 1 or more"),
        ({"design.projection": {"every": 0}}, r"every = 0: give 1 iteration"),
        ({"design.interpolation.p": 0.5}, r"p = 0.5: use 1 to 10"),
    ],
)
def test_what_is_wrong_with_a_design_is_said_in_a_line(
    changes: dict[str, object], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message) as raised:
        evaluator(tmp_path, changes)
    assert "\n" not in str(raised.value)


def test_a_design_without_a_volume_needs_a_start(tmp_path: Path) -> None:
    path = cantilever_file(tmp_path, CANTILEVER.replace("volume = 0.5\n", ""))
    with pytest.raises(InputError, match=r"there is no volume to start from: give start, the density of all cells"):
        read_problem(path)
    assert Evaluator(*read_problem(path, {"design.start": 0.6}), MPI.COMM_WORLD).start().tolist() == [0.6] * 32
