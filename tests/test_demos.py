"""Every demo runs with --quick; each asserts its own numbers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DEMOS = sorted((ROOT / "demos").glob("demo_*.py"))


@pytest.mark.parametrize("demo", DEMOS, ids=lambda demo: demo.stem)
def test_demo_runs_quickly(demo: Path, tmp_path: Path) -> None:
    arguments = ["--quick", "--out", str(tmp_path / "runs")]
    done = subprocess.run(
        [sys.executable, str(demo), *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_there_are_demos() -> None:
    assert DEMOS
