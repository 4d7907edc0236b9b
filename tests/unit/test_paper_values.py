"""Benchmarks against section 5 of Xu & Wriggers, CMAME 450 (2026) 118611: every default and constant, and those of the
command line; what the paper gives in a figure only, against the choice that the documentation names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tmc_vem.cli import run as commands
from tmc_vem.problems import Bodies, Box, CBox, Material, Medium, Problem, Punch
from tmc_vem.problems.cbox import angle_medium
from tmc_vem.problems.probes import Gap

SOFT = {"K": 5.0 / 3.0, "mu": 5.0 / 14.0}
# problem, values of the regions (mu, gamma, alpha_r and beta of a medium) and its regulariser's energy
REGIONS: list[tuple[str, Problem, dict[str, dict[str, float]], str]] = [
    (
        "box", Box(),
        {"solid": {"K": 20.0, "mu": 10.0}, "medium": {"mu": 10.0, "gamma": 1e-5, "alpha_r": 1.0, "beta": 5.0}},
        "medium_huhu_lulu_damped",
    ),
    (
        "cbox", CBox(),
        {"solid": SOFT, "medium": {"mu": 5.0 / 14.0, "gamma": 1e-5, "alpha_r": 1.0, "beta": 0.0}}, "medium_angle",
    ),
    (
        "punch", Punch(),
        {"block": SOFT, "punch": SOFT, "medium": {"mu": 5.0 / 14.0, "gamma": 1e-4, "alpha_r": 1.0, "beta": 0.0}},
        "medium_angle",
    ),
    (
        "stiff punch", Punch(stiffness=100.0),
        {
            "block": SOFT, "punch": {"K": 500.0 / 3.0, "mu": 500.0 / 14.0},
            "medium": {"mu": 5.0 / 14.0, "gamma": 1e-4, "alpha_r": 1.0, "beta": 0.0},
        },
        "medium_angle",
    ),
    (
        "bodies", Bodies(),
        {
            "beam": {"K": 50.0, "mu": 10.0}, "discs": {"K": 50000.0, "mu": 10000.0},
            "medium": {"mu": 10.0, "gamma": 1e-4, "alpha_r": 10.0, "beta": 0.0},
        },
        "medium_angle",
    ),
]  # fmt: skip
# All other numbers of a benchmark. Of the C-box the height follows from g0 = 0.3 and t = 0.1; the gaps of punch and
# bodies, the amplitude of the bodies and the width of the C-box' column are in figures only, and documented choices.
NUMBERS: dict[str, tuple[Problem, dict[str, Any]]] = {
    "box": (Box(), {"length": 2.0, "height": 0.5, "wall": 0.1, "uy": -1.0, "medium_refinement": 1}),
    "cbox": (CBox(), {"length": 1.0, "height": 0.5, "wall": 0.1, "uy": -0.5, "medium_refinement": 1,
                      "solid_cells": "polygons", "column_cells": 1, "polygons_across": 3}),
    "punch": (Punch(), {"width": 2.0, "height": 1.0, "radius": 1.0, "uy": -1.3, "stiffness": 1.0, "gap0": 0.6}),
    "bodies": (Bodies(), {"length": 8.0, "thickness": 0.2, "radius": 0.2, "discs": 7, "case": 1, "gap0": 0.1,
                          "uy": 0.25}),
}  # fmt: skip
# (where, component, value at full load); conditions that are missing here are as wrong as those that are too many
CONDITIONS: list[tuple[Problem, set[tuple[str, int, float]]]] = [
    (Box(), {("support_left", 0, 0.0), ("support_left", 1, 0.0), ("support_right", 1, 0.0), ("load", 1, -1.0)}),
    (CBox(), {("left", 0, 0.0), ("left", 1, 0.0), ("load", 1, -0.5)}),
    (Punch(), {("bottom", 0, 0.0), ("bottom", 1, 0.0), ("axis", 0, 0.0), ("top", 1, -1.3)}),
    (
        Bodies(),
        {("left", 0, 0.0), ("left", 1, 0.0), ("right", 0, 0.0), ("right", 1, 0.0), ("upper", 0, 0.0),
         ("lower", 0, 0.0), ("upper", 1, -0.25), ("lower", 1, 0.25)},
    ),
    (
        Bodies(case=2),
        {("left", 0, 0.0), ("left", 1, 0.0), ("right_corner", 1, 0.0), ("upper", 1, -0.25), ("lower", 1, 0.25)},
    ),
]  # fmt: skip
PLACES: list[tuple[Problem, dict[str, tuple[float, float]]]] = [
    (
        Box(cells=(20, 5)),
        {"support_left": (0.0, 0.0), "support_right": (2.0, 0.0), "load": (1.0, 0.5), "flange_top": (1.0, 0.4),
         "flange_bottom": (1.0, 0.1)},
    ),
    (CBox(solid_cells="quadrilaterals"), {"load": (1.0, 0.5), "tip_top": (1.0, 0.4), "tip_bottom": (1.0, 0.1)}),
    (Punch(size=0.25), {"tip": (0.0, 1.6), "surface": (0.0, 1.0)}),
    (
        Bodies(discs=1, length=2.0),
        {"tip": (1.0, 0.3), "surface": (1.0, 0.2), "right_corner": (2.0, 0.0)},
    ),
]  # fmt: skip


@pytest.mark.parametrize(("problem", "values", "energy"), [entry[1:] for entry in REGIONS], ids=[e[0] for e in REGIONS])
def test_materials_and_media(problem: Problem, values: dict[str, dict[str, float]], energy: str) -> None:
    regions = problem.regions()
    assert {name: dict(region.values) for name, region in regions.items()} == {
        name: pytest.approx(expected, rel=1e-15) for name, expected in values.items()
    }
    assert regions["medium"].energy.name == energy
    assert [name for name, region in regions.items() if region.is_medium] == ["medium"]
    assert all(region.energy.name == "solid" for name, region in regions.items() if name != "medium")


@pytest.mark.parametrize("name", NUMBERS)
def test_sizes_and_loads(name: str) -> None:
    problem, numbers = NUMBERS[name]
    assert {key: getattr(problem, key) for key in numbers} == numbers
    inputs = problem.inputs()
    assert {key: inputs[key] for key in numbers} == numbers  # what a run directory says of itself
    medium = problem.regions()["medium"].values
    assert {key: inputs["medium"][key] for key in ("gamma", "alpha_r", "beta")} == {
        key: medium[key] for key in ("gamma", "alpha_r", "beta")
    }


@pytest.mark.parametrize(("problem", "conditions"), CONDITIONS, ids=lambda entry: getattr(entry, "name", ""))
def test_supports_and_loads(problem: Problem, conditions: set[tuple[str, int, float]]) -> None:
    found = [(condition.where, condition.component, condition.value) for condition in problem.prescribed()]
    assert set(found) == conditions
    assert len(found) == len(conditions)


@pytest.mark.parametrize(("problem", "places"), PLACES, ids=lambda entry: getattr(entry, "name", ""))
def test_named_points(problem: Problem, places: dict[str, tuple[float, float]]) -> None:
    mesh = problem.make_mesh()
    assert {name: tuple(mesh.points_vx[v]) for name, v in mesh.named_points.items()} == {
        name: pytest.approx(place, abs=1e-12) for name, place in places.items()
    }
    gap = problem.probes()["gap"]
    assert isinstance(gap, Gap)
    assert {gap.first, gap.second} <= set(places)


def test_where_the_half_discs_are() -> None:
    """Seven at equal distances, alternately above and below, the round side 0.1 from the beam of thickness 0.2."""
    centres = Bodies().centers()
    assert [x for x, _ in centres] == pytest.approx(np.arange(1.0, 8.0))
    assert [y for _, y in centres] == pytest.approx([0.5, -0.3, 0.5, -0.3, 0.5, -0.3, 0.5])


@pytest.mark.parametrize("make", [
    lambda soft: Box(material=soft), lambda soft: CBox(material=soft), lambda soft: Punch(stiffness=7.0, material=soft),
    lambda soft: Bodies(beam=soft),
])  # fmt: skip
def test_the_medium_has_the_shear_modulus_of_the_soft_solid(make: Any) -> None:
    assert make(Material(3.0, 2.0)).regions()["medium"].values["mu"] == 2.0


def test_media_by_default() -> None:
    """The box' (9) damped by exp(-5 J), and (15) undamped elsewhere."""
    medium = Medium()
    assert (medium.gamma, medium.alpha_r, medium.beta, medium.regulariser) == (1e-5, 1.0, 5.0, "huhu_lulu")
    medium = angle_medium(1e-4, 10.0)
    assert (medium.gamma, medium.alpha_r, medium.beta, medium.regulariser) == (1e-4, 10.0, 0.0, "angle")


