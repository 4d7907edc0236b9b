"""Parameters that vary from cell to cell in finite elements: as virtual elements on rectangles have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers_fem import grid, integral, wavy
from helpers_fem import make_system as fem_system
from helpers_system import CLAMPED, interpolate, make_system

from tmc_vem.mesh import PolygonMesh
from tmc_vem.problems import Material, Medium
from tmc_vem.problems.base import medium_region, solid_region
from tmc_vem.simulation.discretised import _kernels
from tmc_vem.vem.spaces.element_settings import ElementSettings

MEDIUM = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser="huhu_lulu")
REGIONS = {
    "solid": solid_region(Material(E=3.0, nu=0.3), graded={"E": "E * (1 + x)", "nu": "nu + 0.1 * soft"}),
    "medium": medium_region(MEDIUM, 1.5, graded={"gamma": "gamma * 10 ** (x - y)", "alpha_r": "alpha_r * (1 + soft)"}),
}


def layers() -> PolygonMesh:
    mesh = grid(4, 3)
    region = (np.arange(12) // 4 == 1).astype(np.int64)
    soft = np.random.default_rng(2).uniform(0.0, 1.0, 12)
    return replace(mesh, region_c=region, region_names=("solid", "medium"), cell_data={"soft": soft})


@pytest.mark.parametrize("penalty", ["none", "penalty"])
def test_both_methods_have_the_same_potential(penalty: str) -> None:
    mesh, element = layers(), ElementSettings(interior_penalty=penalty, rule="auto")
    fem = fem_system(mesh, REGIONS, CLAMPED, quadrature=6, interior_penalty=penalty)
    kernels = {name: _kernels(name, region, element) for name, region in REGIONS.items()}
    vem = make_system(mesh, kernels, CLAMPED, element)

    def quadratic(x: np.ndarray) -> np.ndarray:
        return 0.1 * np.column_stack([x[:, 0] * x[:, 1] + x[:, 1] ** 2, x[:, 0] ** 2 - 0.5 * x[:, 1]])

    u, v = fem.interpolate(quadratic), interpolate(vem, quadratic)
    by_fem, by_vem = fem.energy(u), vem.energy(v)
    for name in REGIONS:
        assert by_fem.regions[name].energy == pytest.approx(by_vem.regions[name].energy, rel=1e-11), name
    cells = dict(zip(vem.cell_numbers().tolist(), vem.cell_energies(v).tolist(), strict=True))
    for cell, energy in zip(fem.cell_numbers().tolist(), fem.cell_energies(u).tolist(), strict=True):
        assert energy == pytest.approx(cells[cell], rel=1e-11)


@pytest.mark.parametrize("penalty", ["none", "full"])
def test_forms_and_energies_are_of_one_potential(penalty: str) -> None:
    """What forms integrate is what numpy sums, and the residual its derivative."""
    system = fem_system(layers(), REGIONS, (), interior_penalty=penalty)
    u, out = system.interpolate(wavy), system.create_vector()
    stored = integral(system, u, system.forms.cells)
    stored += sum(integral(system, u, facets) for facets in system.forms.facets.values())
    assert system.residual(u, out).energy == pytest.approx(stored, rel=1e-12)
    step, t = system.create_vector(), 1e-5
    step.getArray()[:] = np.random.default_rng(3).uniform(-0.1, 0.1, step.getSize())
    ahead, behind = u.copy(), u.copy()
    ahead.axpy(t, step)
    behind.axpy(-t, step)
    slope = (system.energy(ahead).energy - system.energy(behind).energy) / (2 * t)
    assert out.dot(step) == pytest.approx(slope, rel=1e-7)


def test_levels_change_as_numbers_do() -> None:
    system = fem_system(layers(), REGIONS, (), interior_penalty="penalty")
    u = system.interpolate(wavy)
    before = system.energy(u).regions["medium"].energy
    of_forms = integral(system, u, system.forms.facets["medium"])
    system.set_parameters({"gamma": 0.6})
    assert system.energy(u).regions["medium"].energy == pytest.approx(2.0 * before, rel=1e-12)
    assert integral(system, u, system.forms.facets["medium"]) == pytest.approx(2.0 * of_forms, rel=1e-12)
    cells = system.mesh.region_c[: system.mesh.n_owned] == 1
    assert system.cell_energies(u, "gamma")[cells] == pytest.approx(0.0, abs=1e-300)


def test_triangles_of_a_split_cell_have_its_data() -> None:
    """Formulas of the place are taken in the triangles themselves."""
    mesh = layers()
    graded = {"solid": REGIONS["solid"], "medium": medium_region(MEDIUM, 1.5, graded={"gamma": "gamma * (1 + soft)"})}
    split = fem_system(mesh, graded, (), triangles=True)
    u = split.interpolate(lambda x: 0.1 * x)
    by_cell = np.bincount(split.cell_numbers(), split.cell_energies(u), minlength=12)[4:8]
    plain = fem_system(mesh, {"solid": REGIONS["solid"], "medium": medium_region(MEDIUM, 1.5)}, (), triangles=True)
    uniform = np.bincount(plain.cell_numbers(), plain.cell_energies(plain.interpolate(lambda x: 0.1 * x)), minlength=12)
    assert by_cell == pytest.approx(uniform[4:8] * (1.0 + mesh.cell_data["soft"][4:8]), rel=1e-12)
