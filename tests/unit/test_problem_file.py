"""Problem files: what they describe, and that whatever is wrong with one is said in one line."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from helpers_process import tmc
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tmc_vem import RunResult, run
from tmc_vem.cli.main import _run
from tmc_vem.mesh.geometry import areas
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "demos" / "problems").glob("*.toml"))

SMALL = """\
name = "plug"
gap = ["tip", "ground"]

[shapes]
frame = { rectangle = [0, 0, 1, 1] }
base = { rectangle = [0, 0, 1, 0.3] }
plug = { rectangle = [0.3, 0.5, 0.7, 1.0] }

[regions.base]
shape = "base"
solid = { K = 20, mu = 10 }

[regions.plug]
shape = "plug"
solid = { K = 20, mu = 10 }

[regions.medium]
shape = "frame - base - plug"
medium = { gamma = 1e-4, alpha_r = 1, regulariser = "huhu_lulu" }

[mesh]
cells = "triangles"
size = 0.1

[points]
tip = [0.5, 0.5]
ground = [0.5, 0.3]

[edges]
bottom = { line = [[0, 0], [1, 0]] }
top = { between = ["plug", "outside"] }

[[support]]
at = "bottom"
ux = 0
uy = 0

[[support]]
at = "top"
ux = 0

[load]
at = "top"
uy = -0.1

[solve]
snapshots = 2
"""


def small(tmp_path: Path, text: str = SMALL, **files: str) -> Path:
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    path = tmp_path / "plug.toml"
    path.write_text(text)
    return path


def test_regions_points_edges_and_conditions(tmp_path: Path) -> None:
    problem, options = read_problem(small(tmp_path))
    mesh = problem.make_mesh()
    area = {
        name: sum(areas(mesh.points_vx[cells]).sum() for _, cells in _cells_of(mesh, name))
        for name in mesh.region_names
    }
    assert area == pytest.approx({"base": 0.3, "plug": 0.2, "medium": 0.5})
    assert mesh.points_vx[mesh.named_points["tip"]] == pytest.approx((0.5, 0.5))
    assert (mesh.points_vx[mesh.named_edges["bottom"]][..., 1] == 0.0).all()
    top = mesh.points_vx[mesh.named_edges["top"]]
    assert np.linalg.norm(top[:, 1] - top[:, 0], axis=1).sum() == pytest.approx(0.4)
    assert problem.load().value == -0.1
    assert [(p.where, p.component) for p in problem.prescribed()] == [
        ("bottom", 0), ("bottom", 1), ("top", 0), ("top", 1)]  # fmt: skip
    assert options.snapshots == 2
    assert problem.regions()["medium"].values["mu"] == 10.0


def _cells_of(mesh: Any, name: str) -> list[tuple[int, Any]]:
    region = mesh.region_names.index(name)
    return [(n, loops[mesh.region_c[cells] == region]) for n, cells, loops in mesh.cells_by_size()]


def test_both_methods_agree_on_the_same_triangles(tmp_path: Path) -> None:
    pytest.importorskip("dolfinx")
    path = small(tmp_path)
    gaps = {}
    for method in ("vem", "fem"):
        done = tmc("run", str(path), "--method", method, "--json")
        assert done.returncode == 0, done
        result = json.loads(done.stdout)
        gaps[method] = result["gap"]
        assert result["inputs"]["medium"]["gamma"] == 1e-4
        assert result["inputs"]["method"] == method
    assert gaps["vem"] == pytest.approx(gaps["fem"], rel=0.02)
    assert 0.0 < gaps["vem"] < 0.2 - 0.05


def test_run_directory_and_resume(tmp_path: Path) -> None:
    path = small(tmp_path)
    out = tmp_path / "out"
    done = tmc("run", str(path), "--out", str(out), "--steps", "3", "--quiet")
    assert done.returncode == 0, done
    whole = json.loads((out / "result.json").read_text())
    (out / "result.json").unlink()
    again = tmc("resume", str(out), "--json")
    assert again.returncode == 0, again
    assert json.loads(again.stdout)["gap"] == whole["gap"]
    path.write_text(SMALL.replace("size = 0.1", "size = 0.2"))
    changed = tmc("resume", str(out))
    assert changed.returncode == 2
    assert "mesh" in changed.stderr


def test_own_regulariser_is_found_beside_the_file(tmp_path: Path) -> None:
    source = "def bending(F, G, p, m):\n    return p.kappa * sum(G[i][0][0] ** 2 + G[i][1][1] ** 2 for i in (0, 1))\n"
    text = SMALL.replace('"huhu_lulu"', '"mine.py:bending", parameters = { kappa = 0.5 }')
    problem, _ = read_problem(small(tmp_path, text, **{"mine.py": source}))
    assert problem.regions()["medium"].values["kappa"] == 0.5


def test_own_density_of_a_solid(tmp_path: Path) -> None:
    source = (
        "def spring(F, G, p, m):\n    return p.c * sum((F[i][j] - (i == j)) ** 2 for i in (0, 1) for j in (0, 1))\n"
    )
    text = SMALL.replace("solid = { K = 20, mu = 10 }", 'density = "mine.py:spring"\nparameters = { c = 3 }', 1)
    problem, _ = read_problem(small(tmp_path, text, **{"mine.py": source}))
    region = problem.regions()["base"]
    assert (region.values, region.is_medium) == ({"c": 3.0}, False)


PROBED = """\
[probes]
height = { position = "y", at = [0.5, 1] }
side = { displacement = "ux", at = [0.3, 0.75] }
held = { reaction = "uy", at = "bottom" }
squeezed = { mean = "J", region = "medium" }

