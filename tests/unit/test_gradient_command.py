"""The command ``tmc-vem gradient``: files, benchmarks and run directories; tables, cells, differences, errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from helpers_sensitivity import SEAL
from matplotlib.image import imread

from tmc_vem.cli.main import _run
from tmc_vem.cli.resume import read_command
from tmc_vem.sensitivity.per_cell import short_names

BOX = ("box", "--set", "cells=[20,5]", "--set", "solve.steps=8", "--set", "medium.gamma=1e-3")
E_OF_FOOT, GAMMA = "regions.foot.solid.E", "regions.medium.medium.gamma"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Directory with a problem file, its run with another entry, and the run of a benchmark."""
    where = tmp_path_factory.mktemp("runs")
    (where / "plug.toml").write_text(
        SEAL + 'units = { length = "mm", force = "N" }\nsolve = { steps = 4, snapshots = 0 }\n'
    )
    words = ["run", str(where / "plug.toml"), "--set", f"{E_OF_FOOT}=30", "--quiet", "--out", str(where / "plug")]
    assert _run(words) == 0
    words = ["run", "box", "--cells", "20", "5", "--gamma", "1e-3", "--steps", "8", "--snapshots", "0", "--quiet"]
    assert _run([*words, "--out", str(where / "box")]) == 0
    return where


