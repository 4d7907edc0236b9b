"""Cells that are smaller by themselves where regions are narrow: known sizes, and meshes where there were none."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_problem_file import SMALL, small

from tmc_vem import check
from tmc_vem.mesh.geometry import areas
from tmc_vem.mesh.make import fitted, growing
from tmc_vem.mesh.make.fitted import MARGIN, SMALLEST, Fit, fitted_mesh, fitted_size
from tmc_vem.mesh.make.growing import STEP, Growing
from tmc_vem.mesh.make.narrow import facing
from tmc_vem.mesh.make.outline import Arc, Region, make_skeleton
from tmc_vem.mesh.make.shapes import Shape, combine, disc, polygon, rectangle
from tmc_vem.mesh.make.triangles import triangle_mesh
from tmc_vem.mesh.make.voronoi import UnresolvedError, voronoi_mesh
from tmc_vem.mesh.polygon import PolygonMesh
from tmc_vem.problems.mesh_tables import MeshTable
from tmc_vem.problems.own import OwnProblem
from tmc_vem.simulation.problem_file import problem_text, read_problem
from tmc_vem.support.errors import InputError

ROOT = Path(__file__).parents[2]
FRAME = rectangle(-1.0, -1.0, 1.0, 1.0)
KINDS = ("voronoi", "triangles", "quadrilaterals")


def in_frame(**bodies: Shape) -> list[Region]:
    regions = {"medium": " - ".join(["frame", *bodies]), **{name: name for name in bodies}}
    return combine({"frame": FRAME, **bodies}, regions)


def made(kind: str, regions: list[Region], size: Any, **given: Any) -> PolygonMesh:
    def mesher(of: Any) -> PolygonMesh:
        if kind == "voronoi":
            return voronoi_mesh(regions, of)
        return triangle_mesh(regions, of, quadrilaterals=kind == "quadrilaterals")

    return fitted_mesh(mesher, regions, size, None, Fit(**given))


# -- sizes that grow from places ---------------------------------------------------------------------------------------


def some_places(n: int = 300) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(1)
    return random.uniform(-1.0, 1.0, (n, 2)), 10.0 ** random.uniform(-2.0, -0.5, n)


def test_the_size_is_the_smallest_that_any_place_asks_for() -> None:
    """Up to the rounding of sizes, downwards."""
    places, sizes = some_places()
    size = Growing(0.3, 0.25).with_places(places[:200], sizes[:200]).with_places(places[200:], sizes[200:])
    points = np.random.default_rng(2).uniform(-1.2, 1.2, (2000, 2))
    asked = sizes + 0.3 * np.hypot(*(points[:, None] - places).transpose(2, 0, 1))
    exact = np.minimum(asked.min(axis=1), 0.25)
    found = size(points)
    assert (found <= exact * (1.0 + 1e-9)).all()
    assert (found >= exact / STEP * (1.0 - 1e-9)).all()
    assert len(size.sizes_p) < 150, "those that say nothing are left out"


def test_many_points_get_the_same_sizes_as_few(monkeypatch: pytest.MonkeyPatch) -> None:
    size = Growing(0.3, lambda x: 0.2 + 0.1 * x[:, 0]).with_places(*some_places())
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (500, 2))
    by_pairs = size(points)
    monkeypatch.setattr(growing, "FEW_PAIRS", 0)
    assert size(points).tolist() == pytest.approx(by_pairs.tolist(), rel=1e-12)


def test_sizes_change_no_faster_than_they_grow() -> None:
    size = Growing(0.3, 1.0).with_places(*some_places())
    a, b = np.random.default_rng(3).uniform(-1.0, 1.0, (2, 3000, 2))
    assert (np.abs(size(a) - size(b)) <= 0.3 * np.hypot(*(a - b).T) * (1.0 + 1e-9)).all()


def test_nodes_are_close_where_cells_are_small_however_long_the_outline() -> None:
    """A place of 0.01 on a side of 1000 whose cells else have a size of 10."""
    region = Region("r", [(0.0, 0.0), (1000.0, 0.0), (1000.0, 50.0), (0.0, 50.0)])
    x = 613.21
    size = Growing(0.3, 10.0).with_places(np.array([(x, 0.0)]), np.array([0.01]))
    nodes = make_skeleton([region], size).nodes_nx
    along = np.sort(nodes[np.abs(nodes[:, 1]) < 1e-9][:, 0])
    near = np.searchsorted(along, x)
    assert along[near] - along[near - 1] < 0.02


# -- outlines that face each other -------------------------------------------------------------------------------------


def narrowest(regions: list[Region], reach: float, at: tuple[float, float] | None = None) -> float:
    """Smallest width that nodes have within a reach, all of them or those at a place."""
    skeleton = make_skeleton(regions, 0.05, turn=15.0)
    n, width, _ = facing(skeleton, np.full(len(skeleton.nodes_nx), reach))
    if at is not None:
        width = width[np.hypot(*(skeleton.nodes_nx[n] - at).T) < 1e-9]
    return float(width.min(initial=math.inf))


def blunt(radius: float) -> Region:
    """A square of 2 with rounded corners."""
    return combine({"s": rectangle(0.0, 0.0, 2.0, 2.0, radius)}, {"s": "s"})[0]


def test_what_faces_each_other() -> None:
    strip = [Region("s", [(0.0, 0.0), (3.0, 0.0), (3.0, 0.5), (0.0, 0.5)])]
    assert narrowest(strip, 1.0) == pytest.approx(0.5)
    assert narrowest(strip, 0.49) == math.inf
    assert narrowest(in_frame(a=disc(0.0, 0.0, 0.4), b=disc(0.7, 0.6, 0.5)), 0.3) == pytest.approx(
        math.hypot(0.7, 0.6) - 0.9, rel=0.05
    )


@pytest.mark.parametrize("radius", [0.0, 0.1, 0.5])
def test_corners_do_not_face_themselves(radius: float) -> None:
    """Neither sharp nor rounded ones; a disc is as wide as it is."""
    assert narrowest([blunt(radius)], 1.9) == math.inf
    assert narrowest([Region("d", disc(0.0, 0.0, 0.5).curves)], 0.9) == math.inf  # type: ignore[arg-type]
    assert narrowest([Region("d", disc(0.0, 0.0, 0.5).curves)], 1.1) == pytest.approx(1.0, rel=0.05)  # type: ignore[arg-type]


@pytest.mark.parametrize(("degrees", "narrow"), [(14.0, True), (20.0, False), (60.0, False)])
def test_wedges_are_narrow_if_their_sides_face_each_other(degrees: float, narrow: bool) -> None:
    tip = (2.0 * math.cos(math.radians(degrees)), 2.0 * math.sin(math.radians(degrees)))
    assert (narrowest([Region("w", [(0.0, 0.0), (2.0, 0.0), tip])], 0.3) < 0.1) == narrow


def test_a_corner_faces_a_side_and_another_corner() -> None:
    diamond = polygon([(0.0, -0.9), (0.4, -0.5), (0.0, -0.1), (-0.4, -0.5)])
    assert narrowest(in_frame(a=diamond), 0.2, (0.0, -0.9)) == pytest.approx(0.1)
    squares = in_frame(a=rectangle(-0.5, -0.5, 0.0, 0.0), b=rectangle(0.03, 0.04, 0.5, 0.5))
    assert narrowest(squares, 0.2, (0.0, 0.0)) == pytest.approx(0.05)
    above = in_frame(a=rectangle(-0.5, -0.9, 0.5, 0.0))
    assert narrowest(above, 0.2, (0.5, -0.9)) == pytest.approx(0.1)


# -- sizes that fit ----------------------------------------------------------------------------------------------------


def test_a_strip_has_as_many_cells_across_as_asked_for() -> None:
    strip = [Region("s", [(0.0, 0.0), (3.0, 0.0), (3.0, 0.2), (0.0, 0.2)])]
    middle = np.array([(1.5, 0.1), (1.5, 0.0), (0.3, 0.15)])
    for across in (2.0, 5.0):
        wanted = 0.2 / (MARGIN * across)
        h = fitted_size(strip, 1.0, fit=Fit(across=across))(middle)
        assert (h <= wanted * 1.2).all()
        assert (h >= wanted / STEP).all()


def test_what_is_wide_enough_keeps_its_size() -> None:
    assert not len(fitted_size([blunt(0.0)], 0.4).sizes_p)
    assert fitted_size([blunt(0.0)], lambda x: 0.1 + 0.1 * x[:, 0])(np.array([(1.0, 1.0)])).tolist() == [0.2]


@pytest.mark.parametrize("gap", [0.1, 0.01, 0.006])
@pytest.mark.parametrize("size", [0.1, 0.5])
def test_narrow_places_between_nodes_are_found(gap: float, size: float) -> None:
    """A disc over the frame's side, which has its narrowest place where neither has a node at first."""
    regions = in_frame(a=disc(0.137, -1.0 + 0.3 + gap, 0.3))
    h = fitted_size(regions, size)
    wanted = max(gap / (2.0 * MARGIN), SMALLEST * size)
    assert h(np.array([(0.137, -1.0 + 0.5 * gap)]))[0] == pytest.approx(wanted, rel=0.2)
    away = np.random.default_rng(0).uniform(-1.0, 1.0, (2000, 2))
    assert (h(away) <= size).all()
    assert h(away).max() > 0.9 * min(size, 0.3 * 0.7)


