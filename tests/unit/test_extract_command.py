"""The command ``tmc-vem extract``: from the directory of a search to files that run, pictures, report and numbers."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from tmc_vem.cli.main import _run
from tmc_vem.design import extract_run
from tmc_vem.design.extract_directory import FOUND
from tmc_vem.report.design_figure import VOLUMES, history_figure
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.problem_file import read_problem

# A plate that hangs at its left side, pulled at its right one; a slot of void is passive.
TEXT = """
name = "plate"
[shapes]
plate = { rectangle = [0, 0, 2, 1] }
[mesh]
cells = "grid"
size = 0.125
[regions.design]
shape = "plate"
solid = { E = 100, nu = 0.3 }
medium = { gamma = 1e-4, alpha_r = 0.1 }
[points]
corner = [2, 1]
[edges]
wall = { line = [[0, 0], [0, 1]] }
end = { line = [[2, 0], [2, 1]] }
[probes]
up = { displacement = "uy", at = "corner" }
[[support]]
at = "wall"
ux = 0
uy = 0
[load]
at = "end"
ux = 0.05
[solve]
steps = 2
[design]
minimise = "reaction"
start = 1.0
iterations = 1
filter = { kind = "none" }
passive = [{ is = "void", box = [0.5, 0.5, 1.25, 0.75] }]
"""
CASES = 'cases = [{ name = "pull" }, { name = "shear", set = { load = { at = "end", uy = 0.05 } } }]\n'


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> tuple[str, str]:
    assert _run(list(words)) == code
    out, err = capsys.readouterr()
    return out, err


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory of a search; its densities are solid and void."""
    where = tmp_path_factory.mktemp("plate")
    (where / "plate.toml").write_text(TEXT)
    assert _run(["optimise", str(where / "plate.toml"), "--out", str(where / "plate"), "--quiet"]) == 0
    return where / "plate"