[edges]
"""


@pytest.mark.parametrize("method", ["vem", "fem"])
def test_probes_and_units_reach_summary_history_and_report(method: str, tmp_path: Path) -> None:
    if method == "fem":
        pytest.importorskip("dolfinx")
    units = 'units = { length = "cm", force = "kN" }\n[shapes]'
    path = small(tmp_path, SMALL.replace("[edges]\n", PROBED).replace("[shapes]", units))
    out = tmp_path / "out"
    done = tmc("run", str(path), "--out", str(out), "--method", method)
    assert done.returncode == 0, done
    result = json.loads((out / "result.json").read_text())
    probes = result["probes"]
    assert probes["height"] == pytest.approx(0.9, abs=1e-10)
    assert probes["held"] == pytest.approx(-result["reaction"], rel=1e-8)
    assert probes["side"] < 0.0
    assert probes["squeezed"] == pytest.approx(0.7698, rel=2e-4)  # either method says so
    assert result["units"]["held"] == "kN/cm"
    for row in (f"held {probes['held']:.6e} kN/cm", f"gap {result['gap']:.6e} cm", "displacement -0.1 cm"):
        assert row in " ".join(done.stdout.split())
    header, first, *_ = (out / "history.csv").read_text().splitlines()
    assert "height [cm],side [cm],held [kN/cm],squeezed,reaction [kN/cm]" in header
    assert len(first.split(",")) == len(header.split(","))
    fields = RunResult.read(out).to_pyvista()
    written = pyvista.read(max((out / "fields").glob("*.vtu")))
    for data in (fields, written):
        density = data.GetCellData().GetArray("energy_density")
        assert density.GetInformation().Get(density.UNITS_LABEL()) == "kN/cm^2"
    drawn = tmc("plot", str(out))
    assert drawn.returncode == 0, drawn.stderr
    assert "probes-1.png" in drawn.stdout
    assert "probes-2.png" in drawn.stdout
    page = (out / "plots" / "run.html").read_text()
    assert "held (kN/cm)" in page
    listed = tmc("list", str(tmp_path), "--csv")
    assert "probes.squeezed" in listed.stdout.splitlines()[0]


def test_inputs_of_a_problem_without_new_entries_are_those_of_earlier_versions(tmp_path: Path) -> None:
    """By which a checkpoint is recognised."""
    problem, _ = read_problem(small(tmp_path, SMALL))
    assert problem.inputs()["mesh"] == {"cells": "triangles", "size": 0.1, "growth": 0.3}
    assert set(problem.inputs()["regions"]["base"]) == {"shape", "solid"}


def test_the_table_says_what_is_medium_not_the_name(tmp_path: Path) -> None:
    from tmc_vem.results.snapshots import read_fields, snapshots

    text = SMALL.replace("[regions.medium]", "[regions.air]").replace("regions.plug", "regions.medium_plug")
    problem, options = read_problem(small(tmp_path, text.replace('["plug", ', '["medium_plug", ')))
    result = run(problem, tmp_path / "run", dataclasses.replace(options, steps=1, snapshots=1))
    again = RunResult.read(tmp_path / "run")
    assert again.media == ["air"]
    assert result.checks["overlap_area"] == pytest.approx(0.0)
    fields = read_fields(again, snapshots(again)[-1])
    names = np.array(fields.polygons.region_names)[fields.polygons.region_c]
    assert ((names != "air") == fields.polygons.is_solid_c).all()
    # a run of an earlier version has no such entry: there the names tell
    content = json.loads((tmp_path / "run/result.json").read_text())
    del content["media"]
    (tmp_path / "run/result.json").write_text(json.dumps(content))
    old = RunResult.read(tmp_path / "run")
    assert old.media == ["medium_plug"]
    assert (read_fields(old, snapshots(old)[-1]).polygons.is_solid_c == (names != "medium_plug")).all()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("size = 0.1", "siez = 0.1", ("plug.toml: mesh", "'siez'", "did you mean 'size'", "line 23")),
        ("uy = -0.1", 'uy = "down"', ("load: uy", "'down'", "must be a number")),
        ("uy = -0.1", "ux = 1\nuy = 1", ("load", "one of ux and uy")),
        ("uy = -0.1", "uy = nan", ("load", "finite")),
        ('"huhu_lulu"', '"huhu_luluu"', ("regions: medium", "huhu_luluu", "huhu_lulu")),
        ('"huhu_lulu"', '"gone.py:f"', ("gone.py",)),
        ("K = 20, mu = 10", "K = -20, mu = 10", ("regions: base: solid", "K = -20", "positive")),
        ("K = 20, mu = 10", "K = 20", ("regions: base: solid", "give two of K, mu, E, nu and lambda, not K")),
        ("gamma = 1e-4", "gama = 1e-4", ("regions: medium: medium", "'gama'", "gamma")),
        ("size = 0.1", 'size = 0.1\nnames = { 1 = "plug" }', ("mesh: names", "for a mesh file")),
        (
            "solid = { K = 20, mu = 10 }",
            "solid = { K = 20, mu = 10 }\nis_medium = true",
            ("base: is_medium", "density"),
        ),
        ('"frame - base - plug"', '"frame - base - plugg"', ("region 'medium'", "'plugg'", "frame, base, plug")),
        ('"frame - base - plug"', '"frame - base"', ("'plug' and 'medium' overlap",)),
        ('"triangles"', '"hexagons"', ("mesh", "hexagons", "voronoi, triangles")),
        ("tip = [0.5, 0.5]", "tip = [0.5]", ("points: tip", "a list of 2")),
        (
            "tip = [0.5, 0.5]",
            "tip = [0.5, 0.6]",
            ("named point 'tip'", "no region's outline: the nearest place on one is (0.5, 0.5)"),
        ),
        ('gap = ["tip", "ground"]', 'gap = ["tip", "floor"]', ("no named point 'floor'", "ground, tip")),
        (
            'gap = ["tip", "ground"]',
            'gap = ["tip", [0.5, 3.0]]',
            ("probes: gap: point (0.5, 3)", "2 outside", "(0.5, 1)"),
        ),
        (
            "[edges]",
            '[probes]\na = { gap = ["tip", "ground"] }\na = { mean = "J" }\n[edges]',
            ("plug.toml: 'a' stands twice", "line 31"),
        ),
        ("[edges]", '[probes]\ngap = { gap = ["tip", "ground"] }\n[edges]', ("gap at the top of the file already",)),
        ("[edges]", '[probes]\ntime = { mean = "J", region = "plug" }\n[edges]', ("probes: time", "choose another")),
        ("[edges]", '[probes]\na = { mean = "J", region = "plugg" }\n[edges]', ("no region 'plugg'", "base, plug")),
        ("[edges]", '[probes]\na = { mean = "E", region = "plug" }\n[edges]', ("probes: a", "unknown mean 'E'")),
        ("[edges]", '[probes]\na = { displacement = "ux", at = "top" }\n[edges]', ("no named point 'top'", "tip")),
        ("[edges]", '[probes]\na = { displacement = "ux" }\n[edges]', ("probes: a: displacement lacks 'at'", "line")),
        ("[edges]", '[probes]\na = { gap = ["tip", "tip"], at = "tip" }\n[edges]', ("gap has no use for 'at'",)),
        ("[edges]", '[probes]\na = { position = "x", mean = "J" }\n[edges]', ("not position and mean",)),
        ("[edges]", '[probes]\na = { reaction = "ux", at = [0, 0] }\n[edges]', ("needs the name",)),
        ("[edges]", '[probes]\na = { reaction = "ux", at = "tip" }\n[edges]', ("not prescribed at 'tip'", "ux at top")),
        ("[shapes]", 'units = { length = "mm" }\n[shapes]', ("units", "both length and force")),
        ('at = "bottom"', 'at = "botom"', ("'botom'", "bottom")),
        ("[[0, 0], [1, 0]]", "[[0, 2], [1, 2]]", ("edges: bottom", "no edge")),
        ('["plug", "outside"]', '["plug", "inside"]', ("edges: top", "no region 'inside'")),
        ("[load]", "[loads]", ("no 'loads'", "did you mean 'load'")),
        ("snapshots = 2", "snapshot = 2", ("solve", "'snapshot'", "snapshots")),
        ("snapshots = 2", "snapshots = -2", ("snapshots = -2",)),
        ('name = "plug"', "name = 3", ("name = 3", "text")),
        ('name = "plug"', "", ("lacks 'name'",)),
        ("size = 0.1", "size = ", ("not TOML", "line 23")),
        ("size = 0.1", "", ("mesh: give the size",)),
        ("size = 0.1", "size = 0", ("size = 0", "positive")),
        ("rectangle = [0, 0, 1, 1]", "rectangle = [0, 0, 1, 1], disc = [0, 0, 1]", ("shapes: frame", "one of")),
        ("rectangle = [0, 0, 1, 1]", "disc = [0, 0, 1], rounded = 1", ("shapes: frame", "rounded")),
    ],
)
def test_bad_files_are_refused_in_one_line(
    old: str, new: str, words: tuple[str, ...], tmp_path: Path, capsys: Any
) -> None:
    assert old in SMALL
    code = _run(["run", str(small(tmp_path, SMALL.replace(old, new, 1))), "--out", str(tmp_path / "out")])
    message = capsys.readouterr().err.strip()
    assert code == 2
    assert len(message.splitlines()) == 1, message
    for word in words:
        assert word in message
    assert not (tmp_path / "out").exists()


def test_files_that_cannot_be_read(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "folder.toml").mkdir()
    for name in ("missing.toml", "binary.toml", "folder.toml"):
        assert _run(["run", str(tmp_path / name)]) == 2
        message = capsys.readouterr().err.strip()
        assert name in message
        assert len(message.splitlines()) == 1


VALUES: Any = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 3), st.floats(), st.text(max_size=6), st.just([]), st.just({}),
    st.lists(st.floats(-2, 2), max_size=4), st.sampled_from(["frame", "plug - base", "top", "angle", "fem", "x.py:f"]),
)  # fmt: skip


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_change_to_a_file_is_accepted_or_refused(data: st.DataObject, tmp_path: Path) -> None:
    """A random entry gets a random value, another name, or goes away."""
    import tomllib

    table = copy.deepcopy(tomllib.loads(SMALL))
    places = list(_places(table))
    for _ in range(data.draw(st.integers(1, 2))):
        holder, key = data.draw(st.sampled_from(places))
        change = data.draw(st.sampled_from(["value", "name", "remove"]))
        if key not in holder if isinstance(holder, dict) else key >= len(holder):
            continue
        if change == "value" or isinstance(holder, list):
            holder[key] = data.draw(VALUES)
        elif change == "name":
            holder[data.draw(st.text(max_size=8))] = holder.pop(key)
        else:
            del holder[key]
    path = tmp_path / "any.toml"
    path.write_text(_toml(table), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMC_VEM_MOST_CELLS", "3000")
        refused(path)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(start=st.integers(0, len(SMALL)), length=st.integers(0, 40), text=st.text(max_size=5))
def test_any_broken_text_is_refused_in_one_line(start: int, length: int, text: str, tmp_path: Path) -> None:
    path = tmp_path / "any.toml"
    path.write_text(SMALL[:start] + text + SMALL[start + length :], encoding="utf-8", errors="replace")
    refused(path)


def refused(path: Path) -> None:
    """Reads the file and makes the mesh; if either is refused, that takes one line."""
    message = path.name
    try:
        problem, _ = read_problem(path)
    except InputError as error:
        message = str(error)
    else:
        try:
            problem.make_mesh()
        except InputError as error:
            message = f"{path.name} {error}"
    assert path.name in message
    assert len("".join(ch if ch.isprintable() else "?" for ch in message).splitlines()) == 1


def _places(table: Any) -> Any:
    entries = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in list(entries):
        yield table, key
        if isinstance(value, dict | list):
            yield from _places(value)


def _toml(table: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_value(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float):
        return "nan" if math.isnan(value) else repr(value)
    if value is None:
        return '"none"'
    return json.dumps(value)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_make_their_meshes(path: Path) -> None:
    problem, _ = read_problem(path)
    mesh = problem.make_mesh()
    assert mesh.n_cells > {"blocks": 80, "patch": 60, "sliding_block": 150, "cbox_pad": 200}.get(path.stem, 300)
    assert set(problem.table.points) <= set(mesh.named_points)


@pytest.mark.parametrize("cells", ["voronoi", "triangles"])
@pytest.mark.parametrize("away", [(500000, 4200000), (10000000, -10000000)], ids=["map", "1e7"])
def test_domains_far_from_the_origin_are_meshed_as_at_it(tmp_path: Path, cells: str, away: tuple[int, int]) -> None:
    """Also where coordinates keep nine digits of the size: the mesh is the same, but for the rounding of its place."""
    size = "size = 0.2\nrefine = [{ near = [0.5, 0.5], size = 0.1 }]"
    text = SMALL.replace('cells = "triangles"\nsize = 0.1', f'cells = "{cells}"\n{size}')
    there = text
    for name, numbers in {
        "rectangle": [[0, 0, 1, 1], [0, 0, 1, 0.3], [0.3, 0.5, 0.7, 1.0]], "near": [[0.5, 0.5]], "tip": [[0.5, 0.5]],
        "ground": [[0.5, 0.3]],
    }.items():  # fmt: skip
        for row in numbers:
            moved_row = [round(value + away[n % 2], 3) for n, value in enumerate(row)]
            there = there.replace(f"{name} = {row}", f"{name} = {moved_row}")
    ends = [[round(value + away[n], 3) for n, value in enumerate(end)] for end in ([0, 0], [1, 0])]
    there = there.replace("line = [[0, 0], [1, 0]]", f"line = {ends}")
    assert there.count(str(away[0])[:5]) >= 8
    (tmp_path / "there").mkdir()
    here, far = (read_problem(small(p, t))[0].make_mesh() for p, t in ((tmp_path, text), (tmp_path / "there", there)))
    assert far.cell_vertices.tolist() == here.cell_vertices.tolist()
    assert np.abs(far.points_vx - away - here.points_vx).max() < 4e-9
    assert dict(far.named_points) == dict(here.named_points)
    for name, pairs in here.named_edges.items():
        assert far.named_edges[name].tolist() == pairs.tolist()


def test_points_with_rounded_coordinates(tmp_path: Path) -> None:
    """On an arc, and on vertices of a file; what is farther off is refused with coordinates that can be copied."""
    text = SMALL.replace("[0.3, 0.5, 0.7, 1.0] }", "[0.3, 0.5, 0.7, 1.0], rounded = 0.1 }")
    on_arc = [0.4 - 0.1 * math.sin(0.7), 0.6 - 0.1 * math.cos(0.7)]
    for digits, good in ((7, True), (3, False)):
        place = [round(value, digits) for value in on_arc]
        problem = read_problem(small(tmp_path, text.replace("tip = [0.5, 0.5]", f"tip = {place}")))[0]
        if good:
            mesh = problem.make_mesh()
            assert mesh.points_vx[mesh.named_points["tip"]] == pytest.approx(on_arc, abs=2e-7)
        else:
            with pytest.raises(
                InputError, match=r"on no region's outline: the nearest place on one is \((.*)\)"
            ) as said:
                problem.make_mesh()
            found = str(said.value).rsplit("(", 1)[1].rstrip(")")
            read_problem(small(tmp_path, text.replace("tip = [0.5, 0.5]", f"tip = [{found}]")))[0].make_mesh()
