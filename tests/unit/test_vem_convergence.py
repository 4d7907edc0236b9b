"""Convergence to a manufactured solution of the nonlinear solid: the gradient at h^k, the displacement at h^(k+1)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp
from helpers_mesh import hanging, voronoi
from helpers_system import CLAMPED, errors, interpolate, make_system, rates, region

from tmc_vem.solve.newton import NewtonSolver
from tmc_vem.vem.spaces.element_settings import ElementSettings

K, MU = sp.Rational(5, 3), sp.Rational(5, 14)
SOLID = region("solid", K=float(K), mu=float(MU))


@cache
def manufactured():
    """Displacement, its gradient and the body force -Div P of the solid (2), derived here from psi by hand."""
    x, y = sp.symbols("x y")
    u = [sp.sin(2 * x) * sp.cos(y) / 10 + y**3 / 20, x * sp.sin(x + 2 * y) / 10]
    a, b, c, d = entries = sp.symbols("F11 F12 F21 F22")
    J = a * d - b * c
    psi = K / 2 * sp.log(J) ** 2 + MU / 2 * (J ** sp.Rational(-2, 3) * (sum(f**2 for f in entries) + 1) - 3)
    gradient = [sp.diff(component, axis) for component in u for axis in (x, y)]
    F = [1 + gradient[0], gradient[1], gradient[2], 1 + gradient[3]]
    here = dict(zip(entries, F, strict=True))
    force = [
        -sum(
            sp.diff(psi, entries[2 * i + j], entries[n]).subs(here) * sp.diff(F[n], (x, y)[j])
            for j in (0, 1)
            for n in range(4)
        )
        for i in (0, 1)
    ]
    return tuple(on_points(sp.lambdify((x, y), f, cse=True)) for f in (u, gradient, force))


def on_points(function):
    return lambda p: np.stack(np.broadcast_arrays(*function(p[:, 0], p[:, 1])), axis=-1)


def solve(mesh, k):
    displacement, gradient, force = manufactured()
    system = make_system(mesh, SOLID, CLAMPED, ElementSettings(order=k))
    system.set_body_force(force)
    u = interpolate(system, displacement)
    interpolated = u.copy()
    result = NewtonSolver(system).solve(u)
    assert result.converged, result.reason
    assert (u - interpolated).norm() > 0.0
    return errors(system, u, displacement, lambda p: gradient(p).reshape(-1, 2, 2))


def observed(meshes, k):
    found = np.array([solve(mesh, k) for mesh in meshes])
    sizes = [mesh.n_cells**-0.5 for mesh in meshes]
    return found, rates(sizes, found[:, 0]), rates(sizes, found[:, 1])


def test_order_2_on_voronoi_cells():
    found, displacement, gradient = observed([voronoi(n) for n in (16, 64, 256)], 2)
    assert displacement.min() > 2.85
    assert gradient.min() > 1.75
    assert gradient[-1] > 1.9
    assert found[-1] == pytest.approx([2.0e-6, 1.6e-4], rel=0.2)


@pytest.mark.parametrize("distort", [0.0, 0.03])
def test_order_2_with_hanging_nodes(distort):
    _, displacement, gradient = observed([hanging(n, distort) for n in (4, 8, 16)], 2)
    assert displacement.min() > 2.85
    assert gradient.min() > 1.75
    assert gradient[-1] > 1.9


def test_order_3_on_voronoi_cells():
    """Order 4 of the displacement needs a load that works on the L2 projection."""
    _, displacement, gradient = observed([voronoi(n) for n in (16, 64, 256)], 3)
    assert displacement.min() > 3.8
    assert gradient.min() > 2.8


@pytest.mark.parametrize("distort", [0.0, 0.03])
def test_order_3_with_hanging_nodes(distort):
    """With hanging nodes slightly off their sides, a spectral test that lets nearly spurious modes pass fails here."""
    _, displacement, gradient = observed([hanging(n, distort) for n in (4, 8)], 3)
    assert displacement.min() > 3.8
    assert gradient.min() > 2.8
