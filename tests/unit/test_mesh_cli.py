"""``tmc-vem mesh``: generate, info, check, plot."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tmc_vem.cli import mesh as commands
from tmc_vem.cli.main import main
from tmc_vem.mesh.files.io import read_mesh
from tmc_vem.mesh.make.outline import Region
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.problems import Bodies, Box, CBox, Punch


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


# -- what is generated -------------------------------------------------------------------------------------------------


def generated(monkeypatch, *arguments):
    """What a command would write."""
    kept = []
    monkeypatch.setattr(commands, "_write", lambda mesh, out: kept.append(mesh))
    commands.generate.main([*arguments, "--out", "x.vtu"], standalone_mode=False)
    return kept[0]


@pytest.mark.parametrize(
    ("arguments", "extent", "choices"),
    [
        ((), (1.0, 1.0), {}),
        (("--width", "1.5"), (1.5, 1.0), {}),
        (("--height", "0.7"), (1.0, 0.7), {}),
        (("--size", "0.2"), (1.0, 1.0), {"size": 0.2}),
        (("--relaxation", "2"), (1.0, 1.0), {"relaxation": 2}),
        (("--shortest", "0.4"), (1.0, 1.0), {"shortest": 0.4}),
        (("--seed", "3"), (1.0, 1.0), {"seed": 3}),
    ],
)
def test_a_rectangle_is_what_its_options_and_their_defaults_say(arguments, extent, choices, monkeypatch):
    a, b, c, d = (0.0, 0.0), (extent[0], 0.0), extent, (0.0, extent[1])
    wanted = {"size": 0.1, "relaxation": 10, "shortest": 0.15, "seed": 0, **choices}
    expected = voronoi_mesh([Region("domain", [a, b, c, d])], wanted.pop("size"), **wanted)
    mesh = generated(monkeypatch, "rectangle", *arguments)
    assert np.array_equal(mesh.points_vx, expected.points_vx)
    assert np.array_equal(mesh.cell_vertices, expected.cell_vertices)


@pytest.mark.parametrize("kind", ["quadrilaterals", "triangles"])
def test_sides_and_sizes_of_a_rectangle(kind, monkeypatch):
    mesh = generated(monkeypatch, "rectangle", "--width", "2", "--size", "0.25", "--kind", kind)
    assert set(mesh.n_sides_c) == {4 if kind == "quadrilaterals" else 3}
    for name, axis, place, length, cells in (
        ("bottom", 1, 0.0, 2.0, 8), ("right", 0, 2.0, 1.0, 4), ("top", 1, 1.0, 2.0, 8), ("left", 0, 0.0, 1.0, 4),
    ):  # fmt: skip
        ends = mesh.points_vx[mesh.named_edges[name]]
        assert (ends[..., axis] == place).all()
        assert np.ptp(ends[..., 1 - axis]) == length
        assert len(ends) == cells


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("box",), Box()),
        (("box", "--cells", "20", "5"), Box(cells=(20, 5))),
        (("box", "--refine-medium", "2"), Box(medium_refinement=2)),
        (("cbox",), CBox()),
        (("cbox", "--cells", "10", "5"), CBox(cells=(10, 5))),
        (("cbox", "--refine-medium", "2"), CBox(medium_refinement=2)),
        (("cbox", "--mesh", "quadrilaterals"), CBox(solid_cells="quadrilaterals")),
        (("punch",), Punch()),
        (("punch", "--size", "0.2"), Punch(size=0.2)),
        (("punch", "--gap0", "0.5"), Punch(gap0=0.5)),
        (("bodies",), Bodies()),
        (("bodies", "--size", "0.08"), Bodies(size=0.08)),
        (("bodies", "--discs", "2"), Bodies(discs=2)),
        (("bodies", "--gap0", "0.15"), Bodies(gap0=0.15)),
    ],
)
def test_the_meshes_of_the_paper_are_those_of_its_problems(arguments, problem, monkeypatch):
    monkeypatch.setattr(type(problem), "make_mesh", lambda self: self)
    assert generated(monkeypatch, *arguments) == problem
