"""Limits for gamma to 0 of records of steps: which states count, when a limit is withheld, and what is said of it."""

from __future__ import annotations

import json
import math
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from tmc_vem.report import tables
from tmc_vem.results.limit import (
    GammaLimit,
    LimitPoint,
    LimitValue,
    Lowering,
    limit_at_end,
    limits_of,
    with_uncertainty,
)
from tmc_vem.results.records import StepRecord, finite
from tmc_vem.simulation.descent import Descents


def record(step: int, **values: Any) -> StepRecord:
    usual: dict[str, Any] = {
        "step": step, "load": 0.1 * step, "displacement": -0.2 * step, "probes": {"gap": 0.5, "angle": 2.0},
        "reaction": -3.0, "iterations": 1, "cut_backs": 0, "wasted_iterations": 0, "min_j": {}, "energy": {},
        "negative_pivots": 0, "jumped": False, "seconds": 0.0,
    }  # fmt: skip
    return StepRecord(**{**usual, **values})


LOWERING = Lowering({"gamma": 1e-3}, [10.0 ** (-k / 2) for k in range(5)])
START = record(2, forces={"lid": {"force": 1.0, "reaction": 4.0, "work": 5.0}})
BELOW = [
    record(k, parameters={"gamma": gamma}, limit_of=2, reaction=-3.0 + 0.1 * (1.0 - factor**0.6),
           forces={"lid": {"force": 1.0, "reaction": 3.0 + factor**0.6, "work": 5.0}})
    for k, factor in enumerate((0.7, 10**-0.5, 0.1, 10**-1.5, 0.01), start=1) for gamma in (1e-3 * factor,)
]  # fmt: skip


def test_limits_of_records() -> None:
    found = limits_of(LOWERING, START, BELOW)
    assert set(found) == {"reaction", "gap", "angle", "lid.reaction", "lid.force", "lid.work"}
    assert list(found)[:2] == ["reaction", "gap"]
    assert found["reaction"].value == pytest.approx(-2.9, rel=1e-9)
    assert found["reaction"].at == pytest.approx((-3.0, -3.0 + 0.1 * (1 - 0.1**0.6), -3.0 + 0.1 * (1 - 0.01**0.6)))
    assert found["reaction"].ratio == pytest.approx(10**0.6)
    assert found["lid.reaction"].value == pytest.approx(3.0, rel=1e-9)
    assert (found["gap"].value, found["gap"].ratio) == (0.5, None)
    assert found["lid.work"].value is None
    assert found["lid.work"].reason == "it is summed along the path, and known of the first gamma alone"


@pytest.mark.parametrize("missing", range(7))
def test_values_that_some_states_do_not_have(missing: int) -> None:
    """A half width may be unknown at one gamma: others do not take its place. What the run itself does not
    know has no limit."""
    lowering = Lowering({"gamma": 1e-3}, [10.0 ** (-k / 2) for k in range(7)])
    made = [
        record(n or 2, parameters={"gamma": 1e-3 * factor}, limit_of=2 if n else None, reaction=3.0 + factor**0.6,
               forces={} if n == missing else {"lid": {"reaction": 3.0 + factor**0.6}})
        for n, factor in enumerate(lowering.factors)
    ]  # fmt: skip
    found = limits_of(lowering, made[0], made[1:])
    assert found["reaction"].value == pytest.approx(3.0)
    if missing == 0:
        assert "lid.reaction" not in found
        return
    lid, at = found["lid.reaction"], found["lid.reaction"].at
    assert [math.isnan(value) for value in at] == [missing == n for n in (0, 2, 4, 6)]
    assert missing == 2 or at[1] == pytest.approx(3.0 + 0.1**0.6)
    if missing == 1:  # of seven the first two are not needed
        assert (lid.value, lid.reason) == (pytest.approx(3.0), None)
    else:
        assert (lid.value, lid.ratio, lid.reason) == (None, None, "it is not a number at every gamma")
    text = json.dumps(finite(GammaLimit((1e-3,), 3.98, found).as_dict()))
    again = GammaLimit.from_dict(json.loads(text)).values["lid.reaction"].at
    assert "NaN" not in text
    assert again == pytest.approx(at, nan_ok=True)
    assert tables.number(math.nan) == "–"


