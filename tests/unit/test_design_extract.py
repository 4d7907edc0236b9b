"""From a design to a body-fitted problem: its mesh, its names, its files, and what it gives when it is solved."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

import tmc_vem
from tmc_vem.design.extract import DesignMaterials, Extracted, extracted_problem
from tmc_vem.design.extract_compare import compare_runs, comparison_table
from tmc_vem.design.extract_figure import density_figure
from tmc_vem.design.extract_files import write_extracted
from tmc_vem.design.extract_mesh import with_point
from tmc_vem.design.extract_options import ExtractOptions
from tmc_vem.mesh.check import find_faults
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make.outline import Region, make_skeleton
from tmc_vem.mesh.make.polyline import Polyline
from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.make.voronoi import voronoi_mesh
from tmc_vem.mesh.parts import submesh, with_names
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.description import MediumTable
from tmc_vem.problems.materials import Material
from tmc_vem.problems.own import OwnProblem
from tmc_vem.results.records import StepRecord
from tmc_vem.results.run_result import RunResult
from tmc_vem.simulation.options import RunOptions
from tmc_vem.simulation.problem_file import read_problem
from tmc_vem.support.errors import InputError

Float = NDArray[np.float64]

# A frame with two arms, of which the lower one is pressed; a pad at its end is no design.
TEXT = """
name = "fork"
gap = [[2.0, 0.6], [2.0, 0.4]]
[shapes]
room = {{ rectangle = [0, 0, 2, 1] }}
pad = {{ rectangle = [2, 0.4, 2.2, 0.6] }}
{shapes}
[regions.design]
shape = "{design}"
solid = {{ K = 20, mu = 10 }}
[regions.pad]
shape = "pad"
solid = {{ K = 20, mu = 10 }}
{regions}
[mesh]
size = {size}
[points]
tip = [2.2, 0.5]
foot = [0.0, 0.5]
[edges]
wall = {{ line = [[0, 0], [0, 1]] }}
end = {{ line = [[2.2, 0.4], [2.2, 0.6]] }}
[probes]
tip = {{ displacement = "uy", at = "tip" }}
foot = {{ position = "y", at = "foot" }}
stored = {{ energy = "stored", region = "design" }}
[[support]]
at = "wall"
ux = 0
uy = 0
[load]
at = "end"
uy = -0.02
[solve]
steps = 1
"""
SHAPE = shapely.box(0, 0.7, 2, 0.9) | shapely.box(0, 0.4, 2, 0.6) | shapely.box(1.6, 0.4, 2, 0.9)
EXACT = {
    "shapes": "outer = { rectangle = [0, 0.4, 2, 0.9] }\nslot = { rectangle = [0, 0.6, 1.6, 0.7] }",
    "design": "outer - slot",
    "regions": '[regions.medium]\nshape = "room - (outer - slot)"\nmedium = { gamma = 1e-5, alpha_r = 0.1 }',
}
MATERIALS = {"design": DesignMaterials(Material(K=20, mu=10), MediumTable(gamma=1e-5, alpha_r=0.1))}


def problem(directory: Path, size: float = 0.1, **more: str) -> OwnProblem:
    text = TEXT.format(size=size, **({"shapes": "", "design": "room", "regions": ""} | more))
    (directory / "fork.toml").write_text(text)
    return read_problem(directory / "fork.toml")[0]


def fractions(mesh: PolygonMesh, shape: Any) -> Float:
    cells = np.array([shapely.Polygon(mesh.points_vx[loop]) for loop in mesh.cells()])
    return np.asarray(shapely.area(shapely.intersection(cells, shape)) / shapely.area(cells))


def area_of(mesh: PolygonMesh, name: str) -> float:
    chosen = mesh.region_c == mesh.region_names.index(name)
    return float(sum(areas(mesh.points_vx[loops])[chosen[cells]].sum() for _, cells, loops in mesh.cells_by_size()))


@functools.cache
def fork(directory: Path, size: float = 0.05, **options: Any) -> tuple[OwnProblem, PolygonMesh, Extracted]:
    design = problem(directory, size)
    mesh = design.make_mesh()
    found = extracted_problem(design, mesh, fractions(mesh, SHAPE), MATERIALS, ExtractOptions(**options))
    return design, mesh, found


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fork")


def test_mesh(directory: Path) -> None:
    """Valid, with all names, and solid where the design is."""
    _, _, found = fork(directory)
    mesh = found.mesh
    assert find_faults(mesh) == []
    assert set(mesh.region_names) == {"solid", "medium", "pad"}
    assert area_of(mesh, "pad") == pytest.approx(0.04, rel=1e-9)
    assert area_of(mesh, "solid") == found.volume_mesh == pytest.approx(SHAPE.area, rel=0.01)
    assert area_of(mesh, "solid") + area_of(mesh, "medium") == pytest.approx(2.0, rel=1e-9)
    assert found.outlines.volume == pytest.approx(found.outlines.volume_cleaned, rel=1e-5)
    assert found.notes == ()


def test_names_stay_where_they_are(directory: Path) -> None:
    _, design, found = fork(directory)
    mesh = found.mesh
    assert set(mesh.named_points) == {"tip", "foot"}
    for name, vertex in mesh.named_points.items():
        assert mesh.points_vx[vertex] == pytest.approx(design.points_vx[design.named_points[name]], abs=1e-12)
    for name, x, length in (("wall", 0.0, 1.0), ("end", 2.2, 0.2)):
        ends = mesh.points_vx[mesh.named_edges[name]]
        assert ends[..., 0] == pytest.approx(x, abs=1e-12)
        assert np.hypot(*(ends[:, 1] - ends[:, 0]).T).sum() == pytest.approx(length, rel=1e-9)
    for place in ((2.0, 0.6), (2.0, 0.4)):  # of the gap, by coordinates
        mesh.find_vertex(*place)


def test_places_of_probes_become_vertices(tmp_path: Path) -> None:
    """Also those that are given by coordinates, inside a solid; the mesh does not get names for them."""
    (tmp_path / "fork.toml").write_text(
        TEXT.format(size=0.1, shapes="", design="room", regions="")
        + '[probes.inner]\ndisplacement = "ux"\nat = [1.0, 0.5]\n[probes.under]\nposition = "y"\nat = [1.0, 0.2]\n'
    )
    design = read_problem(tmp_path / "fork.toml")[0]
    mesh = structured_quadrilaterals(
        np.linspace(0, 2.2, 45), np.linspace(0, 1, 21),
        [Rectangle("none", 0, 2.2, 0, 1), Rectangle("design", 0, 2, 0, 1), Rectangle("pad", 2, 2.2, 0.4, 0.6)],
        {"tip": (2.2, 0.5), "foot": (0.0, 0.5)},
    )  # fmt: skip
    mesh = submesh(mesh, mesh.region_c != mesh.region_names.index("none"))
    mesh = with_names(mesh, None, {"wall": ((0, 0), (0, 1)), "end": ((2.2, 0.4), (2.2, 0.6))})
    found = extracted_problem(design, mesh, fractions(mesh, SHAPE), MATERIALS)
    for place in ((1.0, 0.5), (1.0, 0.2), (2.0, 0.6), (2.0, 0.4)):
        found.mesh.find_vertex(*place, tolerance=1e-12)
    assert set(found.mesh.named_points) == {"tip", "foot"}
    assert find_faults(found.mesh) == []
    assert found.volume_mesh == pytest.approx(SHAPE.area, rel=0.01)


def test_narrow_gaps_are_meshed(directory: Path) -> None:
    """At least two cells across the slot, which is as wide as one of the design's cells."""
    _, _, found = fork(directory, 0.1, across=3.0)
    in_slot = found.mesh.points_vx[(np.abs(found.mesh.points_vx - (0.8, 0.65)) < (0.3, 0.03)).all(axis=1)]
    assert len(in_slot) > 10