def said(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> tuple[str, str]:
    assert _run(["gradient", *words]) == code
    out, err = capsys.readouterr()
    return out, err


def read(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    return dict(json.loads(said(capsys, *words, "--json")[0]))


def test_a_directory_of_a_file_says_the_same_as_the_file(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ("--of", "gap", "--of", "hold", "--by", E_OF_FOOT, "--by", "load.uy", "--of", "gap")
    of_directory = read(capsys, str(runs / "plug"), *names)
    of_file = read(capsys, str(runs / "plug.toml"), "--set", f"{E_OF_FOOT}=30", *names)
    assert len(of_directory["derivatives"]) == 4
    assert of_directory["schema"] == 1
    assert (of_directory["problem"], of_directory["load"], of_directory["doubts"]) == ("plug", 1.0, [])
    for a, b in zip(of_directory["derivatives"], of_file["derivatives"], strict=True):
        assert a["derivative"] == pytest.approx(b["derivative"], rel=1e-7)
        assert a["elasticity"] == pytest.approx(a["number"] / a["value"] * a["derivative"])
    first = of_directory["derivatives"][0]
    assert (first["number"], first["units"]) == (30.0, {"value": "mm", "number": "N/mm^2", "derivative": "mm^3/N"})


def test_a_directory_of_a_benchmark_is_understood(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ("--of", "gap", "--of", "reaction", "--by", "material.mu", "--by", "uy")
    ours, solved = read(capsys, str(runs / "box"), *names), read(capsys, *BOX, *names)
    assert read_command(runs / "box")[0] == "box"
    for a, b in zip(ours["derivatives"], solved["derivatives"], strict=True):
        assert a["derivative"] == pytest.approx(b["derivative"], rel=1e-6)
    assert any("reaction squeezes the medium" in text for text in solved["cautions"])


def test_what_is_printed(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = said(capsys, str(runs / "plug"), "--of", "gap", "--by", E_OF_FOOT, "--by", "load.uy", "--check")
    head, first, second = out.splitlines()
    assert head.split() == ["result", "value", "number", "value", "derivative", "elasticity", "central", "difference",
                            "differs", "by"]  # fmt: skip
    assert first.split()[:6] == ["gap", first.split()[1], "mm", E_OF_FOOT, "30", "N/mm^2"]
    assert all(float(line.split()[-1]) < 1e-6 for line in (first, second))
    assert err == ""


def test_derivatives_in_cells(runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "cells.vtu"
    names = ("--of", "gap", "--of", "hold", "--by", E_OF_FOOT, "--by", GAMMA, "--by", "load.uy")
    found = read(capsys, str(runs / "plug"), *names, "--per-cell", "--out", str(target))
    assert found["files"] == [str(target), str(target.with_suffix(".png"))]
    mesh = meshio.read(target)
    assert "d(gap)/d(uy)" not in mesh.cell_data  # a load belongs to no cells
    for entry in found["derivatives"]:
        if entry["by"] == "load.uy":
            continue
        name = f"d({entry['of']})/d({entry['by'].rpartition('.')[2]})"
        total = sum(float(block.sum()) for block in mesh.cell_data[name])
        assert total == pytest.approx(entry["derivative"], rel=1e-10)
        region = np.concatenate(mesh.cell_data["region"])
        values = np.concatenate(mesh.cell_data[name])
        has = np.abs(values) > 0.0
        assert len(set(region[has])) == 1
        assert has.sum() == (region == region[has][0]).sum()
        assert f"{name} per area" in mesh.cell_data
    assert 'Name="d(gap)/d(E)"' in target.read_text()
    assert "mm^3/N</InformationKey>" in target.read_text()
    picture = imread(target.with_suffix(".png"))
    assert min(picture.shape[:2]) > 300
    out, _ = said(capsys, str(runs / "plug"), *names[:2], *names[4:6], "--per-cell", "--out", str(target))
    assert out.splitlines()[-2:] == found["files"]


def test_where_cells_go_without_a_name(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    said(capsys, str(runs / "plug"), "--of", "gap", "--by", E_OF_FOOT, "--per-cell")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plug-gradient.png", "plug-gradient.vtu"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nothing"], "'nothing' is no run directory, and neither a problem file, NAME.toml, nor a benchmark (box"),
        (["nothing.toml"], "nothing.toml cannot be read: No such file or directory"),
        (["{runs}"], "has no problem.toml, as no run of a benchmark from Python has"),
        (["{runs}/plug", "--set", "load.uy=-0.1"], "--set is for what is solved, and"),
        (["{runs}/plug", "--method", "fem"], "--method is for what is solved, and"),
        (["{runs}/plug", "--out", "a.vtu"], "--out a.vtu is where --per-cell writes"),
        (["{runs}/plug", "--per-cell", "--out", "a.png"], "--out a.png: derivatives per cell are written as .vtu"),
        (["{runs}/plug", "--per-cell", "--out", "no/a.vtu"], "--out no/a.vtu: there is no directory no"),
        (["{runs}/plug", "--per-cell", "--by", "load.uy"], "'load.uy' belongs to no cells"),
        (["{runs}/plug", "--of", "gaap"], "unknown result 'gaap' (did you mean 'gap'?)"),
        (["{runs}/plug", "--by", "mesh.size"], "'mesh.size' makes the mesh"),
        (["{runs}/plug", "--by", "regions.foot.solid.c10"], "'regions.foot.solid.c10' is not given"),
        (["box", "--set", "medium.friction=0.3"], "region 'medium' has friction"),
        (["box", "--set", "cells=[20,5]", "--set", "solve.element.interior_penalty=full"], "leave it out (--interior"),
        (["box", "--set", "cells=[20,5]", "--by", "wall"], "'wall' makes the mesh"),
    ],
)  # fmt: skip
def test_errors_are_one_line(words: list[str], message: str, runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = [word.format(runs=runs) for word in words]
    of = [] if "--of" in given else ["--of", "gap"]
    by = [] if "--by" in given else ["--by", "uy" if given[0] == "box" else E_OF_FOOT]
    _, err = said(capsys, *given, *of, *by, code=2)
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_a_seal_agrees_with_differences(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The demo problem: bodies in contact, Voronoi cells of several sizes."""
    names = ("--of", "gap", "--of", "ground_force", "--of", "contact.seal.force_y", "--of", "p_norm.von_mises.seal")
    seal = Path(__file__).parents[2] / "demos" / "problems" / "seal.toml"
    found = read(capsys, str(seal), *names, "--by", "regions.seal.solid.mu", "--by", "load.uy", "--check")
    assert len(found["derivatives"]) == 8
    assert max(entry["deviation"] for entry in found["derivatives"]) < 2e-6
    assert any("J < 0 between the quadrature points" in text for text in found["cautions"])


def test_names_are_needed(capsys: pytest.CaptureFixture[str]) -> None:
    for missing, given in (("--of", "--by"), ("--by", "--of")):
        assert f"Missing option '{missing}'" in said(capsys, "box", given, "gap", code=2)[1]


def test_runs_that_do_not_get_to_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    _, err = said(capsys, *BOX, "--set", "solve.max_iterations=3", "--of", "gap", "--by", "uy", "--quiet", code=3)
    assert "stopped at load 0" in err
    assert "there are no derivatives" in err


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["regions.foot.solid.E", "load.uy"], ["E", "uy"]),
        (["regions.foot.solid.E", "regions.block.solid.E"], ["foot.solid.E", "block.solid.E"]),
        (["uy", "load.uy"], ["uy", "load.uy"]),
        (["load.uy"], ["uy"]),
    ],
)
def test_short_names_tell_numbers_apart(names: list[str], short: list[str]) -> None:
    assert list(short_names(names).values()) == short
