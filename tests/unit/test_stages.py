"""Supports that hold in some stages of a run only: their forces go, what is held stays, and runs are resumed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from helpers_plate import problem_of, result_of

from tmc_vem import RunOptions, run
from tmc_vem.problems.description import ConditionTable
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.plan import control_path
from tmc_vem.support.errors import InputError
from tmc_vem.system.control import Control
from tmc_vem.system.stage import Stage, check_stages

# Pulled while the top is held in y; then the top is let go and the right end held where it is by a new support.
TEXT = """[[stage]]
name = "pull"
begins = 0
[[stage]]
name = "free"
begins = 1
[[stage]]
name = "again"
begins = 2
[[support]]
at = "left"
ux = 0
[[support]]
at = "bottom"
uy = 0
[[support]]
at = "top"
uy = 0
stage = ["pull", "again"]
[[load]]
name = "pull"
at = "right"
traction = [2, 0]
history = [[0, 0], [1, 1], [2, 1], [3, 0]]
[probes]
top = { reaction = "uy", at = "top" }
height = { displacement = "uy", at = "c" }
"""
ALWAYS = TEXT.replace('stage = ["pull", "again"]\n', "")
NEVER = TEXT.replace('[[support]]\nat = "top"\nuy = 0\nstage = ["pull", "again"]\n', "").replace(
    'top = { reaction = "uy", at = "top" }\n', ""
)


@pytest.fixture(scope="module")
def where(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("stages")


def at(result: RunResult) -> dict[float, Any]:
    return {record.load: record for record in result.history}


def test_a_support_that_ends_leaves_nothing_behind(where: Path, method: str) -> None:
    """With it until it ends, without it at the end of the next stage, its force in proportion between."""
    staged = at(result_of(where, TEXT, method=method, steps=4))
    never = at(result_of(where, NEVER, method=method, steps=4))
    always = at(result_of(where, ALWAYS, method=method, steps=4))
    assert staged[1.0].probes["top"] == pytest.approx(always[1.0].probes["top"], rel=1e-9)
    assert staged[1.0].probes["top"] > 0.2, "it keeps the top from coming down"
    for time, share in ((1.25, 0.75), (1.5, 0.5), (1.75, 0.25), (2.0, 0.0)):
        assert staged[time].probes["top"] == pytest.approx(share * staged[1.0].probes["top"], abs=1e-9)
    assert staged[1.5].probes["height"] < 0.3 * never[2.0].probes["height"] < -0.002
    assert staged[2.0].probes["height"] == pytest.approx(never[2.0].probes["height"], rel=1e-7)
    assert sum(staged[2.0].energy.values()) == pytest.approx(sum(never[2.0].energy.values()), rel=1e-9)


def test_a_support_that_begins_holds_what_was_reached(where: Path, method: str) -> None:
    result = result_of(where, TEXT, method=method, steps=4)
    records = at(result)
    held = records[2.0].probes["height"]
    for time in (2.25, 3.0):
        assert records[time].probes["height"] == pytest.approx(held, abs=1e-12)
    assert records[3.0].probes["top"] < -0.2, "it keeps the top from going up again"
    assert result.checks["imbalance"] < 1e-9
    balance = result.checks["energy_balance"]
    assert abs(balance["integration_error"]) < 2e-3 * max(sum(record.energy.values()) for record in result.history)


def test_a_run_is_resumed_within_a_stage_bit_for_bit(where: Path, tmp_path: Path, method: str) -> None:
    problem = problem_of(where, TEXT)
    whole = run(problem, options=RunOptions(method, steps=2))
    done = 0
    for stop in (5, 4, 4, 4, None):  # iterations, of each part
        part = run(problem, tmp_path / "out", RunOptions(method, steps=2, max_iterations=stop), resume=done > 0)
        assert (part.cut_short, part.steps > done) == (stop is not None, True)
        done = part.steps
    plain = [replace(record, seconds=0.0) for record in whole.history]
    assert [replace(record, seconds=0.0) for record in part.history] == plain


# -- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('stage = ["pull", "again"]', 'stage = "fre"',
         "support, entry 3: unknown stage 'fre' (did you mean 'free'?): choose one of pull, free, again"),
        ("uy = 0\nstage", "uy = 0.1\nstage", "uy = 0.1 does not go with stage: a support of some stages holds"),
        ("uy = 0\nstage", "normal = 0\nstage", "normal = 0 does not go with stage"),
        ('stage = ["pull", "again"]', "stage = []", "support, entry 3: stage: there is none"),
        ("begins = 0", "begins = 0.5", "stage, entry 1: begins = 0.5: the first stage begins at 0"),
        ("begins = 2", "begins = 1", "stage, entry 3: begins = 1 must be later than 1 before it"),
        ("begins = 2", "begins = -1", "stage, entry 3: begins = -1: use 0 to 1000, a time"),
        ('name = "again"', 'name = "free"', "stage, entry 3: name = 'free' is that of another stage already"),
        ("begins = 2", "begin = 2", "stage, entry 3 has no 'begin' (did you mean 'begins'?)"),
    ],
)  # fmt: skip
def test_stages_that_are_refused(old: str, new: str, message: str, where: Path) -> None:
    with pytest.raises(InputError) as caught:
        problem_of(where, TEXT.replace(old, new))
    assert message in str(caught.value)
    lines = (where / "plate.toml").read_text().splitlines()
    named = max(n for n, line in enumerate(lines, start=1) if line == new.splitlines()[0])
    assert str(caught.value).endswith(f"(line {named})")


def test_stages_and_paths(where: Path) -> None:
    problem = problem_of(where, TEXT)
    assert [corner.load for corner in control_path(problem, RunOptions()).corners] == [0.0, 1.0, 2.0, 3.0]
    with pytest.raises(InputError, match="path does not go with"):
        control_path(problem, RunOptions(path=(0.0, 3.0, 0.0)))
    with pytest.raises(InputError, match="follow does not go with a history or a stage"):
        control_path(problem, RunOptions(follow=True))
    late = problem_of(where, TEXT.replace("begins = 2", "begins = 3"))
    with pytest.raises(InputError, match="stage 'again' begins at 3, but the run ends at 3"):
        control_path(late, RunOptions())


def test_every_stage_must_hold_the_body(where: Path) -> None:
    text = TEXT.replace('at = "left"\nux = 0', 'at = "left"\nux = 0\nstage = "pull"')
    with pytest.raises(InputError, match="stage 'free': nothing holds part 1"):
        run(problem_of(where, text))


def test_stages_as_data() -> None:
    check_stages([Stage("a", 0.0), Stage("b", 0.5)])
    assert ConditionTable("a", ux=0.0, stage="s").conditions()[0].stages == ("s",)
    assert ConditionTable("a", ux=0.0).stages == ()
    assert Control(0.0).load == 0.0
