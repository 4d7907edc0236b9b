"""The tables of problem files entry by entry: limits on both sides, what is made of them, names by number."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tmc_vem.mesh.make.structured import Rectangle, structured_quadrilaterals
from tmc_vem.mesh.parts import with_names
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.problems.description import (
    ConditionTable,
    MediumTable,
    ProbeTable,
    ProblemTable,
    RegionTable,
)
from tmc_vem.problems.mesh_tables import HUGE, STEEPEST, EdgesTable, MeshTable, RefineTable, ShapeTable
from tmc_vem.problems.own import OwnProblem, find_edges
from tmc_vem.problems.probes import Displacement, Gap, MeanJ, Position, Reaction, check_name, check_probes
from tmc_vem.problems.shaped_mesh import distance_to_line, size_of
from tmc_vem.support.errors import InputError
from tmc_vem.system.constraints import Prescribed

STEEL = Material(K=20.0, mu=10.0)
ONE_OF = (
    "give one of displacement, position, gap, reaction, value, smallest, largest, mean, integral, p_norm, energy, "
    "cut_force, contact"
)


def refused(message: str, make: Any, *arguments: Any, **named: Any) -> None:
    with pytest.raises(InputError) as caught:
        make(*arguments, **named)
    assert str(caught.value) == message


# -- descriptions ----------------------------------------------------------------------------------------------------

SOLID = RegionTable(solid=STEEL)


def table(**changes: Any) -> ProblemTable:
    values: dict[str, Any] = {
        "name": "p", "regions": {"a": SOLID}, "support": (ConditionTable("bottom", 0.0, 0.0),),
        "load": ConditionTable("top", uy=-0.1), "mesh": MeshTable(file="a.msh"),
    }  # fmt: skip
    return ProblemTable(**{**values, **changes})


SQUARE = ShapeTable(rectangle=(0.0, 0.0, 1.0, 1.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ConditionTable("a"), "give ux, uy, normal or tangential; ux = 0 holds, what is left out is free"),
        (lambda: ConditionTable("a", ux=0.0), None),
        (lambda: ConditionTable("a", uy=0.0), None),
        (lambda: ConditionTable("a", 0.0, math.inf), "uy = inf must be a finite number: a displacement"),
        (lambda: ConditionTable("a", math.nan), "ux = nan must be a finite number: a displacement"),
        (lambda: EdgesTable(), "give at least one of line, circle, box and between"),
        (lambda: EdgesTable(line=((0.0, 0.0), (2 * HUGE, 0.0))), f"line = {2 * HUGE:g}: use {-HUGE:g} to {HUGE:g}"),
        (lambda: EdgesTable(circle=(0.0, -2 * HUGE, 1.0)), f"circle = {-2 * HUGE:g}: use {-HUGE:g} to {HUGE:g}"),
        (lambda: EdgesTable(box=(0.0, 0.0, 1.0, math.nan)), f"box = nan: use {-HUGE:g} to {HUGE:g}"),
        (lambda: EdgesTable(box=(-HUGE, 0.0, HUGE, 1.0)), None),
        (lambda: RefineTable((0.0, 2 * HUGE), 0.1), f"near = {2 * HUGE:g}: use {-HUGE:g} to {HUGE:g}"),
        (lambda: RefineTable((0.0, 0.0), 0.0), "size = 0 must be a positive number: of the cells, a length"),
        (lambda: RefineTable((0.0, 0.0), 0.1, math.inf), "within = inf must be a finite number: a distance"),
        (lambda: MeshTable(growth=1e-9), None),
        (lambda: MeshTable(growth=0.5), None),
        (lambda: MeshTable(growth=STEEPEST), None),
        (lambda: MeshTable(growth=0.0), "growth = 0 must be a positive number: try 0.3"),
        (lambda: MeshTable(growth=2 * STEEPEST),
         f"growth = {2 * STEEPEST:g}: use 0 to {STEEPEST:g}, a cell is twice as large as its neighbour at 1; try 0.3"),
        (lambda: MeshTable(size=-1.0), "size = -1 must be a positive number: of the cells, a length"),
        (lambda: MeshTable(region_data="a"), "names, region_data and cracks are for a mesh file"),
        (lambda: MeshTable(names={"1": "a"}), "names, region_data and cracks are for a mesh file"),
        (lambda: MeshTable(cracks="keep"), "names, region_data and cracks are for a mesh file"),
        (lambda: MeshTable(file="a", cracks="keep", names={"1": "a"}, region_data="b"), None),
        (lambda: MediumTable(h=0.5), "h = 0.5 belongs to alpha, alpha_r = alpha mu h^2: give alpha, or leave h out"),
        (lambda: MediumTable(alpha=1.0, h=0.5), None),
        (lambda: RegionTable(),
         "give one of solid, medium and density, or solid and medium for a design region, not none"),
        (lambda: RegionTable(solid=STEEL, density="a.py:f"),
         "give one of solid, medium and density, or solid and medium for a design region, not solid and density"),
        (lambda: RegionTable(solid=STEEL, is_medium=False),
         "is_medium is for a density of your own; 'medium = {...}' is third medium as it is"),
        (lambda: RegionTable(density="a.py:f", is_medium=False), None),
        (lambda: ShapeTable().shape(), "give one of rectangle, polygon and disc, not none"),
        (lambda: ShapeTable(rectangle=(0, 0, 1, 1), disc=(0, 0, 1)).shape(),
         "give one of rectangle, polygon and disc, not rectangle and disc"),
        (lambda: ShapeTable(disc=(0, 0, 1), rounded=0.1).shape(), "'rounded' is for rectangles and polygons"),
        (lambda: ProbeTable(), f"{ONE_OF}, not none"),
        (lambda: ProbeTable(mean="J", reaction="ux", at="a"),
         f"{ONE_OF}, not reaction and mean"),
        (lambda: ProbeTable(displacement="ux"), "displacement lacks 'at'"),
        (lambda: ProbeTable(displacement="ux", at="a", region="b"), "displacement has no use for 'region'"),
        (lambda: ProbeTable(mean="J"), "mean lacks a place: give region, edges or line"),
        (lambda: ProbeTable(mean="J", region="a", at="b"), "mean has no use for 'at'"),
        (lambda: ProbeTable(gap=("a", "b"), at="c"), "gap has no use for 'at'"),
        (lambda: ProbeTable(reaction="ux", at=(0.0, 1.0)), "at: a reaction needs the name of a point or of edges"),
        (lambda: ProbeTable(energy="K", region="a"), "unknown energy 'K': choose one of stored"),
        (lambda: table(load=ConditionTable("top", 0.1, 0.1)),
         "load: give one of ux and uy; further components belong to [[support]]"),
        (lambda: table(load=ConditionTable("top", ux=0.1)), None),
        (lambda: table(gap=("a", "b"), probes={"gap": ProbeTable(gap=("a", "b"))}),
         "probes: gap: there is a gap at the top of the file already; leave out one of them"),
        (lambda: table(probes={"gap": ProbeTable(gap=("a", "b"))}), None),
        (lambda: table(points={"a": (0, 0)}, edges={"a": EdgesTable(box=(0, 0, 1, 1))}),
         "points: 'a' is the name of edges too: give one of them another name"),
        (lambda: table(regions={}), "regions: there is none"),
        (lambda: table(mesh=MeshTable(size=0.1)), "mesh: give either a file, or shapes to make it from"),
        (lambda: table(shapes={"s": SQUARE}), "mesh: give either a file, or shapes to make it from"),
        (lambda: table(shapes={"s": SQUARE}, mesh=MeshTable()), "mesh: give the size of the cells, a length"),
        (lambda: table(shapes={"s": SQUARE}, mesh=MeshTable(size=0.1)), "regions: a: lacks 'shape'"),
        (lambda: table(regions={"a": replace(SOLID, shape="s")}),
         "regions: a: has a shape, but the mesh comes from a file"),
        (lambda: table(regions={"a": replace(SOLID, shape="s")}, shapes={"s": SQUARE}, mesh=MeshTable(size=0.1)), None),
        (lambda: table(mesh=MeshTable(file="a", growth=0.2)),
         "mesh: file = 'a' and growth = 0.2 do not go together: the file has its cells already, so leave out growth"),
        (lambda: table(mesh=MeshTable(file="a", refine=(RefineTable((0.0, 0.0), 0.1),))),
         "mesh: file = 'a' and refine do not go together: the file has its cells already, so leave out refine"),
    ],
)  # fmt: skip
def test_limits_of_descriptions(make: Any, message: str | None) -> None:
    if message is None:
        make()
    else:
        refused(message, make)


def test_probes_of_a_description() -> None:
    assert ProbeTable(displacement="ux", at="a").probe() == Displacement("ux", "a")
    assert ProbeTable(position="y", at=(0.0, 1.0)).probe() == Position("y", (0.0, 1.0))
    assert ProbeTable(gap=("a", (1.0, 2.0))).probe() == Gap("a", (1.0, 2.0))
    assert ProbeTable(reaction="uy", at="a").probe() == Reaction("uy", "a")
    assert ProbeTable(mean="J", region="r").probe() == MeanJ("r")


def test_probes_in_words_and_their_names() -> None:
    probes = (Displacement("ux", "a"), Position("y", (0.5, 1.0)), Gap("a", (1.0, 2.0)), Reaction("uy", "b"), MeanJ("r"))
    assert [str(probe) for probe in probes] == [
        "ux of a", "y of (0.5, 1), deformed", "distance of a and (1, 2)", "reaction to uy at b", "mean of J over r",
    ]  # fmt: skip
    assert [probe.kind for probe in probes] == ["length", "length", "length", "line force", "number"]
    assert [probe.places for probe in probes] == [("a",), ((0.5, 1.0),), ("a", (1.0, 2.0)), (), ()]
    for name in ("step", "load_force", "min_j_x", "energy_x", "parameter_x"):
        refused(f"probes: {name}: history.csv has a column of that name already; choose another name", check_name, name)
    for name in ("1a", "a b", "-a", ""):
        refused(f"probes: {name!r}: use letters, digits, _ and - for a name, a letter first", check_name, name)
    check_name("a-1_b")
    refused("coordinate of a point = inf must be a finite number", Displacement, "ux", (0.0, math.inf))
    held = [Prescribed("b", 1), Prescribed("a", 0)]
    refused("probes: p: ux is not prescribed at 'b', so nothing holds it; prescribed are ux at a, uy at b",
            check_probes, {"p": Reaction("ux", "b")}, held, ("r",))  # fmt: skip
    refused("probes: p: uy is not prescribed at 'b', so nothing holds it; prescribed are none",
            check_probes, {"p": Reaction("uy", "b")}, [], ("r",))  # fmt: skip
    refused("probes: p: there is no region 's' (there are: r, q)", check_probes, {"p": MeanJ("s")}, held, ("r", "q"))
    refused("probes: gap: reports take it for a distance of two points; choose another name",
            check_probes, {"gap": MeanJ("r")}, held, ("r",))  # fmt: skip
    check_probes({"p": Reaction("uy", "b"), "gap": Gap("a", "b"), "m": MeanJ("r")}, held, ("r",))


# -- problems of one's own -------------------------------------------------------------------------------------------


def test_groups_without_names_are_called_by_their_numbers_where_the_description_does() -> None:
    """A named region, point or edge is none of a number, and stays what it is."""
    lines = np.linspace(0.0, 1.0, 3)
    parts = [Rectangle("region_a", 0.0, 1.0, 0.0, 1.0), Rectangle("region_1", 0.0, 0.5, 0.0, 1.0)]
    mesh = with_names(
        structured_quadrilaterals(lines, lines, parts),
        {"point_3": (0.0, 0.0), "point_b": (1.0, 0.0), "point_7": (1.0, 1.0)},
        {"curve_4": ((0.0, 0.0), (1.0, 0.0)), "curve_b": ((0.0, 1.0), (1.0, 1.0)), "curve_8": ((0, 0), (0, 1))},
    )
    described = table(
        regions={"1": SOLID, "a": SOLID},
        support=tuple(ConditionTable(at, 0.0) for at in ("3", "b", "4")),
        load=ConditionTable("b", uy=0.1),
    )
    found = OwnProblem(described)._by_number(mesh)
    assert found.region_names == ("region_a", "1")
    assert list(found.named_points) == ["3", "point_b", "point_7"]
    assert list(found.named_edges) == ["4", "curve_b", "curve_8"]


def test_a_mesh_file_is_read_as_the_description_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}
    lines = np.linspace(0.0, 1.0, 2)
    mesh = structured_quadrilaterals(lines, lines, [Rectangle("a", 0.0, 1.0, 0.0, 1.0)])
    monkeypatch.setattr(
        "tmc_vem.mesh.files.io.read_mesh", lambda path, **given: (asked.update(given, path=path), mesh)[1]
    )
    (tmp_path / "a.msh").write_text("text")
    given = MeshTable(file="a.msh", names={"1": "a"}, region_data="mat", cracks="keep")
    described = table(mesh=given)
    problem = OwnProblem(described, tmp_path)
    problem._from_file()
    read = {"path": tmp_path / "a.msh", "names": {"1": "a"}, "region_data": "mat", "cracks": "keep"}
    assert asked == {**read, "cell_data": ()}
    graded = replace(described.regions["a"], graded={"mu": "mu * soft + x * hard"})
    OwnProblem(replace(described, regions={"a": graded}), tmp_path)._from_file()
    assert asked == {**read, "cell_data": ("hard", "soft")}
    plain = problem.inputs()["mesh"]
    assert plain == {"file": "a.msh", "cells": "voronoi", "growth": 0.3, "names": {"1": "a"}, "region_data": "mat",
                     "cracks": "keep", "content": "982d9e3eb996f559"}  # fmt: skip
    (tmp_path / "a.msh").write_text("other")
    assert problem.inputs()["mesh"]["content"] == "d9298a10d1b07358"
    (tmp_path / "a.msh").unlink()
    refused(f"mesh: there is no file {tmp_path / 'a.msh'}", problem.inputs)


def test_a_solid_of_a_description_has_its_moduli_and_what_holds_it() -> None:
    problem = OwnProblem(table(regions={"a": RegionTable(solid=STEEL, hold="medium"), "b": SOLID}))
    held, other = problem.regions()["a"], problem.regions()["b"]
    assert (dict(held.values), held.hold, other.hold) == ({"K": 20.0, "mu": 10.0}, "medium", None)
    assert [(p.where, p.component, p.value) for p in problem.prescribed()] == [
        ("bottom", 0, 0.0), ("bottom", 1, 0.0), ("top", 1, -0.1),
    ]  # fmt: skip
    assert problem.load() == Prescribed("top", 1, -0.1)


@pytest.mark.parametrize(
    ("group", "name", "words"),
    [
        ("region_5", "wall", '; [mesh] names = { 5 = "wall" }, for example, gives others'),
        ("a b", "wall", '; [mesh] names = { "a b" = "wall" }, for example, gives others'),
    ],
)
def test_how_groups_get_names(group: str, name: str, words: str) -> None:
    assert OwnProblem._naming(group, name) == words


def test_sizes_near_places() -> None:
    near = (RefineTable((0.0, 0.0), 0.1, 0.5), RefineTable(((2.0, 0.0), (2.0, 1.0)), 0.2))
    mesh = MeshTable(size=0.4, refine=near, growth=0.25)
    points = np.array([(0.0, 0.0), (0.0, 0.5), (0.0, 0.9), (2.0, 0.5), (2.0, 1.4), (2.4, 0.5), (-5.0, 0.0)])
    for origin in (None, (1.5, -0.25)):
        size = size_of(mesh, [], origin)
        assert callable(size)
        assert size(points - (origin or (0.0, 0.0))).tolist() == pytest.approx([0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4])
    assert size_of(MeshTable(size=0.4), []) == 0.4


def test_distances_to_a_line_and_to_a_point() -> None:
    points = np.array([(0.5, 2.0), (-3.0, 4.0), (5.0, 3.0)])
    assert distance_to_line(points, np.array([0.0, 0.0]), np.array([2.0, 0.0])) == pytest.approx(
        [2.0, 5.0, math.sqrt(18.0)]
    )
    assert distance_to_line(points, np.array([0.5, 0.0]), np.array([0.5, 0.0])) == pytest.approx(
        [2.0, math.hypot(3.5, 4.0), math.hypot(4.5, 3.0)]
    )


def test_edges_that_are_described() -> None:
    """Two squares side by side, cut into four cells each; interfaces and outlines, not what is inside."""
    x, y = np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3)
    parts = [Rectangle("a", 0.0, 2.0, 0.0, 1.0), Rectangle("b", 1.0, 2.0, 0.0, 1.0)]
    mesh = structured_quadrilaterals(x, y, parts)

    def middles(**described: Any) -> list[tuple[float, float]]:
        ends = mesh.points_vx[find_edges(mesh, "e", EdgesTable(**described))]
        return sorted(map(tuple, ends.mean(axis=1).tolist()))

    assert middles(between=("a", "b")) == middles(between=("b", "a")) == [(1.0, 0.25), (1.0, 0.75)]
    assert middles(between=("b", "outside")) == [(1.25, 0.0), (1.25, 1.0), (1.75, 0.0), (1.75, 1.0), (2.0, 0.25),
                                                 (2.0, 0.75)]  # fmt: skip
    assert middles(line=((0.0, 0.0), (1.0, 0.0))) == [(0.25, 0.0), (0.75, 0.0)]
    assert middles(box=(1.1, 0.6, -0.1, -0.1)) == [(0.0, 0.25), (0.25, 0.0), (0.75, 0.0), (1.0, 0.25)]
    assert middles(box=(-0.1, -0.1, 1.1, 0.6), between=("a", "b")) == [(1.0, 0.25)]
    assert middles(circle=(1.25, 0.0, 0.25)) == [(1.25, 0.0)]
    refused("edges: e: there is no region 'c' (there are: outside, a, b)", middles, between=("a", "c"))
    refused("edges: e: no edge of an outline or interface is there", middles, line=((0.5, 0.5), (0.5, 1.0)))


# -- materials and media ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Material(0.0, 1.0), "K = 0 must be a positive number: the bulk modulus, 20 for the box of the paper"),
        (lambda: Material(1.0, -1.0),
         "mu = -1 must be a positive number: the shear modulus, 10 for the box of the paper"),
        (lambda: Medium(gamma=0.0),
         "gamma = 0 must be a positive number: the medium's stiffness relative to the solid, try 1e-5"),
        (lambda: Medium(alpha_r=0.0), "alpha_r = 0 must be a positive number: the weight of the regulariser, try 1"),
        (lambda: Medium(alpha=0.0),
         "alpha = 0 must be a positive number: alpha_r / (mu h^2) with the gap's width h, try 2.5"),
        (lambda: Medium(alpha=1.0, alpha_r=2.0),
         "alpha = 1 and alpha_r = 2 say one thing in two ways, alpha_r = alpha mu h^2: give one"),
        (lambda: Medium(beta=-0.1),
         "beta = -0.1 must not be negative: 5 damps as in the paper, 0 switches damping off"),
        (lambda: Medium(beta=math.inf),
         "beta = inf must not be negative: 5 damps as in the paper, 0 switches damping off"),
        (lambda: Medium(beta=0.0), None),
        (lambda: Medium(parameters={"k": 1.0}), "regulariser 'huhu_lulu' takes no parameters; given: k"),
        (lambda: Medium(regulariser=odd), "regulariser 'odd' needs a value for k: --param k=..."),
        (lambda: Medium(regulariser=odd, parameters={"k": 1.0}), None),
        (lambda: Medium(alpha=1.0).weight(1.0, None),
         "alpha = 1 needs the width h of the gap: give it, or alpha_r instead"),
        (lambda: Medium(alpha=1.0).weight(1.0, 0.0),
         "h = 0 must be a positive number: the initial width of the gap, a length"),
        (lambda: solid_region(STEEL, "glue"),
         "unknown hold 'glue': choose one of medium; leave it out for a body that supports hold"),
        (lambda: replace(medium_region(Medium(), 1.0), hold="medium"),
         "hold is for solids: a medium hangs on what is around it"),
    ],
)  # fmt: skip
def test_limits_of_materials(make: Any, message: str | None) -> None:
    if message is None:
        make()
    else:
        refused(message, make)


def odd(F: Any, G: Any, p: Any, m: Any) -> Any:
    """A regulariser of one's own."""
    return p.k * G[0][0][0] ** 2


