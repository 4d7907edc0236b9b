"""Derivatives by loads of all kinds, supports and springs, of graded and design regions: Taylor rates at equilibria."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_sensitivity import SEAL, Case, case_of, finer, own, per_cell_sums, wrong

from tmc_vem.problems.own import OwnProblem

# a block with a hole, above the foot, and the medium between and beside them
HOLE = (
    SEAL.replace('"block", solid', '"block - hole", solid').replace('- block"', '- block - hole"')
    + """
shapes.hole = { rectangle = [0.42, 0.65, 0.58, 0.85] }
edges.hole = { box = [0.41, 0.64, 0.59, 0.86], between = ["block", "outside"] }
edges.side = { line = [[0.3, 0.5], [0.3, 1.0]] }
edges.right = { line = [[0.7, 0.5], [0.7, 1.0]] }
points.corner = [0.7, 1.0]
"""
)
FREE = ("load", "support")
HELD = {"at": "bottom", "ux": 0, "uy": 0}
GUIDED = {"at": "top", "ux": 0.0}
SOLIDS = ("regions.foot.solid.E", "block.mu", "regions.medium.medium.gamma")


def loaded(method: str, *loads: dict[str, Any], support: tuple[dict[str, Any], ...] = (HELD, GUIDED), text: str = SEAL,
           **more: Any) -> OwnProblem:  # fmt: skip
    problem = own(text, *FREE, load=list(loads), support=list(support), **more)
    return problem if method == "vem" else finer(problem, cells="triangles", size=0.2)


def assert_right(case: Case, results: tuple[str, ...], numbers: tuple[str, ...]) -> None:
    assert not wrong(case, results, numbers)
    assert max(per_cell_sums(case, results[:2], SOLIDS).values()) < 1e-12


def test_dead_loads_and_springs(method: str) -> None:
    """With histories and amplitudes that are not 1 at the end."""
    problem = loaded(
        method,
        {"name": "push", "at": "corner", "force": [0.05, -0.6], "history": [[0, 0], [1, 1.5]]},
        {"name": "press", "at": "top", "traction": [0.1, -1.2]},
        {"name": "weight", "regions": ["block"], "body_force": [0.02, -0.5]},
        {"name": "heavy", "regions": ["foot"], "acceleration": [0.0, -0.3], "density": 0.4},
        support=(HELD,),
        spring=[{"at": "side", "stiffness": [3.0, 1.0], "name": "bed"}, {"at": "tip", "stiffness": [1.0, 0.5]}],
        text=SEAL + "edges.side = { line = [[0.3, 0.5], [0.3, 1.0]] }\npoints.corner = [0.7, 1.0]\n",
    )  # fmt: skip
    case = case_of(problem, method, steps=4)
    assert case.found.value("gap") < 0.15
    of = ("gap", "hold", "compliance", "push.displacement", "press.displacement", "energy", "contact.block.force")
    by = ("load.push.force.2", "load.press.traction.2", "load.weight.body_force.1", "load.heavy.density",
          "spring.bed.stiffness.1", "spring.2.stiffness.2")  # fmt: skip
    assert_right(case, of, (*by, *SOLIDS))


def test_pressures_that_follow(method: str) -> None:
    problem = loaded(
        method,
        {"name": "air", "at": "hole", "cavity_pressure": 4.0},
        {"name": "wind", "at": "side", "pressure": 1.0},
        {"name": "down", "at": "top", "uy": -0.12},
        text=HOLE,
    )
    case = case_of(problem, method, steps=4)
    of = ("gap", "hold", "compliance", "air.area", "wind.swept", "down.reaction", "p_norm.von_mises.block")
    by = ("load.air.cavity_pressure", "load.wind.pressure", "load.down.uy")
    assert_right(case, of, (*by, *SOLIDS))


def test_a_block_that_is_turned(method: str) -> None:
    turn = {"name": "turn", "at": "top", "rotation": 6.0, "about": [0.5, 1.0]}
    case = case_of(loaded(method, turn, {"name": "down", "at": "ground", "uy": 0.02}, support=(HELD,)), method, steps=4)
    of = ("turn.moment", "turn.angle", "down.reaction", "side", "hold", "energy", "contact.block.moment")
    assert_right(case, of, ("load.turn.rotation", "load.down.uy", *SOLIDS))


def test_inclined_supports(method: str) -> None:
    """Displacements across an incline that turns the axes of nodes, and along it."""
    text = SEAL.replace(
        "[0.3, 0.5, 0.7, 1.0] }",
        "[0.3, 0.5, 0.7, 1.0] }\nshapes.wedge = { polygon = [[0.3, 0.9], [0.7, 1.0], [0.7, 1.1], [0.3, 1.1]] }",
    )
    text = text.replace('"block", solid', '"block - wedge", solid').replace('- block"', '- (block - wedge)"')
    text = text.replace("line = [[0.3, 1], [0.7, 1]]", "line = [[0.3, 0.9], [0.7, 1.0]]")
    text = text.replace('shape = "frame', 'shape = "frame - wedge').replace("[0.65, 0.75]", "[0.6, 0.75]")
    problem = loaded(method, {"at": "top", "normal": -0.12, "name": "press"},
                     support=(HELD, {"at": "top", "tangential": 0.01}), text=text)  # fmt: skip
    case = case_of(problem, method, steps=4)
    assert case.simulation.system.turned()
    of = ("gap", "press.reaction", "press.displacement", "side", "hold", "energy.medium")
    assert_right(case, of, ("load.press.normal", "support.top.tangential", *SOLIDS))


def test_rollers_on_an_incline_alone() -> None:
    text = SEAL + "edges.side = { line = [[0.0, 0.0], [0.0, 0.3]] }\n"
    assert own(text)


@pytest.mark.parametrize("what", ["graded", "design"])
def test_regions_that_vary_from_cell_to_cell(what: str, method: str) -> None:
    text = {
        "graded": SEAL.replace('shape = "foot"', 'shape = "foot", graded = { E = "E * (1 + x)", nu = "nu * (1 - y)" }')
        .replace("- foot - block\"", "- foot - block\", graded = { gamma = \"gamma * 10 ** (x - 1)\" }"),
        "design": SEAL.replace("solid = { E = 40, nu = 0.3 }",
            "solid = { E = 40, nu = 0.3 }, stiffness = 0.4, medium = { mu = 10, gamma = 1e-2, alpha = 1, h = 0.2, beta = 1 }"),
    }[what]  # fmt: skip
    problem = own(text) if method == "vem" else finer(own(text), cells="triangles", size=0.2)
    case = case_of(problem, method, steps=4)
    more = ("regions.foot.stiffness", "regions.foot.medium.gamma") if what == "design" else ("regions.foot.solid.nu",)
    assert_right(case, ("gap", "hold", "mises", "energy.foot"), ("load.uy", *SOLIDS, *more))
    assert max(per_cell_sums(case, ("gap", "mises"), more).values()) < 1e-12


def test_one_cell_alone() -> None:
    """The derivative by the stiffness of one cell is that of a design with another stiffness there."""
    text = SEAL.replace("solid = { E = 40, nu = 0.3 }",
        "solid = { E = 40, nu = 0.3 }, stiffness = 0.4, medium = { mu = 10, gamma = 1e-2, alpha = 1, h = 0.2 }")  # fmt: skip
    case = case_of(own(text), steps=4)
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

    h = 1e-3
    once, twice = ((at(d) - at(-d)) / (2 * d) for d in (h, h / 2))
    assert by_cell[cell] == pytest.approx(twice + (twice - once) / 3, rel=1e-7)
