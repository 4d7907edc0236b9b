"""``tmc-vem check``: what a problem consists of, by numbers that are known; and that what passes it begins in a run."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers_blocks import blocks
from helpers_plug import plug

from codegen.errors import CodegenError
from tmc_vem import Box, Checkup, Medium, RunOptions, check, prepare
from tmc_vem.cli.check import _value, summary
from tmc_vem.cli.main import _run
from tmc_vem.mesh.files.io import write_mesh
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.mesh.rigid import part_numbers
from tmc_vem.problems.base import RegionEnergy, medium_region, solid_region
from tmc_vem.problems.inventory import (
    Corner,
    Part,
    Width,
    _crossed,
    count_nodes,
    count_regions,
    narrowest,
    parts,
    sharp_corners,
    vertices_loaded,
)
from tmc_vem.problems.materials import Material
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed, PrescribedAcross, PrescribedRotation
from tmc_vem.system.fem_settings import FemSettings
from tmc_vem.system.forces import BodyForce, CavityPressure, FollowerPressure, PointForce, Spring, Traction
from tmc_vem.vem.spaces.element_settings import ElementSettings

SOLID, MEDIUM = solid_region(Material(20.0, 10.0)), medium_region(Medium(alpha_r=1.0), 10.0)


def grid() -> tuple[PolygonMesh, dict[str, RegionEnergy]]:
    """6 x 5 unit squares: a floor 1 high, a block on it at the left, a lid from x = 2 on, medium between them."""
    mesh = structured_quadrilaterals(
        np.arange(7.0), np.arange(6.0),
        [Rectangle("medium", 0, 6, 0, 5), Rectangle("floor", 0, 6, 0, 1), Rectangle("block", 0, 1, 1, 3),
         Rectangle("lid", 2, 6, 4, 5)],
    )  # fmt: skip
    mesh = with_names(mesh, {"tip": (1.0, 3.0)}, lines={"bottom": ((0.0, 0.0), (6.0, 0.0)), "top": ((2, 5), (6, 5))})
    return mesh, {**dict.fromkeys(("floor", "block", "lid"), SOLID), "medium": MEDIUM}


HELD = (Prescribed("bottom", 0), Prescribed("bottom", 1), Prescribed("top", 1, -2.0), Prescribed("tip", 0, 0.5))


# -- what there is on a mesh -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("order", "inside", "nodes", "every"),
    [(2, 1, {"medium": 29 + 46 + 18, "floor": 14 + 19 + 6, "block": 6 + 7 + 2, "lid": 10 + 13 + 4}, 42 + 71 + 30),
     (3, 0, {"medium": 29 + 92, "floor": 14 + 38, "block": 6 + 14, "lid": 10 + 26}, 42 + 142)],
)  # fmt: skip
def test_sizes_of_regions(order: int, inside: int, nodes: dict[str, int], every: int) -> None:
    mesh, _ = grid()
    found = count_regions(mesh, order, inside)
    assert [(region.name, region.n_cells) for region in found] == [
        ("medium", 18),
        ("floor", 6),
        ("block", 2),
        ("lid", 4),
    ]
    assert {region.name: region.n_nodes for region in found} == nodes
    assert count_nodes(mesh, order, inside) == every
    assert [region.area for region in found] == [18.0, 6.0, 2.0, 4.0]
    assert {(region.smallest, region.largest) for region in found} == {(1.0, 1.0)}
    wide = PolygonMesh(
        mesh.points_vx + np.where(mesh.points_vx == [6.0, 5.0], [2.0, 3.0], 0.0), mesh.cell_offsets, mesh.cell_vertices,
        mesh.region_c, mesh.region_names,
    )  # fmt: skip
    lid = next(region for region in count_regions(wide, order, inside) if region.name == "lid")
    assert (lid.area, lid.smallest, lid.largest) == pytest.approx((24.0, 2.0, np.sqrt(12.0)))


def test_the_narrowest_gap_of_two_bodies_and_the_cells_across() -> None:
    mesh, regions = grid()
    (gap,) = narrowest(mesh, regions)
    assert isinstance(gap, Width)
    assert (gap.medium, set(gap.solids), gap.width, gap.n_cells) == ("medium", {"floor", "lid"}, 3.0, 3)
    assert gap.place[1] == 2.5
    assert 2.0 < gap.place[0] < 6.0
    assert narrowest(mesh, dict.fromkeys(regions, SOLID)) == []


def test_gaps_are_sorted_and_a_body_may_face_itself() -> None:
    mesh = structured_quadrilaterals(
        np.arange(8.0), np.arange(5.0),
        [Rectangle("body", 0, 7, 0, 4), Rectangle("air", 1, 4, 1, 4), Rectangle("oil", 5, 6, 2, 4),
         Rectangle("bolt", 3, 4, 3, 4)],
    )  # fmt: skip
    found = narrowest(mesh, {"body": SOLID, "bolt": SOLID, "air": MEDIUM, "oil": MEDIUM})
    assert [(gap.medium, gap.width, gap.n_cells) for gap in found] == [("oil", 1.0, 1), ("air", 2.0, 2)]
    assert [set(gap.solids) for gap in found] == [{"body"}, {"body", "bolt"}]


def test_lines_across_cross_edges_and_vertices_once() -> None:
    mesh, _ = grid()
    for start, end, n in (((0.5, 1.0), (0.5, 4.0), 2), ((1.0, 1.0), (1.0, 4.0), 2), ((1.0, 1.0), (4.0, 4.0), 2),
                          ((0.5, 1.2), (0.5, 1.8), 0), ((0.5, 4.0), (0.5, 0.5), 3), ((0.5, 0.5), (3.5, 0.5), 3),
                          ((0.2, 0.9), (0.9, 1.1), 1)):  # fmt: skip
        assert _crossed(mesh, np.array(start), np.array(end)) == n


def test_parts_and_what_holds_them() -> None:
    mesh, regions = grid()
    assert parts(mesh, regions, HELD) == [
        Part(("floor", "block"), 8, (3.0, 1.5), (("ux", "bottom", 0.0), ("uy", "bottom", 0.0), ("ux", "tip", 0.5))),
        Part(("lid",), 4, (4.0, 4.5), (("uy", "top", -2.0),)),
    ]
    assert parts(mesh, dict.fromkeys(regions, MEDIUM), HELD) == []


def test_cells_that_share_a_vertex_are_one_part() -> None:
    mesh, _ = grid()
    chosen = np.zeros(30, dtype=bool)
    chosen[[0, 7, 9, 28]] = True  # 0 and 7 touch in a corner
    assert part_numbers(mesh, chosen)[[0, 7, 9, 28, 1]].tolist() == [0, 0, 1, 2, -1]
    assert set(part_numbers(mesh, np.zeros(30, dtype=bool)).tolist()) == {-1}


def test_sharp_corners_have_medium_on_both_sides() -> None:
    mesh, regions = grid()
    assert sharp_corners(mesh, regions) == [
        Corner("block", (1.0, 3.0), pytest.approx(90.0)), Corner("lid", (2.0, 4.0), pytest.approx(90.0)),
    ]  # fmt: skip
    sharper = mesh.points_vx.copy()
    sharper[mesh.find_vertex(2.0, 4.0)] = (1.5, 3.8)
    moved = PolygonMesh(sharper, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names)
    first = sharp_corners(moved, regions)[0]
    assert (first.region, first.place) == ("lid", (1.5, 3.8))
    assert first.angle == pytest.approx(np.degrees(np.arctan2(1.2, 0.5) - np.arctan2(0.2, 1.5)))
    blunt = mesh.points_vx.copy()
    blunt[mesh.find_vertex(2.0, 4.0)] = (2.4, 4.4)
    moved = PolygonMesh(blunt, mesh.cell_offsets, mesh.cell_vertices, mesh.region_c, mesh.region_names)
    assert [corner.region for corner in sharp_corners(moved, regions)] == ["block"]


# -- a problem as a whole --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> Checkup:
    problem, options = read_problem(plug(tmp_path_factory.mktemp("check")))
    return check(problem, options)


def test_what_is_said_of_a_problem(checked: Checkup) -> None:
    found = checked.as_dict()
    assert json.loads(json.dumps(found)) == found
    assert {"problem", "mesh"}.isdisjoint(found)
    assert (found["name"], found["method"], found["order"]) == ("plug", "vem", 2)
    assert sum(region["n_cells"] for region in found["regions"]) == found["n_cells"] == checked.mesh.n_cells
    assert found["n_dofs"] == 2 * found["n_nodes"]
    assert [region["area"] for region in found["regions"]] == pytest.approx(
        [{"base": 0.3, "plug": 0.2, "medium": 0.5}[region["name"]] for region in found["regions"]]
    )
    n_vertices = found["loads"][0]["n_vertices"]
    assert found["loads"] == [{"name": "", "what": "uy", "at": "top", "value": -0.02, "n_vertices": n_vertices}]
    assert (found["path"], found["steps"]) == ([0.0, 1.0], 1)
    at_top = np.unique(checked.mesh.named_edges["top"])
    assert n_vertices == len(at_top)
    assert found["probes"]["gap"] == {"what": "distance of tip and ground", "initially": pytest.approx(0.2)}
    assert found["probes"]["side"] == {"what": "ux of (0.7, 0.75)"}
    assert found["materials"]["plug"] == {
        "energy": "solid", "medium": False, "E": pytest.approx(25.0), "nu": pytest.approx(0.3),
        "K": pytest.approx(25.0 / 1.2), "mu": pytest.approx(25.0 / 2.6),
        "parameters": {"K": pytest.approx(25.0 / 1.2), "mu": pytest.approx(25.0 / 2.6)},
    }  # fmt: skip
    assert found["materials"]["medium"]["medium"] is True
    assert found["materials"]["medium"]["parameters"]["gamma"] == 1e-4
    assert {tuple(part["regions"]) for part in found["parts"]} == {("base",), ("plug",)}
    assert sorted(corner["place"] for corner in found["corners"]) == [
        pytest.approx([0.3, 0.5]),
        pytest.approx([0.7, 0.5]),
    ]


@pytest.mark.parametrize(
    "options",
    [RunOptions(), RunOptions(element=ElementSettings(order=3)), RunOptions("fem"),
     RunOptions("fem", fem=FemSettings(order=3)), RunOptions("fem", fem=FemSettings(triangles=True))],
)  # fmt: skip
def test_sizes_are_those_of_the_discretisation(options: RunOptions) -> None:
    if options.method == "fem":
        pytest.importorskip("dolfinx")
    problem = Box(cells=(20, 5), medium=Medium(alpha_r=1.0))
    found = check(problem, options)
    from tmc_vem.simulation.discretised import discretise

    comm = pytest.importorskip("mpi4py.MPI").COMM_SELF
    system = discretise(problem, options, comm)
    assert (found.n_cells, found.n_dofs) == (system.n_cells_global, system.n_dofs)


def thin(directory: Path, rows: int = 1, uy: float = -0.01) -> Path:
    """Problem file of two blocks of squares with some rows of cells of medium between them, 0.2 wide."""
    lines = [0.0, 0.2, 0.4, *np.linspace(0.4, 0.6, rows + 1)[1:], 0.8, 1.0]
    mesh = structured_quadrilaterals(
        np.linspace(0.0, 1.0, 6), lines,
        [Rectangle("low", 0, 1, 0, 0.4), Rectangle("medium", 0, 1, 0.4, 0.6), Rectangle("up", 0, 1, 0.6, 1)],
        {"tip": (0.4, 0.6), "ground": (0.4, 0.4)},
    )  # fmt: skip
    write_mesh(mesh, directory / "thin.vtu")
    text = blocks(directory, uy=uy).read_text()
    path = directory / "thin.toml"
    regions, rest = text[text.index("[regions.low]") : text.index("[mesh]")], text[text.index("[edges]") :]
    without = "".join(line for line in regions.splitlines(keepends=True) if not line.startswith("shape"))
    path.write_text(f'name = "thin"\n[mesh]\nfile = "thin.vtu"\n{without}{rest}')
    return path


def test_a_single_cell_across_is_a_caution_with_its_remedy(tmp_path: Path) -> None:
    problem, options = read_problem(thin(tmp_path))
    found = check(problem, options)
    (gap,) = found.gaps
    (caution,) = found.cautions
    x, y = gap.place
    assert (gap.n_cells, gap.width) == (1, pytest.approx(0.2))
    assert caution == (
        f"region 'medium' has a single cell across the gap of 0.2 between {gap.solids[0]} and {gap.solids[1]} at "
        f"({x:.4g}, {y:.4g}): use cells of size 0.1 or less there, refine = [{{ near = [{x:.4g}, {y:.4g}], "
        "size = 0.1 }], or fit = true"
    )
    near = dataclasses.replace(problem, table=dataclasses.replace(
        problem.table, load=dataclasses.replace(problem.table.load, uy=-0.19)))  # fmt: skip
    said = [text for text in check(near, options).cautions if "single cell" in text]
    assert len(said) == 1
    (tmp_path / "two").mkdir()
    assert check(*read_problem(thin(tmp_path / "two", rows=2))).cautions == ()


def test_lines_for_people(checked: Checkup, tmp_path: Path) -> None:
    text = "\n".join(summary(checked))
    for words in (
        f"problem 'plug': {checked.n_cells} cells, {checked.n_nodes} nodes, {checked.n_dofs} degrees of freedom "
        "(vem, order 2)",
        "    solid, energy 'solid': E = 25, nu = 0.3, K = 20.833, mu = 9.6154",
        "    third medium, energy 'medium_huhu_lulu': mu = 10, gamma = 0.0001, alpha_r = 1, beta = 0",
        "narrowest gaps:", "cells across", "  base around (0.5, 0.15)", ": ux = 0 at bottom, uy = 0 at bottom",
        ": ux = 0 at top, uy = -0.02 at top",
        f"load: uy = -0.02 at top, {checked.loads[0].n_vertices} vertices", "path: 0 1 in 1 equal steps",
        "  gap: distance of tip and ground, 0.2 before loading", "  hold: reaction to uy at bottom",
        "sharp corners in the medium, which may slip into what they meet: round those, with a radius of some cells",
        "  plug at (0.3, 0.5): 90 degrees",
    ):  # fmt: skip
        assert words in text
    region = checked.regions[0]
    assert f"  {region.name}: {region.n_cells} cells of size {region.smallest:.3g} to {region.largest:.3g}, " \
        f"{2 * region.n_nodes} degrees of freedom, area {region.area:.4g}" in text  # fmt: skip
    assert text.splitlines()[-1] in ("cautions: none", f"  {checked.cautions[-1] if checked.cautions else ''}")
    one = dataclasses.replace(
        checked, gaps=(Width("medium", ("plug", "plug"), 0.5, (1.0, 2.0), 1),), probes={}, cautions=("a", "b"),
        parts=(Part(("plug",), 3, (0.0, 1.0), ()),), corners=tuple(Corner("x", (n, 0.0), 60.0) for n in range(10)),
        loads=(dataclasses.replace(checked.loads[0], n_vertices=1),), steps=None, path=(0.0, 1.0, 0.5),
    )  # fmt: skip
    lines = summary(one)
    assert "  within plug: 0.5 at (1, 2), 1 cell across" in lines
    assert "  plug around (0, 1), 3 cells: only the medium, as the file says" in lines
    at = lines.index("load: uy = -0.02 at top, 1 vertex")
    assert lines[at + 1] == "path: 0 1 0.5 in automatic steps"
    assert lines[-3:] == ["cautions: 2", "  a", "  b"]
    assert "probes: none" in lines
    assert "  and 2 more" in lines
    assert "  x at (7, 0): 60 degrees" in lines
    bare = summary(dataclasses.replace(one, gaps=(), corners=()))
    assert "narrowest gaps: no two surfaces face each other across medium" in bare
    assert "sharp corners in the medium: none" in bare
    path = plug(tmp_path, ('name = "plug"', 'name = "plug"\nunits = { length = "mm", force = "N" }'))
    with_units = "\n".join(summary(check(*read_problem(path))))
    assert "uy = -0.02 mm at top" in with_units
    assert "0.2 mm before loading" in with_units


def test_the_picture_has_regions_by_name_edges_and_corners(checked: Checkup) -> None:
    (axes,) = checked.figure().axes
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels[:3] == list(checked.mesh.region_names)
    assert labels[-1] == "sharp corner"
    assert {"gap", "side", "$u_y$ = -0.02"} <= set(labels)
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    assert np.sort(np.transpose(crosses[0].get_data()), axis=0) == pytest.approx(np.array([[0.3, 0.5], [0.7, 0.5]]))
    none = dataclasses.replace(checked, corners=()).figure().axes[0]
    assert "sharp corner" not in [text.get_text() for text in none.get_legend().get_texts()]


# -- the command -----------------------------------------------------------------------------------------------------


def test_the_command_writes_one_picture_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], undrawn: None
) -> None:
    drawn: list[tuple[Path, int]] = []
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda _, path, dpi: drawn.append((path, dpi)))
    monkeypatch.chdir(tmp_path)
    plug(tmp_path)
    assert _run(["check", "plug.toml"]) == 0
    assert capsys.readouterr().out.endswith("picture: plug-check.png\n")
    assert _run(["check", "plug.toml", "--output", "a.SVG", "--json", "--set", "load.uy=-0.1", "--method", "vem"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["picture"], found["loads"][0]["value"]) == ("a.SVG", -0.1)
    assert drawn == [(Path("plug-check.png"), 150), (Path("a.SVG"), 150)]
    assert _run(["check", "plug.toml", "--no-picture", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["picture"] is None
    assert len(drawn) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["plug.toml"]


def test_strict_counts_cautions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(thin(tmp_path))
    assert _run(["check", path, "--no-picture"]) == 0
    assert _run(["check", path, "--no-picture", "--strict"]) == 1
    assert capsys.readouterr().err == "tmc-vem: 1 caution, and --strict allows none\n"
    assert _run(["check", str(plug(tmp_path)), "--no-picture", "--strict", "--set", "mesh.size=0.1"]) == 0


def test_a_picture_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = str(plug(tmp_path))

    def save(_: Any, path: Path, dpi: int) -> None:
        raise IsADirectoryError(21, "Is a directory", str(path))

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", save)
    for output, message in (
        ("a.jpeg", "--output a.jpeg: a picture ends in .png, .svg, .pdf"),
        ("nowhere/a.png", "--output nowhere/a.png: there is no directory nowhere"),
        (str(tmp_path / "full.png"), "cannot be written: Is a directory"),
    ):
        assert _run(["check", path, "--output", output]) == 2
        assert message in capsys.readouterr().err


def test_nothing_is_loaded_that_takes_long(tmp_path: Path) -> None:
    code = (
        "import sys; from tmc_vem.cli.main import _run; "
        f"code = _run(['check', {str(plug(tmp_path, ('steps = 1', '')))!r}, '--no-picture']); "
        "heavy = ('petsc4py', 'mpi4py', 'dolfinx', 'sympy', 'matplotlib'); "
        "print(code, [name for name in heavy if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("0 []\n")


OWN = "def f(F, G, p, m):\n    return {}\n"


@pytest.mark.parametrize(
    ("changes", "energy"),
    [
        ({"mesh.size": -1}, ""), ({"support": []}, ""), ({"support.2.ux": 5, "load": {"at": "top", "ux": 1}}, ""),
        ({"gap": ["tip", [0.5, 0.5]]}, ""), ({"gap": ["tip", "nowhere"]}, ""), ({"probes.side.at": [3, 3]}, ""),
        ({"probes.hold.at": "nothing"}, ""), ({"load.at": "nothing"}, ""), ({"solve.steps": 0}, ""),
        ({"solve.solver": "no_such"}, ""), ({"solve.path": [0, 1, 1]}, ""), ({"load.uy": 0}, ""),
        ({"solve.continuation": {"gamma": 1e-3}, "regions.medium.medium.gamma": 1e-3}, ""),
        ({"regions.base.solid": None}, "m.sqrt(F[0][1] ** 2)"),
        ({"mesh.cells": "voronoi", "solve.method": "fem"}, ""), ({"shapes.plug.rectangle": [0.3, 0.3, 0.7, 1]}, ""),
        ({"solve.element": {"degree": 1}}, ""),
        ({"solve.element": {"projection": "full"}, "mesh.cells": "voronoi"}, ""),
        ({"solve.follow": True, "solve.steps": 1}, ""), ({"shapes.plug.disc": [0, 0, 1]}, ""),
    ],
)  # fmt: skip
def test_check_refuses_what_a_run_refuses(tmp_path: Path, changes: dict[str, Any], energy: str) -> None:
    """With the same words, but for what only shows when a run begins."""
    if changes.get("solve.method") == "fem":
        pytest.importorskip("dolfinx")
    path = plug(tmp_path)
    if energy:
        (tmp_path / "own.py").write_text(OWN.format(energy))
        path = plug(tmp_path, ("solid = { K = 20, mu = 10 }", 'density = "own.py:f"'))
        changes = {}

    def said(look: Any) -> str:
        try:
            look(*read_problem(path, changes))
        except (InputError, CodegenError) as error:
            return str(error)
        return ""

    assert said(check) == said(lambda problem, options: prepare(problem, None, options))


def test_every_kind_of_load_is_said() -> None:
    lines = np.linspace(0.0, 1.0, 3)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("all", 0, 1, 0, 1)])
    named = dataclasses.replace(mesh, named_points={"tip": 0}, named_edges={"top": np.array([[6, 7], [7, 8]])})
    regions = {name: solid_region(Material(K=3.0, mu=1.0)) for name in named.region_names}
    (whole,) = named.region_names
    held = [Prescribed("top", 0, 0.5), PrescribedAcross("top", "normal", 0.25, axis=(0.0, 1.0)),
            PrescribedRotation("top", (0.0, 0.0), 90.0)]  # fmt: skip
    forces = [
        PointForce("a", "tip", (0.0, -2.0)), Traction("b", "top", (0.25, 0.0)), BodyForce("c", (whole,), (0.0, 1.0)),
        CavityPressure("d", "top", 3.0), FollowerPressure("e", "top", 4.0), Spring("f", "tip", (1.0, 0.0)),
    ]  # fmt: skip
    (part,) = parts(named, regions, held, forces)
    assert part.conditions == (
        ("ux", "top", 0.5), ("normal", "top", 0.25), ("rotation", "top", 90.0), ("force", "tip", (0.0, -2.0)),
        ("traction", "top", (0.25, 0.0)), ("body_force", whole, (0.0, 1.0)), ("cavity_pressure", "top", 3.0),
        ("pressure", "top", 4.0), ("stiffness", "tip", (1.0, 0.0)),
    )  # fmt: skip
    assert [len(vertices_loaded(named, each)) for each in (*held, *forces)] == [3, 3, 3, 1, 3, 9, 3, 3, 1]
    assert [_value(what, value, " mm") for what, _, value in part.conditions[:5]] == [
        "ux = 0.5 mm", "normal = 0.25 mm", "rotation = 90 degrees", "force = (0, -2)", "traction = (0.25, 0)",
    ]  # fmt: skip


def test_loads_with_names_and_histories(tmp_path: Path) -> None:
    (path,) = Path(__file__).parents[2].glob("demos/problems/bistable.toml")
    problem, options = read_problem(path)
    checked = check(problem, options)
    assert [(load.name, load.what, load.at, load.value) for load in checked.loads] == [
        ("air", "pressure", "top", 0.004)
    ]
    assert (checked.path, checked.steps) == ((0.0, 2.0), None)
    lines = summary(checked)
    assert f"load air: pressure = 0.004 at top, {checked.loads[0].n_vertices} vertices" in lines
    assert "path: 0 2 in automatic steps" in lines
    assert any("hinge" in line and "pressure = 0.004 at top" in line for line in lines)
