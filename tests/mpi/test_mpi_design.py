"""Searches for a design on several ranks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers_design import design_rows
from helpers_process import process

from tmc_vem.design.record import read_records

PROGRAM = str(Path(__file__).with_name("design_by_rank.py"))
# MMA of nlopt finds its multipliers by an iteration, so that rounding becomes a thousand times larger in every design.
CLOSE = {"oc": 1e-8, "mma": 1e-6}


def test_one_and_two_ranks_search_alike(tmp_path: Path) -> None:
    for ranks in (1, 2):
        there = tmp_path / str(ranks)
        there.mkdir()
        done = process([PROGRAM, str(there)], ranks=ranks)
        assert done.returncode == 0, done.stderr
    for method, close in CLOSE.items():
        one, two = (design_rows(tmp_path / ranks / method) for ranks in "12")
        assert len(one) == len(two) == 6
        for name in ("objective", "volume", "change", "down.compliance", "up.compliance"):
            first, second = (np.array([float(row[name]) for row in rows]) for rows in (one, two))
            assert first == pytest.approx(second, rel=close, abs=close * np.abs(first).max()), (method, name)
        # the same design is worth the same to rounding
        (first,), (second,) = (read_records(tmp_path / ranks / method / "evaluations", 32, 1) for ranks in "12")
        assert first.z.tobytes() == second.z.tobytes()
        assert first.evaluation.objective == pytest.approx(second.evaluation.objective, rel=1e-12)
        assert first.evaluation.gradient == pytest.approx(second.evaluation.gradient, rel=1e-10)
