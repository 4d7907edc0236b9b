"""``tmc-vem mesh``: generate, info, check, plot."""

from __future__ import annotations

import re

import pytest

from tmc_vem.cli.main import main
from tmc_vem.mesh.files.io import read_mesh


def call(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        main(["mesh", *map(str, arguments)])
    out = capsys.readouterr()
    return left.value.code, out.out, out.err


@pytest.mark.parametrize(
    ("arguments", "suffix"),
    [
        (["rectangle", "--size", "0.2"], ".vtu"),
        (["rectangle", "--size", "0.2", "--kind", "triangles"], ".msh"),
        (["rectangle", "--size", "0.2", "--kind", "quadrilaterals"], ".inp"),
        (["box", "--cells", "20", "5", "--refine-medium", "2"], ".obj"),
        (["cbox", "--cells", "10", "5"], ".vtk"),
        (["punch", "--size", "0.2"], ".vtu"),
        (["bodies", "--discs", "1"], ".vtu"),
    ],
)
def test_generate_then_info_check_and_plot(arguments, suffix, tmp_path, capsys):
    file = tmp_path / f"mesh{suffix}"
    code, out, _ = call(capsys, "generate", *arguments, "--out", file)
    assert code == 0
    mesh = read_mesh(file)
    assert f"{mesh.n_cells} cells, {mesh.n_vertices} vertices written to" in out
    code, out, _ = call(capsys, "info", file)
    assert code == 0
    assert "l = " in out
    assert "degrees of freedom" in out
    code, out, _ = call(capsys, "check", file)
    assert (code, "no faults" in out) == (0, True)
    code, out, _ = call(capsys, "plot", file, "--out", tmp_path / "mesh.png")
    assert code == 0
    assert (tmp_path / "mesh.png").stat().st_size > 5000


def test_info_names_the_projection_of_cells_with_hanging_nodes(tmp_path, capsys):
    file = tmp_path / "mesh.vtu"
    assert call(capsys, "generate", "box", "--cells", "20", "5", "--refine-medium", "2", "--out", file)[0] == 0
    _, out, _ = call(capsys, "info", file)
    assert re.search(r"^ *l = 3 +\d+ with 4 sides *$", out, re.MULTILINE)
    assert re.search(r"^ *composite +42 with 5 sides *$", out, re.MULTILINE)


def test_info_counts(tmp_path, capsys):
    call(capsys, "generate", "box", "--cells", 20, 5, "--refine-medium", 2, "--out", tmp_path / "b.vtu")
    _, out, _ = call(capsys, "info", tmp_path / "b.vtu")
    text = " ".join(out.split())
    assert "220 with 4 sides, 42 with 5 sides" in text
    assert "region solid 46 cells, area 0.46" in text
    assert "region medium 216 cells, area 0.54" in text


def test_check_names_faults_and_fixes_them(tmp_path, capsys):
    file = tmp_path / "bad.obj"
    file.write_text("v 0 0\nv 1 0\nv 1 1\nv 0 1\nv 9 9\nv 2 0\nv 2 1\nv 1 0\nf 4 3 2 1\nf 8 6 7 3\n")
    code, out, _ = call(capsys, "check", file)
    assert code == 1
    assert "note: a cell is clockwise and turned: cell 0" in out
    assert "note: a vertex belongs to no cell and is left out: vertex 4" in out
    assert "vertices 1 and 6 are both at (1, 0)" in out
    assert "--fix repairs this" in out
    code, out, _ = call(capsys, "check", file, "--fix", tmp_path / "good.vtu")
    assert (code, "1 fault repaired" in out) == (0, True)
    assert call(capsys, "check", tmp_path / "good.vtu")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["info", "none.vtu"], "mesh file none.vtu does not exist"),
        (["generate", "rectangle", "--size", "-1", "--out", "x.vtu"], "--size = -1 must be a positive number"),
        (["generate", "rectangle", "--out", "x.abc"], "unknown mesh format '.abc'"),
        (["generate", "box", "--cells", "30", "10", "--out", "x.vtu"], "do not resolve the wall"),
        (["generate", "punch", "--out", "x.msh"], "triangles and quadrilaterals only"),
    ],
)
def test_bad_input_is_one_line(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = call(capsys, *arguments)
    assert code == 2
    assert message in err
    assert err.count("\n") == 1