def test_files(directory: Path, tmp_path: Path) -> None:
    """The written problem is read as it was, from a directory of its own."""
    _, _, found = fork(directory)
    path, made = write_extracted(found, tmp_path / "out", "fork_fitted", solve={"steps": 2})
    assert sorted(file.name for file in path.parent.iterdir()) == ["fork_fitted.toml", "fork_fitted.vtu"]
    read, options = read_problem(path)
    assert read.table == made.table
    assert options.steps == 2
    assert path.read_text().startswith("# A design by its outlines")
    assert f"of the mesh {found.volume_mesh:.6g}" in path.read_text()
    mesh = read.make_mesh()
    assert np.array_equal(mesh.points_vx, found.mesh.points_vx)
    assert dict(mesh.named_points) == dict(found.mesh.named_points)
    assert read.table.probes["stored"].region == "solid"
    assert read.table.name == "fork, extracted"
    assert not read.table.shapes


def test_files_of_the_design_are_found(tmp_path: Path) -> None:
    """Energies and regularisers in files are named from the root."""
    (tmp_path / "mine.py").write_text("def twice(F, G, p, m):\n    return G[0][0][0] ** 2 + 0 * F[0][0]\n")
    design = problem(tmp_path, 0.2)
    mesh = design.make_mesh()
    medium = MediumTable(gamma=1e-5, alpha_r=0.1, regulariser="mine.py:twice")
    found = extracted_problem(
        design, mesh, fractions(mesh, SHAPE), {"design": replace(MATERIALS["design"], medium=medium)}
    )
    path, made = write_extracted(found, tmp_path / "elsewhere")
    table = read_problem(path)[0].table.regions["medium"].medium
    assert table is not None
    assert table.regulariser == f"{tmp_path.resolve()}/mine.py:twice"
    assert made.table.regions["medium"].medium == table


