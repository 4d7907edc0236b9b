"""On rectangles both methods are one: [P_3]^2 on them with the product rule is Q2 with 4 x 4 Gauss points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_fem import FemSettings, Float, grid, integral, medium
from helpers_fem import make_system as fem_system
from helpers_forces import KINDS, ROLLERS, Parts, cavity_plate
from helpers_penalty import penalised
from helpers_system import interpolate, make_system

from tmc_vem import Box, RunOptions, RunResult, run
from tmc_vem.problems.probes import Displacement
from tmc_vem.problems.wrapped import Probed
from tmc_vem.vem.spaces.element_settings import ElementSettings


@pytest.fixture(scope="module")
def by_vem() -> RunResult:
    return run(Box(cells=(20, 10), uy=-0.3), None, RunOptions(element=ElementSettings(rule="auto")))


@pytest.fixture(scope="module")
def by_fem() -> RunResult:
    chosen = FemSettings(quadrature=6, interior_penalty="none")
    return run(Box(cells=(20, 10), uy=-0.3), None, RunOptions("fem", fem=chosen))


def test_all_digits_agree_on_rectangles(by_vem: RunResult, by_fem: RunResult) -> None:
    """So agreement on rectangles checks the programs, not the discretisation."""
    assert by_vem.history[-1].probes["gap"] < 0.05
    assert len(by_vem.history) == len(by_fem.history)
    for vem, fem in zip(by_vem.history, by_fem.history, strict=True):
        assert vem.load == pytest.approx(fem.load, rel=1e-12)
        assert vem.iterations == fem.iterations
        assert vem.probes["gap"] == pytest.approx(fem.probes["gap"], rel=1e-11)
        assert vem.reaction == pytest.approx(fem.reaction, rel=1e-10)
        for of in ("energy", "min_j"):
            assert dict(getattr(vem, of)) == pytest.approx(dict(getattr(fem, of)), rel=1e-9), of


def test_forces_are_the_same_on_rectangles() -> None:
    """One of each kind, solved: displacements, resultants, work, area."""
    problem = Parts(lambda: cavity_plate(bent=0.0), ROLLERS, [replace(f, name=kind) for kind, f in KINDS.items()])
    auto, q2 = ElementSettings(rule="auto"), FemSettings(quadrature=6, interior_penalty="none")
    vem, fem = (
        run(Probed(problem, {"tip": Displacement("ux", "tip")}), None, options)
        for options in (RunOptions(element=auto, steps=2), RunOptions("fem", fem=q2, steps=2))
    )
    assert vem.complete
    assert abs(vem.probes["tip"]) > 0.05
    for one, other in zip(vem.history, fem.history, strict=True):
        assert one.probes["tip"] == pytest.approx(other.probes["tip"], rel=1e-9)
        assert one.reaction == pytest.approx(other.reaction, rel=1e-9)
        for kind in KINDS:
            assert one.forces[kind] == pytest.approx(other.forces[kind], rel=1e-9, abs=1e-11), kind


@pytest.mark.parametrize("kind", ["penalty", "full"])
def test_sides_of_squares_store_the_same_energy(kind: str) -> None:
    """Kinks along both directions of a grid, in a state of Q2; there neither method has a jump along the side."""

    def kinked(x: Float) -> Float:
        right, top = np.maximum(x[:, 0] - 0.5, 0.0), np.maximum(x[:, 1] - 0.5, 0.0)
        return np.column_stack([0.3 * right * (1 + x[:, 1]) - 0.1 * x[:, 1] ** 2, 0.2 * top * x[:, 0] + 0.1 * right])

    mesh, energy = grid(4, 4), medium()
    fem = fem_system(mesh, energy, interior_penalty=kind)
    stored = integral(fem, fem.interpolate(kinked), fem.forms.facets["all"])
    vem = make_system(mesh, penalised(energy.integrand, energy.values, kind), ())
    assert vem.penalty is not None
    u = vem.nodal_values(interpolate(vem, kinked))
    sides = sum(terms.energies(u)[0].sum() for terms in vem.penalty.terms)
    assert stored > 1e-3
    assert sides == pytest.approx(stored, rel=1e-9)


def test_other_cells_and_rules_are_other_methods(by_fem: RunResult) -> None:
    """Hanging nodes, Voronoi cells and other rules move the gap by much more than rounding, and not by much."""
    box = Box(cells=(20, 10), uy=-0.3)
    others = {
        "points on sub-triangles": (box, ElementSettings(rule="triangles")),
        "hanging nodes": (Box(cells=(20, 10), uy=-0.3, medium_refinement=2), ElementSettings()),
        "voronoi": (Box(cells=(20, 10), uy=-0.3, cell_kind="voronoi"), ElementSettings()),
    }
    for name, (problem, chosen) in others.items():
        gap = run(problem, None, RunOptions(element=chosen)).gap
        assert 1e-8 < np.abs(gap / by_fem.gap - 1.0) < 0.03, name
