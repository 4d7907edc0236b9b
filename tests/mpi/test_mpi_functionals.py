"""Derivatives of results on one, two and three ranks: the same numbers."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest
from helpers_process import process

SCRIPT = Path(__file__).resolve().parent / "functionals_by_rank.py"


@cache
def numbers(n_ranks: int) -> dict[str, float]:
    done = process([str(SCRIPT)], ranks=n_ranks)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize("n_ranks", [2, 3])
def test_derivatives_do_not_depend_on_the_ranks(n_ranks: int) -> None:
    one, several = numbers(1), numbers(n_ranks)
    assert len(one) > 400
    assert one.keys() == several.keys()
    for name, value in one.items():
        assert several[name] == pytest.approx(value, rel=1e-10, abs=1e-12), name