def test_run_and_comparison(found: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Densities of 0 and 1 with straight borders do nearly what their outlines do; the files run."""
    out, err = said(capsys, "extract", str(found), "--run", "--out", str(tmp_path / "o"), "--smoothing", "0")
    assert "reaction" in out
    assert "1 hole" in out
    assert "2 degrees" not in err
    data: dict[str, Any] = json.loads((tmp_path / "o" / FOUND).read_text())
    rows = {row["name"]: row for row in data["compared"][""]["quantities"]}
    assert data["compared"][""]["load"] == 1.0
    assert data["grey"] == 0.0
    assert rows["reaction"]["extracted"] == pytest.approx(rows["reaction"]["design"], rel=0.02)
    assert rows["reaction"]["design"] == RunResult.read(found / "final").reaction
    assert {"volume", "displacement", "up"} <= rows.keys()
    assert rows["volume"]["design"] == pytest.approx(2.0 - 0.75 * 0.25)
    assert RunResult.read(tmp_path / "o" / "run").complete
    page = (tmp_path / "o" / "report.md").read_text()
    assert "body-fitted" in page
    assert "| reaction |" in page
    for name in ("outlines.png", "curves.png"):
        assert imread(tmp_path / "o" / name).shape[1] > 600
    problem, _ = read_problem(tmp_path / "o" / "extracted.toml")
    assert problem.table.design is None
    assert set(problem.make_mesh().region_names) == {"solid", "medium"}


def killed(*_: Any, **__: Any) -> None:
    raise RuntimeError("killed")


def test_default_place_and_options(
    found: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = tmp_path / "plate"
    shutil.copytree(found, directory)
    shutil.rmtree(directory / "final")
    data = json.loads(said(capsys, "extract", str(directory), "--json", "--level", "0.4", "--size", "0.25")[0])
    assert (data["level"], data["files"], data["compared"]) == (0.4, {"": "extracted.toml"}, {})
    finer = json.loads(
        said(capsys, "extract", str(directory), "--json", "--size", "0.0625", "--out", str(tmp_path / "fine"))[0]
    )
    assert finer["n_cells"] > 3 * data["n_cells"]
    _, err = said(capsys, "extract", str(directory), code=2)
    assert "has outlines in it: choose another, or say --overwrite" in err
    out, _ = said(capsys, "extract", str(directory), "--overwrite", "--run")  # no run of the densities is there
    assert "reaction" in out
    with monkeypatch.context() as patched:  # a kill on the way leaves what the next one may replace
        patched.setattr(extract_run, "write_extracted", killed)
        with pytest.raises(RuntimeError):
            _run(["extract", str(directory), "--overwrite", "--quiet"])
    said(capsys, "extract", str(directory), "--overwrite", "--quiet")
    assert not (directory / "outlines" / "run").exists()
    assert not (directory / "outlines" / "curves.png").exists()


def test_load_cases_have_one_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plate.toml").write_text(TEXT + CASES)
    said(capsys, "optimise", str(tmp_path / "plate.toml"), "--out", str(tmp_path / "plate"), "--quiet")
    data = json.loads(said(capsys, "extract", str(tmp_path / "plate"), "--run", "--json")[0])
    assert data["files"] == {"pull": "extracted-pull.toml", "shear": "extracted-shear.toml"}
    meshes = [(tmp_path / "plate/outlines" / f"extracted-{case}.vtu").read_bytes() for case in ("pull", "shear")]
    assert meshes[0] == meshes[1]
    reactions = {
        case: {row["name"]: row for row in of["quantities"]}["reaction"] for case, of in data["compared"].items()
    }
    assert reactions["pull"]["design"] > 2 * reactions["shear"]["design"] > 0.0
    for row in reactions.values():
        assert abs(row["difference"]) < 0.1


def test_grey_designs_are_called_so(found: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    directory = tmp_path / "plate"
    shutil.copytree(found, directory)
    arrays = dict(np.load(directory / "stiffness.npz"))
    arrays["density_c"] = np.where(arrays["density_c"] > 0.5, 0.9, 0.2)
    np.savez(directory / "stiffness.npz", **arrays)
    out, _ = said(capsys, "extract", str(directory))
    assert "the densities are grey: 4 x (1 - x) is 3" in out  # 0.36 in most cells, 0.64 in the slot


def test_bad_input(found: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words, message in (
        ((str(tmp_path),), "is not a directory of 'tmc-vem optimise'"),
        ((str(found / "final"),), "is not a directory of 'tmc-vem optimise'"),
        ((str(found), "--level", "2"), "level = 2"),
        ((str(found), "--size", "-1"), "size = -1"),
        ((str(found), "--out", str(found)), "has other things in it"),
        ((str(found), "--out", str(found / "final")), "has other things in it"),
    ):
        assert message in said(capsys, "extract", *words, code=2)[1]
    directory = tmp_path / "plate"
    shutil.copytree(found, directory)
    (directory / "stiffness.npz").unlink()
    assert "stiffness.npz cannot be read" in said(capsys, "extract", str(directory), code=2)[1]
    arrays = dict(np.load(found / "stiffness.npz"))
    np.savez(directory / "stiffness.npz", **{name: arrays[name] for name in ("centroid_cx", "stiffness_c")})
    assert "no array density_c" in said(capsys, "extract", str(directory), code=2)[1]
    assert not (directory / "outlines").exists()
    (directory / "result.json").unlink()
    assert "has no result yet" in said(capsys, "extract", str(directory), code=2)[1]


def test_a_constant_volume_is_drawn_as_constant() -> None:
    """And not as its rounding errors."""
    rows = [
        {"evaluation": str(n), "better": "1", "objective": str(1 / n), "volume": str(0.7 + n * 1e-15), "level": "0"}
        for n in (1, 2, 3)
    ]
    low, high = history_figure(rows, "reaction", []).axes[1].get_ylim()
    assert high - low == pytest.approx(VOLUMES)
    assert (low + high) / 2 == pytest.approx(0.7)
