"""Every demo runs with --quick; each asserts its own numbers."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers_process import process

ROOT = Path(__file__).parents[1]
SLOW = ("demo_belt", "demo_cattaneo", "demo_shear_lag", "demo_sliding_block", "demo_snap_fit")
DEMOS = [
    pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem in SLOW else [])
    for path in sorted((ROOT / "demos").glob("demo_*.py"))
]


@pytest.mark.parametrize("demo", DEMOS)
def test_demo_runs_quickly(demo: Path, tmp_path: Path) -> None:
    done = process([str(demo), "--quick", "--out", str(tmp_path / "runs")], cwd=tmp_path, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_there_are_demos() -> None:
    assert DEMOS