def test_short_pieces_and_named_points_make_cells_smaller() -> None:
    """Hardly larger than half the piece of 0.02 that two points cut off."""
    points = {"p": (1.0, 0.0), "q": (1.02, 0.0)}
    h = fitted_size([blunt(0.0)], 0.4, points)
    assert 0.01 / STEP <= h(np.array([(1.01, 0.0)]))[0] <= 0.01 / fitted.SHORT
    with pytest.raises(UnresolvedError, match="too quickly"):
        voronoi_mesh([blunt(0.0)], 0.4, points)
    assert 25 < voronoi_mesh([blunt(0.0)], h, points).n_cells < 200


def test_the_smallest_size_ends_it() -> None:
    """A disc that touches: 0 wide there, unless another limit is given than a hundredth."""
    regions = combine({"frame": FRAME, "d": disc(0.0, -0.7, 0.3)}, {"medium": "frame - d", "d": "d"})
    touching = np.array([(0.0, -1.0)])
    assert SMALLEST * 0.3 <= fitted_size(regions, 0.3)(touching)[0] <= SMALLEST * 0.3 * 1.5
    assert 0.02 <= fitted_size(regions, 0.3, fit=Fit(smallest=0.02))(touching)[0] <= 0.02 * 1.5
    pytest.importorskip("gmsh")
    mesh = made("triangles", regions, 0.3, smallest=0.02)
    assert mesh.n_cells < 1500


