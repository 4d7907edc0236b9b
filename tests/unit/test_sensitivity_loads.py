"""Derivatives by loads of all kinds, supports and springs, of graded and design regions: Taylor rates at equilibria."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_sensitivity import SEAL, Case, case_of, finer, own, per_cell_sums, wrong

from tmc_vem.problems.own import OwnProblem

HOLE = (
    SEAL.replace('"block", solid', '"block - hole", hold = "medium", solid')
    .replace("[0.3, 0.5, 0.7, 1.0]", "[0.2, 0.5, 0.8, 1.0]").replace("[[0.3, 1], [0.7, 1]]", "[[0.2, 1], [0.8, 1]]")
    .replace("size = 0.18", "size = 0.09")
    + """
shapes.hole = { rectangle = [0.41, 0.69, 0.59, 0.81] }
edges.hole = { box = [0.4, 0.68, 0.6, 0.82], between = ["block", "outside"] }
"""
)  # fmt: skip
BESIDE = "edges.side = { line = [[0.3, 0.5], [0.3, 1.0]] }\npoints.corner = [0.7, 1.0]\n"
INCLINED = (
    SEAL.replace("{ rectangle = [0, 0, 1, 1] }", "{ polygon = [[0, 0], [1, 0], [1, 1.075], [0, 0.825]] }")
    .replace("{ rectangle = [0.3, 0.5, 0.7, 1.0] }", "{ polygon = [[0.3, 0.5], [0.7, 0.5], [0.7, 1.0], [0.3, 0.9]] }")
    .replace("[[0.3, 1], [0.7, 1]]", "[[0.3, 0.9], [0.7, 1.0]]")
)
GRADED = SEAL.replace('shape = "foot"', 'shape = "foot", graded = { E = "E * (1 + x)", nu = "nu * (1 - y)" }').replace(
    '- foot - block"', '- foot - block", graded = { gamma = "gamma * 10 ** (x - 1)" }'
)
DESIGN = SEAL.replace(
    "solid = { E = 40, nu = 0.3 }",
    "solid = { E = 40, nu = 0.3 }, stiffness = 0.4, medium = { mu = 10, gamma = 1e-2, alpha = 1, h = 0.2, beta = 1 }",
)
HELD = {"at": "bottom", "ux": 0, "uy": 0}
GUIDED = {"at": "top", "ux": 0.0}
SOLIDS = ("regions.foot.solid.E", "block.mu", "regions.medium.medium.gamma")


def by(method: str, problem: OwnProblem, size: float = 0.2) -> OwnProblem:
    """With cells that the method can use."""
    return problem if method == "vem" else finer(problem, cells="triangles", size=size)


def loaded(
    text: str, *loads: dict[str, Any], support: tuple[dict[str, Any], ...] = (HELD, GUIDED), **more: Any
) -> OwnProblem:
    return own(text, "load", "support", load=list(loads), support=list(support), **more)


def assert_right(case: Case, results: tuple[str, ...], numbers: tuple[str, ...]) -> None:
    assert not wrong(case, results, numbers)
    assert max(per_cell_sums(case, results[:2], SOLIDS).values()) < 1e-12


def test_dead_loads_and_springs(method: str) -> None:
    """With a history whose amplitude is not 1 at the end."""
    problem = loaded(
        SEAL + BESIDE,
        {"name": "push", "at": "corner", "force": [0.05, -0.1], "history": [[0, 0], [1, 1.5]]},
        {"name": "press", "at": "top", "traction": [0.1, -0.3]},
        {"name": "weight", "regions": ["block"], "body_force": [0.02, -0.5]},
        {"name": "heavy", "regions": ["foot"], "acceleration": [0.0, -0.3], "density": 0.4},
        spring=[{"at": "side", "stiffness": [3.0, 1.0], "name": "bed"}, {"at": "tip", "stiffness": [1.0, 0.5]}],
    )
    case = case_of(by(method, problem), method, steps=4)
    assert case.found.value("gap") < 0.15
    of = ("gap", "hold", "compliance", "push.displacement", "press.displacement", "energy", "contact.block.force")
    numbers = ("load.push.force.2", "load.press.traction.2", "load.weight.body_force.1", "load.heavy.density",
               "spring.bed.stiffness.1", "spring.2.stiffness.2")  # fmt: skip
    assert_right(case, of, (*numbers, *SOLIDS))


def test_pressures_that_follow(method: str) -> None:
    problem = loaded(
        HOLE,
        {"name": "air", "at": "hole", "cavity_pressure": 2.0},
        {"name": "wind", "at": "top", "pressure": 0.3},
        {"name": "lift", "at": "ground", "uy": 0.02},
    )
    case = case_of(by(method, problem, 0.15), method, steps=4)
    of = ("gap", "hold", "compliance", "air.area", "wind.swept", "lift.reaction", "p_norm.von_mises.block")
    assert_right(case, of, ("load.air.cavity_pressure", "load.wind.pressure", "load.lift.uy", *SOLIDS))


def test_a_block_that_is_turned(method: str) -> None:
    turn = {"name": "turn", "at": "top", "rotation": 6.0, "about": [0.5, 1.0]}
    problem = loaded(SEAL, turn, {"name": "lift", "at": "ground", "uy": 0.02}, support=(HELD,))
    case = case_of(by(method, problem), method, steps=4)
    of = ("turn.moment", "turn.angle", "lift.reaction", "side", "hold", "energy", "contact.block.moment")
    assert_right(case, of, ("load.turn.rotation", "load.lift.uy", *SOLIDS))


def test_a_centre_that_moves() -> None:
    """The moment is about the same point as the rotation."""
    turn = {"name": "turn", "at": "top", "rotation": 6.0, "about": [0.4, 1.0]}
    case = case_of(loaded(SEAL, turn, support=(HELD,)), steps=4)
    of, numbers = ("turn.moment", "turn.angle", "side"), ("load.turn.about.1", "load.turn.about.2")
    assert not wrong(case, of, numbers)
    assert case.found.gradient("turn.angle", numbers[0]) == 0.0


def test_nearly_incompressible() -> None:
    """Beyond nu = 0.5, which is close, there is nothing."""
    case = case_of(own(SEAL.replace("nu = 0.3", "nu = 0.4999")), steps=4)
    found = case.found.gradients
    slopes = found.by("regions.foot.solid.nu").parameters["foot"]
    assert slopes["K"] == pytest.approx(40.0 * 2.0 / 3.0 / (1.0 - 2.0 * 0.4999) ** 2, rel=1e-9)
    assert slopes["mu"] == pytest.approx(-20.0 / 1.4999**2, rel=1e-9)


def test_inclined_supports(method: str) -> None:
    """Displacements across an incline that turns the axes of nodes, and along it."""
    slide = {"at": "side", "force": [0.0, -0.02], "name": "slide"}
    problem = loaded(INCLINED + "points.side = [0.7, 0.75]\n", {"at": "top", "normal": -0.12, "name": "press"}, slide,
                     support=(HELD, {"at": "side", "ux": 0.01}))  # fmt: skip
    case = case_of(by(method, problem), method, steps=4)
    assert case.simulation.system.turned().nodes.size
    of = ("gap", "press.reaction", "press.displacement", "side", "hold", "energy.medium")
    assert_right(case, of, ("load.press.normal", "load.slide.force.2", "support.side.ux", *SOLIDS))


@pytest.mark.parametrize(
    ("text", "more"),
    [
        (GRADED, ("regions.foot.solid.nu", "foot.mu", "medium.gamma")),
        (
            DESIGN,
            ("regions.foot.stiffness", "foot.stiffness", "regions.foot.medium.gamma", "regions.foot.medium.alpha"),
        ),
    ],
    ids=["graded", "design"],
)
def test_regions_that_vary_from_cell_to_cell(text: str, more: tuple[str, ...], method: str) -> None:
    problem = by(method, own(text, "probes.cut"))  # in a design there is no solid to cut
    case = case_of(problem, method, steps=4)
    assert_right(case, ("gap", "hold", "mises", "energy.foot"), ("load.uy", *SOLIDS, *more))
    assert max(per_cell_sums(case, ("gap", "mises"), more).values()) < 1e-12


def test_one_cell_alone(method: str) -> None:
    """The derivative by the stiffness of one cell is that of a design with another stiffness there."""
    case = case_of(by(method, own(DESIGN, "probes.cut")), method, steps=4)
    by_cell = np.asarray(case.found.gradient("hold", "regions.foot.stiffness", per_cell=True))
    system, solver = case.simulation.system, case.simulation.solver
    cell = int(np.abs(by_cell).argmax())
    index = int(np.flatnonzero(system.cell_numbers() == cell)[0])

    def at(h: float) -> float:
        factor_ck = np.full((len(by_cell), 1), 0.4)
        factor_ck[index] += h
        system.set_factors("foot", factor_ck)
        u, residual = case.u.copy(), system.create_vector()
        assert solver.solve(u).converged
        system.residual(u, residual)
        return system.reaction(residual, "bottom", 1)

    h = 1e-2
    once, twice = ((at(d) - at(-d)) / (2 * d) for d in (h, h / 2))
    assert by_cell[cell] == pytest.approx(twice + (twice - once) / 3, rel=1e-7)