def test_solved(directory: Path, tmp_path: Path) -> None:
    """The force of the extracted problem is that of the shape meshed as it is, up to what cells of this size make of
    its area and corners."""
    _, _, found = fork(directory)
    path, _ = write_extracted(found, tmp_path / "out")
    extracted = tmc_vem.run(read_problem(path)[0], tmp_path / "run", read_problem(path)[1])
    design = problem(tmp_path, 0.05, **EXACT)
    exact = tmc_vem.run(design, tmp_path / "exact", RunOptions(steps=1))
    assert extracted.complete
    assert exact.complete
    assert extracted.probes["tip"] == pytest.approx(-0.02)
    assert extracted.reaction is not None
    assert extracted.reaction == pytest.approx(exact.reaction, rel=0.04)
    assert extracted.probes["stored"] == pytest.approx(exact.probes["stored"], rel=0.04)


# -- names of regions --------------------------------------------------------------------------------------------------


def test_passive_media(tmp_path: Path) -> None:
    """A passive medium like that in void becomes one region with it; another keeps its name, and its border."""
    text = TEXT.format(
        size=0.1, shapes="below = { rectangle = [0, -0.3, 2, 0] }", design="room",
        regions='[regions.medium]\nshape = "below"\nmedium = { gamma = 1e-5, alpha_r = 0.1 }',
    )  # fmt: skip
    (tmp_path / "fork.toml").write_text(text)
    design = read_problem(tmp_path / "fork.toml")[0]
    mesh = design.make_mesh()
    density = fractions(mesh, SHAPE)
    same = extracted_problem(design, mesh, density, MATERIALS)
    assert set(same.table.regions) == {"solid", "medium", "pad"}
    assert area_of(same.mesh, "medium") == pytest.approx(2.6 - same.volume_mesh)
    other = {"design": replace(MATERIALS["design"], medium=MediumTable(gamma=1e-6, alpha_r=0.1))}
    apart = extracted_problem(design, mesh, density, other)
    assert set(apart.table.regions) == {"solid", "medium", "design_medium", "pad"}
    assert area_of(apart.mesh, "medium") == pytest.approx(0.6)
    assert find_faults(apart.mesh) == []