vars(odd)["declared"] = {"parameters": {"k": None}}


def test_media_as_their_regions_have_them() -> None:
    plain = medium_region(Medium(gamma=1e-4, alpha_r=2.0, beta=3.0), 5.0)
    assert (dict(plain.values), plain.is_medium, plain.hold) == (
        {"mu": 5.0, "gamma": 1e-4, "alpha_r": 2.0, "beta": 3.0}, True, None,
    )  # fmt: skip
    own = medium_region(Medium(alpha=2.0, beta=0.0, regulariser=odd, parameters={"k": 7.0}), 5.0, 0.5)
    assert dict(own.values) == {"mu": 5.0, "gamma": 1e-5, "alpha_r": 2.5, "beta": 0.0, "k": 7.0}
    assert "damped" not in own.energy.name
    assert "damped" in plain.energy.name
    assert Medium(alpha=2.0, regulariser=odd, parameters={"k": 7.0}, energy="balanced").as_dict(5.0, 0.5) == {
        "gamma": 1e-5, "alpha_r": 2.5, "alpha": 2.0, "h": 0.5, "beta": 5.0, "energy": "balanced", "regulariser": "odd",
        "parameters": {"k": 7.0},
    }  # fmt: skip
    assert Medium(alpha=2.0).as_dict() == {"gamma": 1e-5, "alpha": 2.0, "beta": 5.0, "regulariser": "huhu_lulu"}
    assert Medium().as_dict() == {"gamma": 1e-5, "alpha_r": 1.0, "beta": 5.0, "regulariser": "huhu_lulu"}
    assert own.integrand.parameter_names == own.energy.parameters


