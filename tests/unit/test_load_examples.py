"""Examples whose loads are pressures: each has a number that is known, or one that is asserted."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tmc_vem import RunResult, run
from tmc_vem.simulation.problem_file import read_problem


def arch_alone(name: str, folder: Path) -> RunResult:
    """An example of the arch without floor and medium, as often before: they would only cost time."""
    text = (Path(__file__).parents[2] / "demos" / "problems" / f"{name}.toml").read_text()
    text, n = re.subn(r"\[regions\.floor\].*(?=\[mesh\])", "", text, flags=re.DOTALL)
    assert n == 1
    for line in (
        'gap = ["belly", "ground"]', "ground = [0, -0.12]", "base = { line = [[0, -0.2], [1, -0.2]] }",
        '[[support]]\nat = "base"\nuy = 0\n', 'contact = { reaction = "uy", at = "base" }',
    ):  # fmt: skip
        assert text.count(line) == 1, line
        text = text.replace(line, "")
    (folder / "arch.toml").write_text(text)
    problem, options = read_problem(folder / "arch.toml")
    result = run(problem, None, options)
    assert result.complete
    return result


def test_a_bistable_cell_stays_below_when_the_pressure_is_gone(tmp_path: Path) -> None:
    result = arch_alone("bistable", tmp_path)
    (through,) = [step for step in result.history if step.jumped]
    assert 0.25 < through.load < 0.35
    full, last = min(result.history, key=lambda step: abs(step.load - 1.0)), result.history[-1]
    assert (full.load, last.load) == (1.0, 2.0)
    assert (full.forces["air"]["pressure"], last.forces["air"]["pressure"]) == (0.004, 0.0)
    assert last.probes["crown"] == pytest.approx(-0.338, abs=0.005)
    assert full.probes["crown"] < last.probes["crown"]
    assert last.energy["arch"] > 0.5 * through.energy["arch"] > 0.0


def test_a_lid_is_followed_through_its_limit_points_under_a_force(tmp_path: Path) -> None:
    result = arch_alone("snap", tmp_path)
    loads, crowns = ([of(step) for step in result.history] for of in (lambda s: s.load, lambda s: s.probes["crown"]))
    first = next(n for n in range(len(loads)) if loads[n + 1] < loads[n])
    assert loads[first] == pytest.approx(0.373, abs=0.01)
    assert -0.1 < crowns[first] < -0.06
    assert min(loads) < -0.15  # it has to be held back before it lies below
    assert (loads[-1], crowns[-1]) == (1.0, pytest.approx(-0.389, abs=0.005))
    pivots = [step.negative_pivots for step in result.history]
    assert pivots[first + 2] == 1
    assert pivots[0] == pivots[-1] == 0
    assert result.history[-1].forces["push"]["force_y"] == pytest.approx(-2e-3)


def test_a_pneumatic_finger_presses_on_a_block(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "demos" / "problems" / "pneumatic.toml").read_text()
    assert text.count("size = 0.08") == 1
    (tmp_path / "finger.toml").write_text(text.replace("size = 0.08", "size = 0.12"))
    problem, options = read_problem(tmp_path / "finger.toml")
    result = run(problem, None, options)
    assert result.complete
    last, air = result.history[-1], result.history[-1].forces["air"]
    assert air["area_at_start"] == pytest.approx(
        3 * (0.5 * 0.25 - (4 - np.pi) * 0.05**2), rel=5e-3
    )  # corners are polygons
    assert air["area"] > 2.0 * air["area_at_start"]
    assert last.probes["contact"] == pytest.approx(0.0102, rel=0.15)
    assert sum(last.energy.values()) == pytest.approx(air["work"], rel=0.02)
