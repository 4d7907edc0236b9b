"""A user's file with a density is executed once a run: edited, broken or removed meanwhile, it changes nothing."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest

from tmc_vem import Box, Medium, RunOptions, run
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

BENDING = '''
from pathlib import Path

executions = Path(__file__).with_name("executions")
executions.write_text(executions.read_text() + "x" if executions.exists() else "x")
{then}

def bending(F, G, p, m):
    """A regulariser."""
    return sum(G[i][j][k] ** 2 for i in (0, 1) for j in (0, 1) for k in (0, 1)) / 2

def stiff(F, G, p, m):
    """An energy of its own."""
    J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
    C = F[0][0] ** 2 + F[1][0] ** 2 + F[0][1] ** 2 + F[1][1] ** 2
    return 5 * (C - 2 - 2 * m.log(J)) + 5 * (J - 1) ** 2
'''
WHAT_BECOMES_OF_IT = {
    "stays": "",
    "is removed": "Path(__file__).unlink()",
    "is broken": "Path(__file__).write_text('def bending(')",
    "is replaced": "Path(__file__).write_text('def bending(F, G, p, m): return 1e9 * G[0][0][0] ** 2')",
}
OWN = """
name = "blocks"
[regions.block]
density = "mine.py:stiff"
shape = "block"
[regions.medium]
medium = { gamma = 1e-3, alpha_r = 0.1, mu = 10, regulariser = "mine.py:bending" }
shape = "above"
[shapes]
block = { rectangle = [0, 0, 1, 1] }
above = { rectangle = [0, 1, 1, 2] }
[mesh]
size = 0.5
cells = "triangles"
[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { line = [[0, 2], [1, 2]] }
[[support]]
at = "bottom"
ux = 0
uy = 0
[[support]]
at = "top"
ux = 0
[load]
at = "top"
uy = -0.1
"""


@pytest.fixture
def directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("then", WHAT_BECOMES_OF_IT)
def test_a_regulariser_is_taken_from_its_file_once(directory: Path, then: str) -> None:
    (directory / "mine.py").write_text(BENDING.format(then=WHAT_BECOMES_OF_IT[then]))
    medium = Medium(gamma=1e-3, alpha_r=0.1, regulariser="mine.py:bending")
    result = run(Box((20, 10), medium, uy=-0.05), directory / "run", RunOptions(steps=2))
    built_in = Medium(gamma=1e-3, alpha_r=0.1, regulariser="huhu")
    expected = run(Box((20, 10), built_in, uy=-0.05), None, RunOptions(steps=2))
    assert result.complete
    assert result.gap == pytest.approx(expected.gap, rel=1e-12)
    assert json.loads((directory / "run" / "result.json").read_text())["complete"]
    assert (directory / "executions").read_text() == "x"


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_files_of_a_problem_file_are_executed_once_an_entry(directory: Path, method: str) -> None:
    """Two entries name the file; it is gone before the first step."""
    (directory / "mine.py").write_text(BENDING.format(then=""))
    (directory / "own.toml").write_text(OWN)
    problem, _ = read_problem(directory / "own.toml")
    (directory / "mine.py").unlink()
    result = run(problem, directory / "run", RunOptions(method=method, steps=2))
    assert result.complete
    assert (directory / "executions").read_text() == "xx"


def test_another_process_finds_the_function_in_the_file_again(directory: Path) -> None:
    (directory / "mine.py").write_text(BENDING.format(then=""))
    sent = pickle.dumps(Medium(regulariser="mine.py:bending"))
    received = pickle.loads(sent)
    assert received.resolve()[0].name == "bending"
    (directory / "mine.py").unlink()
    with pytest.raises(InputError, match=r"there is no file mine\.py"):
        pickle.loads(sent).resolve()


NAMED_SOLID = """
def solid(F, G, p, m):
    J = F[0][0] * F[1][1] - F[0][1] * F[1][0]
    return p.mu / 2 * (F[0][0] ** 2 + F[1][0] ** 2 + F[0][1] ** 2 + F[1][1] ** 2 - 2 - 2 * m.log(J))
"""


@pytest.mark.parametrize(
    ("density", "parameters", "moduli"),
    [("mine.py:solid", "{ mu = 3 }", None), ("tmc_vem.energy:solid", "{ K = 20, mu = 10 }", (20.0, 10.0))],
)
def test_a_name_says_nothing_about_moduli(directory: Path, density: str, parameters: str, moduli: object) -> None:
    """Whether K and mu are moduli is known of the program's solid, not of a function that is called like it."""
    (directory / "mine.py").write_text(NAMED_SOLID + BENDING.format(then=""))
    (directory / "blocks.toml").write_text(OWN.replace('"mine.py:stiff"', f'"{density}"\nparameters = {parameters}', 1))
    problem, options = read_problem(directory / "blocks.toml")
    found = problem.regions()["block"].moduli
    assert (None if found is None else (found.K, found.mu)) == moduli
    assert run(problem, None, options).complete