def test_graded_by_cell_data_is_refused(directory: Path) -> None:
    design, mesh, _ = fork(directory)
    pad = replace(design.table.regions["pad"], shape=None, graded={"mu": "stiffness"})
    table = replace(
        design.table, shapes={}, points={}, edges={}, mesh=replace(design.table.mesh, size=None, file="a.vtu"),
        regions={"design": replace(design.table.regions["design"], shape=None), "pad": pad},
    )  # fmt: skip
    with pytest.raises(InputError, match="regions: pad: graded by 'stiffness' of the design's mesh"):
        extracted_problem(OwnProblem(table, directory), mesh, np.ones(mesh.n_cells), MATERIALS)


def test_options_that_are_none() -> None:
    for options, message in (
        ({"level": 1.5}, "level = 1.5: use 0.01 to 0.99"),
        ({"narrowest": 0.0}, "narrowest = 0"),
        ({"smoothing": -1}, "smoothing = -1: use 0 to 1000 passes"),
        ({"cells": "hexagons"}, "cells"),
        ({"size": -1.0}, "size = -1"),
    ):
        with pytest.raises(InputError, match=message):
            ExtractOptions(**options)


# -- meshes ------------------------------------------------------------------------------------------------------------


def test_a_named_point_inside_a_region() -> None:
    lines = np.linspace(0.0, 1.0, 11)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("design", 0, 1, 0, 1)])
    moved = with_point(mesh, "inside", (0.53, 0.48))
    assert moved.points_vx[moved.named_points["inside"]].tolist() == [0.53, 0.48]
    assert find_faults(moved) == []
    coarse = structured_quadrilaterals([0, 1], [0, 1], [Rectangle("design", 0, 1, 0, 1)])
    with pytest.raises(InputError, match=r"named point 'inside' at .* no vertex can be moved there"):
        with_point(coarse, "inside", (0.5, 0.5))


def test_polylines() -> None:
    curve = Polyline(((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)))
    assert curve.length == 7.0
    assert curve.at(np.array([0.0, 3.0 / 7.0, 5.0 / 7.0, 1.0])) == pytest.approx(
        np.array([[0, 0], [3, 0], [3, 2], [3, 4]])
    )
    assert curve.parameter_of((4.0, 2.0)) == (pytest.approx(5.0 / 7.0), 1.0)
    part = curve.part(1.0 / 7.0, 5.0 / 7.0, (1.0, 0.0), (3.0, 2.0))
    assert part.points == ((1.0, 0.0), (3.0, 0.0), (3.0, 2.0))
    with pytest.raises(InputError, match=r"a polyline stands still at \(0, 0\)"):
        Polyline(((0.0, 0.0), (0.0, 0.0), (1.0, 0.0)))
    with pytest.raises(InputError, match="at least 2 points, got 1"):
        Polyline(((0.0, 0.0),))


