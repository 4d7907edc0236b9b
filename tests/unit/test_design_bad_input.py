"""What is wrong with a search for a design is said in one line, and before anything long is done."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from tmc_vem.cli.main import _run

TEXT = """
name = "plate"
[shapes]
plate = { rectangle = [0, 0, 2, 1] }
below = { rectangle = [0, -0.5, 2, 0] }
[mesh]
cells = "grid"
size = 0.25
[regions.design]
shape = "plate"
solid = { E = 100, nu = 0.3 }
medium = { gamma = 1e-4, alpha_r = 0.1 }
[regions.below]
shape = "below"
medium = { gamma = 1e-4, alpha_r = 0.1 }
[edges]
wall = { line = [[0, 0], [0, 1]] }
end = { line = [[2, 0], [2, 1]] }
floor = { line = [[0, -0.5], [2, -0.5]] }
[[support]]
at = "wall"
ux = 0
uy = 0
[[support]]
at = "floor"
ux = 0
uy = 0
[load]
at = "end"
uy = -0.01
[solve]
steps = 1
[design]
minimise = "reaction"
volume = 0.5
iterations = 2
method = "oc"
"""


def said(tmp_path: Path, capsys: pytest.CaptureFixture[str], *changes: str, code: int = 2) -> str:
    """What a search says at last."""
    (tmp_path / "plate.toml").write_text(TEXT)
    words = [word for change in changes for word in ("--set", change)]
    options = ["--quiet", "--no-final", "--no-animation", "--out", str(tmp_path / "found"), "--overwrite"]
    assert _run(["optimise", str(tmp_path / "plate.toml"), *words, *options]) == code
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("design.filter.radius=3", "radius = 3 is larger than the design, whose extent is 2: all densities would be"),
        ("design.passive=[{is='void',box=[5,5,6,6]}]", "no cell has its centroid in (5.0, 5.0, 6.0, 6.0): the mesh"),
        ("design.passive=[{is='void',circle=[1,1,-1]}]", "design: passive: radius of the circle = -1"),
        ("design.passive=[{is='solid',box=[0,0,2,0.8]}]", "of its area: use a volume in between"),
        ("design.minimise=displacement", "minimise = 'displacement' does not depend on the design: its derivative is"),
        ("solve.element.interior_penalty=full", 'leave it out (--interior-penalty none, or interior_penalty = "none")'),
    ],
)
def test_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], change: str, message: str) -> None:
    err = said(tmp_path, capsys, change)
    assert message in err
    assert err.count("\n") == 1
    assert not list((tmp_path / "found" / "evaluations").glob("*.npz"))


def test_a_design_may_be_less_than_its_volume(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Void parts leave less than the largest volume: that is no fault."""
    said(tmp_path, capsys, "design.volume=0.6", "design.passive=[{is='void',box=[0,0,2,0.5]}]", code=0)


def test_a_filter_that_does_nothing_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    err = said(tmp_path, capsys, "design.filter.radius=0.1", code=0)
    assert "radius = 0.1 is smaller than the cells, which are 0.25 wide: it filters nothing" in err


def test_no_equilibrium(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    err = said(tmp_path, capsys, "load={at='end',traction=[0,-500]}", "design.minimise=compliance")
    assert "the first design could not be evaluated (plate: no equilibrium was found at full load" in err
    assert "begin with a stiffer one (start = 1), apply a smaller load" in err


def test_nlopt_is_missed_before_a_design_is_evaluated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "nlopt", None)
    err = said(tmp_path, capsys, "design.method=mma")
    assert "the method 'mma' needs nlopt" in err
    assert not (tmp_path / "found").exists()


def test_directories_of_searches_are_no_runs_and_keep_their_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said(tmp_path, capsys, code=0)
    found = str(tmp_path / "found")
    for words in (
        ("plot", found),
        ("animate", found),
        ("gradient", found, "--of", "reaction", "--by", "load.uy"),
    ):
        assert _run(list(words)) == 2
        assert f"is run in {tmp_path / 'found' / 'final'}" in capsys.readouterr().err
    words = ["gradient", f"{found}/final.toml", "--of", "reaction", "--by", "regions.design.stiffness", "--quiet"]
    assert _run(words) == 2
    assert "or 'design.stiffness', by which the stiffnesses of all cells are multiplied" in capsys.readouterr().err
    assert _run(["optimise", str(tmp_path / "plate.toml"), "--out", found]) == 2
    assert "has a search for a design in it: choose another, or say --overwrite" in capsys.readouterr().err
    before = (tmp_path / "found" / "result.json").read_bytes()
    assert _run(["resume", found, "--iterations", "1"]) == 2
    assert "has 2 evaluations, more than iterations = 1: give 2 or more" in capsys.readouterr().err
    assert (tmp_path / "found" / "result.json").read_bytes() == before
    shutil.rmtree(tmp_path / "found")
