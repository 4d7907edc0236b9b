"""The generated C text: unchanged unless somebody wants a change, and the same in every process."""

from __future__ import annotations

import difflib
import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tmc_vem.energy import PAPER_DENSITIES

GOLDEN = Path(__file__).parents[1] / "golden"


def load_update():
    spec = importlib.util.spec_from_file_location("golden_update", GOLDEN / "update.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


update = load_update()


@pytest.mark.parametrize("name", PAPER_DENSITIES)
def test_generated_c_has_not_drifted(name):
    path = GOLDEN / f"{name}.c"
    kept = path.read_text() if path.exists() else ""
    generated = update.golden_text(name)
    diff = difflib.unified_diff(kept.splitlines(), generated.splitlines(), str(path.name), "generated now", lineterm="")
    assert kept == generated, f"if this is wanted, run: {update.COMMAND}\n" + "\n".join(diff)


def test_one_file_for_each_energy_and_no_others():
    assert {path.stem for path in GOLDEN.glob("*.c")} == set(PAPER_DENSITIES)


def test_text_does_not_depend_on_the_hash_seed():
    code = (
        f"import runpy; module = runpy.run_path({str(GOLDEN / 'update.py')!r});"
        "print(module['golden_text']('medium_huhu_lulu_damped'))"
    )
    texts = []
    for seed in ("1", "2", "271828"):
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        texts.append(run.stdout)
    assert texts[0].strip() == (GOLDEN / "medium_huhu_lulu_damped.c").read_text().strip()
    assert texts[0] == texts[1] == texts[2]


@pytest.mark.parametrize("name", PAPER_DENSITIES)
def test_one_logarithm_and_one_exponential_of_j_and_no_power(name):
    text = (GOLDEN / f"{name}.c").read_text()
    for kernel in text.split("static void ")[1:]:
        assert len(re.findall(r"\blog\(", kernel)) == 1
        assert len(re.findall(r"\bexp\(", kernel)) == (2 if "damped" in name else 1)  # exp(-beta J) is the other
        assert "pow(" not in kernel
        assert kernel.count("1.0/J") <= 1


def test_zero_entries_of_the_hessian_are_not_computed():
    """The solid has 10 of the 78; without damping, psi_r = (6) adds the diagonal of B and no A."""
    solid = (GOLDEN / "solid.c").read_text()
    assert sorted(map(int, set(re.findall(r"h\[(\d+)\]\[v\]", solid)))) == [0, 1, 2, 3, 12, 13, 14, 23, 24, 33]
    assert len(set(re.findall(r"h\[(\d+)\]\[v\]", (GOLDEN / "medium_huhu.c").read_text()))) == 10 + 8
