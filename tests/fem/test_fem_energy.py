"""Energies of the finite elements against the virtual elements, against UFL written by hand, and against themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from helpers_fem import (
    REGULARISERS,
    SOLID,
    Field,
    Float,
    grid,
    integral,
    layered,
    make_system,
    medium,
    wavy,
)

from tmc_vem.energy import Regulariser
from tmc_vem.mesh.make.split import split_quadrilaterals
from tmc_vem.problems import Medium
from tmc_vem.problems.base import RegionEnergy, medium_region


def affine(x: Float) -> Float:
    return x @ np.array([[0.2, -0.15], [0.35, 0.1]]) + [0.3, -0.2]


def quadratic(x: Float) -> Float:
    a, b = x[:, 0], x[:, 1]
    return np.stack([0.02 * a * a - 0.03 * a * b + 0.1 * b, 0.025 * b * b + 0.02 * a * b - 0.08 * a], axis=1)


ENERGIES = {"solid": SOLID, **{name: medium(name) for name in REGULARISERS}}


@pytest.mark.parametrize("field", [affine, quadratic])
@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("name", ENERGIES)
def test_same_energy_as_virtual_elements(name: str, triangles: bool, field: Field) -> None:
    from helpers_system import interpolate
    from helpers_system import make_system as make_vem
    from helpers_system import region as vem_region

    from tmc_vem.vem.spaces.element_settings import ElementSettings

    energy = ENERGIES[name]
    mesh = grid(2, 2, distort=0.2)
    if triangles:
        mesh, _ = split_quadrilaterals(mesh)
    vem = make_vem(mesh, vem_region(energy.energy.name, **energy.values), settings=ElementSettings(quadrature=20))
    fem = make_system(mesh, energy, quadrature=20)
    expected = vem.energy(interpolate(vem, field)).energy
    assert expected > 1e-4
    assert fem.energy(fem.interpolate(field)).energy == pytest.approx(expected, rel=1e-12)


def by_hand(u: Any, name: str, values: Any) -> Any:
    """Third medium with damped regulariser from the paper's tensor formulas, differentiated by UFL."""
    import ufl

    F = ufl.Identity(2) + ufl.grad(u)
    J = ufl.det(F)
    H = ufl.grad(ufl.grad(u))
    Lu = ufl.div(ufl.grad(u))
    t = (F[0, 1] - F[1, 0]) / (F[0, 0] + F[1, 1])

    def squared(v: Any) -> Any:
        return ufl.dot(ufl.grad(v), ufl.grad(v))

    psi_r = {
        "huhu": ufl.inner(H, H) / 2,
        "huhu_lulu": (ufl.inner(H, H) - ufl.dot(Lu, Lu) / 2) / 2,
        "angle": (squared(ufl.atan(t)) + squared(J)) / 2,
        "tangent": (squared(t) + squared(J)) / 2,
    }[name]
    isochoric = values["mu"] / 2 * (J ** (-2.0 / 3.0) * (ufl.tr(F.T * F) + 1) - 3)
    return values["gamma"] * (isochoric + values["alpha_r"] * ufl.exp(-values["beta"] * J) * psi_r)


@pytest.mark.parametrize("name", REGULARISERS)
def test_same_energy_as_formulas_written_by_hand(name: str) -> None:
    import ufl

    energy = medium(name)
    system = make_system(grid(3, 3, distort=0.2), energy)
    u = system.interpolate(wavy)
    dx = ufl.Measure("dx", domain=system.mesh.mesh, metadata={"quadrature_degree": 4})
    expected = integral(system, u, by_hand(system._state, name, energy.values) * dx)
    assert system.energy(u).energy == pytest.approx(expected, rel=1e-12)


def test_solid_written_by_hand() -> None:
    import ufl

    system = make_system(grid(3, 3, distort=0.2), SOLID)
    u = system.interpolate(wavy)
    F = ufl.Identity(2) + ufl.grad(system._state)
    J, K, mu = ufl.det(F), SOLID.values["K"], SOLID.values["mu"]
    psi = K / 2 * ufl.ln(J) ** 2 + mu / 2 * (J ** (-2.0 / 3.0) * (ufl.inner(F, F) + 1) - 3)
    dx = ufl.Measure("dx", domain=system.mesh.mesh, metadata={"quadrature_degree": 4})
    assert system.energy(u).energy == pytest.approx(integral(system, u, psi * dx), rel=1e-12)


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("triangles", [False, True])
def test_numpy_energy_is_that_of_the_forms(triangles: bool, order: int) -> None:
    system = make_system(layered(), {"solid": SOLID, "medium": medium()}, order=order, triangles=triangles)
    u = system.interpolate(wavy)
    evaluation = system.energy(u)
    assert evaluation.energy == pytest.approx(integral(system, u, system.forms.cells), rel=1e-12)
    assert evaluation.energy == pytest.approx(system.cell_energies(u).sum(), rel=1e-13)
    assert evaluation.energy == pytest.approx(sum(values.energy for values in evaluation.regions.values()), rel=1e-14)


def test_energy_near_the_reference_state_keeps_its_digits() -> None:
    system = make_system(grid(2, 2), SOLID)
    tiny, small = 1e-7, 1e-6
    energies = [system.energy(system.interpolate(lambda x, s=size: s * wavy(x))).energy for size in (tiny, small)]
    assert energies[1] / energies[0] == pytest.approx(100.0, rel=1e-4)


def own_density(F: Any, G: Any, p: Any, m: Any) -> Any:
    """A regulariser with parameters of its own and every function of the namespace."""
    bending = (G[0][1][1] * G[0][1][1] + G[1][0][0] * G[1][0][0]) * p.bending
    turn = m.atan2(F[0][1] - F[1][0], F[0][0] + F[1][1]) + m.atan(F[0][1]) * m.sin(F[0][0]) * m.cos(F[1][1])
    return bending + p.turning * m.sqrt(1 + turn * turn) * (G[0][0][0] * G[0][0][0] + G[1][1][1] * G[1][1][1])


def test_regulariser_of_the_user() -> None:
    own = Regulariser("own", own_density, parameters=("bending", "turning"))
    given = Medium(gamma=0.3, alpha_r=0.7, beta=2.0, regulariser=own, parameters={"bending": 0.4, "turning": 1.3})
    region: RegionEnergy = medium_region(given, mu=1.5)
    system = make_system(grid(3, 3, distort=0.2), region, interior_penalty="penalty")
    u = system.interpolate(wavy)
    assembled = integral(system, u, system.forms.cells + system.forms.facets["all"])
    assert system.energy(u).energy == pytest.approx(assembled, rel=1e-12)
    stronger = medium_region(Medium(0.3, 0.7, 2.0, own, {"bending": 4.0, "turning": 1.3}), mu=1.5)
    assert make_system(grid(3, 3, distort=0.2), stronger).energy(u).energy > system.energy(u).energy