# -- the command line has defaults of its own ------------------------------------------------------------------------


def from_command(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> tuple[Problem, Any]:
    """Problem and options that a command would run."""
    kept: list[Any] = []
    monkeypatch.setattr(commands, "execute", lambda problem, settings, options: kept.extend((problem, settings)))
    commands.run_group.main(list(arguments), standalone_mode=False)
    return kept[0], kept[1]


@pytest.mark.parametrize("problem", [Box(), CBox(), Punch(), Bodies()], ids=lambda problem: problem.name)
def test_a_command_without_options_is_the_benchmark_of_python(problem: Problem, monkeypatch: Any) -> None:
    from tmc_vem.simulation import RunOptions

    made, settings = from_command(monkeypatch, problem.name)
    assert made == problem
    assert settings == RunOptions()


# -- tables that say which run is which figure or cell --------------------------------------------------------------


def test_the_tables_and_figures_ask_for_what_the_paper_asks_for() -> None:
    from tmc_vem.study.paper.body_figures import FIGURES
    from tmc_vem.study.paper.table2 import MEDIA
    from tmc_vem.study.paper.values import table2

    assert set(table2()) == {(a, g) for a in (10.0, 1.0, 0.1) for g in (1e-4, 1e-5, 1e-6)}
    for (alpha_r, gamma), medium in MEDIA.items():
        assert (medium.alpha_r, medium.gamma, medium.beta) == (alpha_r, gamma, 5.0)
        assert medium.regulariser == "huhu_lulu"
    problems = {figure.number: list(figure.problems(False).values()) for figure in FIGURES}
    values = {n: [p.regions()["medium"].values for p in found] for n, found in problems.items()}
    medium = {n: {(v["gamma"], v["alpha_r"], v["beta"]) for v in found} for n, found in values.items()}
    assert medium == {
        7: {(1e-5, 1.0, 0.0)}, 8: {(1e-5, 20.0, 0.0)}, 10: {(1e-4, 1.0, 0.0)}, 11: {(1e-4, 1.0, 0.0)},
        13: {(1e-4, 10.0, 0.0)}, 14: {(1e-4, 10.0, 0.0)},
    }  # fmt: skip
    loads = {n: {p.load().value for p in found} for n, found in problems.items()}
    assert loads == {7: {-0.5}, 8: {-1.0}, 10: {-1.3}, 11: {-1.3}, 13: {-0.25}, 14: {-0.25}}
    assert [p.inputs()["medium_refinement"] for p in problems[7]] == [1, 2]
    assert problems[11][0].inputs()["stiffness"] == 100.0
    assert [problems[n][0].inputs()["case"] for n in (13, 14)] == [1, 2]