def test_too_few_states_have_no_limit() -> None:
    some = limits_of(LOWERING, START, BELOW[:4])["reaction"]
    assert (some.value, some.ratio, some.reason) == (None, None, "4 values of gamma, 5 are needed")
    assert len(some.at) == 2


@pytest.mark.parametrize(
    ("before", "start", "below", "done", "reason"),
    [
        ({"jumped": True}, {}, {}, {2: ""}, "the run jumped to another branch at load 0.1: which one belongs to"),
        ({}, {"jumped": True}, {}, {2: ""}, "the run jumped to another branch at load 0.2: which one belongs to"),
        ({}, {"negative_pivots": 2}, {}, {2: ""}, "the state is unstable (2 negative pivots): the medium may have"),
        ({}, {}, {"negative_pivots": 1}, {2: ""}, "the state at gamma = 0.0007 is unstable (1 negative pivots): the m"),
        ({}, {}, {"jumped": True}, {2: ""}, "a step to gamma = 0.0007 jumped to another branch"),
        ({}, {}, {}, {2: "solids would overlap"}, "gamma could not be lowered to the end: solids would overlap"),
        ({}, {}, {}, {1: ""}, "gamma could not be lowered to the end: gamma was not lowered at this load"),
        ({"negative_pivots": 3}, {"negative_pivots": None}, {}, {2: ""}, None),
    ],
)  # fmt: skip
def test_why_limits_are_withheld(
    before: dict[str, Any], start: dict[str, Any], below: dict[str, Any], done: dict[int, str], reason: str | None
) -> None:
    history = [record(1, **before), replace(START, **start)]
    lowered = [replace(BELOW[0], **below), *BELOW[1:], replace(BELOW[0], limit_of=1, negative_pivots=5)]
    made = limit_at_end(LOWERING, history, lowered, done, along_path=False, newton_iterations=7)
    entry = made.values["reaction"]
    assert (entry.value is None) == (reason is not None)
    assert (entry.reason or "").startswith(reason or "")
    assert entry.ratio == pytest.approx(10**0.6)
    assert (made.newton_iterations, made.path, made.by_medium) == (7, (), {})
    assert ("reaction" in made.withheld) == (reason is not None)
    doubted = limit_at_end(LOWERING, history, lowered, done, along_path=True, doubt="solids overlap")
    assert doubted.values["gap"].reason == "solids overlap"
    assert [point.step for point in doubted.path] == list(done)


def test_a_limit_is_plain_values_and_back() -> None:
    value = LimitValue(1.0, 0.25, 4.0, None, (2.0, 1.5))
    limit = GammaLimit(
        (1e-3, 1e-4), 3.98, {"gap": value, "x": LimitValue(None, None, None, "why")}, {"a": (1.0,)},
        (LimitPoint(3, 0.5, -0.1, {"gap": value}),), 12,
    )  # fmt: skip
    plain = json.loads(json.dumps(limit.as_dict()))
    assert plain["values"]["gap"] == {"value": 1.0, "uncertainty": 0.25, "ratio": 4.0, "reason": None, "at": [2.0, 1.5]}
    assert GammaLimit.from_dict(plain) == limit
    assert limit.withheld == {"x": "why"}
    assert "by_medium" not in replace(limit, by_medium={}).as_dict()
    for broken in (
        None,
        {},
        {**plain, "path": 3},
        {**plain, "values": {"gap": {"value": 1.0}}},
        {**plain, "gammas": ["x"]},
    ):
        with pytest.raises(TypeError, match="has the wrong form"):
            GammaLimit.from_dict(broken)