def test_too_many_cells_are_refused_with_the_place() -> None:
    strip = [Region("s", [(0.0, 0.0), (1000.0, 0.0), (1000.0, 0.01), (0.0, 0.01)])]
    with pytest.raises(InputError) as refused:
        fitted_size(strip, 1.0, fit=Fit(smallest=1e-5), limit=1e5)
    assert re.search(
        r"more than 1e\+05: .*The smallest, of size 0.004, fit = true wants near \(.*\), where region 's' is 0.01 "
        r"wide: give a larger smallest",
        str(refused.value),
    )
    with pytest.raises(InputError, match=r"where an outline has a piece of length 5e-05"):
        fitted_size([blunt(0.0)], 0.4, {"p": (1.0, 0.0), "q": (1.0001, 0.0)}, Fit(smallest=1e-9), limit=200)


def test_equal_shapes_get_equal_sizes() -> None:
    regions = in_frame(a=disc(0.0, 0.0, 0.4), b=rectangle(0.45, -0.5, 0.8, 0.5, 0.05))
    first, again = fitted_size(regions, 0.2), fitted_size(regions, 0.2)
    assert first.places_px.tobytes() == again.places_px.tobytes()
    assert first.sizes_p.tobytes() == again.sizes_p.tobytes()


# -- meshes that fit ---------------------------------------------------------------------------------------------------