def test_a_medium_of_a_description_takes_what_it_lacks_from_the_rest() -> None:
    """mu of the only solid, h of the gap, alpha_r of both."""

    def medium(given: MediumTable, solids: tuple[Material, ...] = (STEEL,), **more: Any) -> Any:
        regions = {f"s{n}": RegionTable(solid=solid) for n, solid in enumerate(solids)}
        described = table(regions={**regions, "m": RegionTable(medium=given)}, **more)
        return OwnProblem(described).regions()["m"].values

    assert medium(MediumTable(gamma=1e-3))["mu"] == 10.0
    assert medium(MediumTable(mu=3.0), (STEEL, Material(1.0, 2.0)))["mu"] == 3.0
    assert medium(MediumTable(), (STEEL, STEEL))["mu"] == 10.0
    places = {"points": {"a": (0.0, 3.0)}, "gap": ("a", (4.0, 0.0))}
    assert medium(MediumTable(alpha=2.0), **places)["alpha_r"] == pytest.approx(2.0 * 10.0 * 25.0)
    assert medium(MediumTable(alpha=2.0, h=0.5), **places)["alpha_r"] == pytest.approx(2.0 * 10.0 * 0.25)
    said = "regions: m: medium lacks 'mu': the solids have several shear moduli or none, so say which"
    refused(said, medium, MediumTable(), (STEEL, Material(1.0, 2.0)))
    refused(said, medium, MediumTable(), ())
    refused(
        'regions: m: alpha = 2 needs the width of the gap: name two points, gap = ["...", "..."], or give the width '
        "itself, h = ...",
        medium, MediumTable(alpha=2.0),
    )  # fmt: skip
