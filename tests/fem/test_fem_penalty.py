"""The interior penalty: what it does not punish, how it scales, and that it makes the second gradient converge."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from helpers_fem import (
    CLAMPED,
    SOLID,
    Float,
    grid,
    integral,
    layered,
    make_system,
    medium,
    random_vector,
    rates,
    wavy,
)

from tmc_vem.energy import Energy
from tmc_vem.energy import kinematics as kin
from tmc_vem.problems.base import RegionEnergy
from tmc_vem.solve.linear import LinearSolver
from tmc_vem.support.errors import InputError


def facet_energy(system: Any, u: Any, region: str) -> float:
    """Energy of the interior penalty alone."""
    return integral(system, u, system.forms.facets[region])


def quadratic(x: Float) -> Float:
    a, b = x[:, 0], x[:, 1]
    return 0.05 * np.stack([a * a - 3.0 * a * b, 2.0 * b * b + a * b], axis=1)


@pytest.mark.parametrize("mode", ["penalty", "full"])
@pytest.mark.parametrize("triangles", [False, True])
def test_patch(triangles: bool, mode: str) -> None:
    """Smooth quadratic fields have no jumps: the facet terms vanish, and so does what they add to the residual."""
    regions = {"solid": SOLID, "medium": medium()}
    system = make_system(layered(), regions, interior_penalty=mode, triangles=triangles)
    plain = make_system(layered(), regions, triangles=triangles)
    u = system.interpolate(quadratic)
    assert abs(facet_energy(system, u, "medium")) < 1e-14
    bumpy = u.copy()
    bumpy.axpy(1.0, random_vector(system, 3, 0.01))
    assert facet_energy(system, bumpy, "medium") > 1e-4
    if mode == "penalty":
        with_penalty, without = system.create_vector(), system.create_vector()
        system.residual(u, with_penalty)
        plain.residual(u, without)
        with_penalty.axpy(-1.0, without)
        assert with_penalty.norm() < 1e-12


def test_scaling_of_the_penalty() -> None:
    """Linear in gamma, alpha_r and eta; by hand on two squares: a kink of slope s costs gamma alpha_r eta s^2 / 2."""
    mesh = grid(2, 1, length=1.0, height=0.5)
    slope = 0.2
    base = {"gamma": 0.3, "alpha_r": 0.7, "beta": 0.0}

    def energy(eta: float = 10.0, triangles: bool = False, **changes: float) -> float:
        from tmc_vem.problems import Medium
        from tmc_vem.problems.base import medium_region

        region = medium_region(Medium(**{**base, **changes}), mu=1.0)
        system = make_system(mesh, region, interior_penalty="penalty", eta=eta, triangles=triangles)
        u = system.interpolate(lambda x: np.stack([0.0 * x[:, 0], slope * np.maximum(x[:, 0] - 0.5, 0.0)], axis=1))
        return facet_energy(system, u, "all")

    # the facet has length 1/2 and both widths are 1/2: squares directly, triangles by the factor 2
    expected = 0.3 * 0.7 * 10.0 / (2.0 * 0.5) * slope**2 * 0.5
    assert energy() == pytest.approx(expected)
    assert energy(triangles=True) == pytest.approx(expected)
    assert energy(eta=1.0) == pytest.approx(0.1 * expected)
    assert energy(gamma=0.6) == pytest.approx(2.0 * expected)
    assert energy(alpha_r=1.4) == pytest.approx(2.0 * expected)
    # damping: mean of exp(-beta J), and J = 1 on both sides
    assert energy(beta=2.0) == pytest.approx(np.exp(-2.0) * expected)


def test_damping_of_the_penalty_is_by_j_of_both_sides() -> None:
    """A sheared and stretched state with a kink: J by hand on both sides, and the mean of exp(-beta J)."""
    A = np.array([[0.1, 0.4], [-0.2, 0.3]])
    kink, beta, length = np.array([0.05, 0.15]), 3.0, 0.5

    def moved(x: Float) -> Float:
        return x @ A.T + np.maximum(x[:, :1] - 0.5, 0.0) * kink

    system = make_system(grid(2, 1, length=1.0, height=length), medium(beta=beta), interior_penalty="penalty")
    left = np.eye(2) + A
    right = left + np.outer(kink, [1.0, 0.0])
    damping = np.mean([np.exp(-beta * np.linalg.det(F)) for F in (left, right)])
    expected = 0.3 * 0.7 * 10.0 / (2.0 * 0.5) * damping * (kink @ kink) * length
    assert facet_energy(system, system.interpolate(moved), "all") == pytest.approx(expected, rel=1e-10)


def test_no_penalty_on_facets_of_the_solid() -> None:
    """A kink between solid and medium, or inside the solid, is free."""
    system = make_system(layered(4, 4, distort=0.0), {"solid": SOLID, "medium": medium()}, interior_penalty="penalty")

    def kink_at(y: float) -> float:
        u = system.interpolate(lambda x: np.stack([0.1 * np.maximum(x[:, 1] - y, 0.0), 0.0 * x[:, 0]], axis=1))
        return facet_energy(system, u, "medium")

    assert kink_at(0.25) == pytest.approx(0.0, abs=1e-15)
    assert kink_at(0.75) == pytest.approx(0.0, abs=1e-15)
    assert kink_at(0.5) > 1e-4


def test_region_evaluations_contain_the_penalty() -> None:
    system = make_system(layered(), {"solid": SOLID, "medium": medium()}, interior_penalty="penalty")
    u = system.interpolate(wavy)
    cells = np.array(system.mesh.region_c) == 1
    with_facets = system.energy(u).regions["medium"].energy
    assert with_facets == pytest.approx(system.cell_energies(u)[cells].sum() + facet_energy(system, u, "medium"))


def test_energies_without_the_medium_s_parameters_are_refused() -> None:
    other = RegionEnergy(Energy("other", lambda F, G, p, m: p.a * G[0][0][0] ** 2, ("a",)), {"a": 1.0}, is_medium=True)
    with pytest.raises(InputError, match="has no parameter 'gamma'"):
        make_system(grid(2, 2), other, interior_penalty="penalty")


# A linear problem with a known solution: psi = 1/2 |grad u|^2 + a/2 |grad grad u|^2 on the unit square. With
# u = sin(pi x) sin(pi y) the displacement and its second normal derivative vanish on the boundary, so that u = 0 is all
# there is to prescribe, and the load is (2 pi^2 + 4 pi^4 a) u.
ALPHA = 0.3


def linear_density(F: Any, G: Any, p: Any, m: Any) -> Any:
    H = [F[i][j] - (1 if i == j else 0) for i in kin.AXES for j in kin.AXES]
    return p.gamma * (kin.squared_norm(H) + p.alpha_r * kin.squared_norm(kin.all_second_gradients(G))) / 2


LINEAR = RegionEnergy(
    Energy("linear", linear_density, ("gamma", "alpha_r")), {"gamma": 1.0, "alpha_r": ALPHA}, is_medium=True
)


def exact(x: Float) -> Float:
    bump = np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1])
    return np.stack([bump, -2.0 * bump], axis=1)


def load(x: Float) -> Float:
    return (2.0 * np.pi**2 + 4.0 * np.pi**4 * ALPHA) * exact(x)


def solve_linear(n: int, mode: str, triangles: bool) -> tuple[float, float]:
    """Errors of the discrete solution: in the energy norm with jumps, and in the first gradient."""
    import ufl

    system = make_system(grid(n, n), LINEAR, CLAMPED, interior_penalty=mode, triangles=triangles)
    system.set_body_force(load)
    u, residual = system.create_vector(), system.create_vector()
    matrix = system.create_matrix()
    system.residual(u, residual)
    system.jacobian(u, matrix)
    residual.getArray()[system.constrained()] = 0.0
    residual.scale(-1.0)
    assert LinearSolver(matrix, system.comm).solve(residual, u)

    x, w = system.points.X_cqx, system.points.w_cq
    nodes = u.getArray().reshape(-1, 2)
    first, second = system.points.gradients(nodes[system.nodes.cell_nodes_ca])
    s, c = np.sin(np.pi * x), np.cos(np.pi * x)
    slope = np.pi * np.stack([c[..., 0] * s[..., 1], s[..., 0] * c[..., 1]], axis=-1)
    bump, twist = s[..., 0] * s[..., 1], c[..., 0] * c[..., 1]
    curvature = np.pi**2 * np.stack([np.stack([-bump, twist], -1), np.stack([twist, -bump], -1)], -1)
    sizes = np.array([1.0, -2.0])
    gradient_error = (w[..., None, None] * (first - sizes[:, None] * slope[..., None, :]) ** 2).sum()
    expected = sizes[:, None, None] * curvature[..., None, :, :]
    curvature_error = (w[..., None, None, None] * (second - expected) ** 2).sum()
    n_facet = ufl.FacetNormal(system.mesh.mesh)
    jump = ufl.jump(ufl.grad(system._state), n_facet)
    jumps = integral(system, u, n * ufl.inner(jump, jump) * ufl.dS)
    return float(np.sqrt(gradient_error + ALPHA * (curvature_error + jumps))), float(np.sqrt(gradient_error))


@pytest.mark.parametrize("triangles", [False, True])
def test_full_converges_in_its_natural_norm(triangles: bool) -> None:
    """Order 1 in the energy norm with jumps, as for quadratic C0 interior penalty; order 2 in the first gradient."""
    cells = (4, 8, 16)
    errors = np.array([solve_linear(n, "full", triangles) for n in cells])
    sizes = [1.0 / n for n in cells]
    assert rates(sizes, errors[:, 0])[-1] > 0.9
    assert rates(sizes, errors[:, 1])[-1] > 1.8


def test_broken_second_derivatives_alone_do_not_converge_on_triangles() -> None:
    """'none' on P2 misses the bending in the jumps: its solution is far too soft, whatever the mesh."""
    coarse, fine = (solve_linear(n, "none", True)[1] for n in (8, 16))
    right = solve_linear(16, "full", True)[1]
    assert fine > 0.5 * coarse
    assert fine > 20.0 * right


def test_parameters_are_plain_values() -> None:
    """The energy of the manufactured problem, once by hand."""
    values = SimpleNamespace(**LINEAR.values)
    G = [[[1.0, 2.0], [2.0, 3.0]], [[0.0, 0.0], [0.0, 0.0]]]
    assert linear_density([[2.0, 0.0], [0.0, 1.0]], G, values, None) == pytest.approx(0.5 * (1.0 + ALPHA * 18.0))
