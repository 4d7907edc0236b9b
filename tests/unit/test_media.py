"""The medium that pulls nothing in: blocks that pass through each other in the paper's medium stay apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers_blocks import blocks

from tmc_vem.problems.hints import FLUSH, hints
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation import run
from tmc_vem.simulation.problem_file import read_problem

OURS = 'energy = "balanced", regulariser = "angle_log", alpha = 2.5'


ENDS_FLUSH: dict[str, float] = {}
PUNCH = {"left": 0.2, "right": 0.8, "top": 1.0}  # square corners, with medium around them


def problem_of(directory: Path, medium: str, solve: str = "", **shape: float) -> Any:
    """Problem and options of two blocks with a medium."""
    return read_problem(blocks(directory, f"max_iterations = 300\n{solve}", medium=medium, **shape))


def solved(directory: Path, medium: str, solve: str = "", **shape: float) -> RunResult:
    """Result of a run."""
    problem, options = problem_of(directory, medium, solve, **shape)
    return run(problem, options=options)


@pytest.mark.parametrize(
    ("shape", "gamma", "penalty"),
    [(ENDS_FLUSH, "1e-4", "none"), (ENDS_FLUSH, "1e-6", "none"), (ENDS_FLUSH, "1e-4", "full"), (PUNCH, "1e-4", "none")],
)
def test_blocks_stay_apart(tmp_path: Path, shape: dict[str, float], gamma: str, penalty: str) -> None:
    """At full load, without a jump, with J > 0 at 28 points of every sub-triangle of every cell."""
    element = f'element = {{ interior_penalty = "{penalty}" }}'
    result = solved(tmp_path, f"{OURS}, gamma = {gamma}", element, **shape)
    assert result.complete
    assert result.checks["interpenetrates"] is False
    assert result.checks["inverted_cells"] == {}
    assert all(smallest > 0.0 for smallest in result.checks["dense_min_j"].values())
    assert "inverted_from" not in result.checks
    assert 0.0 < result.gap < 0.2 - 0.18
    assert not any(step.jumped for step in result.history)
    assert "balanced" in str(result.inputs)


def test_the_paper_s_medium_does_not_keep_them_apart(tmp_path: Path) -> None:
    result = solved(tmp_path, "gamma = 1e-4, alpha = 0.25")
    assert not result.complete
    assert any(f"or take {OURS}" in warning for warning in result.warnings)


def test_only_media_that_are_drawn_in_are_warned_of(tmp_path: Path) -> None:
    said = {}
    for medium in (OURS, "alpha = 0.25", 'energy = "balanced", alpha = 0.25'):
        problem, _ = problem_of(tmp_path, medium)
        found = [h for h in hints(problem.make_mesh(), problem.regions(), problem.prescribed()) if h.kind == FLUSH]
        assert found
        said[medium] = any(hint.likely for hint in found)
    assert list(said.values()) == [False, True, True]