@pytest.mark.parametrize("origin", [(0.0, 0.0), (3e5, -2e5)])
def test_meshes_of_polylines(origin: tuple[float, float]) -> None:
    """Nodes follow the size along a polyline, not its points; both sides share them, also far from the origin."""
    angle = np.linspace(0.0, np.pi, 201)
    arc = np.column_stack([0.5 + 0.3 * np.cos(angle), 0.5 + 0.3 * np.sin(angle)]) + origin
    upper = Polyline(tuple(map(tuple, arc.tolist())))
    lower = Polyline(tuple(map(tuple, (2.0 * (0.5 + np.array(origin)) - arc).tolist())))
    square = [(origin[0] + x, origin[1] + y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    regions = [Region("around", square, [[upper, lower]]), Region("disc", [upper, lower])]
    assert len(make_skeleton(regions, 0.1).segments_sn) == 4 * 10 + 2 * 9
    mesh = voronoi_mesh(regions, 0.1)
    assert find_faults(mesh) == []
    assert area_of(mesh, "disc") == pytest.approx(np.pi * 0.09, rel=0.03)
    pytest.importorskip("gmsh")
    assert area_of(triangle_mesh(regions, 0.1), "disc") == pytest.approx(area_of(mesh, "disc"), rel=1e-6)


# -- pictures ----------------------------------------------------------------------------------------------------------


def test_figure(directory: Path) -> None:
    _, mesh, found = fork(directory)
    density = np.where(mesh.region_c == mesh.region_names.index("pad"), np.nan, fractions(mesh, SHAPE))
    figure = density_figure(mesh, density, found.outlines.solid)
    cells, _, lines = figure.axes[0].collections
    colours = cells.get_facecolors()[:, :3]
    assert len(colours) == mesh.n_cells
    assert colours[np.nanargmax(density)] == pytest.approx(1.0 - np.nanmax(density))
    assert (colours[np.isnan(density), 2] > colours[np.isnan(density), 0]).all()  # blue
    assert len(lines.get_segments()) == found.outlines.parts + found.outlines.holes
    moved = density_figure(mesh, density, found.outlines.solid, 0.1 * mesh.points_vx, "stretched")
    there = np.concatenate(moved.axes[0].collections[2].get_segments())
    here = np.concatenate(lines.get_segments())
    assert there.max(axis=0) == pytest.approx(1.1 * here.max(axis=0), rel=1e-6)
    assert moved.axes[0].get_title() == "stretched"
    wide = max(path.vertices[:, 0].max() for path in moved.axes[0].collections[0].get_paths())
    assert wide == pytest.approx(1.1 * 2.2)
    with pytest.raises(InputError, match="densities have shape"):
        density_figure(mesh, density[1:])
    with pytest.raises(InputError, match="displacements have shape"):
        density_figure(mesh, density, None, mesh.points_vx[1:])


# -- comparison --------------------------------------------------------------------------------------------------------


def run_of(directory: Path, *steps: tuple[float, float, dict[str, float]]) -> RunResult:
    """A run that has reached some loads, with reactions and probes."""
    history = [
        StepRecord(
            n, load, -0.2 * load, probes, reaction, iterations=3, cut_backs=0, wasted_iterations=0, min_j={}, energy={},
            negative_pivots=0, jumped=False, seconds=1.0,
        )
        for n, (load, reaction, probes) in enumerate(steps, start=1)
    ]  # fmt: skip
    return RunResult(
        inputs={}, versions={}, complete=False, reason="", load=1.0, n_cells=1, n_dofs=1, newton_iterations=0,
        cut_backs=0, projection_degrees={}, seconds={}, history=history, directory=directory,
    )  # fmt: skip


def test_comparison(directory: Path) -> None:
    """At the last load that both reached, between steps on a line."""
    _, _, found = fork(directory)
    design = run_of(directory, (0.5, -1.0, {"tip": 0.1, "own": 1.0}), (1.0, -3.0, {"tip": 0.3, "own": 1.0}))
    fitted = run_of(directory, (0.75, -2.1, {"tip": 0.19}))
    rows = {row.name: row for row in compare_runs(design, fitted, found)}
    assert list(rows) == ["volume", "displacement", "reaction", "tip"]
    assert (rows["reaction"].design, rows["reaction"].extracted) == (pytest.approx(-2.0), -2.1)
    assert rows["reaction"].difference == pytest.approx(0.05)
    assert rows["displacement"].difference == pytest.approx(0.0)
    assert rows["tip"].design == pytest.approx(0.2)
    assert rows["volume"].extracted == found.volume_mesh
    table = comparison_table(design, fitted)
    assert table.caption.endswith("at 0.75 of the load.")
    assert tuple(table.rows[1]) == ("reaction", "-2.0000e+00", "-2.1000e+00", "+5.00 %")
    with pytest.raises(InputError, match="the run of the extracted problem has no load step"):
        compare_runs(design, run_of(directory))