PLACES: dict[str, Callable[[], list[Region]]] = {
    "two discs": lambda: in_frame(a=disc(-0.3, 0.0, 0.3), b=disc(0.32, 0.1, 0.3)),
    "disc and corner": lambda: in_frame(a=disc(-0.3, 0.0, 0.3), b=polygon([(0.03, 0.0), (0.5, -0.3), (0.5, 0.3)])),
    "corners": lambda: in_frame(a=rectangle(-0.5, -0.5, 0.0, 0.0), b=rectangle(0.03, 0.04, 0.5, 0.5)),
    "thin wall": lambda: in_frame(a=rectangle(-0.5, -0.8, -0.46, 0.6), b=rectangle(0.0, 0.0, 0.3, 0.3, 0.02)),
    "wedge": lambda: in_frame(a=polygon([(-0.8, -0.97), (0.8, -0.7), (0.8, 0.0), (-0.8, 0.0)])),
    "tiny disc": lambda: in_frame(a=disc(0.0, 0.0, 0.01), b=rectangle(0.02, -0.5, 0.5, 0.5)),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", PLACES)
def test_meshes_of_narrow_places(name: str, kind: str) -> None:
    """Interfaces are kept: the area of every region is that of its outline with the nodes that it has."""
    if kind != "voronoi":
        pytest.importorskip("gmsh")
    regions = PLACES[name]()
    mesh = made(kind, regions, 0.25)
    assert mesh.n_cells < 6000
    for region in regions:
        number = mesh.region_names.index(region.name)
        area = sum(areas(mesh.points_vx[of])[mesh.region_c[c] == number].sum() for _, c, of in mesh.cells_by_size())
        assert area == pytest.approx(region.polygon().area, rel=0.12 if "disc" in name else 0.01)


def refusing(where: tuple[float, float], above: float, tried: list[float]) -> Callable[[Any], PolygonMesh]:
    """A mesher that cannot do with cells above a size at a place."""

    def mesher(size: Any) -> PolygonMesh:
        tried.append(float(size(np.array([where]))[0]))
        if tried[-1] > above:
            raise UnresolvedError("it is not resolved", where)
        return "mesh"  # type: ignore[return-value]

    return mesher


def test_where_a_mesher_fails_cells_become_smaller() -> None:
    tried: list[float] = []
    assert fitted_mesh(refusing((1.0, 1.0), 0.15, tried), [blunt(0.0)], 0.4) == "mesh"
    assert len(tried) == 4
    assert tried[0] == 0.4
    assert tried == sorted(tried, reverse=True)
    with pytest.raises(InputError, match=r"^it is not resolved. fit = true makes no cells below 0.1.* there: give a"):
        fitted_mesh(refusing((1.0, 1.0), 0.05, tried), [blunt(0.0)], 0.4, fit=Fit(smallest=0.1))
    with pytest.raises(InputError, match=r"^it is not resolved. fit = true has tried cells down to 0.00.* there"):
        fitted_mesh(refusing((1.0, 1.0), 0.0, tried), [blunt(0.0)], 0.4, fit=Fit(smallest=1e-6))


# -- problem files -----------------------------------------------------------------------------------------------------


def without_refine(name: str, tmp_path: Path) -> Path:
    text = (ROOT / "demos" / "problems" / f"{name}.toml").read_text()
    path = tmp_path / f"{name}.toml"
    path.write_text(re.sub(r"^refine = \[.*?^\]$", "fit = true", text, flags=re.DOTALL | re.MULTILINE))
    assert "fit = true" in path.read_text()
    return path


@pytest.mark.parametrize("name", ["seal", "gripper", "hertz"])
def test_examples_need_no_refine(name: str, tmp_path: Path) -> None:
    """They are refused without, and have about as many cells, two or more across every gap."""
    path = without_refine(name, tmp_path)
    with pytest.raises(InputError, match=r"too narrow for cells.*; fit = true in \[mesh\] makes"):
        read_problem(path, {"mesh.fit": False})[0].make_mesh()
    by_hand = read_problem(ROOT / "demos" / "problems" / f"{name}.toml")[0].make_mesh()
    found = check(*read_problem(path))
    assert not found.cautions
    assert all(gap.n_cells >= 2 for gap in found.gaps)
    assert 0.8 < found.n_cells / by_hand.n_cells < 1.25
    pytest.importorskip("gmsh")
    for kind in KINDS[1:]:
        other = check(*read_problem(path, {"mesh.cells": kind}))
        assert not other.cautions
        assert all(gap.n_cells >= 2 for gap in other.gaps)


def problem(tmp_path: Path, mesh: str) -> OwnProblem:
    return read_problem(small(tmp_path, SMALL.replace("size = 0.1", mesh)))[0]


def test_what_fit_goes_with(tmp_path: Path) -> None:
    for mesh, message in (
        ("size = 0.1\nacross = 3", "across = 3 is for fit = true"),
        ("size = 0.1\nsmallest = 0.01", "smallest = 0.01 is for fit = true"),
        ("size = 0.1\nfit = true\nacross = 1.5", "across = 1.5: use 2 to 100"),
        ("size = 0.1\nfit = true\nsmallest = 0", "smallest = 0 must be a positive number"),
        ("size = 0.1\nfit = true\nsmallest = 0.2", "smallest = 0.2 is larger than size = 0.1"),
        ("size = 0.1\nfit = 1", "fit = 1 must be true or false"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            problem(tmp_path, mesh)
    with pytest.raises(InputError, match="fit and cells = 'grid' do not go together"):
        read_problem(small(tmp_path, SMALL.replace('"triangles"', '"grid"')), {"mesh.fit": True})
    with pytest.raises(InputError, match=r"file = 'a\.msh' and fit = true do not go together"):
        replace(problem(tmp_path, "size = 0.1").table, shapes={}, mesh=MeshTable(file="a.msh", fit=True))


def test_fit_is_part_of_what_a_run_is_known_by_only_if_it_is_on(tmp_path: Path) -> None:
    plain = problem(tmp_path, "size = 0.1")
    assert {"fit", "across", "smallest"}.isdisjoint(plain.inputs()["mesh"])
    fitted_one = problem(tmp_path, "size = 0.1\nfit = true\nacross = 3\nsmallest = 0.02")
    assert {"fit": True, "across": 3.0, "smallest": 0.02}.items() <= fitted_one.inputs()["mesh"].items()
    path = tmp_path / "again.toml"
    path.write_text(problem_text(fitted_one, read_problem(tmp_path / "plug.toml")[1]))
    assert read_problem(path)[0].inputs() == fitted_one.inputs()
    switched = replace(plain, table=replace(plain.table, mesh=replace(plain.table.mesh, fit=True)))
    assert switched.make_mesh().n_cells > 0


def test_other_sizes_keep_the_proportions(tmp_path: Path) -> None:
    of = problem(tmp_path, "size = 0.1\nfit = true\nacross = 3\nsmallest = 0.02").with_size(0.08).table.mesh
    assert (of.size, of.across, of.smallest, of.fit) == (0.08, pytest.approx(3.75), pytest.approx(0.016), True)
    with pytest.raises(InputError, match=r"leaves 1.5 cells across narrow places, where 2 are needed: use cells up to"):
        problem(tmp_path, "size = 0.1\nfit = true\nacross = 3").with_size(0.2)


def test_far_from_the_origin_cells_fit_as_well(tmp_path: Path) -> None:
    """Also where messages say places."""
    text = SMALL.replace("size = 0.1", "size = 0.25\nfit = true").replace("triangles", "voronoi")
    text = text.replace("plug = { rectangle = [0.3, 0.5,", "plug = { rectangle = [0.3, 0.35,").replace(
        "0.5, 0.5", "0.5, 0.35"
    )
    near = read_problem(small(tmp_path, text))[0].make_mesh()

    def away(match: re.Match[str]) -> str:
        numbers = [float(word) for word in match[2].split(",")]
        moved = [value + (4e6 if n % 2 == 0 else 0.0) for n, value in enumerate(numbers)]
        return f"{match[1]}[{', '.join(map(repr, moved))}]"

    text = re.sub(r"(rectangle = |tip = |ground = )\[([^\]]*)\]", away, text)
    text = text.replace("[[0, 0], [1, 0]]", "[[4e6, 0], [4000001.0, 0]]")
    far = read_problem(small(tmp_path, text))[0]
    mesh = far.make_mesh()
    assert mesh.n_cells == near.n_cells
    assert mesh.points_vx - (4e6, 0.0) == pytest.approx(near.points_vx, abs=1e-8)
    with pytest.raises(InputError, match=r"too narrow.*\(places are counted from \(4000000"):
        read_problem(small(tmp_path, text), {"mesh.fit": False})[0].make_mesh()


def test_arcs_alone() -> None:
    """A ring, whose outlines have no corners."""
    outer = [Arc((0.0, 0.0), 1.0, 0.0, 180.0), Arc((0.0, 0.0), 1.0, 180.0, 360.0)]
    inner = [Arc((0.0, 0.0), 0.9, 0.0, 180.0), Arc((0.0, 0.0), 0.9, 180.0, 360.0)]
    mesh = made("voronoi", [Region("ring", outer, [inner])], 0.4)
    assert 2 * 150 < mesh.n_cells < 4 * 150


def test_comparisons_begin_with_cells_that_fit() -> None:
    assert MeshTable(size=0.1).possible((2.0, 1.5, 1.0)) == (2.0, 1.5, 1.0)
    assert MeshTable(size=0.1, fit=True).possible((2.0, 1.5, 1.0)) == (1.0, 0.75, 0.5)
    assert MeshTable(size=0.1, fit=True, across=3.0).possible((2.0, 1.0)) == (1.5, 0.75)
    assert MeshTable(size=0.1, fit=True, across=8.0).possible((2.0, 1.0)) == (2.0, 1.0)
