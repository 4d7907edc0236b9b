"""Results that look converged and should not be quoted as they are."""

from __future__ import annotations

from typing import Any

import pytest

from tmc_vem import Box, Medium, run
from tmc_vem.plausibility import warnings_of
from tmc_vem.results import StepRecord


def record(load: float = 1.0, **changes: Any) -> StepRecord:
    values: dict[str, Any] = {
        "step": 1, "load": load, "displacement": -load, "probes": {}, "reaction": -1.0, "iterations": 3, "cut_backs": 0,
        "wasted_iterations": 0, "min_j": {"solid": 0.8, "medium": 0.01}, "energy": {"solid": 1.0, "medium": 0.01},
        "negative_pivots": 0, "jumped": False, "seconds": 0.0,
    }  # fmt: skip
    return StepRecord(**{**values, **changes})


def found(
    *history: StepRecord, inputs: dict[str, Any] | None = None, checks: dict[str, Any] | None = None
) -> list[str]:
    return warnings_of(inputs or {"medium": {"gamma": 1e-5}}, history, checks or {}, ["medium"], 2.0)


def test_a_good_result_has_no_warnings() -> None:
    early = record(0.1, min_j={"solid": 0.9, "medium": 0.9}, energy={"solid": 0.1, "medium": 0.001})
    assert found(early, record()) == []
    assert found() == []


@pytest.mark.parametrize(
    ("history", "message"),
    [
        ([record(negative_pivots=2)], "unstable"),
        ([record(0.5, jumped=True), record()], "jumped to another one at load 0.5"),
        ([record(min_j={"solid": 0.1, "medium": 0.01})], "smallest J in region 'solid' is 0.1, below 0.2"),
        ([record(min_j={"solid": 0.8, "medium": 1e-7})], "smallest J in region 'medium' is 1e-07, below 1e-06"),
        ([record(energy={"solid": 1.0, "medium": 0.1})], "the medium holds 9.1% of the energy"),
        (
            [record(0.1, min_j={"solid": 1, "medium": 0.9}, energy={"solid": 0.1, "medium": 0.05}), record()],
            "the medium takes 33% of the work before contact",
        ),
    ],
)
def test_doubtful_results_are_said(history: list[StepRecord], message: str) -> None:
    (text,) = found(*history)
    assert message in text


def test_inputs_and_overlaps_are_said() -> None:
    assert "gamma = 0.05 is above 0.01" in found(record(), inputs={"medium": {"gamma": 0.05}})[0]
    checks = {"penetration_depth": 1e-3, "overlap_area": 0.0, "summary": "solids overlap"}
    assert "solids overlap" in found(record(), checks=checks)[0]
    assert found(record(), checks={**checks, "penetration_depth": 1e-9}) == []


def test_a_run_says_them() -> None:
    stiff = run(Box(cells=(20, 5), uy=-0.2, medium=Medium(gamma=0.05)))
    assert any("gamma = 0.05" in text for text in stiff.warnings)
    assert any("work before contact" in text for text in stiff.warnings)
    soft = run(Box(cells=(20, 5), uy=-0.2, medium=Medium(gamma=1e-6)))
    assert list(soft.warnings) == []
