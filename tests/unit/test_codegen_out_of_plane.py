"""The third direction: F[2][2] for those who ask for it, nothing for others, and the stress across the plane."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from codegen.compiler import generate
from codegen.declare import Declaration, declaration, energy
from codegen.directional import Rated, rated
from codegen.errors import CodegenError
from codegen.integrand import DEFORMATION_GRADIENT, SECOND_GRADIENT, Integrand, second_gradient_energy
from codegen.kernel import ENERGY, Kernel, compile_energy, compiled
from codegen.layout import Input, Take
from codegen.oracle import components, energy_density, one_state
from codegen.out_of_plane import out_of_plane_stress
from codegen.sampling import REGIMES, from_vector, sample
from codegen.trace import trace
from codegen.verify import verify
from tmc_vem.energy import DENSITIES, densities
from tmc_vem.energy import kinematics as kin

VALUES = {"K": 20.0, "mu": 3.0}
EXPECTED = [[None, None, 0], [None, None, 0], [0, 0, 1]]


@pytest.fixture(scope="module")
def states() -> np.ndarray:
    rng = np.random.default_rng(8)
    return np.concatenate([sample(regime, 10, rng) for regime in REGIMES[:2]])


def in_plane(F, G, p, m):
    """A Saint Venant-Kirchhoff-like energy of the plane, with loops over rows."""
    squares = sum(x * x for row in F for x in row)
    return p.mu / 2 * (squares - len(F) - 2 * m.log(F[0][0] * F[-1][-1] - F[0][1] * F[1][0]))


def in_space(F, G, p, m):
    squares = sum(F[i][j] * F[i][j] for i in range(3) for j in range(3))
    det = F[2][2] * (F[0][0] * F[1][1] - F[0][1] * F[1][0])
    return p.mu / 2 * (squares - 3 - 2 * m.log(det)) + p.K / 2 * m.log(det) ** 2


def plain(F, G, p, m):
    squares = sum(F[i][j] * F[i][j] for i in (0, 1) for j in (0, 1))
    det = F[0][0] * F[1][1] - F[0][1] * F[1][0]
    return p.mu / 2 * (squares - 2 - 2 * m.log(det)) + p.K / 2 * m.log(det) ** 2


def seen(F, G, p, m):
    """Passes on what it was given."""
    return SimpleNamespace(F=F, G=G)


def third_of(F) -> None:
    assert len(F) == 2
    assert [len(row) for row in F] == [2, 2]
    for i in range(3):
        for j in range(3):
            value = F[i][j].value if isinstance(F[i][j], Rated) else F[i][j]
            if EXPECTED[i][j] is not None:
                assert value == EXPECTED[i][j], (i, j)
    for index in (3, -3):
        with pytest.raises(IndexError):
            F[index]
        with pytest.raises(IndexError):
            F[0][index]
    assert [list(row) for row in F[0:3]] == [list(F[0]), list(F[1])]


def test_every_path_has_the_third_direction_for_those_who_ask(states) -> None:
    third_of(components(states)[0])
    third_of(one_state(states[0])[0])
    integrand = second_gradient_energy(seen, "seen")
    third_of(integrand.of_fields(lambda take: lambda index: float(sum(index)), None, None).F)
    third_of(rated(DEFORMATION_GRADIENT, np.zeros((2, 2))))
    assert integrand.of_fields(lambda take: lambda index: 7.0, None, None).F[0][0] == 8.0


def test_no_other_tensor_has_one(states) -> None:
    _, G = components(states)
    for tensor in (G, G[0], G[0][0], Input("H", "u", Take.GRADIENT, (2, 2)).nested(lambda index: 5.0)):
        with pytest.raises(IndexError):
            tensor[2]
    without = Input("H", "u", Take.GRADIENT, (2, 2), third=True).nested(lambda index: 5.0)
    assert (without[2][2], without[2][0], without[1][2], without[1][1]) == (0, 0, 0, 5.0)


def test_an_energy_of_the_plane_computes_what_it_did(states) -> None:
    """Loops over rows see two, and the trace is that of the components written out."""
    F, _ = from_vector(states)
    expected = VALUES["mu"] / 2 * ((F**2).sum(axis=(1, 2)) - 2 - 2 * np.log(np.linalg.det(F)))
    np.testing.assert_allclose(energy_density(in_plane, states, VALUES), expected, rtol=1e-10, atol=1e-12)
    nodes = trace(second_gradient_energy(in_plane, "e", ("mu",))).nodes
    assert "const" in {node.op for node in nodes}
    assert {node.value for node in nodes if node.op == "const"} == {0.0, 2.0}


def test_asking_for_it_makes_the_same_kernel(states) -> None:
    """1 and 0 vanish on paper: the C text is that of the energy written for the plane."""
    texts = {generate(trace(second_gradient_energy(f, "e", ("K", "mu")))).c_source for f in (in_space, plain)}
    assert len({text[text.index("static void point_energy") :] for text in texts}) == 1
    psi = compile_energy(in_space, "e", ("K", "mu")).points(ENERGY, states, np.array([20.0, 3.0]))[0]
    np.testing.assert_allclose(psi, energy_density(in_space, states, VALUES), rtol=1e-12)


def test_a_plain_matrix_is_plane_strain() -> None:
    """Scripts may call functions of kinematics with an F of two rows."""
    F = [[2.0, 0.5], [0.25, 1.0]]
    assert kin.stretch_across(F) == 1
    assert kin.det(F) == 1.875
    assert kin.trace_c(F) == 4.0 + 0.25 + 0.0625 + 1.0 + 1.0
    assert kin.det([[2.0, 0.5, 0.0], [0.25, 1.0, 0.0], [0.0, 0.0, 3.0]]) == 3 * 1.875


def test_invariants_and_strain_in_space() -> None:
    F = np.eye(3)
    F[:2, :2] = [[1.3, 0.4], [-0.2, 0.8]]
    F[2, 2] = 1.7
    C = F.T @ F
    assert kin.det(F) == pytest.approx(np.linalg.det(F))
    assert kin.trace_c(F) == pytest.approx(np.trace(C))
    assert kin.second_invariant(F) == pytest.approx((np.trace(C) ** 2 - np.trace(C @ C)) / 2)
    E = (C - np.eye(3)) / 2
    assert kin.strain(F) == pytest.approx((E[0, 0], E[1, 1], E[0, 1], E[2, 2]))
    G = np.random.default_rng(0).normal(size=(2, 2, 2))
    gradient = [(np.linalg.det(F[:2, :2] + 1e-6 * G[:, :, k]) - np.linalg.det(F[:2, :2])) / 1e-6 * 1.7 for k in (0, 1)]
    assert kin.gradient_of_det(F, G) == pytest.approx(gradient, rel=1e-4)
    assert kin.gradient_of_log_det(F, G) == pytest.approx(np.array(gradient) / np.linalg.det(F), rel=1e-4)


def test_the_stress_across_the_plane_is_that_of_the_formula(states) -> None:
    """``P33 = K ln J + mu J^(-2/3) (1 - I1/3)`` of (2), by numpy, by the compiled kernel and by UFL."""
    solid = DENSITIES["solid"]
    across = out_of_plane_stress(second_gradient_energy(solid.density, "solid", solid.parameters))
    assert across.stress is not None
    assert not across.reason
    assert (across.stress.name, across.stress.parameter_names) == ("solid_P33", ("K", "mu"))
    F, _ = from_vector(states)
    J = np.linalg.det(F)
    expected = 20.0 * np.log(J) + 3.0 * J ** (-2 / 3) * (1 - ((F**2).sum(axis=(1, 2)) + 1) / 3)
    np.testing.assert_allclose(energy_density(across.stress.function, states, VALUES), expected, rtol=1e-10, atol=1e-10)
    found = Kernel(compiled(across.stress), across.stress).points(ENERGY, states, np.array([20.0, 3.0]))[0]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


def test_the_stress_across_the_plane_in_ufl(states) -> None:
    ufl = pytest.importorskip("ufl")
    from tmc_vem.fem.maths import ufl_namespace

    solid = DENSITIES["solid"]
    stress = out_of_plane_stress(second_gradient_energy(solid.density, "solid", solid.parameters)).stress
    assert stress is not None
    H = ufl.as_matrix((states[0, :4].reshape(2, 2).T).tolist())
    zero = ufl.as_tensor(np.zeros((2, 2, 2)).tolist())
    taken = {Take.GRADIENT: H.__getitem__, Take.SECOND_GRADIENT: zero.__getitem__}
    found = float(stress.of_fields(taken.__getitem__, SimpleNamespace(**VALUES), ufl_namespace()))
    assert found == pytest.approx(energy_density(stress.function, states[:1], VALUES)[0], rel=1e-12)


def test_it_is_withheld_of_an_energy_that_does_not_use_it() -> None:
    across = out_of_plane_stress(second_gradient_energy(in_plane, "mine", ("mu",)))
    assert across.stress is None
    assert across.reason == "energy 'mine' does not use F[2][2], 1 in plane strain, so it has no out-of-plane stress"
    only_g = Integrand("g", (SECOND_GRADIENT,), (), lambda G, p, m: G[0][0][0] ** 2)
    with pytest.raises(CodegenError, match="energy 'g' reads no deformation gradient, so it has no out-of-plane"):
        out_of_plane_stress(only_g)
    with pytest.raises(CodegenError, match="energy 'bad'"):
        out_of_plane_stress(second_gradient_energy(lambda F, G, p, m: F[4][0], "bad"))


def test_a_constant_stress_across_the_plane_is_one() -> None:
    """Prestress: its rate is the number 1, not the number 0."""
    of = second_gradient_energy(lambda F, G, p, m: F[0][0] + F[2][2], "prestress")
    across = out_of_plane_stress(of).stress
    assert across is not None
    assert energy_density(across.function, np.zeros((3, 12)), {}).tolist() == [1.0] * 3


def test_the_medium_has_one_too() -> None:
    medium = DENSITIES["medium_angle_log_damped"]
    integrand = second_gradient_energy(medium.density, medium.name, medium.parameters)
    stress = out_of_plane_stress(integrand).stress
    assert stress is not None
    values = {"mu": 3.0, "gamma": 0.5, "alpha_r": 0.0, "beta": 5.0}
    x = np.zeros((1, 12))
    x[0, 0] = -0.5
    assert energy_density(stress.function, x, values)[0] == pytest.approx(1.5 * 0.5 ** (-2 / 3) * (1 - 2.25 / 3))


# ---- The check ------------------------------------------------------------------------------------------------------


def half_in_space(F, G, p, m):
    """F[2][2] in the determinant, 1 in the trace."""
    log_j = m.log(kin.det(F))
    return p.K / 2 * log_j**2 + p.mu / 2 * (sum(x * x for row in F for x in row) - 2 - 2 * log_j)


def findings_of(density, **declared):
    names = ("K", "mu")
    return {
        finding.what: finding
        for finding in verify(
            compile_energy(density, density.__name__, names), density, VALUES, Declaration(**declared)
        )
    }


def test_an_energy_that_uses_it_in_a_part_only_is_found() -> None:
    found = findings_of(half_in_space)["out-of-plane stress at F = I"]
    assert not found.passed
    assert found.words == (
        "F = I is not free of stress across the plane: P33 = -3; an energy that uses F[2][2] must do so in all its "
        "parts."
    )
    assert found.required == "< 1e-12"
    right = findings_of(in_space)
    assert right["out-of-plane stress at F = I"].passed
    assert not right["out-of-plane stress at F = I"].words
    assert "out-of-plane stress at F = I" not in findings_of(plain)


def test_a_declared_domain_limits_the_states() -> None:
    def below(F, G, p, m):
        return 4 - kin.trace_c(F)

    def log_of_it(F, G, p, m):
        return -p.mu / 2 * m.log(below(F, G, p, m)) + p.K / 2 * (kin.trace_c(F) - 3) ** 2

    without = findings_of(log_of_it, stress_free=False)
    assert [finding.passed for finding in without.values()] == [False]
    found = findings_of(log_of_it, stress_free=False, domain=below)
    assert "finite, in its domain, rotation to 170 deg" in found
    assert all(finding.passed for finding in found.values())
    with pytest.raises(CodegenError, match="the declared domain excludes F = I"):
        findings_of(log_of_it, stress_free=False, domain=lambda F, G, p, m: kin.trace_c(F) - 3)


def test_a_domain_is_declared_like_the_rest() -> None:
    def below(F, G, p, m):
        return 1.0

    @energy(domain=below)
    def mine(F, G, p, m):
        return F[0][0]

    assert declaration(mine).domain is below
    assert declaration(densities.solid).domain is None