def test_a_limit_in_words() -> None:
    assert with_uncertainty(-0.0255291, 0.0000243) == "-0.025529 ± 0.000024"
    assert with_uncertainty(123.456, 0.99) == "123.46 ± 0.99"
    assert with_uncertainty(1234567.0, 2300.0) == "(1.2346 ± 0.0023)e+06"
    assert with_uncertainty(1.23e-5, 4.5e-7) == "(1.230 ± 0.045)e-05"
    assert with_uncertainty(0.5, 0.0) == "0.5 ± 0"
    assert with_uncertainty(200.0, 37.0) == "200 ± 37"
    assert with_uncertainty(2000.0, 370.0) == "(2.00 ± 0.37)e+03"
    assert with_uncertainty(0.0, 1e-3) == "0.0000 ± 0.0010"
    assert str(LimitValue(1.0, 0.1, None)) == "1.00 ± 0.10"
    assert str(LimitValue(None, None, None, "why")) == "withheld"


def test_where_gamma_is_lowered_along_a_path() -> None:
    """At the first step at or beyond each tenth, however long a branch is, and at stops."""

    def due(before: float, now: float, end: float = 1.0, stops: tuple[float, ...] = ()) -> bool:
        steps = [record(1, time=before), record(2, time=now)] if before else [record(1, time=now)]
        recorder: Any = SimpleNamespace(history=steps)
        nothing: Any = None
        return Descents(nothing, True, stops, end, nothing, recorder, nothing)._is_due()

    assert [due(0.0, now) for now in (0.05, 0.1, 0.1 - 1e-12, 0.15)] == [False, True, True, True]
    assert [due(0.1 - 1e-12, 0.1), due(0.11, 0.19), due(0.11, 0.2), due(1.25, 1.28), due(1.25, 1.31)] == [
        False, False, True, False, True,
    ]  # fmt: skip
    assert (due(0.11, 0.19, end=0.5), due(0.11, 0.14, end=0.5), due(0.11, 0.15, end=0.5)) == (True, False, True)
    assert (due(0.11, 0.19, stops=(0.15,)), due(0.11, 0.15 - 1e-12, stops=(0.15,))) == (True, True)
    assert (due(0.15, 0.19, stops=(0.15,)), due(0.11, 0.14, stops=(0.15,))) == (False, False)


def test_gamma_is_not_lowered_in_vain() -> None:
    """After a jump nothing has a limit, and elsewhere gamma was another one."""
    ended: list[str] = []
    nothing: Any = None

    def descend(*steps: StepRecord) -> list[str]:
        ended.clear()
        recorder: Any = SimpleNamespace(
            history=list(steps), lowered=SimpleNamespace(done={}), inputs={}, end_descent=ended.append
        )
        with pytest.raises(AttributeError) if not any(step.jumped for step in steps) else nullcontext():
            Descents(Lowering({"gamma": 1e-4}, [1.0]), True, (), 1.0, nothing, recorder, nothing).descend(nothing)
        return list(ended)

    assert descend(record(1), record(2)) == []  # it begins: there is no solver here
    assert descend(record(1, jumped=True), record(2)) == ["the run jumped to another branch before"]
    assert descend(record(1), record(2, jumped=True)) == ["the run jumped to another branch before"]


def test_progress_says_a_line_a_decade(capsys: pytest.CaptureFixture[str]) -> None:
    from tmc_vem.cli.progress import ConsoleMonitor

    monitor = ConsoleMonitor()
    for number, gamma in ((1, 1e-4), (1, 3e-5), (1, 1e-5), (1, 5e-6), (2, 5e-5), (2, 4e-5)):
        monitor.lowered(record(3, limit_of=number, parameters={"gamma": gamma}))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "load 0.300 with gamma 1.00e-04, gap 0.5, 1 iterations"
    assert [line.split("gamma ")[1][:8] for line in lines] == ["1.00e-04", "1.00e-05", "5.00e-05"]
