"""Derivatives on one, two and three ranks: the same numbers; and the command on two."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest
from helpers_process import process, tmc
from helpers_sensitivity import SEAL

SCRIPT = Path(__file__).resolve().parent / "sensitivity_by_rank.py"


@cache
def numbers(n_ranks: int, method: str) -> dict[str, float]:
    done = process([str(SCRIPT), method], ranks=n_ranks)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize("n_ranks", [2, 3])
def test_derivatives_do_not_depend_on_the_ranks(n_ranks: int, method: str) -> None:
    one, several = numbers(1, method), numbers(n_ranks, method)
    assert len(one) > 100
    assert one.keys() == several.keys()
    for name, value in one.items():
        assert several[name] == pytest.approx(value, rel=1e-9, abs=1e-13), name


def test_the_command_on_two_ranks(tmp_path: Path) -> None:
    """A run directory of two ranks, read by one and by two; files of cells are whole."""
    (tmp_path / "plug.toml").write_text(SEAL + "solve = { steps = 4, snapshots = 0 }\n")
    done = tmc("run", "plug.toml", "--out", "out", "--quiet", ranks=2, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    words = ("--of", "gap", "--by", "regions.foot.solid.E", "--per-cell", "--json")
    told = []
    for n_ranks, source in ((0, "out"), (2, "out"), (2, "plug.toml")):
        done = tmc("gradient", source, *words, "--out", f"{n_ranks}.vtu", ranks=n_ranks, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        told.append(json.loads(done.stdout)["derivatives"][0]["derivative"])
    assert told[1:] == pytest.approx(told[:1] * 2, rel=1e-7)
    sizes = [(tmp_path / f"{n}.vtu").stat().st_size for n in (0, 2)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.2)
    done = tmc("gradient", "out", "--of", "gaap", "--by", "load.uy", ranks=2, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("unknown result 'gaap'")) == (2, 1)
